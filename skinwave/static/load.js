// The moving load of a Tacton: its path, its modulation and its spectral lines, as in simple_model.load.

import { addTimes, fourier, indexIn, unitCircle, zeros } from "./numeric.js";

const TAU = 2 * Math.PI;
const FEWEST_SAMPLES = 132; // of a closed path: enough for all harmonics below 66 f_d
const SAMPLES_PER_WIDTH = 8; // of the focal spot
const JUMP_RATE = 25000; // samples per second of a path that jumps; the most of joined paths
const ROUND = 132; // straight parts of a circle that is joined to other paths (simple_model.joined)
const SIDES = { point: 1, line: 2, triangle: 3, square: 4, circle: ROUND }; // of a joined path
const AFTER_JUMP = 1e-12; // s, so that round-off does not place a focus before a jump
const PHASES = 8; // of each sinusoid: more than twice the degree of a drive law
const NEGLIGIBLE_PART = 1e-6; // of the strength of a line
const ROOT3 = Math.sqrt(3);
const CORNERS = {
  point: [[0, 0]],
  line: [[-0.5, 0], [0.5, 0]],
  triangle: [[0, 1 / ROOT3], [-0.5, -0.5 / ROOT3], [0.5, -0.5 / ROOT3]],
  square: [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]],
};

// Force on a disc of 10 mm radius by height in mm, relative to 200 mm (simple_model.load.focus).
const HEIGHTS = [20, 40, 60, 80, 100, 120, 150, 180, 200, 220, 250, 300, 350, 400, 500, 600];
const FORCES = [0.2395, 0.4048, 0.5717, 0.6989, 0.785, 0.8502, 0.9319, 0.986, 1, 0.9963, 0.9634,
  0.8655, 0.7505, 0.6411, 0.4644, 0.3414];

const DRIVES = {
  pressure_squared: (amplitude, m, depth) => (amplitude * (1 + depth * m) / (1 + depth)) ** 2,
  force_corrected: (amplitude, m, depth) => amplitude * (1 + depth * m) / (1 + depth),
  linear: (amplitude, m) => amplitude * m,
};

/** Value at x of straight lines between (xs, ys), constant outside. */
function interpolate(x, xs, ys) {
  const k = indexIn(xs, x), step = xs[k + 1] - xs[k];
  return ys[k] + (ys[k + 1] - ys[k]) * (step ? Math.min(Math.max((x - xs[k]) / step, 0), 1) : 1);
}

// Slopes of the monotone cubic through them (Fritsch and Carlson).
const FORCE_SLOPES = [0.008225, 0.00830480734497, 0.00721852431146, 0.00513451476793, 0.00371032385988,
  0.00298545060529, 0.00216984290623, 0.000979734391169, 0, -0.000302259559676, -0.00137362001564,
  -0.00211526538281, -0.00224260249554, -0.00197849343265, -0.00145039039039, -0.0009615];

/** Intensity of the focus at a height in metre, relative to that at 200 mm. */
export function relativeIntensity(height) {
  const x = Math.min(Math.max(1e3 * height, HEIGHTS[0]), HEIGHTS[HEIGHTS.length - 1]);
  const k = indexIn(HEIGHTS, x), h = HEIGHTS[k + 1] - HEIGHTS[k], t = (x - HEIGHTS[k]) / h;
  return FORCES[k] * (1 + 2 * t) * (1 - t) ** 2 + FORCE_SLOPES[k] * h * t * (1 - t) ** 2
    + FORCES[k + 1] * t * t * (3 - 2 * t) + FORCE_SLOPES[k + 1] * h * t * t * (t - 1);
}

/** Distance in metre from the focus to the first zero of its main lobe, at a height in metre. */
function lobeWidth(height) {
  const above = height - 0.2;
  return 11.6e-3 + 46.5e-3 * above + 25e-3 * above ** 2;
}

/** Standard deviation in metre of the Gaussian focal spot at a height in metre. */
export const spotWidth = (height) => 4.35e-3 * lobeWidth(height) / lobeWidth(0.2);

/** Relative pressure of a focal spot at a squared distance in m2 from its middle. */
export function spot(squared, height, profile) {
  if (profile === "gaussian") return Math.exp(-squared / (2 * spotWidth(height) ** 2));
  const angle = Math.PI * Math.sqrt(Math.max(squared, 1e-24)) / lobeWidth(height);
  return (Math.sin(angle) / angle) ** 2;
}

const isClosed = (points) => points.length > 2
  && points[0][0] === points[points.length - 1][0] && points[0][1] === points[points.length - 1][1];

/** Corners of a path in metre, and whether a period passes them once, not there and back. */
function outline(path) {
  if (path.shape === "polyline") {
    return { corners: path.points, runsOn: path.sweep === "one_way" || isClosed(path.points) };
  }
  const unit = CORNERS[path.shape].map(([x, y]) => [path.size * x, path.size * y]);
  const open = path.shape === "line";
  return { corners: open ? unit : [...unit, unit[0]], runsOn: !open || path.sweep === "one_way" };
}

/** Lengths along lines through corners, from the first corner to each. */
function arc(corners) {
  let sum = 0;
  return corners.map(([x, y], k) => {
    const [x0, y0] = corners[Math.max(k - 1, 0)];
    return sum += Math.hypot(x - x0, y - y0);
  });
}

/**
 * Corners {points: [[x, y]] in metre, times in s} of the paths of several foci, joined one after the other.
 * Each path takes 1 / `drawn` s. Foci at even phases of the whole are on one path each.
 */
export function joinedCorners({ paths, drawn }) {
  const points = [], times = [];
  paths.forEach((path, before) => {
    const at = positionOf(path), sides = SIDES[path.shape];
    for (let k = 0; k <= sides; k++) {
      points.push(at(k / sides));
      times.push((before + k / sides) / drawn);
    }
  });
  return { points, times };
}

/** Length in metre of one period of a path that is not joined. */
function pathLength(path) {
  if (path.shape === "circle") return Math.PI * path.size;
  const { corners, runsOn } = outline(path);
  return arc(corners).pop() * (runsOn ? 1 : 2);
}

/** Frequency in Hz at which a path repeats, joined paths together; 0 if the focus rests. */
export function drawingFrequency(path) {
  if (path.shape === "joined") return path.drawn / path.paths.length;
  const length = pathLength(path);
  return length > 0 ? path.speed / length : 0;
}

/** Function that gives the place on straight lines between points, which it passes at ascending marks. */
function along(points, marks) {
  const axes = [0, 1].map((axis) => points.map((at) => at[axis]));
  return (mark) => axes.map((own) => interpolate(mark, marks, own));
}

/** Position [x, y] in metre as a function of the fraction 0..1 of the period. */
export function positionOf(path) {
  if (path.shape === "joined") {
    const { points, times } = joinedCorners(path), at = along(points, times);
    return (p) => at(p * path.paths.length / path.drawn + AFTER_JUMP);
  }
  const [cx, cy] = path.centre || [0, 0];
  if (path.shape === "circle") {
    return (p) => [path.size / 2 * Math.cos(TAU * p) + cx, path.size / 2 * Math.sin(TAU * p) + cy];
  }
  const { corners, runsOn } = outline(path), lengths = arc(corners), whole = lengths[lengths.length - 1];
  const points = corners.map(([x, y]) => [x + cx, y + cy]), at = along(points, lengths);
  if (!whole) return () => points[0];
  if (runsOn) return (p) => at(p * whole);
  return (p) => at(whole * (path.sweep === "sinusoidal" ? (1 - Math.cos(TAU * p)) / 2
    : 1 - Math.abs(1 - 2 * p)));
}

/** Fractions of the period at which a focus jumps. */
function jumpPhases(path) {
  if (path.shape !== "joined") return jumps(path) ? [0] : [];
  const starts = path.paths.map((each) => positionOf(each)(0)), n = starts.length;
  const moved = ([x, y], [x0, y0]) => Math.max(Math.abs(x - x0), Math.abs(y - y0)) > 1e-7;
  return starts.map((at, k) => (moved(at, starts[(k + n - 1) % n]) ? k / n : -1)).filter((p) => p >= 0);
}

/** Whether the focus jumps at the end of each period. */
export function jumps(path) {
  if (!["line", "polyline"].includes(path.shape) || drawingFrequency(path) === 0) return false;
  return path.sweep === "one_way" && !(path.shape === "polyline" && isClosed(path.points));
}

/** Positions {x, y} in metre at the middles of equal cells of one period; of foci that rest, their own. */
export function pathSamples(load) {
  const { path, foci } = load, moves = drawingFrequency(path) > 0;
  const count = moves ? sampleCount(load) : foci.length;
  const at = positionOf(path), x = new Float64Array(count), y = new Float64Array(count);
  for (let q = 0; q < count; q++) [x[q], y[q]] = at(moves ? (q + 0.5) / count : foci[q] % 1);
  return { x, y };
}

/** Number of samples of a path, such that corners and jumps fall between them. */
function sampleCount({ path, height }) {
  const perMetre = SAMPLES_PER_WIDTH / spotWidth(height), fd = drawingFrequency(path);
  if (path.shape === "joined") {
    const sides = path.paths.map(({ shape }) => SIDES[shape]), n = sides.length;
    const whole = n * (sides.every((each) => each === sides[0]) ? sides[0] : 12);
    const most = Math.min(perMetre * n * Math.max(...path.paths.map(pathLength)), JUMP_RATE / fd);
    return whole * Math.ceil(Math.max(most, FEWEST_SAMPLES) / whole);
  }
  const enough = Math.max(perMetre * pathLength(path), FEWEST_SAMPLES);
  return jumps(path) ? fastLength(Math.ceil(Math.max(enough, JUMP_RATE / fd))) : 12 * Math.ceil(enough / 12);
}

/** Smallest number from a count on without a prime factor above 11, as simple_model counts samples. */
function fastLength(count) {
  let rest = count;
  for (const factor of [2, 3, 5, 7, 11]) while (rest % factor === 0) rest /= factor;
  return rest === 1 ? count : fastLength(count + 1);
}

const tones = (load) => [load.am, load.am2, load.envelope];

/** Modulation at given phases of the two AM sinusoids and the envelope. */
function modulationAt(load, phases) {
  const [m1, m2, e] = tones(load).map((f, k) => (f > 0 ? Math.sin(phases[k]) : 1));
  return (load.w1 * m1 + (1 - load.w1) * m2) * e;
}

/** Period in s of the pulses of a rhythm. */
export const rhythmPeriod = ({ pulses }) => pulses.reduce((sum, [on, gap]) => sum + on + gap, 0);

/** Level of the rhythm from 0 to 1 at a time in s; 1 without a rhythm. */
export function rhythmLevel(load, t) {
  if (!load.pulses) return 1;
  const period = rhythmPeriod(load);
  let into = ((t / period + 1e-12) % 1 + 1) % 1 * period;
  for (const [on, gap] of load.pulses) {
    if (into < on) return load.ramp > 0 ? Math.min(1, into / load.ramp, (on - into) / load.ramp) : 1;
    if (into < on + gap) return 0;
    into -= on + gap;
  }
  return 0;
}

/** Mean factor on the pressure of the rhythm from a time in s to another, at `count` instants. */
export function meanFactor(load, from, to, count) {
  let sum = 0;
  for (let k = 0; k < count; k++) {
    const at = from + (k + 0.5) / count * (to - from);
    if (at > 0) sum += levelFactor(load, rhythmLevel(load, at)); // which is 0 before the start
  }
  return sum / count;
}

/** Pressure in Pa of each focus at full drive. */
export const fullPressure = ({ peak, height, foci }) => peak * relativeIntensity(height) / foci.length;

/** Pressure in Pa of each focus at a time in s, without the rhythm. */
export const gainAt = (load, t) => fullPressure(load) * DRIVES[load.drive](
  load.amplitude, modulationAt(load, tones(load).map((f) => TAU * f * t)), load.depth);

/** Factor on the pressure of a level of the amplitude from 0 to 1. */
export const levelFactor = (load, level) => DRIVES[load.drive](level, 1, load.depth);

/** Lines [{f, re, im, orders}] of the pressure of each focus in Pa, at positive and negative f in Hz. */
export function gainLines(load) {
  const fs = tones(load), counts = fs.map((f) => (f > 0 ? PHASES : 1));
  const strides = [counts[1] * counts[2], counts[2], 1], total = counts[0] * strides[0];
  const places = (k) => counts.map((count, axis) => Math.floor(k / strides[axis]) % count);
  const full = fullPressure(load);
  let re = Float64Array.from({ length: total }, (_, k) => {
    const phases = places(k).map((j, axis) => TAU * j / counts[axis]);
    return full / total * DRIVES[load.drive](load.amplitude, modulationAt(load, phases), load.depth);
  });
  let im = new Float64Array(total);
  counts.forEach((count, axis) => {
    if (count > 1) [re, im] = transformed(re, im, count, strides[axis]);
  });
  const lines = Array.from(re, (value, k) => {
    const orders = places(k).map((n, axis) => (n >= counts[axis] / 2 && n > 0 ? n - counts[axis] : n));
    return { f: orders.reduce((sum, n, axis) => sum + n * fs[axis], 0), re: value, im: im[k], orders };
  });
  const largest = Math.max(...lines.map((c) => Math.hypot(c.re, c.im)));
  return lines.filter((c) => Math.hypot(c.re, c.im) > 1e-12 * largest);
}

/** Discrete Fourier transform along the axis of a table with this count and stride. */
function transformed(re, im, count, stride) {
  const { cos, sin } = unitCircle(count), { re: a, im: b } = zeros(re.length);
  for (let k = 0; k < re.length; k++) {
    const n = Math.floor(k / stride) % count, first = k - n * stride;
    for (let j = 0; j < count; j++) {
      const c = cos[n * j % count], s = sin[n * j % count], from = first + j * stride;
      a[k] += re[from] * c + im[from] * s;
      b[k] += im[from] * c - re[from] * s;
    }
  }
  return [a, b];
}

/** Array factor [re, im] of all foci on harmonic n of the path. */
function arrayFactor(load, n) {
  let re = 0, im = 0;
  for (const ahead of load.foci) {
    re += Math.cos(TAU * n * ahead);
    im += Math.sin(TAU * n * ahead);
  }
  return [re, im];
}

/**
 * Weights w {re, im} (q,) of the samples X of a path in its harmonic n, with all foci. The pressure at a
 * place x is that of one focus times sum_n exp(2 pi i n f_d t) sum_q w_q S(x - X_q).
 */
export function pathHarmonic(load, n, count) {
  const [ar, ai] = arrayFactor(load, n), { cos, sin } = unitCircle(2 * count), { re, im } = zeros(count);
  const whole = 2 * count, first = ((n % whole) + whole) % whole, step = (2 * first) % whole;
  for (let q = 0, turn = first; q < count; q++) {
    const c = cos[turn] / count, s = -sin[turn] / count;
    re[q] = c * ar - s * ai;
    im[q] = c * ai + s * ar;
    turn += step;
    if (turn >= whole) turn -= whole;
  }
  for (const each of [re, im]) spreadJumps(load.path, each);
  return { re, im };
}

/**
 * The strongest spectral lines of the load, without its mean: frequencies f (l,) in Hz, ascending, and for
 * each line the weights w {re, im} (q,) in Pa of the samples X of the path. The pressure at a place x is
 * Re sum_q w_q S(x - X_q) exp(2 pi i f t). The `parts` of a line are harmonics n of the path times lines
 * {re, im} of the gain.
 */
export function loadLines(load, { threshold = 3e-4, lowest = 1e-6, highest = 1000, most = 120 } = {}) {
  const samples = pathSamples(load), count = samples.x.length, gain = gainLines(load);
  const fd = drawingFrequency(load.path);
  const last = lastOrder(load, count, gain, highest), byFrequency = new Map();
  const shares = harmonicStrengths(load, samples, last);
  for (let n = -last; n <= last; n++) {
    const factor = Math.hypot(...arrayFactor(load, n)) * shares[(n + count) % count];
    if (factor < 1e-12) continue;
    for (const c of gain) {
      const f = Math.round((c.f + n * fd) * 1e9) / 1e9;
      if (f < lowest || f > highest) continue;
      const line = byFrequency.get(f) || { f, parts: [], strength: 0 };
      const strength = (f > 0 ? 2 : 1) * Math.hypot(c.re, c.im) * factor;
      line.parts.push({ n, ...c, strength });
      line.strength += strength;
      byFrequency.set(f, line);
    }
  }
  const all = [...byFrequency.values()].sort((a, b) => b.strength - a.strength).slice(0, most);
  const lines = all.filter((line) => line.strength > threshold * all[0].strength)
    .sort((a, b) => a.f - b.f);
  const harmonics = new Map();
  const w = lines.map(({ f, strength, parts }) => {
    const sum = zeros(count), twice = f > 0 ? 2 : 1;
    for (const part of parts) {
      if (part.strength < NEGLIGIBLE_PART * strength) continue;
      if (!harmonics.has(part.n)) harmonics.set(part.n, pathHarmonic(load, part.n, count));
      addTimes(sum, [twice * part.re, twice * part.im], harmonics.get(part.n));
    }
    return sum;
  });
  const f = Float64Array.from(lines, (line) => line.f);
  return { f, w, samples, parts: lines.map((line) => line.parts) };
}

/** Correct the cells before and after each jump for its moments (simple_model.load.path_cells). */
function spreadJumps(path, cells) {
  const count = cells.length;
  for (const phase of jumpPhases(path)) {
    const after = Math.round(phase * count), before = (after + count - 1) % count;
    const share = (cells[before] - cells[after]) / 24;
    cells[after] += share;
    cells[before] -= share;
  }
}

/** Highest harmonic of the path that makes a line up to a frequency in Hz. */
function lastOrder(load, count, gain, highest) {
  const fd = drawingFrequency(load.path), top = highest + Math.max(...gain.map(({ f }) => f));
  return fd > 0 ? Math.min(Math.floor((count - 1) / 2), Math.ceil(top / fd)) : 0;
}

/** Largest amplitude of each harmonic up to `last` of the passing focal spot, at nine points of the path. */
function harmonicStrengths(load, { x, y }, last) {
  const count = x.length, even = Math.max(1, Math.floor(count / 8));
  const step = load.path.shape === "joined" ? even + 1 : even; // not the same places of each path
  const strongest = new Float64Array(count);
  for (let p = 0; p < Math.min(9 * step, count); p += step) {
    const values = new Float64Array(count);
    for (let q = 0; q < count; q++) {
      values[q] = spot((x[p] - x[q]) ** 2 + (y[p] - y[q]) ** 2, load.height, load.profile);
    }
    spreadJumps(load.path, values);
    const { re, im } = fourier(values);
    for (let n = 0; n <= last; n++) {
      strongest[n] = Math.max(strongest[n], Math.hypot(re[n], im[n]) / count);
      strongest[(count - n) % count] = strongest[n];
    }
  }
  return strongest;
}
