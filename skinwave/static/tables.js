// The tiles and tables of an answer, as HTML.

import { inQuantity, lineName, typeset } from "./answer.js";
import { QUANTITIES, lineTable, meanLevel } from "./evaluate.js";
import { indexNear } from "./numeric.js";
import { escaped, rounded, signed } from "./text.js";
import { LABELS, STARTS, textOf } from "./values.js";

const NONE = "–", SAME_LINE = 0.5; // Hz: lines of A and B this close are the same

const fixed = (value, digits, unit) => (Number.isFinite(value)
  ? `${value.toFixed(digits).replace(/^-(?=[0.]*[1-9])/, "−").replace("-", "")} ${unit}` : NONE);
const percent = (share) => fixed(100 * share, share < 0.0995 ? 1 : 0, "%");
const milliseconds = (seconds) => fixed(1e3 * seconds, 1, "ms");
const distance = (reach) => (reach ? `${reach.beyond ? "> " : ""}${fixed(1e3 * reach.metre, 0, "mm")}`
  : reach === null ? "nowhere" : NONE); // until there are maps
const subscript = (name) => escaped(name).replace(/_(\w+)/g, "<sub>$1</sub>");

/** The four numbers of an answer as text; level and reach exist on skin only. */
function numbersOf({ body, level, reach, share, delay }) {
  const [above, far] = body.is_skin ? [level ? `${signed(level.dB)} dB` : "none", distance(reach)]
    : [NONE, NONE];
  return { level: above, reach: far, share: percent(share), delay: milliseconds(delay) };
}

const TILES = {
  share: ["Motion outside the kernel's region",
    "Share of the mean-square motion where the kernel is below −20 dB of its largest"],
  reach: ["Reach above threshold",
    "Largest distance from the path at which a component is above the detection threshold, "
    + "while a pulse is on"],
  level: ["Level at the point", "Level of the largest component above the detection threshold of skin, "
    + "while a pulse is on"],
  delay: ["Delay", "Lag of the motion behind the pressure on the path, at the strongest component"],
};

/** HTML of the four tiles, with the numbers of the pinned answer. */
export function tiles(answer, pinned) {
  const own = numbersOf(answer), other = pinned && numbersOf(pinned), { level, reach, load, body } = answer;
  const line = level ? `${level.f.toFixed(0)} Hz (${subscript(lineName(answer, level.f) || "line")})${
    load.pulses ? ", pulse on" : ""}` : "";
  const onSkin = (text) => (body.is_skin ? text : "not skin, no threshold");
  const details = { level: onSkin(line), reach: onSkin(reach ? "from the path" : ""), share: "",
    delay: "behind the pressure" };
  const kernel = { level: answer.kernelLevel ? `${signed(answer.kernelLevel.dB)} dB` : "none",
    reach: distance(answer.kernelReach), share: percent(answer.kernelShare), delay: milliseconds(0) };
  return Object.entries(TILES).map(([key, [name, help]]) => `<div class="tile" title="${help}">
    <span class="name">${name}</span><span class="value">${own[key]}</span>
    <span class="kernel">kernel ${kernel[key]}</span><span class="detail">${details[key]}</span>
    <span class="of-a">${other ? `A: ${other[key]}` : ""}</span></div>`).join("");
}

/** HTML of a table with columns [head, class] and rows of cells; each row begins with its head. */
function table(columns, rows, marked = () => false) {
  const heads = columns.map(([head, look]) => `<th scope="col"${look ? ` class="${look}"`
    : ""}>${head}</th>`);
  const body = rows.map((row, k) => `<tr${marked(k) ? ' class="different"' : ""}>${row.map((cell, j) => (j
    ? `<td class="${columns[j][1] ?? ""}">${cell}</td>` : `<th scope="row">${cell}</th>`)).join("")}</tr>`);
  return `<thead><tr>${heads.join("")}</tr></thead><tbody>${body.join("")}</tbody>`;
}

/** HTML of the table of lines, with the amplitudes of the pinned answer. */
export function linesTable(answer, pinned) {
  const name = answer.values.quantity, { unit, per } = QUANTITIES[name];
  const other = pinned && inQuantity(pinned.waves.f, pinned.wavesAt, name);
  const ofA = (f) => {
    const k = indexNear(pinned.waves.f, f, SAME_LINE);
    return k < 0 ? NONE : rounded(meanLevel(pinned.load) * other[k]);
  };
  const columns = [["Line"], ["Hz"], ["Kernel, Pa"], [`Waves, ${unit}`, "waves-ink"],
    ...(pinned ? [["A", "of-a"]] : []), ['<abbr title="dB above the detection threshold">dB SL</abbr>']];
  const mark = (f) => (f > answer.body.band_hz ? "≈ " : ""); // beyond the frequencies of the stated error
  return table(columns, lineTable(answer).map(({ name: line, f, pressure, motion, level }) => [
    subscript(typeset(line)) || NONE, f.toFixed(1), rounded(pressure), mark(f) + rounded(per * motion),
    ...(pinned ? [ofA(f)] : []), level === null ? NONE : signed(level)]));
}

/** HTML of the table that compares A and B: values that differ, then the four numbers. */
export function comparison(a, b) {
  const valueOf = (own, key) => (key === "body" ? own.body.title : textOf(key, own.values[key]));
  const rows = Object.keys(STARTS).filter((key) => a.values[key] !== b.values[key])
    .map((key) => [LABELS[key], valueOf(a, key), valueOf(b, key)]);
  for (const { key, label, value, unit } of (a.body.title === b.body.title && a.body.keys) || []) {
    const other = b.body.keys.find((own) => own.key === key)?.value ?? value;
    if (other !== value) rows.push([label, `${value} ${unit}`, `${other} ${unit}`]);
  }
  const count = rows.length, [ofA, ofB] = [a, b].map(numbersOf);
  for (const [key, [name]] of Object.entries(TILES)) rows.push([name, ofA[key], ofB[key]]);
  return `<table>${table([["Scene"], ["A, pinned", "of-a"], ["B, shown", "waves-ink"]],
    rows.map((row) => row.map(escaped)), (k) => k < count)}</table>`;
}
