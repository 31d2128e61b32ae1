// Numbers of an answer: thresholds, levels, maps, reach, share, delay, and names of lines.

import { fourier, largestOf } from "./numeric.js";
import { arrayFactor, drawingFrequency, gainLines, harmonicStrengths, jumps, lastOrder, levelFactor, outline,
  pathSamples, positionOf, rhythmLevel, rhythmPeriod } from "./load.js";

const TAU = 2 * Math.PI;
const PACINIAN = -13, NON_PACINIAN = 12; // dB re 1 um peak, at 250 Hz for a focal spot and at any
const LOWEST = 10, HIGHEST = 1000; // Hz, between which the thresholds are known
const PRESSURE = 2.2, TESTED = 200; // Pa of a component, and its frequency in Hz
const SIDE = 45, HALF = 0.044; // places along a side of a map, and half of it in metre
const LEVELS = 4096; // instants of a rhythm
const OUTSIDE = 0.1; // of the largest RMS: edge of the kernel's region
const ON_PATH = 12; // places of the path at which the delay is looked for
const HEARD = 0.1; // of its largest on the path: a weaker line has no phase
const SYMBOLS = ["f_d", "f_AM", "f_AM2", "f_e", "f_r"];
const SAME = 1e-3; // over the duration: lines as near to each other in Hz coincide
const REPEATED = 1.5; // periods in the Tacton at least, to make lines
const PULSED = 2 ** 14; // samples of a period of a rhythm
const MOST_HARMONICS = 400, MOST_PRODUCTS = 4000; // as in simple_model.load.line_names
const NEGLIGIBLE_LINE = 1e-3; // of the strongest in a table
const MINOR = 0.05, FAINT = 0.02, ALIKE = 1e-3, WINDOW = 19, BINS = 2.5; // as in simple_model.response

/** Quantities at the point: `rate` is the order of the derivative, 1 in SI is `per` in `unit`. */
export const QUANTITIES = {
  displacement: { words: "displacement into the body", unit: "µm", per: 1e6, rate: 0 },
  velocity: { words: "velocity into the body", unit: "mm/s", per: 1e3, rate: 1 },
  acceleration: { words: "acceleration into the body", unit: "m/s²", per: 1, rate: 2 },
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

/** Distance in metre from the path of a load, as a function of x and y in metre. */
function distanceFromPath(load) {
  const { path } = load, moves = drawingFrequency(path) > 0;
  const pieces = [];
  for (const own of path.paths || [path]) {
    const [cx, cy] = own.centre || [0, 0];
    if (own.shape === "point" || !moves || (own.shape !== "polyline" && !own.size)) {
      const at = positionOf(own), places = moves ? [0] : load.foci;
      for (const phase of places) pieces.push({ ends: [at(phase % 1), at(phase % 1)] });
    } else if (own.shape === "circle") pieces.push({ circle: [cx, cy, own.size / 2] });
    else {
      const corners = outline(own).corners.map(([x, y]) => [x + cx, y + cy]);
      corners.slice(1).forEach((end, k) => pieces.push({ ends: [corners[k], end] }));
    }
  }
  return (x, y) => Math.min(...pieces.map(({ circle, ends }) => {
    if (circle) return Math.abs(Math.hypot(x - circle[0], y - circle[1]) - circle[2]);
    const [[ax, ay], [bx, by]] = ends, dx = bx - ax, dy = by - ay, squared = dx * dx + dy * dy;
    const part = squared ? Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / squared, 0), 1) : 0;
    return Math.hypot(x - ax - part * dx, y - ay - part * dy);
  }));
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
function symbolsOf(load) {
  const own = load.path.shape === "joined", turns = own ? load.path.drawn : drawingFrequency(load.path);
  const fd = own && turns * load.duration < REPEATED ? 0 : turns;
  const rhythm = load.pulses ? 1 / rhythmPeriod(load) : 0;
  return [fd, load.w1 > 0 ? load.am : 0, load.w1 < 1 ? load.am2 : 0, load.envelope,
    rhythm * load.duration >= REPEATED ? rhythm : 0];
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

/** Harmonics [{n, share}] of the path of a load that make lines up to `highest`, the strongest first. */
function pathShares(load, symbols, highest) {
  const samples = pathSamples(load), count = samples.x.length, own = load.path.shape === "joined";
  const last = lastOrder(load, count, gainLines(load), highest), fd = drawingFrequency(load.path);
  const strengths = harmonicStrengths(load, samples, last), n = own ? load.path.paths.length : 1;
  const once = fd > 0 && jumps(load.path) && fd * load.duration < 1 - 1e-9;
  const found = [];
  for (let k = -last; k <= last; k++) {
    found.push({ n: k, share: strengths[(k + count) % count] * Math.hypot(...arrayFactor(load, k)) });
  }
  const least = 1e-10 * Math.max(...found.map(({ share }) => share));
  const named = (k) => (symbols[0] && !once ? k % n === 0 : k === 0);
  return found.filter(({ n: k, share }) => (share > least || k === 0) && named(k))
    .map(({ n: k, share }) => ({ n: k / n, share }))
    .sort((a, b) => b.share - a.share).slice(0, MOST_HARMONICS);
}

/** Products [{orders of SYMBOLS but f_d, c}] of the sinusoids and the rhythm, c in Pa. */
function gainProducts(load, symbols, least) {
  const strongest = (found) => {
    found.sort((a, b) => b.c - a.c);
    return found.filter(({ c }, k) => c >= least * found[0].c && k < MOST_PRODUCTS);
  };
  const gain = strongest(gainLines(load).map(({ orders, re, im }) => (
    { orders: [...orders, 0], c: Math.hypot(re, im) })));
  if (!symbols[4]) return gain;
  const period = rhythmPeriod(load);
  const { re, im } = fourier(Float64Array.from({ length: PULSED },
    (_, k) => levelFactor(load, rhythmLevel(load, (k + 0.5) / PULSED * period)) / PULSED));
  const orders = Array.from(re, (value, k) => (
    { v: k > PULSED / 2 ? k - PULSED : k, a: Math.hypot(value, im[k]) }));
  const top = Math.max(...orders.map(({ a }) => a));
  const kept = orders.filter(({ a }) => a >= least * top);
  return strongest(gain.flatMap(({ orders: own, c }) => kept.map(({ v, a }) => (
    { orders: [...own.slice(0, 3), v], c: c * a }))));
}

/**
 * Lines of a load above a fraction of the strongest on the path, without the mean: [{name, f in Hz,
 * strength in Pa}], ascending, no two the same (simple_model.load.line_names).
 */
export function lineNames(load, { threshold = 1e-3, most = 200, highest = Infinity } = {}) {
  const symbols = symbolsOf(load), same = SAME / load.duration, shares = pathShares(load, symbols, highest);
  const gain = gainProducts(load, symbols, 1e-3 * threshold);
  const base = gain.map(({ orders }) => orders.reduce((sum, n, k) => sum + n * symbols[k + 1], 0));
  const each = (visit) => shares.forEach(({ n, share }) => {
    for (let g = 0; g < gain.length; g++) {
      const f = n * symbols[0] + base[g];
      if (f > same) visit(n, g, f, 2 * share * gain[g].c);
    }
  });
  let top = 0;
  each((n, g, f, strength) => { top = Math.max(top, strength); });
  const found = [];
  each((n, g, f, strength) => {
    if (strength > 1e-2 * threshold * top) found.push({ n, g, f, strength });
  });
  found.sort((a, b) => a.f - b.f);
  const groups = [];
  found.forEach((line, k) => {
    const orders = [line.n, ...gain[line.g].orders], used = orders.filter((n) => n).length;
    const sum = orders.reduce((total, n) => total + Math.abs(n), 0);
    const effort = sum + (orders[0] ? 0.1 : 0) + 0.01 * used;
    if (k === 0 || line.f - found[k - 1].f > same) groups.push({ effort: Infinity, power: 0 });
    const group = groups[groups.length - 1];
    group.power += line.strength ** 2;
    if (effort < group.effort - 1e-9 || (effort < group.effort + 1e-9 && line.strength > group.best)) {
      Object.assign(group, { effort, best: line.strength, f: line.f, orders });
    }
  });
  const strongest = [...groups].sort((a, b) => b.power - a.power).slice(0, most);
  return strongest.filter(({ power }) => power > threshold ** 2 * strongest[0].power)
    .sort((a, b) => a.f - b.f)
    .map(({ orders, f, power }) => ({ name: nameOf(orders, symbols), f, strength: Math.sqrt(power) }));
}

/** Names of a load's lines while a pulse is on, as a function of the frequency in Hz; "" if unknown. */
export function namesOf(load) {
  const known = lineNames({ ...load, pulses: null }, { threshold: 1e-4, most: 1000, highest: HIGHEST });
  const same = Math.max(SAME / load.duration, 1e-6);
  return (f) => known.find((line) => Math.abs(line.f - f) <= same)?.name || "";
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

/** Names of the lines below 1 kHz that the Tacton is too short to resolve from 0 Hz or each other. */
export function unresolvedNames(load) {
  const lines = lineNames(load, { highest: HIGHEST }).filter(({ f }) => f < HIGHEST);
  const least = 2 / load.duration; // of its second half, when it has settled
  const top = Math.max(...lines.map(({ strength }) => strength), 1e-300);
  const near = (a, b, far) => Math.abs(a - b) < far;
  let known = lines.map(({ f }) => {
    const close = lines.filter((other) => near(f, other.f, least));
    const sum = (some) => some.reduce((total, { strength }) => total + strength, 0);
    const alike = close.filter((other) => Math.abs(f - other.f) <= ALIKE * least);
    return f >= least && sum(close) - sum(alike) <= MINOR * sum(alike);
  });
  for (let before = -1; before !== known.filter(Boolean).length;) {
    before = known.filter(Boolean).length;
    const kept = lines.filter((_, k) => known[k]), lost = lines.filter((_, k) => !known[k]);
    const gaps = kept.map(({ f }, k) => f - (k ? kept[k - 1].f : 0)).filter((gap) => gap >= least);
    const beta = betaOf(Math.min(...gaps, Infinity) / least);
    known = lines.map(({ f, strength }, k) => {
      const leaks = lost.map((o) => o.strength * kaiser(Math.PI * (f - o.f) / least, beta));
      const leak = Math.hypot(...leaks);
      return known[k] && leak <= MINOR * Math.max(strength, FAINT * top);
    });
  }
  const kept = lines.filter((_, k) => known[k]);
  return lines.filter(({ f }, k) => !known[k] && !kept.some((other) => near(f, other.f, least)))
    .map(({ name }) => name);
}

/** Parameter of the Kaiser window for lines so many bins apart. */
function betaOf(bins) {
  const lobe = Math.hypot(1, WINDOW / Math.PI) * Math.min(bins / BINS, 1);
  return Math.PI * Math.sqrt(Math.max(lobe * lobe - 1, 0));
}

/** Transform of a Kaiser window, relative; x is pi times bins. */
function kaiser(x, beta) {
  const root = Math.sqrt(Math.abs(beta * beta - x * x)) + 1e-9;
  const value = Math.abs(x) < beta ? Math.sinh(root) / root : Math.abs(Math.sin(root) / root);
  return value * (beta ? beta / Math.sinh(beta) : 1);
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
 * Levels over a value of the controls, in steps: yields {x, kernel, waves, best} after each of `count`
 * + 1 values from low to high and after each refinement and, last, with the highest of the curve `of` as
 * `best`, {at, level}, to `within` of the range. `levelsAt(value)` returns {kernel, waves} in dB or throws,
 * which skips a value.
 */
export function* levelOver(levelsAt, [low, high], { of = "waves", count = 48, within = 1e-3 } = {}) {
  const found = { x: [], kernel: [], waves: [], best: null };
  const levelOfValue = (value) => {
    try { return levelsAt(value); } catch { return null; } // such as a path that leaves the body
  };
  for (let k = 0; k <= count; k++) {
    const value = low + (high - low) * k / count, levels = levelOfValue(value);
    if (levels) {
      found.x.push(value);
      found.kernel.push(levels.kernel);
      found.waves.push(levels.waves);
    }
    yield found;
  }
  const known = found[of], top = known.reduce((best, level, k) => (
    Number.isFinite(level) && !(level <= known[best]) ? k : best), -1);
  if (top < 0) return;
  const section = (Math.sqrt(5) - 1) / 2; // golden
  let [a, b] = [found.x[Math.max(top - 1, 0)], found.x[Math.min(top + 1, found.x.length - 1)]];
  const measured = (at) => ({ at, level: levelOfValue(at)?.[of] ?? -Infinity });
  let c = measured(b - section * (b - a)), d = measured(a + section * (b - a));
  let best = { at: found.x[top], level: known[top] };
  while (b - a > within * (high - low)) {
    for (const each of [c, d]) if (each.level > best.level) best = each;
    if (c.level > d.level) {
      [b, d] = [d.at, c];
      c = measured(b - section * (b - a));
    } else {
      [a, c] = [c.at, d];
      d = measured(a + section * (b - a));
    }
    yield found;
  }
  found.best = best;
  yield found;
}
