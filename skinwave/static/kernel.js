// The point kernel of Lim, Seifi and Park (CHI EA '24): the pressure itself, which nothing carries on.

import { drawingFrequency, gainAt, jumps, levelFactor, loadLines, pathHarmonic, positionOf,
  rhythmLevel, spot, spotWidth } from "./load.js";

const PASSED = 5.7 / (2 * Math.PI); // f s / v, at which the spectrum of a passing focal spot is 1e-7
const PER_PERIOD = 8; // samples of the highest frequency
const REACH = 128; // samples on either side that the low pass weighs
const BETA = 10; // of its Kaiser window, 100 dB down
const NEGLIGIBLE = 5.7; // widths of a Gaussian spot, beyond which it is below 1e-7
const DEGREES = { linear: 1, pressure_squared: 2, force_corrected: 1 };

/** The load as published: linear drive law and the main lobe alone (simple_model.published). */
const asPublished = (load) => ({ ...load, drive: "linear", profile: "main_lobe" });

/** Motion of the point kernel under a load, with the interface of a body's, in Pa in place of metre. */
export function respond(given, { published = false } = {}) {
  const load = published ? asPublished(given) : given, { f, parts, samples } = loadLines(load);
  const orders = [...new Set(parts.flat().map(({ n }) => Math.abs(n)))];
  const index = new Map(orders.map((n, k) => [n, k]));
  const weights = orders.map((n) => pathHarmonic(load, n, samples.x.length));
  const onGrid = (xs, ys) => {
    const passages = passagesOf(load, samples, weights, xs, ys);
    const places = xs.length * ys.length;
    const found = { re: new Float32Array(f.length * places), im: new Float32Array(f.length * places) };
    parts.forEach((own, l) => {
      const re = found.re.subarray(l * places), im = found.im.subarray(l * places);
      for (const { n, re: cr, im: ci } of own) {
        const h = passages[index.get(Math.abs(n))], sign = n < 0 ? -1 : 1;
        for (let p = 0; p < places; p++) {
          re[p] += 2 * (cr * h.re[p] - sign * ci * h.im[p]);
          im[p] += 2 * (sign * cr * h.im[p] + ci * h.re[p]);
        }
      }
    });
    return found;
  };
  const at = (x, y) => {
    const { re, im } = onGrid([x], [y]);
    return { re: Float64Array.from(re), im: Float64Array.from(im) };
  };
  return { f, unit: "Pa", load, at, onGrid, waveform: (x, y, times) => waveform(load, x, y, times) };
}

/** Harmonics [{re, im}] of the passing focal spot at places row by row, from the weights of samples. */
function passagesOf({ height, profile }, samples, weights, xs, ys) {
  const places = xs.length * ys.length;
  const reach = profile === "gaussian" ? NEGLIGIBLE * spotWidth(height) : Infinity;
  const found = weights.map(() => ({ re: new Float64Array(places), im: new Float64Array(places) }));
  for (let q = 0; q < samples.x.length; q++) {
    for (let p = 0; p < places; p++) {
      const x = xs[p % xs.length] - samples.x[q], y = ys[Math.floor(p / xs.length)] - samples.y[q];
      if (Math.abs(x) > reach || Math.abs(y) > reach) continue;
      const s = spot(x * x + y * y, height, profile);
      for (let k = 0; k < weights.length; k++) {
        found[k].re[p] += s * weights[k].re[q];
        found[k].im[p] += s * weights[k].im[q];
      }
    }
  }
  return found;
}

/** Pressure (t,) in Pa at a place over equally spaced times in s, with the rhythm and the mean. */
function waveform(load, x, y, times) {
  const dt = times.length > 1 ? times[1] - times[0] : 1e-4, parts = finer(highestLine(load), dt);
  const pressure = pressureAt(load, x, y);
  if (parts === 1) return Float64Array.from(times, pressure);
  const taps = lowPass(parts), half = REACH * parts, fine = dt / parts;
  const dense = new Float64Array((times.length - 1) * parts + 2 * half + 1);
  for (let k = 0; k < dense.length; k++) dense[k] = pressure(times[0] + (k - half) * fine);
  return Float64Array.from(times, (_, k) => {
    let sum = 0;
    for (let j = 0, from = k * parts; j < taps.length; j++) sum += taps[j] * dense[from + j];
    return sum;
  });
}

function pressureAt(load, x, y) {
  const fd = drawingFrequency(load.path), position = positionOf(load.path);
  return (t) => {
    let sum = 0;
    for (const a of load.foci) {
      const [px, py] = position((((fd * t + a) % 1) + 1) % 1);
      sum += spot((x - px) ** 2 + (y - py) ** 2, load.height, load.profile);
    }
    return sum * gainAt(load, t) * levelFactor(load, rhythmLevel(load, t));
  };
}

/** Highest line in Hz of a load at any place (simple_model.load.sampling); jumps have none. */
function highestLine(load) {
  const { path } = load, own = path.shape === "joined" ? path.paths : null;
  let speed = own ? Math.max(...own.map((each) => each.size * lengthPerSize(each) * path.drawn)) : path.speed;
  if (drawingFrequency(path) === 0) speed = 0;
  const eased = path.sweep === "sinusoidal" && ["line", "polyline"].includes(path.shape);
  const passing = PASSED * speed * (eased ? Math.PI / 2 : 1) / spotWidth(load.height);
  const tone = Math.max(load.w1 > 0 ? load.am : 0, load.w1 < 1 ? load.am2 : 0) + load.envelope;
  return (own || jumps(path) ? Math.min(passing, 1e4) : passing) + DEGREES[load.drive] * tone;
}

const lengthPerSize = ({ shape }) => ({ point: 0, line: 2, triangle: 3, square: 4, circle: Math.PI })[shape];

const finer = (highest, dt) => (highest < 0.5 / dt ? 1 : Math.ceil(PER_PERIOD * highest * dt));

/** Modified Bessel function I0. */
function besselI0(x) {
  let sum = 1;
  for (let n = 1, term = 1; term > 1e-17 * sum; n++) sum += term *= (x / (2 * n)) ** 2;
  return sum;
}

/** Windowed sinc that passes one part in `parts` of the band, as scipy.signal.firwin makes it. */
function lowPass(parts) {
  const half = REACH * parts, taps = new Float64Array(2 * half + 1);
  for (let k = 0; k < taps.length; k++) {
    const m = k - half, turn = Math.PI * m / parts;
    taps[k] = (m ? Math.sin(turn) / turn : 1) * besselI0(BETA * Math.sqrt(1 - (m / half) ** 2));
  }
  const sum = taps.reduce((a, b) => a + b);
  return taps.map((tap) => tap / sum);
}
