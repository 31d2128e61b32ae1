// The point kernel of Lim, Seifi and Park (CHI EA '24): the pressure itself, which does not propagate.

import { drawingFrequency, gainAt, levelFactor, loadLines, positionOf, rhythmLevel, spot,
  spotWidth } from "./load.js";
import { zeros } from "./numeric.js";

const NEGLIGIBLE = 5.7; // widths of a Gaussian spot, beyond which it is below 1e-7
const ROUND_OFF = 1e-9; // of the peak pressure: weaker lines at a point are 0

/** Motion of the point kernel under a load, with the interface of a body's, in Pa in place of metre. */
export function kernelMotion(load) {
  const { f, w, samples } = loadLines(load);
  const reach = load.profile === "gaussian" ? NEGLIGIBLE * spotWidth(load.height) : Infinity;
  const onGrid = (xs, ys) => {
    const n = xs.length * ys.length, { re, im } = zeros(f.length * n);
    const near = new Uint16Array(samples.x.length), spots = new Float64Array(samples.x.length);
    for (let p = 0; p < n; p++) {
      let count = 0; // of samples near the place
      for (let q = 0; q < samples.x.length; q++) {
        const x = xs[p % xs.length] - samples.x[q], y = ys[Math.floor(p / xs.length)] - samples.y[q];
        if (Math.abs(x) > reach || Math.abs(y) > reach) continue;
        near[count] = q;
        spots[count++] = spot(x * x + y * y, load.height, load.profile);
      }
      for (let l = 0, to = p; l < f.length; l++, to += n) {
        const { re: wr, im: wi } = w[l];
        for (let k = 0; k < count; k++) {
          re[to] += spots[k] * wr[near[k]];
          im[to] += spots[k] * wi[near[k]];
        }
      }
    }
    return { re, im };
  };
  const at = (x, y) => {
    const { re, im } = onGrid([x], [y]);
    re.forEach((own, l) => {
      if (Math.hypot(own, im[l]) < ROUND_OFF * load.peak) re[l] = im[l] = 0;
    });
    return { re, im };
  };
  const pressure = pressureOf(load);
  const waveform = (x, y, times) => Float64Array.from(times, (t) => pressure(t)(x, y));
  const snapshot = (t, xs, ys, out) => {
    const now = pressure(t);
    for (let p = 0; p < out.length; p++) out[p] = now(xs[p % xs.length], ys[Math.floor(p / xs.length)]);
  };
  return { f, unit: "Pa", load, at, onGrid, waveform, snapshot };
}

/** Function of the time in s that gives the pressure in Pa over x, y in metre, with rhythm and mean. */
function pressureOf(load) {
  const fd = drawingFrequency(load.path), position = positionOf(load.path);
  return (t) => {
    const foci = load.foci.map((ahead) => position((((fd * t + ahead) % 1) + 1) % 1));
    const gain = gainAt(load, t) * levelFactor(load, rhythmLevel(load, t));
    return (x, y) => gain * foci.reduce((sum, [px, py]) => (
      sum + spot((x - px) ** 2 + (y - py) ** 2, load.height, load.profile)), 0);
  };
}
