// Motion of a laterally infinite body, by its compliance G over wavenumber and frequency:
//   g(r, f) = 1 / (2 pi) int S(k) G(k, f) J0(k r) k dk
// along a path of complex k, as skinwave.live.radial packs it.

import { spotWidth } from "./load.js";

/** Bessel function J0 of a complex argument with a positive real part: [re, im], to about 1e-7. */
export function besselJ0(a, b) {
  return Math.hypot(a, b) < 18 ? seriesJ0(a, b) : asymptoticJ0(a, b);
}

/** Power series, Abramowitz and Stegun 9.1.12. */
function seriesJ0(a, b) {
  const re2 = -(a * a - b * b) / 4, im2 = -a * b / 2;
  let tr = 1, ti = 0, re = 1, im = 0;
  for (let n = 1; n < 60; n++) {
    [tr, ti] = [(tr * re2 - ti * im2) / (n * n), (tr * im2 + ti * re2) / (n * n)];
    re += tr;
    im += ti;
    if (Math.abs(tr) + Math.abs(ti) < 1e-17 * (Math.abs(re) + Math.abs(im))) break;
  }
  return [re, im];
}

/** Hankel's expansion, Abramowitz and Stegun 9.2.5, as (H1 + H2) / 2. */
function asymptoticJ0(a, b) {
  const size = a * a + b * b, ir = a / size, ii = -b / size; // 1 / z
  let [pr, pi, qr, qi] = [0, 0, 0, 0], [tr, ti] = [1, 0];
  for (let n = 0; n < 20; n++) {
    const sign = n % 4 < 2 ? 1 : -1;
    if (n % 2 === 0) { pr += sign * tr; pi += sign * ti; } else { qr += sign * tr; qi += sign * ti; }
    const c = -((2 * n + 1) ** 2) / (8 * (n + 1));
    [tr, ti] = [c * (tr * ir - ti * ii), c * (tr * ii + ti * ir)];
  }
  // cos and sin of z - pi / 4
  const x = a - Math.PI / 4, up = Math.exp(b), down = 1 / up;
  const [cr, ci] = [Math.cos(x) * (up + down) / 2, -Math.sin(x) * (up - down) / 2];
  const [sr, si] = [Math.sin(x) * (up + down) / 2, Math.cos(x) * (up - down) / 2];
  const [vr, vi] = [pr * cr - pi * ci - (qr * sr - qi * si), pr * ci + pi * cr - (qr * si + qi * sr)];
  // sqrt(2 / (pi z))
  const m = Math.sqrt(2 / Math.PI) * size ** -0.25, half = -Math.atan2(b, a) / 2;
  const [wr, wi] = [m * Math.cos(half), m * Math.sin(half)];
  return [vr * wr - vi * wi, vr * wi + vi * wr];
}

/**
 * A radial pack made ready: frequencies (f,) in Hz, distances (r,) in metre, and the table g (f, r)
 * in m/Pa for the focal spot of a height.
 */
export class RadialBody {
  constructor(pack) {
    Object.assign(this, pack); // frequencies, k {re, im}, weights {re, im}, G {re, im} (f, k)
    this.distances = Float64Array.from({ length: pack.n_distances },
      (_, j) => j * pack.furthest / (pack.n_distances - 1));
    const n = this.k.re.length, m = this.distances.length;
    this.bessel = { re: new Float64Array(n * m), im: new Float64Array(n * m) };
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < m; j++) {
        const r = this.distances[j];
        const [re, im] = r ? besselJ0(this.k.re[i] * r, this.k.im[i] * r) : [1, 0];
        this.bessel.re[i * m + j] = re;
        this.bessel.im[i * m + j] = im;
      }
    }
    this.height = null;
  }

  /** Table g (f, r) for a height in metre, as {re, im}. */
  table(height) {
    if (this.height === height) return this.g;
    const width = spotWidth(height), n = this.k.re.length, m = this.distances.length;
    const nf = this.frequencies.length;
    // kernel (k, r): J0 times k S(k) and the weights of the integration
    const kr = new Float64Array(n * m), ki = new Float64Array(n * m);
    for (let i = 0; i < n; i++) {
      const a = this.k.re[i], b = this.k.im[i];
      const damp = width * width * Math.exp(-(a * a - b * b) * width * width / 2);
      const turn = -a * b * width * width;
      const [sr, si] = [damp * Math.cos(turn), damp * Math.sin(turn)];
      const [pr, pi] = [sr * a - si * b, sr * b + si * a];
      const [wr, wi] = [pr * this.weights.re[i] - pi * this.weights.im[i],
        pr * this.weights.im[i] + pi * this.weights.re[i]];
      for (let j = i * m; j < (i + 1) * m; j++) {
        kr[j] = wr * this.bessel.re[j] - wi * this.bessel.im[j];
        ki[j] = wr * this.bessel.im[j] + wi * this.bessel.re[j];
      }
    }
    const re = new Float64Array(nf * m), im = new Float64Array(nf * m);
    for (let f = 0; f < nf; f++) {
      for (let i = 0; i < n; i++) {
        const a = this.G.re[f * n + i], b = this.G.im[f * n + i];
        const to = f * m, from = i * m;
        for (let j = 0; j < m; j++) {
          re[to + j] += a * kr[from + j] - b * ki[from + j];
          im[to + j] += a * ki[from + j] + b * kr[from + j];
        }
      }
    }
    this.height = height;
    this.g = { re, im };
    return this.g;
  }
}

/** Fractional index of a value among ascending ones, for cubics between them. */
const indexIn = (values, x) => {
  let low = 0, high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle; else high = middle;
  }
  return low;
};

/** Weights of the four neighbours, at indices first .. first + 3, of a cubic through them at x. */
function lagrange(values, x) {
  const first = Math.min(Math.max(indexIn(values, x) - 1, 0), values.length - 4);
  const at = [0, 1, 2, 3].map((k) => values[first + k]);
  return { first, shares: at.map((own, k) => at.reduce(
    (product, other, j) => (j === k ? product : product * (x - other) / (own - other)), 1)) };
}

/** g (r,) in m/Pa at a frequency in Hz, as {re, im}. */
export function alongDistance(body, height, frequency) {
  const g = body.table(height), m = body.distances.length;
  const re = new Float64Array(m), im = new Float64Array(m);
  const { first, shares } = lagrange(body.frequencies, frequency);
  shares.forEach((share, k) => {
    const from = (first + k) * m;
    for (let j = 0; j < m; j++) {
      re[j] += share * g.re[from + j];
      im[j] += share * g.im[from + j];
    }
  });
  return { re, im };
}

/** Complex motion {re, im} in metre of places for one line, by weights of a path's samples. */
export function lineMotion(body, g, w, samples, places) {
  const re = new Float64Array(places.x.length), im = new Float64Array(places.x.length);
  const step = body.distances[1], last = body.distances.length - 4;
  for (let p = 0; p < places.x.length; p++) {
    let a = 0, b = 0;
    for (let q = 0; q < samples.x.length; q++) {
      const r = Math.hypot(places.x[p] - samples.x[q], places.y[p] - samples.y[q]) / step;
      const first = Math.min(Math.max(Math.floor(r) - 1, 0), last), x = r - first;
      const s0 = -(x - 1) * (x - 2) * (x - 3) / 6, s1 = x * (x - 2) * (x - 3) / 2;
      const s2 = -x * (x - 1) * (x - 3) / 2, s3 = x * (x - 1) * (x - 2) / 6;
      const gr = s0 * g.re[first] + s1 * g.re[first + 1] + s2 * g.re[first + 2] + s3 * g.re[first + 3];
      const gi = s0 * g.im[first] + s1 * g.im[first + 1] + s2 * g.im[first + 2] + s3 * g.im[first + 3];
      a += gr * w.re[q] - gi * w.im[q];
      b += gr * w.im[q] + gi * w.re[q];
    }
    re[p] = a;
    im[p] = b;
  }
  return { re, im };
}
