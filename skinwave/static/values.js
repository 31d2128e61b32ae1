// The controls of the page: ranges, units, steps, checks, the address, and the load that they describe.

import { drawingFrequency } from "./load.js";

/**
 * Numbers with a slider from `low` to `high` in steps of `step`, in `unit`; `least` is the smallest
 * value that the field takes. Ranges: Lim, Seifi and Park, CHI EA '24, section 2.2.
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
const SHAPES = ["point", "line", "circle", "triangle", "square"]; // a size describes them
export const CHOICES = {
  ratio: Object.keys(RATIOS),
  shape: [...SHAPES, "polyline"],
  sweep: ["there_and_back", "one_way", "sinusoidal"],
  drive: ["linear", "pressure_squared", "force_corrected"],
  profile: ["gaussian", "main_lobe"],
  sharing: ["simultaneous", "time_multiplexed"],
  quantity: ["displacement", "velocity", "acceleration"],
  body: [], // filled by nameBodies
};

export const STARTS = {
  ...Object.fromEntries(Object.entries(NUMBERS).map(([key, number]) => [key, number.start])),
  ratio: "1:0", shape: "circle", sweep: "there_and_back", drive: "pressure_squared",
  profile: "gaussian", body: "skin-slab", sharing: "simultaneous", quantity: "displacement",
  pulses: "", phases: "", paths: "", polyline: "",
};

export const LABELS = {
  ...Object.fromEntries(Object.entries(NUMBERS).map(([key, number]) => [key, number.label])),
  ratio: "Superposition ratio", shape: "Shape of the path", sweep: "Sweep of a line", drive: "Drive law",
  profile: "Focus profile", body: "Body", sharing: "Several foci", quantity: "Quantity at the point",
  pulses: "Rhythm, ms", phases: "Phases, %", paths: "Paths of the foci", polyline: "Points of the path, mm",
};

const AREA = 50; // mm: half the side of the area that paths stay within
const LARGEST = 60; // mm, the size of a palm
const FASTEST = 20000; // Hz, half the carrier
// mm: where paths of further foci are placed
const CENTRES = [[-20, 0], [20, 0], [0, 20], [0, -20], [-20, 20], [20, -20], [20, 20], [-20, -20]];
const ROOT3 = Math.sqrt(3);

/** Names of the bodies that the page has. */
export function nameBodies(names) {
  CHOICES.body = [...names];
}

const parts = (text) => text.split(",").map((part) => part.trim()).filter(Boolean);
const toNumber = (text) => (/^[^\s]+$/.test(text.trim()) ? Number(text) : NaN);
const inUnit = (value, unit) => (unit ? `${value} ${unit}` : `${value}`);
const short = (text) => (text.length > 40 ? `${text.slice(0, 37)}...` : text);

/**
 * Texts of rows, each of `count` numbers between slashes, after one of some `words`; at `most` so many.
 * `like` says what one is.
 */
const TEXTS = {
  pulses: { count: 2, most: 64, like: "on/off times in ms, on longer than 0, such as 100/50",
    isValid: ([on, gap]) => on > 0 && gap >= 0 },
  phases: { count: 1, most: NUMBERS.foci.high, like: "0 to below 100 %, such as 0, 25, 60",
    isValid: ([phase]) => phase >= 0 && phase < 100 },
  polyline: { count: 2, most: 400, like: `x/y in mm within ±${AREA} mm, such as 10/5`,
    isValid: (at) => Math.max(...at.map(Math.abs)) <= AREA },
  paths: { count: 3, words: SHAPES, most: NUMBERS.foci.high, like: "shape/size/x/y in mm, such as "
    + `circle/20/-15/0, with a shape of ${SHAPES.join(", ")}, up to ${LARGEST} mm and within ±${AREA} mm`,
  isValid: ([shape, size, ...at]) => size >= 0 && size <= LARGEST && extentOf(shape, size)
    .every((extent, axis) => Math.abs(at[axis]) + extent <= AREA * (1 + 1e-9)) },
};

/** Rows [[...]] of the text of a control, in its units; [] if empty. Throws an Error for users. */
function rowsOf(key, text) {
  const { count, words, most, like, isValid } = TEXTS[key];
  const rows = parts(text).map((part) => {
    const cells = part.split("/"), word = words ? [cells.shift().trim()] : [];
    const row = [...word, ...cells.map(toNumber)];
    const isKnown = cells.length === count && row.slice(word.length).every(Number.isFinite);
    if (isKnown && (!words || words.includes(row[0])) && isValid(row)) return row;
    throw new Error(`${LABELS[key]}: "${short(part)}" is not understood. Give ${like}.`);
  });
  if (rows.length <= most) return rows;
  throw new Error(`${LABELS[key]}: ${rows.length} exceed the limit of ${most}. Give fewer.`);
}

/** Pulses and gaps [[on, gap]] in s of a text such as "100/50, 40/110" in ms; [] if empty. */
export const pulsesOf = (text) => rowsOf("pulses", text).map((pulse) => pulse.map((ms) => ms / 1e3));

/** How far from its centre a named shape extends along each axis, as [x, y], in the unit of its size. */
function extentOf(shape, size) {
  return { point: [0, 0], line: [size / 2, 0], triangle: [size / 2, size / ROOT3] }[shape]
    || [size / 2, size / 2];
}

/** Paths {shape, size, centre} in metre, one for each focus, of a text; [] if empty. */
const pathsOf = (text) => rowsOf("paths", text).map(([shape, size, x, y]) => (
  { shape, size: shape === "point" ? 0 : size / 1e3, centre: [x / 1e3, y / 1e3] }));

/**
 * Value of a control from what was typed or chosen. Throws an Error with one sentence for users if it
 * is unknown, not a number or out of range.
 */
export function check(key, text) {
  if (!(key in STARTS)) throw new Error(`"${short(key)}" is not a control of this page.`);
  const given = String(text).trim(), label = LABELS[key];
  if (key in TEXTS) {
    rowsOf(key, given);
    return given;
  }
  if (key in CHOICES) {
    if (CHOICES[key].length && !CHOICES[key].includes(given)) {
      throw new Error(`${label}: "${short(given)}" is not available. Choose ${CHOICES[key].join(", ")}.`);
    }
    return given;
  }
  const { unit, low, high, least = low } = NUMBERS[key], value = toNumber(given.replace(",", "."));
  if (!Number.isFinite(value)) {
    throw new Error(`${label}: "${short(given)}" is not a number. Give ${least} to ${inUnit(high, unit)}.`);
  }
  if (value < least || value > high) {
    throw new Error(`${label}: ${inUnit(value, unit)} is outside ${least} to ${inUnit(high, unit)}.`);
  }
  if (key === "foci" && !Number.isInteger(value)) {
    throw new Error(`${label}: ${value} is not a whole number. Give ${least} to ${high}.`);
  }
  return value;
}

/** Value of a control in words, with its unit. */
export function shown(key, value) {
  if (key in NUMBERS) return inUnit(Number(Number(value).toPrecision(6)), NUMBERS[key].unit);
  return String(value).replaceAll("_", " ") || "none";
}

/** Part of an address that fromAddress reads: the values that differ from the starts. */
export function toAddress(values, starts = STARTS) {
  return Object.keys(STARTS).filter((key) => values[key] !== starts[key]).map((key) => {
    const text = key in NUMBERS ? Number(values[key].toPrecision(10)) : values[key];
    return `${key}=${encodeURIComponent(text).replace(/%(2F|3A|2C)/g, decodeURIComponent)}`;
  }).join("&");
}

/** Values of an address, and a sentence for each part of it that was refused: {values, refused}. */
export function fromAddress(text, starts = STARTS) {
  const values = { ...starts }, refused = [];
  for (const [key, given] of new URLSearchParams(text.replace(/^[#?]/, ""))) {
    try {
      values[key] = check(key, given);
    } catch (error) {
      refused.push(`Left out of the address: ${error.message}`);
    }
  }
  return { values, refused };
}

/**
 * Values with as many paths as foci, if foci have paths of their own. `moved` is the control that was
 * moved, "foci" or "paths", and stays.
 */
export function fitPaths(values, moved) {
  if (!values.paths) return values;
  const own = parts(values.paths);
  if (moved === "paths") return { ...values, foci: own.length };
  const kept = own.slice(0, values.foci), like = kept[kept.length - 1].split("/").slice(0, 2).join("/");
  const more = CENTRES.slice(kept.length, values.foci).map(([x, y]) => `${like}/${x}/${y}`);
  return { ...values, paths: [...kept, ...more].join(", ") };
}

const evenly = (n) => Array.from({ length: n }, (_, k) => k / n);

/** The path of a load, and the phases of its foci. */
function pathAndFoci(values) {
  const n = values.foci, own = pathsOf(values.paths);
  if (own.length) {
    if (own.length !== n) {
      throw new Error(`Paths: ${own.length} for ${n} foci. Give one path for each focus, or none.`);
    }
    return { path: { shape: "joined", paths: own, drawn: values.drawn }, foci: evenly(n) };
  }
  const phases = rowsOf("phases", values.phases).map(([phase]) => phase / 100), { shape, sweep } = values;
  if (phases.length && phases.length !== n) {
    throw new Error(`Phases: ${phases.length} for ${n} foci. Give one phase for each focus, or none.`);
  }
  const foci = phases.length ? phases : evenly(n);
  if (shape === "point") return { path: { shape, size: 0, speed: 0, sweep, centre: [0, 0] }, foci };
  if (shape === "polyline") {
    const points = rowsOf("polyline", values.polyline).map(([x, y]) => [x / 1e3, y / 1e3]);
    if (points.length < 2) throw new Error("The path needs two points or more, such as 0/0, 10/0.");
    return { path: { shape, size: 0, speed: values.speed, sweep, points, centre: [0, 0] }, foci };
  }
  return { path: { shape, size: values.size / 1e3, speed: values.speed, sweep, centre: [0, 0] }, foci };
}

/** How far in metre the path of a load extends from the origin along each axis, as [x, y]. */
function pathExtent(path) {
  const each = (path.paths || [path]).map(({ shape, size, points, centre: [cx, cy] }) => {
    if (shape === "polyline") return points.map(([x, y]) => [Math.abs(x + cx), Math.abs(y + cy)]);
    const [ex, ey] = extentOf(shape, size);
    return [[Math.abs(cx) + ex, Math.abs(cy) + ey]];
  }).flat();
  return [0, 1].map((axis) => Math.max(...each.map((point) => point[axis])));
}

/**
 * The load that the controls describe, in SI units. Throws an Error with one sentence for users if
 * values contradict each other or, with a body's record, the path leaves the body.
 */
export function loadOf(values, body = null) {
  const { path, foci } = pathAndFoci(values), pulses = pulsesOf(values.pulses), ramp = values.ramp / 1e3;
  const turns = drawingFrequency(path);
  if (turns > FASTEST) {
    throw new Error(`The path is drawn ${Math.round(turns)} times a second; the limit is ${FASTEST} Hz, `
      + "half the carrier. Make it longer or slower.");
  }
  const shortest = Math.min(...pulses.map(([on]) => on));
  if (pulses.length && ramp > shortest / 2) {
    throw new Error(`Ramp: ${values.ramp} ms is longer than half the shortest pulse of `
      + `${Number((1e3 * shortest).toPrecision(6))} ms. Shorten it.`);
  }
  if (body) checkOnBody(path, values, body);
  return {
    path, foci, am: values.am, am2: values.am2, envelope: values.envelope, w1: RATIOS[values.ratio],
    amplitude: values.amplitude / 100, depth: values.modulation / 100, drive: values.drive,
    profile: values.profile, peak: values.peak, height: values.height / 1e3,
    pulses: pulses.length ? pulses : null, ramp, duration: values.duration,
  };
}

function checkOnBody(path, values, body) {
  if (values.height < (body.lowest_height_mm || 0)) {
    throw new Error(`Height of the focus: ${values.height} mm is below ${body.lowest_height_mm} mm, the `
      + `lowest for ${body.title}. Raise it.`);
  }
  if (!body.extent_mm) return;
  const reach = pathExtent(path);
  for (const axis of [0, 1]) {
    const half = body.extent_mm[axis], name = "xy"[axis];
    if (1e3 * reach[axis] > half * (1 + 1e-9)) {
      throw new Error(`The path reaches ${Number((1e3 * reach[axis]).toPrecision(3))} mm along ${name}, off `
        + `the body, which ends at ${half} mm. Shrink it.`);
    }
    if (Math.abs(values[name]) > half) {
      throw new Error(`Point ${name} = ${values[name]} mm is off the body, which ends at ${half} mm.`);
    }
  }
}
