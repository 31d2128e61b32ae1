// Requests of a page that "skinwave web" serves: bodies with other values, scenes and measurements.

const LARGEST_FILE = 20e6; // the most that the server takes of a file

/**
 * What the server makes of a request: {body} of a "body", {values, body} of a "scene", the record of a
 * "measurement". Throws an Error for users, or an AbortError.
 */
export async function request({ base, token }, name, body, { signal, fileName = "" } = {}) {
  const headers = { "X-Token": token, "X-Name": encodeURIComponent(fileName) };
  const given = { method: "POST", body, signal, headers };
  const answer = await fetch(`${base}api/${name}`, given).catch((error) => {
    throw error.name === "AbortError" ? error
      : new Error("The server does not answer. Start skinwave web again and open its new address.");
  });
  if (answer.ok) return answer.json();
  throw new Error(await answer.text() || `The server answered ${answer.status}.`);
}

/** What the server makes of a file. */
export function sendFile(api, name, file) {
  if (file.size <= LARGEST_FILE) return request(api, name, file, { fileName: file.name });
  throw new Error(`${file.name}: ${(file.size / 1e6).toFixed(0)} MB exceed 20 MB.`);
}
