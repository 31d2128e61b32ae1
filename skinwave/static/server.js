// Requests to the server of the page, skinwave web: changed bodies, scenes and measurements.

const LARGEST_FILE = 20e6; // bytes that the server accepts

/**
 * Send a request and return the answer: {body} for a "body", {dispersion} for a "dispersion", {values, body}
 * for a "scene", the record of a "measurement". Throws an Error with a sentence for users, or an AbortError.
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

/** Send a file and return the answer. */
export function sendFile(api, name, file) {
  if (file.size <= LARGEST_FILE) return request(api, name, file, { fileName: file.name });
  const size = `${(file.size / 1e6).toFixed(0)} MB`;
  throw new Error(`${file.name} has ${size}; the limit is 20 MB. Use skinwave compare.`);
}
