// Maps of answers, computed beside the page, so that its controls stay free.

import { mapsOf, respond } from "./answer.js";
import { openBody } from "./bodies.js";
import { nameBodies } from "./values.js";

const opened = new Map(); // bodies by name

/** Buffers of the arrays in a record, each once. */
function buffersOf(record, found = new Set()) {
  for (const own of Object.values(record ?? {})) {
    if (ArrayBuffer.isView(own)) found.add(own.buffer);
    else if (typeof own === "object") buffersOf(own, found);
  }
  return [...found];
}

onmessage = ({ data: { record, values } }) => {
  if (record) opened.set(record.name, openBody(record));
  nameBodies([...opened.keys()]);
  const maps = mapsOf(respond(values, opened.get(values.body)));
  postMessage(maps, buffersOf(maps));
};
