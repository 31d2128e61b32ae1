// Evaluation of an answer: thresholds, levels, maps, reach, share, delay, and names of lines.

import { fourier, indexNear, largestOf } from "./numeric.js";
import { strongLines } from "./surface3d.js";
import { drawingFrequency, jumps, loadLines, meanFactor, pathSamples, positionOf,
  rhythmPeriod } from "./load.js";

const TAU = 2 * Math.PI;
const PACINIAN = -13, NON_PACINIAN = 12; // dB re 1 um peak: at 250 Hz for a focal spot; at any frequency
const LOWEST = 10, HIGHEST = 1000; // Hz: range of the thresholds
const PRESSURE = 2.2, PRESSURE_AT = 200; // threshold of a component in Pa, and its frequency in Hz
const SIDE = 45; // places along a side of a map
export const HALF = 0.044; // m: half the width of a map
const EXAMINED = 0.06, STEP = 2e-4; // s of motion in which the largest is looked for, and the time step
const LEVELS = 4096; // instants of a rhythm that are averaged
const OUTSIDE = 0.1; // of the largest RMS: edge of the kernel's region
const PATH_PLACES = 12; // on which the delay is looked for
const WITH_PHASE = 0.1; // of its largest on the path: a weaker line has no reliable phase
const SYMBOLS = ["f_d", "f_AM", "f_AM2", "f_e"];
const REPETITIONS = 1.5; // periods in the Tacton that a path needs to make lines
const NEGLIGIBLE_LINE = 1e-3; // of the strongest in a table
const NEGLIGIBLE_PRODUCT = 1e-5; // of the strongest product of sinusoids: weaker ones give a line no name
const FINER = 16; // steps between neighbours of the highest level, among which a higher one is looked for

/** Quantities at the point: `rate` is the order of the derivative; 1 in SI units is `per` in `unit`. */
export const QUANTITIES = {
  displacement: { unit: "µm", per: 1e6, rate: 0 },
  velocity: { unit: "mm/s", per: 1e3, rate: 1 },
  acceleration: { unit: "m/s²", per: 1, rate: 2 },
};

/** Detection threshold in metre, peak displacement, at a frequency in Hz; NaN if unknown. */
export function thresholdAt(frequency) {
  if (!(frequency >= LOWEST && frequency <= HIGHEST)) return NaN;
  const octaves = Math.log2(frequency / 250), slope = octaves < 0 ? -12 : 9;
  return 1e-6 * 10 ** (Math.min(PACINIAN + slope * octaves, NON_PACINIAN) / 20);
}

/** Detection threshold in Pa of a component of the pressure at a frequency in Hz; NaN if unknown. */
export const pressureThresholdAt = (frequency) => (
  PRESSURE * thresholdAt(frequency) / thresholdAt(PRESSURE_AT));

/** Level in dB of a peak amplitude in metre or Pa above its threshold; -Infinity without a threshold. */
function sensationLevel(amplitude, frequency, unit = "m") {
  const least = unit === "m" ? thresholdAt(frequency) : pressureThresholdAt(frequency);
  return amplitude > 0 && least > 0 ? 20 * Math.log10(amplitude / least) : -Infinity;
}

/** Amplitude of lines averaged over the rhythm, relative to that during a pulse. */
export const meanLevel = (load) => (load.pulses ? meanFactor(load, 0, rhythmPeriod(load), LEVELS) : 1);

/** Amplitudes (l,) of complex lines at a place, of the `rate`-th time derivative. */
export function amplitudesOf(f, { re, im }, rate = 0) {
  return Float64Array.from(f, (at, l) => (TAU * at) ** rate * Math.hypot(re[l], im[l]));
}

/**
 * Highest level of the lines at a place while a pulse is on: {dB, f}; null if nothing moves there.
 * `unit` is "m" or "Pa".
 */
export function levelOf(f, at, unit = "m") {
  let best = null;
  amplitudesOf(f, at).forEach((amplitude, l) => {
    const dB = sensationLevel(amplitude, f[l], unit);
    if (dB > (best ? best.dB : -Infinity)) best = { dB, f: f[l] };
  });
  return best;
}

/** Coordinates (n,) in metre of the places of a map along either axis. */
export const MAP_LINE = Float64Array.from({ length: SIDE }, (_, k) => HALF * (2 * k / (SIDE - 1) - 1));

/**
 * Map of a motion {rms, level, f, re, im} while a pulse is on, by row y and column x; NaN off the body. `rms`
 * is about the mean; `level` in dB is that of the highest line; re, im (l * n) are the lines f, of which
 * `strongLines` gives those that are drawn. `strongest` is the place [x, y] in metre of the largest `rms`.
 */
export function mapOf(motion) {
  const { re, im } = motion.onGrid(MAP_LINE, MAP_LINE), places = SIDE * SIDE;
  const rms = new Float32Array(places), level = new Float32Array(places), unit = motion.unit || "m";
  motion.f.forEach((f, l) => {
    const least = unit === "m" ? thresholdAt(f) : pressureThresholdAt(f), known = least > 0;
    for (let p = 0, k = l * places; p < places; p++, k++) {
      const square = re[k] * re[k] + im[k] * im[k];
      rms[p] += square / 2;
      if (known) level[p] = Math.max(level[p], square / (least * least));
    }
  });
  for (let p = 0; p < places; p++) {
    level[p] = Number.isNaN(rms[p]) ? NaN : 10 * Math.log10(Math.max(level[p], 1e-20));
    rms[p] = Math.sqrt(rms[p]);
  }
  const top = Math.max(0, rms.indexOf(largestOf(rms))), { f } = motion;
  return { rms, level, f, re, im, ...strongLines({ f, re, im }),
    strongest: [MAP_LINE[top % SIDE], MAP_LINE[Math.floor(top / SIDE)]] };
}

/** Largest value of the `rate`-th derivative of a motion at a place within the first `EXAMINED` s. */
export function peakAt(motion, [x, y], rate = 0) {
  const times = Float64Array.from({ length: EXAMINED / STEP }, (_, k) => k * STEP);
  return largestOf(derivative(motion.waveform(x, y, times), STEP, rate));
}

/** Derivative (t,) of an order of values (t,) at steps of dt in s. */
export function derivative(values, dt, order) {
  if (!order) return values;
  const last = values.length - 1, lower = derivative(values, dt, order - 1);
  return lower.map((_, k) => {
    const [before, after] = [Math.max(k - 1, 0), Math.min(k + 1, last)];
    return (lower[after] - lower[before]) / (dt * (after - before));
  });
}

/** Share 0 to 1 of squared motion where the kernel is 20 dB below its largest; NaN if nothing moves. */
export function shareOutside(kernelRms, rms) {
  const edge = OUTSIDE * largestOf(kernelRms);
  let outside = 0, all = 0;
  rms.forEach((value, p) => {
    if (Number.isNaN(value)) return;
    all += value * value;
    if (kernelRms[p] < edge) outside += value * value;
  });
  return outside / all;
}

/** Function of x, y in metre that gives the distance in metre from the samples of a path. */
function distanceFromPath(load) {
  const { x: xs, y: ys } = pathSamples(load);
  return (x, y) => Math.sqrt(xs.reduce(
    (least, own, q) => Math.min(least, (x - own) ** 2 + (y - ys[q]) ** 2), Infinity));
}

/**
 * Largest distance from the path at which a map is above the detection threshold, interpolated between
 * places: {metre, beyond}; null if it is nowhere above. `beyond` is true if it is above at the map's edge.
 */
export function reach(load, { level }) {
  const distance = distanceFromPath(load), isIn = (p) => level[p] >= 0, at = (k) => MAP_LINE[k];
  let metre = -1, beyond = false;
  for (let p = 0; p < SIDE * SIDE; p++) {
    if (!isIn(p)) continue;
    const row = Math.floor(p / SIDE), column = p % SIDE, x = at(column), y = at(row);
    metre = Math.max(metre, distance(x, y));
    for (const [i, j] of [[column - 1, row], [column + 1, row], [column, row - 1], [column, row + 1]]) {
      if (Math.min(i, j) < 0 || Math.max(i, j) === SIDE) {
        beyond = true;
        continue;
      }
      const other = j * SIDE + i, part = level[p] / (level[p] - level[other]);
      if (Number.isNaN(level[other]) || isIn(other)) continue;
      metre = Math.max(metre, distance(x + part * (at(i) - x), y + part * (at(j) - y)));
    }
  }
  return metre < 0 ? null : { metre, beyond };
}

/** Delay in s of a complex b behind a at a frequency in Hz, from -1/4 to 3/4 of a period. */
export function phaseDelay(a, b, f) {
  const turns = (Math.atan2(a.im, a.re) - Math.atan2(b.im, b.re)) / TAU;
  return (turns - Math.floor(turns + 0.25)) / f;
}

/** Complex lines {re, im} of a motion at each of several places. */
function linesAt(motion, places) {
  if (!motion.places) return places.map(([x, y]) => motion.at(x, y));
  const { re, im } = motion.places(...[0, 1].map((axis) => Float64Array.from(places, (at) => at[axis])));
  const own = (values, p) => Float64Array.from(motion.f, (_, l) => values[l * places.length + p]);
  return places.map((_, p) => ({ re: own(re, p), im: own(im, p) }));
}

/**
 * Delay of the strongest line of a motion behind the kernel's pressure, at the place of the path where that
 * line of the pressure is largest: {delay in s, f in Hz}; null if kernel and motion share no such line.
 */
export function delayOf(kernel, motion, load) {
  const position = positionOf(load.path), moves = drawingFrequency(load.path) > 0;
  const evenly = Array.from({ length: PATH_PLACES }, (_, k) => k / PATH_PLACES);
  const places = (moves ? evenly : load.foci.map((ahead) => ahead % 1)).map((phase) => position(phase));
  const [a, b] = [kernel, motion].map((each) => linesAt(each, places));
  const size = (each, l) => each.map(({ re, im }) => Math.hypot(re[l], im[l]));
  let line = -1, strongest = 0;
  motion.f.forEach((_, l) => {
    const most = largestOf(size(b, l));
    if (most > strongest) [line, strongest] = [l, most];
  });
  if (line < 0) return null;
  const f = motion.f[line], own = indexNear(kernel.f, f);
  if (own < 0) return null;
  const pressure = size(a, own), moved = size(b, line);
  const hasPhase = (sizes, k) => sizes[k] > 0 && sizes[k] >= WITH_PHASE * largestOf(sizes);
  const clear = pressure.map((size, k) => (hasPhase(pressure, k) && hasPhase(moved, k) ? size : -1));
  const most = Math.max(...clear), best = clear.indexOf(most);
  if (most < 0) return null;
  const at = ({ re, im }, l) => ({ re: re[l], im: im[l] });
  return { delay: phaseDelay(at(a[best], own), at(b[best], line), f), f };
}

/** Frequencies in Hz of SYMBOLS; 0 for those that the Tacton does not repeat. */
function symbolsOf({ path, duration, am, am2, envelope, w1 }) {
  const isJoined = path.shape === "joined", fd = isJoined ? path.drawn : drawingFrequency(path);
  const least = isJoined ? REPETITIONS : jumps(path) ? 1 - 1e-9 : 0;
  return [fd * duration >= least ? fd : 0, w1 > 0 ? am : 0, w1 < 1 ? am2 : 0, envelope];
}

/** Name of a line from its orders of SYMBOLS, such as "2f_d-f_AM". */
function nameOf(orders, symbols) {
  const sum = orders.reduce((total, n, k) => total + n * symbols[k], 0);
  const sign = orders[0] > 0 || (orders[0] === 0 && sum > 0) ? 1 : -1;
  let terms = orders.map((n, k) => [sign * n, SYMBOLS[k]]).filter(([n]) => n);
  if (!orders[0]) terms = [...terms.filter(([n]) => n > 0), ...terms.filter(([n]) => n < 0)];
  const times = (n) => (Math.abs(n) > 1 ? Math.abs(n) : "");
  return terms.map(([n, symbol]) => `${n < 0 ? "-" : "+"}${times(n)}${symbol}`).join("").replace(/^\+/, "");
}

/** Function of the frequency in Hz that gives the name of a line of the load; "" if it is unknown. */
export function namesOf(load) {
  const symbols = symbolsOf(load), paths = load.path.paths?.length ?? 1;
  const { f, parts } = loadLines(load, { threshold: 1e-4, most: 1000 });
  const least = NEGLIGIBLE_PRODUCT * Math.max(...parts.flat().map(({ strength }) => strength));
  const isNamed = ({ n, strength }) => strength > least && (symbols[0] ? n % paths === 0 : n === 0);
  const effortOf = (orders) => orders.reduce((sum, n) => sum + Math.abs(n) + (n ? 0.01 : 0),
    orders[0] ? 0.1 : 0);
  const names = parts.map((own) => {
    const known = own.filter(isNamed).map(({ n, orders, strength }) => (
      { orders: [n / paths, ...orders], effort: effortOf([n / paths, ...orders]), strength }));
    const isEven = (a, b) => Math.abs(a.effort - b.effort) < 1e-9;
    known.sort((a, b) => (isEven(a, b) ? b.strength - a.strength : a.effort - b.effort));
    return known.length ? nameOf(known[0].orders, symbols) : "";
  });
  return (at) => names[indexNear(f, at)] ?? "";
}

/**
 * Table of the lines of an answer at the point, the strongest first: [{name, f, motion, pressure, level}],
 * with `motion` in SI units of the quantity and the kernel's `pressure` in Pa, averaged over the rhythm, and
 * `level` in dB while a pulse is on, or null if the body is not skin.
 */
export function lineTable({ load, values, body, waves, wavesAt, kernel, kernelAt, names = namesOf(load) }) {
  const { rate } = QUANTITIES[values.quantity], mean = meanLevel(load);
  const [moved, motion] = [0, rate].map((order) => amplitudesOf(waves.f, wavesAt, order));
  const pressure = amplitudesOf(kernel.f, kernelAt), least = NEGLIGIBLE_LINE * largestOf(motion);
  return Array.from(waves.f, (f, l) => {
    const own = indexNear(kernel.f, f);
    return { name: names(f), f, motion: mean * motion[l], pressure: own < 0 ? 0 : mean * pressure[own],
      level: body.is_skin ? sensationLevel(moved[l], f) : null };
  }).filter((_, l) => motion[l] > least).sort((a, b) => b.motion - a.motion);
}

/**
 * Amplitude spectrum {f in Hz, amplitudes} of values at steps of dt in s under a Hann window, as
 * simple_model.spectrum computes it: a sinusoid on a bin has its own amplitude.
 */
export function spectrum(values, dt) {
  const n = values.length, count = Math.floor(n / 2) + 1;
  const window = Float64Array.from({ length: n }, (_, k) => (n < 2 ? 1 : (1 - Math.cos(TAU * k / n)) / 2));
  const { re, im } = fourier(window.map((w, k) => w * values[k])), weights = window.reduce((a, b) => a + b);
  const f = Float64Array.from({ length: count }, (_, k) => k / (n * dt));
  return { f, amplitudes: f.map((_, k) => (k ? 2 : 1) * Math.hypot(re[k], im[k]) / weights) };
}

/**
 * Levels over a value of the controls. Yields {x, kernel, waves, best} after each of `count` + 1 values, and
 * at the end with `best`, {at, level}: the highest level of the curve `lead`, refined between the values.
 * `levelsAt(value)` returns {kernel, waves} in dB; if it throws, the value is skipped.
 */
export function* levelOver(levelsAt, [low, high], { lead = "waves", count = 48 } = {}) {
  const curves = { x: [], kernel: [], waves: [], best: null };
  let best = { level: -Infinity }, [a, b] = [low, high];
  for (const parts of [count, FINER, FINER]) {
    for (let k = 0; k <= parts; k++) {
      const at = a + (b - a) * k / parts;
      let levels;
      try { levels = levelsAt(at); } catch { continue; } // such as a path that leaves the body
      if (levels[lead] > best.level) best = { at, level: levels[lead] };
      if (b - a < high - low) continue;
      curves.x.push(at);
      curves.kernel.push(levels.kernel);
      curves.waves.push(levels.waves);
      yield curves;
    }
    if (best.level === -Infinity) return;
    [a, b] = [Math.max(best.at - (b - a) / parts, low), Math.min(best.at + (b - a) / parts, high)];
  }
  yield { ...curves, best };
}
