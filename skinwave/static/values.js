// The controls of the page: ranges, units, steps, checks, and the load that they describe.

import { drawingFrequency } from "./load.js";

/**
 * Numbers with a slider from `low` to `high` in steps of `step`, in `unit`; `least` is the smallest value
 * of the field, if not `low`. Ranges: Lim, Seifi and Park, CHI EA '24, section 2.2.
 */
export const NUMBERS = {
  amplitude: { label: "Amplitude", unit: "%", low: 0, high: 100, step: 1, start: 100 },
  am: { label: "AM frequency", unit: "Hz", low: 0, high: 500, step: 1, start: 140 },
  am2: { label: "Second AM frequency", unit: "Hz", low: 0, high: 500, step: 1, start: 0 },
  envelope: { label: "Envelope frequency", unit: "Hz", low: 0, high: 100, step: 0.5, start: 0 },
  duration: { label: "Duration", unit: "s", low: 0.1, high: 10, step: 0.1, start: 1, least: 0.01 },
  size: { label: "Size", unit: "mm", low: 0, high: 60, step: 0.5, start: 20 },
  speed: { label: "Drawing speed", unit: "m/s", low: 0, high: 40, step: 0.1, start: 12 },
  drawn: { label: "Drawing frequency", unit: "Hz", low: 1, high: 500, step: 1, start: 100 },
  height: { label: "Height of the focus", unit: "mm", low: 100, high: 600, step: 5, start: 200 },
  foci: { label: "Focal points", unit: "", low: 1, high: 8, step: 1, start: 1 },
  ramp: { label: "Ramp", unit: "ms", low: 0, high: 100, step: 1, start: 0 },
  modulation: { label: "Depth of modulation", unit: "%", low: 0, high: 100, step: 1, start: 100 },
  peak: { label: "Peak pressure", unit: "Pa", low: 1, high: 200, step: 1, start: 50, least: 0 },
  x: { label: "Point x", unit: "mm", low: -50, high: 50, step: 0.1, start: 10 },
  y: { label: "Point y", unit: "mm", low: -50, high: 50, step: 0.1, start: 0 },
};

const RATIOS = { "1:0": 1, "0.75:0.25": 0.75, "0.5:0.5": 0.5, "0.25:0.75": 0.25, "0:1": 0 };
const SHAPES = ["point", "line", "circle", "triangle", "square"]; // shapes that have a size

/** Choices of words. */
export const CHOICES = {
  ratio: { label: "Superposition ratio", start: "1:0", options: Object.keys(RATIOS) },
  shape: { label: "Shape of the path", start: "circle", options: [...SHAPES, "polyline"] },
  sweep: { label: "Sweep of a line", start: "there_and_back",
    options: ["there_and_back", "one_way", "sinusoidal"] },
  drive: { label: "Drive law", start: "pressure_squared",
    options: ["linear", "pressure_squared", "force_corrected"] },
  profile: { label: "Focus profile", start: "gaussian", options: ["gaussian", "main_lobe"] },
  body: { label: "Body", start: "skin-slab", options: [] }, // filled by nameBodies
  sharing: { label: "Several foci", start: "simultaneous", options: ["simultaneous", "time_multiplexed"] },
  quantity: { label: "Quantity at the point", start: "displacement",
    options: ["displacement", "velocity", "acceleration"] },
};

const AREA = 50; // mm: half the side of the area of paths
const LARGEST_SIZE = 60; // mm, the size of a palm
// mm: centres of the paths of further foci
const CENTRES = [[-20, 0], [20, 0], [0, 20], [0, -20], [-20, 20], [20, -20], [20, 20], [-20, -20]];

/**
 * Texts of at most `most` rows. A row has one of some `words`, if there are any, and `count` numbers, all
 * between slashes. `like` describes a row.
 */
const TEXTS = {
  pulses: { label: "Rhythm, ms", count: 2, most: 64,
    like: "on/off times in ms, with on above 0, such as 100/50", isValid: ([on, gap]) => on > 0 && gap >= 0 },
  phases: { label: "Phases, %", count: 1, most: NUMBERS.foci.high,
    like: "phases from 0 to below 100 %, such as 0, 25, 60",
    isValid: ([phase]) => phase >= 0 && phase < 100 },
  paths: { label: "Paths of the foci", count: 3, words: SHAPES, most: NUMBERS.foci.high,
    like: `shape/size/x/y in mm, such as circle/20/-15/0. Shapes: ${SHAPES.join(", ")}; size up to ${
      LARGEST_SIZE} mm; all within ±${AREA} mm`,
    isValid: ([shape, size, ...at]) => size >= 0 && size <= LARGEST_SIZE && extentOf(shape, size)
      .every((extent, axis) => Math.abs(at[axis]) + extent <= AREA * (1 + 1e-9)) },
  polyline: { label: "Points of the path, mm", count: 2, most: 400,
    like: `corners x/y within ±${AREA} mm, such as 10/5`,
    isValid: (at) => Math.max(...at.map(Math.abs)) <= AREA },
};

const ofControls = (valueOf) => Object.fromEntries(
  Object.entries({ ...NUMBERS, ...CHOICES, ...TEXTS }).map(([key, control]) => [key, valueOf(control)]));
export const STARTS = ofControls(({ start = "" }) => start);
export const LABELS = ofControls(({ label }) => label);

/** Set the names of the bodies. */
export function nameBodies(names) {
  CHOICES.body.options = [...names];
}

const parts = (text) => text.split(",").map((part) => part.trim()).filter(Boolean);
const toNumber = (text) => (/^[^\s]+$/.test(text.trim()) ? Number(text) : NaN);
const inUnit = (value, unit) => (unit ? `${value} ${unit}` : `${value}`);
const refuseIf = (isWrong, sentence) => { if (isWrong) throw new Error(sentence); };
const short = (text) => (text.length > 40 ? `${text.slice(0, 37)}...` : text);

/** Rows [[...]] of the text of a control, in its units. Throws an Error with a sentence for users. */
export function rowsOf(key, text) {
  const { count, words, most, like, isValid } = TEXTS[key];
  const rows = parts(text).map((part) => {
    const cells = part.split("/"), word = words ? [cells.shift().trim()] : [];
    const row = [...word, ...cells.map(toNumber)];
    const isKnown = cells.length === count && row.slice(word.length).every(Number.isFinite);
    refuseIf(!isKnown || (words && !words.includes(row[0])) || !isValid(row),
      `${LABELS[key]}: "${short(part)}" is not valid. Give ${like}.`);
    return row;
  });
  refuseIf(rows.length > most, `${LABELS[key]}: ${rows.length} entries are too many. Give at most ${most}.`);
  return rows;
}

/** Pulses and gaps [[on, gap]] in s, from a text such as "100/50, 40/110" in ms. */
export const pulsesOf = (text) => rowsOf("pulses", text).map((pulse) => pulse.map((ms) => ms / 1e3));

/** Half extent [x, y] of a shape around its centre, in the unit of its size. */
function extentOf(shape, size) {
  return { point: [0, 0], line: [size / 2, 0], triangle: [size / 2, size / Math.sqrt(3)] }[shape]
    || [size / 2, size / 2];
}

/** Paths {shape, size, centre} in metre, one for each focus, from a text. */
const pathsOf = (text) => rowsOf("paths", text).map(([shape, size, x, y]) => (
  { shape, size: shape === "point" ? 0 : size / 1e3, centre: [x / 1e3, y / 1e3] }));

/** Key of the text with the places of a path that can be dragged; "" if there is none. */
const draggedKey = ({ paths, shape }) => (paths ? "paths" : shape === "polyline" ? "polyline" : "");

/** Places [[x, y]] in metre that can be dragged: corners of a polyline, or middles of own paths. */
export function cornersOf(values) {
  const key = draggedKey(values);
  return key ? rowsOf(key, values[key]).map((row) => row.slice(-2).map((mm) => mm / 1e3)) : [];
}

/** Values with corner k at [x, y] in metre. The two ends of a closed polyline move together. */
export function withCorner(values, k, at) {
  const key = draggedKey(values), rows = parts(values[key]), before = rows[k];
  const moved = [...before.split("/").slice(0, -2), ...at.map((v) => Math.round(1e4 * v) / 10)].join("/");
  const isMoved = (row, j) => j === k || (key === "polyline" && row === before);
  return { ...values, [key]: check(key, rows.map((row, j) => (isMoved(row, j) ? moved : row)).join(", ")) };
}

/**
 * Value of a control from typed text or a choice. Throws an Error with a sentence for users if it is unknown,
 * not a number or out of range.
 */
export function check(key, text) {
  refuseIf(!(key in STARTS), `"${short(key)}" is not a control of this page.`);
  const given = String(text).trim(), label = LABELS[key];
  if (key in TEXTS) {
    rowsOf(key, given);
    return given;
  }
  if (key in CHOICES) {
    const { options } = CHOICES[key];
    refuseIf(options.length && !options.includes(given),
      `${label}: "${short(given)}" is not available. Choose ${options.join(", ")}.`);
    return given;
  }
  const { unit, low, high, least = low } = NUMBERS[key], value = toNumber(given.replace(",", "."));
  const problem = !Number.isFinite(value) ? `"${short(given)}" is not a number`
    : value < least || value > high ? `${inUnit(short(given), unit)} is out of range`
      : key === "foci" && !Number.isInteger(value) ? `${value} is not a whole number` : "";
  refuseIf(problem, `${label}: ${problem}. Give a value from ${least} to ${inUnit(high, unit)}.`);
  return value;
}

/** Text of a value of a control, with its unit. */
export function textOf(key, value) {
  if (key in NUMBERS) return inUnit(Number(Number(value).toPrecision(6)), NUMBERS[key].unit);
  return String(value).replaceAll("_", " ") || "none";
}

/**
 * Values with as many paths as foci, if foci have paths of their own. `moved` is the control that keeps its
 * value, "foci" or "paths".
 */
export function fitPaths(values, moved) {
  if (!values.paths) return values;
  const own = parts(values.paths);
  if (moved === "paths") return { ...values, foci: own.length };
  const first = own.slice(0, values.foci), like = first[first.length - 1].split("/").slice(0, 2).join("/");
  const more = CENTRES.slice(first.length, values.foci).map(([x, y]) => `${like}/${x}/${y}`);
  return { ...values, paths: [...first, ...more].join(", ") };
}

const evenly = (n) => Array.from({ length: n }, (_, k) => k / n);

/** Path and phases of the foci {path, foci} of a load. */
function pathAndFoci(values) {
  const n = values.foci, own = pathsOf(values.paths);
  const expectOneEach = ({ length }, title, words) => refuseIf(length && length !== n,
    `${title}: there are ${length} ${words} and ${n} foci. Give one for each focus.`);
  expectOneEach(own, "Own paths", "paths");
  if (own.length) return { path: { shape: "joined", paths: own, drawn: values.drawn }, foci: evenly(n) };
  const phases = rowsOf("phases", values.phases).map(([phase]) => phase / 100), { shape, sweep } = values;
  expectOneEach(phases, "Phases", "phases");
  const path = { shape, size: 0, speed: shape === "point" ? 0 : values.speed, sweep, centre: [0, 0] };
  if (SHAPES.includes(shape) && shape !== "point") path.size = values.size / 1e3;
  if (shape === "polyline") {
    path.points = rowsOf("polyline", values.polyline).map(([x, y]) => [x / 1e3, y / 1e3]);
    refuseIf(path.points.length < 2, "A polyline needs two corners or more, such as 0/0, 10/0.");
  }
  return { path, foci: phases.length ? phases : evenly(n) };
}

/** Largest distance [x, y] in metre of the path of a load from the origin along each axis. */
function pathExtent(path) {
  const furthest = (path.paths || [path]).flatMap(({ shape, size, points, centre }) => {
    if (shape === "polyline") return points;
    return [extentOf(shape, size).map((extent, axis) => Math.abs(centre[axis]) + extent)];
  });
  return [0, 1].map((axis) => Math.max(...furthest.map((at) => Math.abs(at[axis]))));
}

/**
 * Load of the values of the controls, in SI units. Throws an Error with a sentence for users if values
 * contradict each other or, with a body's record, if the path leaves the body.
 */
export function loadOf(values, body = null) {
  const { path, foci } = pathAndFoci(values), pulses = pulsesOf(values.pulses), ramp = values.ramp / 1e3;
  const fd = drawingFrequency(path);
  refuseIf(fd > 20000, `The drawing frequency is ${Math.round(fd)} Hz; the limit is 20000 Hz, half the `
    + "carrier. Use a longer path or a lower speed.");
  const shortest = Math.min(...pulses.map(([on]) => on));
  refuseIf(ramp > shortest / 2, `Ramp: ${values.ramp} ms is longer than half the shortest pulse of ${
    Number((1e3 * shortest).toPrecision(6))} ms. Give a shorter ramp.`);
  if (body) checkOnBody(path, values, body);
  return {
    path, foci, am: values.am, am2: values.am2, envelope: values.envelope, w1: RATIOS[values.ratio],
    amplitude: values.amplitude / 100, depth: values.modulation / 100, drive: values.drive,
    profile: values.profile, peak: values.peak, height: values.height / 1e3,
    pulses: pulses.length ? pulses : null, ramp, duration: values.duration,
  };
}

function checkOnBody(path, values, body) {
  refuseIf(values.height < body.lowest_height_mm, `Height of the focus: ${values.height} mm is too low for ${
    body.title}. Give at least ${body.lowest_height_mm} mm.`);
  if (!body.extent_mm) return;
  pathExtent(path).forEach((reach, axis) => {
    const half = body.extent_mm[axis], name = "xy"[axis], furthest = Number((1e3 * reach).toPrecision(3));
    const end = `off the body, which ends at ±${half} mm`;
    refuseIf(1e3 * reach > half * (1 + 1e-9),
      `The path reaches ${name} = ${furthest} mm, ${end}. Make the path smaller.`);
    refuseIf(Math.abs(values[name]) > half, `Point: ${name} = ${values[name]} mm is ${end}. Move the point.`);
  });
}
