// Numbers of an answer: thresholds, levels, maps, reach, share, delay, and names of lines.

import { fourier, largestOf } from "./numeric.js";
import { drawingFrequency, jumps, levelFactor, loadLines, pathSamples, positionOf, rhythmLevel,
  rhythmPeriod } from "./load.js";

const TAU = 2 * Math.PI;
const PACINIAN = -13, NON_PACINIAN = 12; // dB re 1 um peak, at 250 Hz for a focal spot and at any
const LOWEST = 10, HIGHEST = 1000; // Hz, between which the thresholds are known
const PRESSURE = 2.2, TESTED = 200; // Pa of a component, and its frequency in Hz
const SIDE = 45, HALF = 0.044; // places along a side of a map, and half of it in metre
const LEVELS = 4096; // instants of a rhythm
const OUTSIDE = 0.1; // of the largest RMS: edge of the kernel's region
const ON_PATH = 12; // places of the path at which the delay is looked for
const HEARD = 0.1; // of its largest on the path: a weaker line has no phase
const SYMBOLS = ["f_d", "f_AM", "f_AM2", "f_e"];
const REPEATED = 1.5; // periods in the Tacton at least, to make lines
const NEGLIGIBLE_LINE = 1e-3; // of the strongest in a table
const FAINT = 1e-5; // of the strongest product of sinusoids: weaker ones give no line a name
const FINER = 16; // values between two others, among which the highest level is looked for

/** Quantities at the point: `rate` is the order of the derivative, 1 in SI is `per` in `unit`. */
export const QUANTITIES = {
  displacement: { unit: "µm", per: 1e6, rate: 0 },
  velocity: { unit: "mm/s", per: 1e3, rate: 1 },
  acceleration: { unit: "m/s²", per: 1, rate: 2 },
};

/** Detection threshold of displacement in metre, peak, at a frequency in Hz; NaN if not known. */
export function thresholdAt(frequency) {
  if (!(frequency >= LOWEST && frequency <= HIGHEST)) return NaN;
  const octaves = Math.log2(frequency / 250), slope = octaves < 0 ? -12 : 9;
  return 1e-6 * 10 ** (Math.min(PACINIAN + slope * octaves, NON_PACINIAN) / 20);
}

/** Detection threshold in Pa of a component of the pressure at a frequency in Hz; NaN if not known. */
export const pressureThresholdAt = (frequency) => PRESSURE * thresholdAt(frequency) / thresholdAt(TESTED);

/** Level in dB of a peak amplitude in metre or Pa above its threshold; -Infinity if there is none. */
function sensationLevel(amplitude, frequency, unit = "m") {
  const least = unit === "m" ? thresholdAt(frequency) : pressureThresholdAt(frequency);
  return amplitude > 0 && least > 0 ? 20 * Math.log10(amplitude / least) : -Infinity;
}

/** Amplitude of lines with the pauses of the rhythm over that while a pulse is on. */
export function meanLevel(load) {
  if (!load.pulses) return 1;
  const period = rhythmPeriod(load);
  let sum = 0;
  for (let k = 0; k < LEVELS; k++) sum += levelFactor(load, rhythmLevel(load, (k + 0.5) / LEVELS * period));
  return sum / LEVELS;
}

/** Amplitudes (l,) of complex lines at a place, as the `rate`-th derivative in time. */
export function amplitudesOf(f, { re, im }, rate = 0) {
  return Float64Array.from(f, (at, l) => (TAU * at) ** rate * Math.hypot(re[l], im[l]));
}

/**
 * Highest level over lines at a place, with the pauses of the rhythm: {dB, f}; null if nothing moves
 * there. `unit` is "m" or "Pa".
 */
export function levelOf(load, f, at, unit = "m") {
  const mean = meanLevel(load);
  let best = null;
  amplitudesOf(f, at).forEach((amplitude, l) => {
    const dB = sensationLevel(mean * amplitude, f[l], unit);
    if (dB > (best ? best.dB : -Infinity)) best = { dB, f: f[l] };
  });
  return best;
}

/** Coordinates (n,) in metre of every map along either axis. */
export const MAP_LINE = Float64Array.from({ length: SIDE }, (_, k) => HALF * (2 * k / (SIDE - 1) - 1));

/**
 * Map of a motion: {rms, level}, row y, column x. RMS about the mean while a pulse is on; level
 * in dB of the highest line, with the pauses of a rhythm. NaN off the body.
 */
export function mapOf(motion, load) {
  const { re, im } = motion.onGrid(MAP_LINE, MAP_LINE), places = SIDE * SIDE, mean = meanLevel(load);
  const rms = new Float32Array(places), level = new Float32Array(places), unit = motion.unit || "m";
  motion.f.forEach((f, l) => {
    const least = (unit === "m" ? thresholdAt(f) : pressureThresholdAt(f)) / mean, known = least > 0;
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
  return { rms, level };
}

/** Share 0..1 of squared motion where the kernel is 20 dB below its largest; NaN if nothing moves. */
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

/** Distance in metre from the samples of the path of a load, as a function of x and y in metre. */
function distanceFromPath(load) {
  const { x: xs, y: ys } = pathSamples(load);
  return (x, y) => Math.sqrt(xs.reduce((least, own, q) => Math.min(least, (x - own) ** 2 + (y - ys[q]) ** 2),
    Infinity));
}

/**
 * Largest distance from the path at which a map is above the threshold of skin, interpolated between
 * places: {metre, beyond}, with `beyond` if it is at the edge of the map; null if it is nowhere.
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

/** Delay in s of a complex b behind a at a frequency in Hz: a quarter period before to three after. */
export function phaseDelay(a, b, f) {
  const turns = (Math.atan2(a.im, a.re) - Math.atan2(b.im, b.re)) / TAU;
  return (turns - Math.floor(turns + 0.25)) / f;
}

/** Complex lines {re, im} of a motion at each of some places; at all of them at once if it can. */
function linesAt(motion, places) {
  if (!motion.places) return places.map(([x, y]) => motion.at(x, y));
  const { re, im } = motion.places(...[0, 1].map((axis) => Float64Array.from(places, (at) => at[axis])));
  const own = (values, p) => Float64Array.from(motion.f, (_, l) => values[l * places.length + p]);
  return places.map((_, p) => ({ re: own(re, p), im: own(im, p) }));
}

/**
 * Delay of the strongest line of a motion behind the kernel's pressure at the place of the path where
 * the pressure has most of it: {delay in s, f in Hz}; null if they share none.
 */
export function delayOf(kernel, motion, load) {
  const position = positionOf(load.path), moves = drawingFrequency(load.path) > 0;
  const phases = moves ? Array.from({ length: ON_PATH }, (_, k) => k / ON_PATH) : load.foci.map((a) => a % 1);
  const places = phases.map((phase) => position(phase));
  const [a, b] = [kernel, motion].map((each) => linesAt(each, places));
  const size = (each, l) => each.map(({ re, im }) => Math.hypot(re[l], im[l]));
  let line = -1, strongest = 0;
  motion.f.forEach((_, l) => {
    const most = largestOf(size(b, l));
    if (most > strongest) [line, strongest] = [l, most];
  });
  if (line < 0) return null;
  const f = motion.f[line], own = kernel.f.findIndex((at) => Math.abs(at - f) < 1e-6);
  if (own < 0) return null;
  const pressure = size(a, own), moved = size(b, line);
  const heard = (sizes, k) => sizes[k] > 0 && sizes[k] >= HEARD * largestOf(sizes);
  const best = places.reduce((top, _, k) => (heard(pressure, k) && heard(moved, k)
    && (top < 0 || pressure[k] > pressure[top]) ? k : top), -1);
  if (best < 0) return null;
  const at = ({ re, im }, l) => ({ re: re[l], im: im[l] });
  return { delay: phaseDelay(at(a[best], own), at(b[best], line), f), f };
}

/** Frequencies in Hz of SYMBOLS, 0 of those that the Tacton does not repeat. */
function symbolsOf({ path, duration, am, am2, envelope, w1 }) {
  const own = path.shape === "joined", turns = own ? path.drawn : drawingFrequency(path);
  const least = own ? REPEATED : jumps(path) ? 1 - 1e-9 : 0;
  return [turns * duration >= least ? turns : 0, w1 > 0 ? am : 0, w1 < 1 ? am2 : 0, envelope];
}

/** Name of the line of orders of SYMBOLS, such as "2f_d-f_AM". */
function nameOf(orders, symbols) {
  const sum = orders.reduce((total, n, k) => total + n * symbols[k], 0);
  const sign = orders[0] > 0 || (orders[0] === 0 && sum > 0) ? 1 : -1;
  let terms = orders.map((n, k) => [sign * n, SYMBOLS[k]]).filter(([n]) => n);
  if (!orders[0]) terms = [...terms.filter(([n]) => n > 0), ...terms.filter(([n]) => n < 0)];
  const times = (n) => (Math.abs(n) > 1 ? Math.abs(n) : "");
  return terms.map(([n, symbol]) => `${n < 0 ? "-" : "+"}${times(n)}${symbol}`).join("").replace(/^\+/, "");
}

/** Names of a load's lines while a pulse is on, as a function of the frequency in Hz; "" if unknown. */
export function namesOf(load) {
  const symbols = symbolsOf(load), paths = load.path.paths?.length ?? 1;
  const { f, parts } = loadLines(load, { threshold: 1e-4, most: 1000 });
  const least = FAINT * Math.max(...parts.flat().map(({ strength }) => strength));
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
  return (at) => names[f.findIndex((own) => Math.abs(own - at) < 1e-6)] ?? "";
}

/**
 * Table of lines at a point, the strongest first: [{name, f, motion, pressure, level}] of an answer
 * {load, values, body, waves, wavesAt, kernel, kernelAt}: `motion` in SI units of the quantity, `pressure`
 * of the kernel in Pa, `level` in dB, null where the body is not skin.
 */
export function lineTable({ load, values, body, waves, wavesAt, kernel, kernelAt, names = namesOf(load) }) {
  const { rate } = QUANTITIES[values.quantity], mean = meanLevel(load);
  const [moved, motion] = [0, rate].map((order) => amplitudesOf(waves.f, wavesAt, order));
  const pressure = amplitudesOf(kernel.f, kernelAt), least = NEGLIGIBLE_LINE * largestOf(motion);
  return Array.from(waves.f, (f, l) => {
    const own = kernel.f.findIndex((at) => Math.abs(at - f) < 1e-6);
    return { name: names(f), f, motion: mean * motion[l], pressure: own < 0 ? 0 : mean * pressure[own],
      level: body.is_skin ? sensationLevel(mean * moved[l], f) : null };
  }).filter((_, l) => motion[l] > least).sort((a, b) => b.motion - a.motion);
}

/**
 * Amplitude spectrum {f in Hz, amplitudes} of values at equal steps dt in s under a Hann window, as
 * simple_model.spectrum: a sinusoid of amplitude a on a bin shows as a.
 */
export function spectrum(values, dt) {
  const n = values.length, count = Math.floor(n / 2) + 1;
  const window = Float64Array.from({ length: n }, (_, k) => (n < 2 ? 1 : (1 - Math.cos(TAU * k / n)) / 2));
  const { re, im } = fourier(window.map((w, k) => w * values[k])), weights = window.reduce((a, b) => a + b);
  const f = Float64Array.from({ length: count }, (_, k) => k / (n * dt));
  return { f, amplitudes: f.map((_, k) => (k ? 2 : 1) * Math.hypot(re[k], im[k]) / weights) };
}

/**
 * Levels over a value of the controls: yields {x, kernel, waves, best} after each of `count` + 1 values
 * and, last, with the highest of the curve `of` as `best`, {at, level}, between them. `levelsAt(value)`
 * returns {kernel, waves} in dB or throws, which skips a value.
 */
export function* levelOver(levelsAt, [low, high], { of = "waves", count = 48 } = {}) {
  const found = { x: [], kernel: [], waves: [], best: null };
  let best = { level: -Infinity }, [a, b] = [low, high];
  for (const parts of [count, FINER, FINER]) {
    for (let k = 0; k <= parts; k++) {
      const at = a + (b - a) * k / parts;
      let levels;
      try { levels = levelsAt(at); } catch { continue; } // such as a path that leaves the body
      if (levels[of] > best.level) best = { at, level: levels[of] };
      if (b - a < high - low) continue;
      found.x.push(at);
      found.kernel.push(levels.kernel);
      found.waves.push(levels.waves);
      yield found;
    }
    if (best.level === -Infinity) return;
    [a, b] = [Math.max(best.at - (b - a) / parts, low), Math.min(best.at + (b - a) / parts, high)];
  }
  yield { ...found, best };
}
