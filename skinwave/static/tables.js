// The tiles and tables of an answer, as HTML.

import { inQuantity, lineName, typeset } from "./answer.js";
import { QUANTITIES, lineTable, meanLevel } from "./numbers.js";
import { escaped, rounded, signed } from "./text.js";
import { LABELS, STARTS, shown } from "./values.js";

const NONE = "–", SAME_LINE = 0.5; // Hz between the same line of A and B at most

const fixed = (value, digits, unit) => (Number.isFinite(value) ? `${value.toFixed(digits)} ${unit}` : NONE);
const percent = (share) => fixed(100 * share, share < 0.0995 ? 1 : 0, "%");
const delayed = (seconds) => fixed(1e3 * seconds, 1, "ms");
const far = (reach) => (reach ? `${reach.beyond ? "> " : ""}${fixed(1e3 * reach.metre, 0, "mm")}`
  : "nowhere");
const subscript = (name) => escaped(name).replace(/_(\w+)/g, "<sub>$1</sub>");

/** The four numbers of an answer as text; those of the skin are none on another body. */
function numbersOf({ body, level, reach, share, delay }) {
  return { level: body.is_skin ? `${signed(level?.dB)} dB` : NONE, reach: body.is_skin ? far(reach) : NONE,
    share: percent(share), delay: delayed(delay) };
}

/** HTML of the four tiles, with the numbers of what is pinned. */
export function tiles(answer, pinned) {
  const own = numbersOf(answer), other = pinned && numbersOf(pinned), { level, reach, body } = answer;
  const pauses = answer.load.pulses ? ", mean with pauses" : "";
  const line = level
    ? `${level.f.toFixed(0)} Hz (${subscript(lineName(answer, level.f) || "line")})${pauses}` : "";
  const tile = (key, name, help, detail, kernel) => `<div class="tile" title="${help}">
    <span class="name">${name}</span><span class="value">${own[key]}</span><span
      class="detail">${detail}</span>
    <span class="kernel">kernel ${kernel}</span><span class="of-a">${other ? `A: ${other[key]}`
      : ""}</span></div>`;
  const skin = (text) => (body.is_skin ? text : "no threshold: not skin");
  return tile("level", "Level at the point", "Largest component over the detection threshold of skin",
    skin(line), `${signed(answer.kernelLevel?.dB)} dB`)
    + tile("reach", "Reach above threshold",
      "Largest distance from the path at which a component is above threshold", skin(reach ? "from the path"
        : ""), far(answer.kernelReach))
    + tile("share", "Outside the kernel's region",
      "Share of the mean-square motion where the kernel is below −20 dB of its largest", "of the motion",
      percent(answer.kernelShare))
    + tile("delay", "Delay", "Lag of the motion behind the pressure on the path, at the strongest component",
      "behind the pressure", "0.0 ms");
}

/** A table of columns [head, class] and rows of cells of HTML, the first of them heads; `marked` rows. */
function table(columns, rows, marked = () => false) {
  const heads = columns.map(([head, look]) => `<th scope="col"${look ? ` class="${look}"`
    : ""}>${head}</th>`);
  const body = rows.map((row, k) => `<tr${marked(k) ? ' class="different"' : ""}>${row.map((cell, j) => (j
    ? `<td class="${columns[j][1] ?? ""}">${cell}</td>` : `<th scope="row">${cell}</th>`)).join("")}</tr>`);
  return `<thead><tr>${heads.join("")}</tr></thead><tbody>${body.join("")}</tbody>`;
}

/** The table of lines, with the amplitudes of what is pinned. */
export function linesTable(answer, pinned) {
  const name = answer.values.quantity, { unit, per } = QUANTITIES[name];
  const other = pinned && inQuantity(pinned.waves.f, pinned.wavesAt, name);
  const ofA = (f) => {
    const k = pinned.waves.f.findIndex((at) => Math.abs(at - f) < SAME_LINE);
    return k < 0 ? NONE : rounded(meanLevel(pinned.load) * other[k]);
  };
  const columns = [["Line"], ["Hz"], ["kernel, Pa"], [`waves, ${unit}`, "waves-ink"], ...(pinned ? [["A",
    "of-a"]] : []),
    ['<abbr title="dB above the detection threshold">dB SL</abbr>']];
  return table(columns, lineTable(answer).map(({ name: line, f, pressure, motion, level }) => [
    subscript(typeset(line)) || NONE, f.toFixed(1), rounded(pressure), rounded(per * motion),
    ...(pinned ? [ofA(f)] : []), level === null ? NONE : signed(level)]));
}

/** The table of what differs between A and B: values, then numbers. */
export function comparison(a, b) {
  const said = (own, key) => (key === "body" ? own.body.title : shown(key, own.values[key]));
  const rows = Object.keys(STARTS).filter((key) => a.values[key] !== b.values[key])
    .map((key) => [LABELS[key], said(a, key), said(b, key)]);
  for (const { key, label, value, unit } of (a.body.title === b.body.title && a.body.keys) || []) {
    const other = b.body.keys.find((own) => own.key === key)?.value ?? value;
    if (other !== value) rows.push([label, `${value} ${unit}`, `${other} ${unit}`]);
  }
  const count = rows.length, [ofA, ofB] = [a, b].map(numbersOf);
  const names = { level: "Level at the point", reach: "Reach above threshold",
    share: "Outside the kernel's region",
    delay: "Delay" };
  for (const [key, name] of Object.entries(names)) rows.push([name, ofA[key], ofB[key]]);
  return `<table>${table([["Scene"], ["A, pinned", "of-a"], ["B, shown", "waves-ink"]],
    rows.map((row) => row.map(escaped)), (k) => k < count)}</table>`;
}
