// The worker of the page, which computes maps.

import { mapsOf } from "./answer.js";

/**
 * Function `(answer, record)` that computes the maps of an answer in a worker and gives them to
 * `take(maps, answer)`. While the worker is busy, only the last answer waits. `program` is the text of the
 * worker. If a browser allows no worker, the maps are computed at once.
 */
export function mapsBeside(program, take) {
  const sent = new Map(); // records by name
  let worker = null, now = null, next = null;
  const send = ({ answer, record }) => {
    const isKnown = sent.get(record.name) === record;
    now = answer;
    worker.postMessage({ values: answer.values, record: isKnown ? null : record });
    sent.set(record.name, record);
  };
  const compute = (answer) => take(mapsOf(answer), answer);
  try {
    worker = new Worker(URL.createObjectURL(new Blob([program], { type: "text/javascript" })));
  } catch { return compute; }
  worker.onmessage = ({ data }) => {
    const [done, waiting] = [now, next];
    [now, next] = [null, null];
    if (waiting) send(waiting);
    take(data, done);
  };
  worker.onerror = () => {
    const waiting = next?.answer ?? now;
    worker = now = next = null;
    if (waiting) compute(waiting);
  };
  return (answer, record) => {
    if (!worker) compute(answer);
    else if (now) next = { answer, record };
    else send({ answer, record });
  };
}
