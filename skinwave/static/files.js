// Files: scenes, waveforms and lines as tables, sound, patterns for devices, and measurements to read.

import { DRIVES, drawingFrequency, gainAt, joinedCorners, levelFactor, outline, pathLength, positionOf,
  rhythmLevel } from "./load.js";
import { QUANTITIES, lineTable } from "./numbers.js";
import { largestOf } from "./numeric.js";
import { loadOf, pulsesOf } from "./values.js";

const NAME = "skinwave live";
const RATE = 10000; // Hz of waveforms
const FULL_SCALE = 32767;
const ENGINE_RATE = 20000; // Hz, of samples in AdapTics
const STRAIGHT = [2e-5, 2e-5]; // m, within which straight lines stand for samples
const MOST_KEYFRAMES = 20000;
const ASIDE = 1e-9; // of a period: just before and after a corner, so that jumps stay jumps
const TICK = 40000; // Hz of AUTD3
const MOST_PATTERNS = 8192, MOST_SAMPLES = 32768, MOST_DIVISION = 65535, MODULATION = 10;
const ADAPTICS = ["MidAirHapticsAnimationFileFormat", "0.1.0-alpha.3"];

const float = (value) => (Number.isInteger(value) ? `${value}.0` : `${value}`); // TOML and Python
const pairs = (points) => `[${points.map(([x, y]) => `[${float(x)}, ${float(y)}]`).join(", ")}]`;
const cell = (value) => (/[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : `${value}`);
const csv = (header, rows) => [header, ...rows].map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
const digits = (value) => `${Number(value.toPrecision(9))}`;

/** Scene file of the controls' values and a body's record, which skinwave reads. */
export function sceneToml(values, record) {
  const { path, foci } = loadOf(values), lines = {
    amplitude_percent: float(values.amplitude), am_frequency_hz: float(values.am),
    second_am_frequency_hz: float(values.am2),
    superposition: `[${values.ratio.split(":").map((w) => float(Number(w))).join(", ")}]`,
    envelope_frequency_hz: float(values.envelope), duration_s: float(values.duration),
    shape: `"${path.shape === "joined" ? "recorded" : path.shape}"`,
  };
  if (path.shape === "joined") {
    const { points, times } = joinedCorners(path);
    lines.points_mm = pairs(points.map(([x, y]) => [1e3 * x, 1e3 * y]));
    lines.times_s = `[${times.map(float).join(", ")}]`;
  } else if (path.shape !== "point") {
    if (path.shape === "polyline") {
      const corners = values.polyline.split(",").filter((part) => part.trim());
      lines.points_mm = pairs(corners.map((part) => part.split("/").map(Number)));
    } else lines.size_mm = float(values.size);
    lines.speed_m_per_s = float(values.speed);
    lines.sweep = `"${values.sweep}"`;
  }
  lines.foci = `[${foci.map(float).join(", ")}]`;
  lines.sharing = `"${values.sharing}"`;
  const table = (own) => Object.entries(own).map(([key, value]) => `${key} = ${value}`).join("\n");
  const pulses = pulsesOf(values.pulses).map((pulse) => pulse.map((s) => Number((1e3 * s).toPrecision(12))));
  const rhythm = { pulses_ms: pairs(pulses), ramp_ms: float(values.ramp) };
  const focus = {
    height_mm: float(values.height), drive: `"${values.drive}"`, profile: `"${values.profile}"`,
    depth_of_modulation: float(values.modulation / 100), peak_pressure_pa: float(values.peak),
  };
  const probes = { points_mm: pairs([[values.x, values.y]]), quantity: `"${values.quantity}"` };
  return [`name = "${NAME}"`, `[tacton]\n${table(lines)}`,
    ...(pulses.length ? [`[tacton.rhythm]\n${table(rhythm)}`] : []),
    `[focus]\n${table(focus)}`, record.toml.trim(), `[probes]\n${table(probes)}`].join("\n\n") + "\n";
}

const timesOf = ({ duration }) => Float64Array.from({ length: Math.max(2, Math.round(duration * RATE)) },
  (_, k) => k / RATE);

/** CSV of the waveforms at the point: time in s, displacement in metre, pressure of the kernel in Pa. */
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

/** Samples about their mean, the largest of size 1. */
export function asSound(samples) {
  const mean = samples.reduce((sum, value) => sum + value, 0) / samples.length;
  const about = samples.map((value) => value - mean), largest = largestOf(about) || 1;
  return about.map((value) => value / largest);
}

/** WAV (16 bit, mono) of samples about their mean, as loud as the format holds. */
function wav(samples, rate) {
  const bytes = new DataView(new ArrayBuffer(44 + 2 * samples.length));
  const text = (at, word) => [...word].forEach((letter, k) => bytes.setUint8(at + k, letter.charCodeAt(0)));
  text(0, "RIFF"); text(8, "WAVEfmt "); text(36, "data");
  bytes.setUint32(4, bytes.byteLength - 8, true);
  const words = [16, 1 + (1 << 16), rate, 2 * rate, 2 + (16 << 16)];
  words.forEach((word, k) => bytes.setUint32(16 + 4 * k, word, true));
  bytes.setUint32(40, 2 * samples.length, true);
  asSound(samples).forEach((value, k) => bytes.setInt16(44 + 2 * k, Math.round(value * FULL_SCALE), true));
  return new Uint8Array(bytes.buffer);
}

/** WAV of the displacement at the point. */
export const waveformWav = ({ load, waves, x, y }) => wav(waves.waveform(x, y, timesOf(load)), RATE);

/** Sound pressure 0..1 of a focus over that at full drive at a time in s; throws if it is negative. */
function loudness(load, t) {
  const alone = { ...load, amplitude: 1, am: 0, am2: 0, envelope: 0 };
  const full = gainAt(alone, 0), driven = gainAt(load, t) * levelFactor(load, rhythmLevel(load, t));
  const relative = full ? driven / full : 0;
  if (relative < -1e-12) {
    throw new Error(`The drive law "${load.drive}" gives negative pressure half of the time, which no device `
      + "exerts. Choose pressure_squared or force_corrected.");
  }
  return Math.sqrt(Math.min(Math.max(relative, 0), 1));
}

/** Fractions of the period, from 0 to 1, between which a path is smooth. */
function cornerPhases(path) {
  if (path.shape === "joined") return joinedCorners(path).times.map((t) => t * drawingFrequency(path));
  if (["point", "circle"].includes(path.shape)) return [0, 1];
  const { corners, runsOn } = outline(path), eased = path.sweep === "sinusoidal" && !runsOn;
  const along = corners.map((_, k) => (k ? pathLength({ shape: "polyline", points: corners.slice(0, k + 1),
    sweep: "one_way" }) : 0));
  const bounds = along.map((s) => s / along[along.length - 1]);
  if (runsOn) return bounds;
  const way = eased ? bounds.map((b) => Math.acos(1 - 2 * b) / Math.PI) : bounds;
  return [...way, ...way.map((b) => 2 - b).reverse()].map((b) => b / 2);
}

/** Indices of the samples that straight lines join within STRAIGHT of all places [[x, y]] at times. */
function thinned(times, places) {
  const off = (a, b, k) => {
    const part = times[b] > times[a] ? (times[k] - times[a]) / (times[b] - times[a]) : 0;
    return Math.max(...STRAIGHT.map((within, axis) => Math.abs(places[k][axis] - places[a][axis]
      - part * (places[b][axis] - places[a][axis])) / within));
  };
  let kept = times.map((_, k) => k);
  for (let before = 0; before !== kept.length;) {
    before = kept.length;
    const fewer = kept.filter((_, k) => k % 2 === 0 && k < kept.length - 1).concat(kept[kept.length - 1]);
    const next = new Set(fewer), own = new Set(kept);
    for (let j = 1; j < fewer.length; j++) {
      let worst = 0, between = -1;
      for (let k = fewer[j - 1]; k < fewer[j]; k++) {
        worst = Math.max(worst, off(fewer[j - 1], fewer[j], k));
        if (k > fewer[j - 1] && own.has(k)) between = k;
      }
      if (worst > 1 && between >= 0) next.add(between);
    }
    kept = [...next].sort((a, b) => a - b);
  }
  return kept;
}

/** AdapTics pattern of a load as JSON; throws an Error with what the format cannot express. */
export function adaptics(load) {
  const { path, foci, duration } = load, fd = drawingFrequency(path), refuse = (what) => {
    throw new Error(`An .adaptics file cannot express ${what}. Save the pyautd3 script, or leave it out.`);
  };
  if (foci.length > 1) refuse("several foci");
  if (load.w1 < 1 && load.am2 > 0) refuse("a second AM frequency");
  if (load.w1 < 1 && load.am > 0) refuse("a part of the AM alone");
  if (load.envelope > 0) refuse("an envelope frequency");
  if (load.pulses) refuse("a rhythm");
  const am = load.w1 > 0 ? load.am : 0;
  const isFull = (m) => Math.abs(DRIVES[load.drive](1, m, load.depth) - ((1 + m) / 2) ** 2) < 1e-9;
  if (am && ![-1, 0, 0.5].every(isFull)) {
    throw new Error("AdapTics modulates the sound pressure fully. Choose the drive law pressure_squared and "
      + "100 % depth of modulation.");
  }
  const value = am ? load.amplitude : loudness(load, 0);
  const f64 = (number) => ({ type: "f64", value: number });
  const brush = (name, numbers, turns) => {
    const params = Object.entries({ ...numbers, am_freq: am, stm_freq: turns });
    return { name, params: Object.fromEntries(params.map(([key, number]) => [key, f64(number)])) };
  };
  const position = positionOf(path);
  const keyframe = (t, [x, y], own) => {
    const transition = { name: "linear", params: {} };
    return { type: "standard", time: 1e3 * t, brush: { brush: own, transition },
      intensity: { intensity: { name: "constant", params: { value: f64(value) } }, transition },
      coords: { coords: { x: 1e3 * x, y: 1e3 * y, z: 0 }, transition }, cjumps: [] };
  };
  let own = null, place = null;
  const begins = foci[0] % 1 === 0;
  if (path.shape === "circle" && begins && fd) {
    [own, place] = [brush("circle", { radius: 500 * path.size }, fd), [0, 0]];
  } else if (!fd) [own, place] = [brush("circle", { radius: 0 }, 100), position(foci[0] % 1)];
  else if (path.sweep === "sinusoidal" && begins && (path.shape === "line" || path.points?.length === 2)) {
    const [[ax, ay], [bx, by]] = [position(0), position(0.5)];
    place = [(ax + bx) / 2, (ay + by) / 2];
    const [dx, dy] = [(ax - bx) / 2, (ay - by) / 2];
    own = brush("line", { length: 1e3 * Math.hypot(dx, dy), thickness: 1,
      rotation: Math.atan2(dy, dx) * 180 / Math.PI }, fd);
  }
  const keyframes = own ? [0, duration].map((t) => keyframe(t, place, own)) : [];
  if (!own) {
    const still = brush("circle", { radius: 0 }, 0), times = [];
    for (let k = 0; k <= Math.round(duration * ENGINE_RATE); k++) times.push(k / ENGINE_RATE);
    const corners = cornerPhases(path);
    for (let turn = -1; turn < Math.floor(duration * fd) + 2; turn++) {
      for (const corner of corners) {
        for (const aside of [-ASIDE, ASIDE]) times.push((turn + corner - foci[0] + aside) / fd);
      }
    }
    const all = [...new Set(times)].filter((t) => t >= 0 && t <= duration).sort((a, b) => a - b);
    const places = all.map((t) => position((((fd * t + foci[0]) % 1) + 1) % 1));
    const kept = thinned(all, places);
    if (kept.length > MOST_KEYFRAMES) {
      throw new Error(`The path takes ${kept.length} keyframes in ${duration} s; the limit is `
        + `${MOST_KEYFRAMES}. Shorten the Tacton.`);
    }
    keyframes.push(...kept.map((k) => keyframe(all[k], places[k], still)));
  }
  const one = f64(1), zero = f64(0);
  return JSON.stringify({
    $DATA_FORMAT: ADAPTICS[0], $REVISION: ADAPTICS[1], name: NAME,
    keyframes: [...keyframes, { type: "stop", time: 1e3 * duration }],
    pattern_transform: {
      geometric_transforms: { translate: { x: zero, y: zero, z: f64(1e3 * load.height) }, rotation: zero,
        scale: { x: one, y: one, z: one } },
      intensity_factor: one, playback_speed: one,
    },
    user_parameter_definitions: {},
  }, null, 1);
}

/** Points to a period, a multiple, and ticks to a point that come nearest to a frequency in Hz. */
function stepsOf(frequency, multiple) {
  if (frequency === 0) return [2 * multiple, 1];
  const ticks = TICK / frequency, most = Math.floor(MOST_PATTERNS / multiple) * multiple;
  const division = Math.max(1, Math.ceil(ticks / most - 1e-9));
  if (division > MOST_DIVISION) {
    throw new Error(`The path is drawn ${frequency} times a second, too slow for a device. Raise the speed.`);
  }
  return [Math.min(Math.max(multiple, Math.round(ticks / division / multiple) * multiple), most), division];
}

/** Python script that plays a load on AUTD3 devices by FociSTM; throws an Error if no sound makes it. */
export function pyautd3(load, sharing) {
  const { path, foci, duration } = load, fd = drawingFrequency(path), n = foci.length;
  const position = positionOf(path), turns = sharing === "time_multiplexed";
  const [count, division] = stepsOf(fd, turns ? n : 1);
  const places = Array.from({ length: count }, (_, k) => (turns ? [foci[k % n]] : foci).map((ahead) => (
    position(((fd > 0 ? k / count : 0) + ahead) % 1).map((metre) => (1e3 * metre).toFixed(3)))));
  const ticks = Math.max(MODULATION, Math.ceil(duration * TICK / MOST_SAMPLES));
  const loud = Array.from({ length: Math.max(2, Math.floor(duration * TICK / ticks)) },
    (_, k) => loudness(load, k * ticks / TICK));
  const steady = Math.max(...loud) - Math.min(...loud) < 1e-12;
  const samples = (steady ? [loud[0], loud[0]] : loud).map((value) => Math.round(255 * value));
  const notes = [`${count} patterns of ${places[0].length} foci, one each ${division} ticks of 40 kHz`,
    `draws ${digits(fd ? TICK / division / count : 0)} Hz where ${digits(fd)} Hz was asked for`,
    "positions rounded to 0.025 mm by the device",
    ...(n > 1 ? [`${n} foci ${turns ? "in turn" : "at the same time"}`] : []),
    ...(steady ? [] : [`modulation: ${samples.length} samples at ${digits(TICK / ticks)} Hz in 255 steps`])];
  return `"""${NAME}: ${duration} s on AUTD3 devices, by pyautd3 38."""
${notes.map((note) => `# ${note}.`).join("\n")}
# Open the link of your own devices in place of Nop.

import time

import numpy as np
from pyautd3 import AUTD3, ControlPoint, ControlPoints, Controller, FociSTM, Null
from pyautd3 import SamplingConfig, Silencer
from pyautd3.link.nop import Nop
from pyautd3.modulation import Custom

HEIGHT = ${float(1e3 * load.height)}  # mm above the array
PLACES = [  # mm from the centre: patterns, foci, (x, y)
${places.map((pattern) => `    [${pattern.map(([x, y]) => `[${x}, ${y}]`).join(", ")}]`).join(",\n")},
]
MODULATION = [${samples.join(", ")}]  # of 255, full drive

with Controller.open([AUTD3(pos=[0.0, 0.0, 0.0], rot=[1, 0, 0, 0])], Nop()) as autd:
    centre = autd.center()
    foci = [
        ControlPoints([ControlPoint(centre + np.array([x, y, HEIGHT])) for x, y in pattern])
        for pattern in PLACES
    ]
    autd.send(Silencer.disable())
    modulation = Custom(np.array(MODULATION, dtype=np.uint8), SamplingConfig(${ticks}))
    autd.send((modulation, FociSTM(foci, SamplingConfig(${division}))))
    time.sleep(${float(duration)})
    autd.send(Null())
`;
}

/** Files that the page saves: [[heading, [[title, name, type, (answer) => text or bytes]]]]. */
export const WRITERS = [
  ["Data", [
    ["Waveforms, CSV", "waveforms.csv", "text/csv", waveformCsv],
    ["Lines, CSV", "lines.csv", "text/csv", linesCsv],
    ["Displacement, WAV", "displacement.wav", "audio/wav", waveformWav],
  ]],
  ["Tacton", [
    ["Scene, TOML", "scene.toml", "application/toml", ({ values, body }) => sceneToml(values, body)],
    ["AdapTics", "tacton.adaptics", "application/json", ({ load }) => adaptics(load)],
    ["pyautd3 script", "tacton.py", "text/x-python", ({ load, values }) => pyautd3(load, values.sharing)],
  ]],
];

const LENGTHS = { m: 1, cm: 1e2, mm: 1e3, um: 1e6, nm: 1e9 }; // in one metre
const TIMES = { s: 1, ms: 1e3, us: 1e6 }, FREQUENCIES = { Hz: 1, kHz: 1e-3 };
const MOTIONS = {
  displacement: LENGTHS,
  velocity: Object.fromEntries(Object.entries(LENGTHS).map(([unit, per]) => [`${unit}/s`, per])),
  acceleration: { ...Object.fromEntries(Object.entries(LENGTHS).map(([unit, per]) => [`${unit}/s2`, per])),
    g: 1 / 9.80665 },
};
const OTHERS = "skinwave web and skinwave compare read other formats.";
const UNEVEN = 0.25; // of a sampling interval, from where times are not equally spaced

/** Cells of a line of text; a delimiter in quotes or brackets does not count. */
function cellsOf(line, delimiter) {
  const found = [""];
  let quoted = false, depth = 0;
  for (const letter of line) {
    depth += (letter === "(") - (letter === ")");
    if (letter === '"') quoted = !quoted;
    else if (letter === delimiter && !quoted && depth <= 0) found.push("");
    else found[found.length - 1] += letter;
  }
  return found.map((text) => text.trim());
}

/** Unit of a column's title: in brackets, or behind the last comma. */
function unitIn(title) {
  const plain = title.replaceAll("µ", "u").replaceAll("μ", "u").replaceAll("²", "2").replaceAll("^", "");
  const words = [...plain.matchAll(/[([]([^()[\]]*)[)\]]/g)].map(([, word]) => word.trim());
  const last = plain.split(",").pop().replace(/\(.*\)/, "").trim();
  const known = [TIMES, FREQUENCIES, ...Object.values(MOTIONS)];
  return [...words.reverse(), last].find((word) => known.some((units) => Object.hasOwn(units, word))) || "";
}

/** Place [x, y] in metre in a column's title such as "displacement(0,10) [m]", in mm; null if none. */
function placeIn(title) {
  const found = title.match(/\(\s*(-?[\d.]+)\s*[,;]\s*(-?[\d.]+)\s*\)/);
  return found ? [Number(found[1]) / 1e3, Number(found[2]) / 1e3] : null;
}

/**
 * Measurement in a text of columns with units in the header, over time or frequency: {name, quantity,
 * places, remarks} with {times, values} or {frequencies, amplitudes} by place, in SI units. Throws an
 * Error for users if it is of another form.
 */
export function readMeasurement(text, name) {
  const rows = text.replace(/^\ufeff/, "").split(/\r?\n/);
  const lines = rows.filter((line) => line.trim() && !/^[#%]/.test(line));
  const delimiter = ["\t", ";", ","].find((mark) => cellsOf(lines[1] || "", mark).length > 1) || ",";
  const number = (word) => (word === "" ? NaN : Number(delimiter === "," ? word : word.replace(",", ".")));
  const titles = cellsOf(lines[0] || "", delimiter), refuse = (what) => {
    throw new Error(`${name}: ${what} ${OTHERS}`);
  };
  if (titles.length < 2 || titles.every((title) => Number.isFinite(number(title)))) {
    refuse("the first line has no titles of columns. Write one such as: time [s], displacement [µm].");
  }
  const units = titles.map(unitIn), over = units[0];
  const isTime = Object.hasOwn(TIMES, over);
  if (!isTime && !Object.hasOwn(FREQUENCIES, over)) {
    refuse(`the first column, "${titles[0]}", has no unit of time or frequency. Name it time [s] or `
      + "frequency [Hz].");
  }
  const kindOf = (unit) => Object.keys(MOTIONS).find((kind) => Object.hasOwn(MOTIONS[kind], unit));
  const first = units.findIndex((unit, k) => k > 0 && kindOf(unit));
  if (first < 0) refuse(`"${titles[1]}" has no unit of motion. Write it as in velocity [mm/s].`);
  if (!isTime && titles.some((title) => /(^|\W)(re|im|real|imag|imaginary|phase)(\W|$)/i.test(title))) {
    refuse("its spectrum has real and imaginary parts or phases. Give amplitudes alone.");
  }
  const quantity = kindOf(units[first]);
  const columns = units.map((unit, k) => k).filter((k) => k > 0 && kindOf(units[k]) === quantity);
  const table = lines.slice(1).map((line, row) => {
    const cells = cellsOf(line, delimiter).map(number);
    if (![0, ...columns].every((k) => Number.isFinite(cells[k]))) {
      refuse(`row ${row + 1} below the titles has a cell that is not a number.`);
    }
    return cells;
  });
  if (table.length < 3) refuse(`it has ${table.length} rows of numbers. Give three or more.`);
  const at = table.map((cells) => cells[0] / { ...TIMES, ...FREQUENCIES }[over]);
  if (at.some((value, k) => k > 0 && value <= at[k - 1])) refuse("the first column does not rise.");
  const step = (at[at.length - 1] - at[0]) / (at.length - 1);
  if (isTime && at.some((value, k) => Math.abs(value - at[0] - k * step) > UNEVEN * step)) {
    refuse("its times are not equally spaced.");
  }
  const values = columns.map((k) => table.map((cells) => cells[k] / MOTIONS[quantity][units[k]]));
  const left = titles.length - 1 - columns.length;
  const remarks = left ? [`${left} of ${titles.length - 1} columns are not shown.`] : [];
  const found = { name, quantity, remarks, places: columns.map((k) => placeIn(titles[k])) };
  if (!isTime) return { ...found, frequencies: at, amplitudes: values.map((own) => own.map(Math.abs)) };
  return { ...found, times: at.map((t) => t - at[0]), values };
}
