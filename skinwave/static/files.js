// Files: scenes, tables of waveforms and lines, sound, and measurements.

import { joinedCorners } from "./load.js";
import { QUANTITIES, lineTable } from "./evaluate.js";
import { largestOf } from "./numeric.js";
import { STARTS, check, loadOf, pulsesOf, rowsOf } from "./values.js";

const NAME = "skinwave live", SESSION = "skinwave live session";
const RATE = 10000; // Hz of waveforms

const float = (value) => (Number.isInteger(value) ? `${value}.0` : `${value}`); // TOML and Python
const pairs = (points) => `[${points.map(([x, y]) => `[${float(x)}, ${float(y)}]`).join(", ")}]`;
const cell = (value) => (/[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : `${value}`);
const csv = (header, rows) => [header, ...rows].map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
const digits = (value) => `${Number(value.toPrecision(9))}`;

// Keys of a scene file whose values are those of a control.
const KEYS = {
  tacton: { amplitude_percent: "amplitude", am_frequency_hz: "am", second_am_frequency_hz: "am2",
    envelope_frequency_hz: "envelope", duration_s: "duration", shape: "shape", size_mm: "size",
    speed_m_per_s: "speed", sweep: "sweep", sharing: "sharing" },
  "tacton.rhythm": { ramp_ms: "ramp" },
  focus: { height_mm: "height", drive: "drive", profile: "profile", peak_pressure_pa: "peak" },
  probes: { quantity: "quantity" },
};

/** Scene file (TOML) of the controls' values and a body's record. */
export function sceneToml(values, record) {
  const { path, foci } = loadOf(values), { shape } = path;
  const table = (name, own) => {
    const known = Object.entries(KEYS[name]).map(([key, control]) => [key,
      typeof values[control] === "number" ? float(values[control]) : `"${values[control]}"`]);
    const lines = Object.entries({ ...Object.fromEntries(known), ...own }).filter(([, value]) => value);
    return `[${name}]\n${lines.map(([key, value]) => `${key} = ${value}`).join("\n")}`;
  };
  const own = { superposition: `[${values.ratio.split(":").map((w) => float(Number(w))).join(", ")}]`,
    foci: `[${foci.map(float).join(", ")}]`, points_mm: "", times_s: "" };
  if (shape === "joined") {
    const { points, times } = joinedCorners(path);
    own.shape = '"recorded"';
    own.points_mm = pairs(points.map(([x, y]) => [1e3 * x, 1e3 * y]));
    own.times_s = `[${times.map(float).join(", ")}]`;
  } else if (shape === "polyline") own.points_mm = pairs(rowsOf("polyline", values.polyline));
  if (["joined", "polyline", "point"].includes(shape)) own.size_mm = "";
  if (["joined", "point"].includes(shape)) own.speed_m_per_s = own.sweep = "";
  const pulses = pulsesOf(values.pulses).map((pulse) => pulse.map((s) => Number((1e3 * s).toPrecision(12))));
  return [`name = "${NAME}"`, table("tacton", own),
    ...(pulses.length ? [table("tacton.rhythm", { pulses_ms: pairs(pulses) })] : []),
    table("focus", { depth_of_modulation: float(values.modulation / 100) }), record.toml.trim(),
    table("probes", { points_mm: pairs([[values.x, values.y]]) })].join("\n\n") + "\n";
}

/**
 * Values of the controls in a scene file that this page has saved; the body is one of `bodies` with the same
 * table. Throws an Error with a sentence for users if the file holds something else.
 */
export function readScene(text, name, bodies) {
  const refuse = (sentence) => {
    throw new Error(`${name}: ${sentence} Use skinwave web, which opens any scene.`);
  };
  const given = {}, values = { ...STARTS };
  let table = "";
  for (const line of text.split(/\r?\n/)) {
    const [, head] = line.match(/^\[([\w.]+)\]$/) ?? [];
    const [, key, value] = line.match(/^(\w+) = (.+)$/) ?? [];
    if (head) table = `${head}.`;
    if (!key) continue;
    try { given[table + key] = JSON.parse(value); } catch { given[table + key] = value; }
  }
  if (given.name !== NAME) refuse("The file is not a scene from Save.");
  const lists = ["tacton.superposition", "tacton.foci", "probes.points_mm"];
  if (!lists.every((key) => Array.isArray(given[key]))) refuse("The scene is incomplete.");
  if (given["tacton.shape"] === "recorded") refuse("Own paths are kept in a session only.");
  for (const [name, keys] of Object.entries(KEYS)) {
    for (const [key, control] of Object.entries(keys)) {
      const value = given[`${name}.${key}`];
      if (value !== undefined) values[control] = check(control, value);
    }
  }
  const rows = (key) => (given[key] ?? []).map((row) => row.join("/")).join(", ");
  const percent = (share) => Number((100 * share).toPrecision(9)), foci = given["tacton.foci"];
  const [[x, y]] = given["probes.points_mm"];
  const set = {
    ratio: given["tacton.superposition"].join(":"), foci: foci.length,
    phases: foci.length > 1 ? foci.map(percent).join(", ") : "",
    pulses: rows("tacton.rhythm.pulses_ms"), polyline: rows("tacton.points_mm"),
    modulation: percent(given["focus.depth_of_modulation"]), x, y,
  };
  for (const [key, own] of Object.entries(set)) values[key] = check(key, own);
  const own = bodies.find((body) => text.includes(body.toml.trim()));
  return { ...values, body: (own ?? refuse("The body of the scene is not on this page.")).name };
}

const timesOf = ({ duration }) => Float64Array.from({ length: Math.max(2, Math.round(duration * RATE)) },
  (_, k) => k / RATE);

/** CSV of the waveforms at the point: time in s, displacement in metre, the kernel's pressure in Pa. */
export function waveformCsv({ values, load, kernel, waves, x, y }) {
  const times = timesOf(load), columns = [waves, kernel].map((motion) => motion.waveform(x, y, times));
  const at = `(${values.x},${values.y})`, header = ["t [s]", `displacement${at} [m]`, `pressure${at} [Pa]`];
  return csv(header, Array.from(times, (t, k) => [t, columns[0][k], columns[1][k]].map(digits)));
}

/** CSV of the lines at the point. */
export function linesCsv(answer) {
  const { unit, per } = QUANTITIES[answer.values.quantity];
  const header = ["line", "frequency, Hz", `${answer.values.quantity}, ${unit}`, "kernel pressure, Pa",
    "sensation level, dB"];
  return csv(header, lineTable(answer).map(({ name, f, motion, pressure, level }) => [
    name || "unnamed", ...[f, per * motion, pressure].map(digits),
    level === null || level === -Infinity ? "" : digits(level),
  ]));
}

/** WAV (16 bit, mono) of samples from -1 to 1. */
function wav({ samples, rate }) {
  const bytes = new DataView(new ArrayBuffer(44 + 2 * samples.length));
  const text = (at, word) => [...word].forEach((letter, k) => bytes.setUint8(at + k, letter.charCodeAt(0)));
  text(0, "RIFF"); text(8, "WAVEfmt "); text(36, "data");
  bytes.setUint32(4, bytes.byteLength - 8, true);
  const words = [16, 1 + (1 << 16), rate, 2 * rate, 2 + (16 << 16)];
  words.forEach((word, k) => bytes.setUint32(16 + 4 * k, word, true));
  bytes.setUint32(40, 2 * samples.length, true);
  samples.forEach((value, k) => bytes.setInt16(44 + 2 * k, Math.round(32767 * value), true));
  return new Uint8Array(bytes.buffer);
}

/** Displacement at the point as sound: samples from -1 to 1 without their mean, and their rate in Hz. */
export function samplesOf({ load, waves, x, y }) {
  const values = waves.waveform(x, y, timesOf(load));
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const centred = values.map((value) => value - mean), largest = largestOf(centred) || 1;
  return { samples: centred.map((value) => value / largest), rate: RATE };
}

/** WAV of the displacement at the point. */
export const waveformWav = (answer) => wav(samplesOf(answer));

/** Session (JSON) of the values of the controls, and of those of A, if it is pinned. */
export const sessionJson = ({ values, pinned }) => `${JSON.stringify({ format: SESSION, b: values,
  ...(pinned && { a: pinned.values }) }, null, 2)}\n`;

/** Values {b, a} of a session; throws an Error with a sentence for users if it is not one of this page. */
export function readSession(text, name) {
  let found = {};
  try { found = JSON.parse(text); } catch { /* not JSON */ }
  if (found?.format !== SESSION) {
    throw new Error(`${name} is not a session of this page. Choose a file from Save.`);
  }
  const checked = (own) => ({ ...STARTS, ...Object.fromEntries(
    Object.entries(own).map(([key, value]) => [key, check(key, value)])) });
  return { b: checked(found.b ?? {}), a: found.a ? checked(found.a) : null };
}

/** Files that the page saves: [[title, name, type, (answer) => text or bytes]]. */
export const WRITERS = [
  ["Waveforms, CSV", "waveforms.csv", "text/csv", waveformCsv],
  ["Lines, CSV", "lines.csv", "text/csv", linesCsv],
  ["Displacement, WAV", "displacement.wav", "audio/wav", waveformWav],
  ["Session, A and B, JSON", "session.json", "application/json", sessionJson],
  ["Scene, TOML", "scene.toml", "application/toml", ({ values, body }) => sceneToml(values, body)],
];

const TIMES = { s: 1, ms: 1e-3, us: 1e-6 }, FREQUENCIES = { Hz: 1, kHz: 1e3 };
const METRES = { m: 1, cm: 1e-2, mm: 1e-3, um: 1e-6, nm: 1e-9 };
const MOTION = /^(c?m|mm|um|nm)(|\/s|\/s2)$/;
const KINDS = { "": "displacement", "/s": "velocity", "/s2": "acceleration" };

/** Unit in brackets at the end of a column's title. */
const unitIn = (title) => title.replace(/[µμ]/g, "u").replace("²", "2")
  .match(/[([]([^()[\]]*)[)\]]$/)?.[1] ?? "";

/** Place [x, y] in metre from a column's title such as "displacement(0,10) [m]" in mm; null if none. */
function placeIn(title) {
  const match = title.match(/\(\s*(-?[\d.]+)\s*[,;]\s*(-?[\d.]+)\s*\)/);
  return match ? [Number(match[1]) / 1e3, Number(match[2]) / 1e3] : null;
}

/**
 * Read a measurement from a text of columns with units in the header, over time or frequency: {name,
 * quantity, places, remarks} with {times, values} or {frequencies, amplitudes} by place, in SI units. Throws
 * an Error with a sentence for users if the text has another form. Times may deviate from equal spacing by a
 * share `jitter` of the sampling interval.
 */
export function readMeasurement(text, name, jitter = 0.25) {
  const lines = text.replace(/^\ufeff/, "").split(/\r?\n/).filter((line) => /^[^#%]/.test(line.trim()));
  const mark = ["\t", ";"].find((own) => lines[0]?.includes(own)) ?? ",";
  const separator = new RegExp(`${mark}(?![^(]*\\))`); // outside the brackets of a place
  const [titles = [], ...rows] = lines.map((line) => line.replaceAll('"', "").split(separator)
    .map((word) => word.trim()));
  const refuse = (sentence) => {
    throw new Error(`${name}: ${sentence} skinwave web and skinwave compare read other formats.`);
  };
  const [unit, ...units] = titles.map(unitIn), kinds = units.map((own) => own.match(MOTION));
  const over = TIMES[unit] ?? FREQUENCIES[unit], isTime = unit in TIMES;
  if (!over || !kinds[0]) {
    refuse("The first line must name a time or frequency and a motion, with their units: time [s], "
      + "displacement [µm].");
  }
  if (!isTime && titles.some((title) => /\b(re|im|real|imag|imaginary|phase)\b/i.test(title))) {
    refuse("The spectrum has real and imaginary parts or phases. Give amplitudes only.");
  }
  const columns = [...kinds.keys()].filter((k) => kinds[k]?.[2] === kinds[0][2]);
  const number = (word) => Number((mark === "," ? word : word?.replace(",", ".")) || NaN);
  const values = columns.map((k) => rows.map((row) => METRES[kinds[k][1]] * number(row[k + 1])));
  const at = rows.map((row) => over * number(row[0])), step = (at[at.length - 1] - at[0]) / (at.length - 1);
  if (at.length < 3 || ![at, ...values].flat().every(Number.isFinite)) {
    refuse("It needs at least three rows, with a number in each cell.");
  }
  const isUneven = (value, k) => value <= at[k - 1]
    || (isTime && Math.abs(value - at[0] - k * step) > jitter * step);
  if (at.some(isUneven)) {
    refuse(isTime ? "The times are not equally spaced." : "The frequencies are not in ascending order.");
  }
  const common = { name, quantity: KINDS[kinds[0][2]], remarks: [],
    places: columns.map((k) => placeIn(titles[k + 1])) };
  if (!isTime) return { ...common, frequencies: at, amplitudes: values.map((own) => own.map(Math.abs)) };
  return { ...common, times: at.map((t) => t - at[0]), values };
}
