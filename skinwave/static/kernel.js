// The point kernel of Lim, Seifi and Park (CHI EA '24): the pressure itself, which nothing carries on.

import { drawingFrequency, gainAt, levelFactor, loadLines, pathHarmonic, positionOf, rhythmLevel, spot,
  spotWidth } from "./load.js";

const NEGLIGIBLE = 5.7; // widths of a Gaussian spot, beyond which it is below 1e-7

/** Motion of the point kernel under a load, with the interface of a body's, in Pa in place of metre. */
export function respond(load) {
  const { f, parts, samples } = loadLines(load);
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
  const waveform = (x, y, times) => Float64Array.from(times, pressureAt(load, x, y));
  return { f, unit: "Pa", load, at, onGrid, waveform };
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

/** Pressure in Pa at a place as a function of the time in s, with the rhythm and the mean. */
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
