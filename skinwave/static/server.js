// Requests of a page that "skinwave web" serves: bodies with other values, scenes and measurements.

const LARGEST_FILE = 20e6; // the most that the server takes of a file

async function post({ base, token }, name, body, { signal, headers = {} } = {}) {
  const answer = await fetch(`${base}api/${name}`, { method: "POST", body, signal,
    headers: { "X-Token": token, ...headers } }).catch((error) => {
    throw error.name === "AbortError" ? error
      : new Error("The server does not answer. Start skinwave web again and open its new address.");
  });
  if (!answer.ok) {
    const { error } = await answer.json().catch(() => ({}));
    throw new Error(error ?? `The server answered ${answer.status}.`);
  }
  return answer;
}

/**
 * Ask for the body of a TOML text with changes {key: value}. `told` has functions of what arrives:
 * progress(fraction, phase), body(record), dispersion(curves). Throws an Error for users, or an AbortError.
 */
export async function requestBody(api, given, signal, told) {
  const answer = await post(api, "body", JSON.stringify(given), { signal });
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  for (let rest = "", known = false; ;) {
    const { value, done } = await reader.read();
    const lines = (rest + (value ?? "")).split("\n");
    rest = lines.pop();
    for (const line of lines.filter(Boolean).map((text) => JSON.parse(text))) {
      if (line.error) throw new Error(line.error);
      if (line.superseded) throw new DOMException("A newer request has come.", "AbortError");
      if (line.body) { known = true; told.body(line.body); }
      else if ("dispersion" in line) told.dispersion(line.dispersion);
      else told.progress(line.fraction, line.phase);
    }
    if (done && !known) throw new Error("The server ended the answer early. Move the value again.");
    if (done) return;
  }
}

/** What the server makes of a file: of a "scene" {values, body}, of a "measurement" its record. */
export async function sendFile(api, name, file) {
  if (file.size > LARGEST_FILE) {
    throw new Error(`${file.name}: ${(file.size / 1e6).toFixed(0)} MB exceed 20 MB.`);
  }
  const answer = await post(api, name, file, { headers: { "X-Name": encodeURIComponent(file.name) } });
  return answer.json();
}
