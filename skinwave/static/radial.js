// Motion of a laterally infinite body by its compliance G over wavenumber and frequency. At a distance r
// from a focal spot it is
//   g(r, f) = 1 / (2 pi) int S(k) G(k, f) J0(k r) k dk
// along a path of complex k (see skinwave.live.radial).

import { samplesKey } from "./fields.js";
import { addTimes, cached, complexFrom, indexIn, lagrange, powerOfTwo, transform, zeros } from "./numeric.js";
import { drawingFrequency, gainAt, gainLines, loadLines, meanFactor, pathHarmonic,
  spotWidth } from "./load.js";

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

const TAIL = 0.4; // s: motion after the load has died away by then
const HIGHEST = 1200; // Hz up to which a body's motion from rest is computed
const FINER = 8; // distances of a map's table in each interval of the pack's distances
const LEVELS = 8; // of a rhythm, averaged in a time step
const NEGLIGIBLE_HARMONIC = 1e-4; // of the largest harmonic of a path
const BROADEST = 6.5; // over the width of a spot: its transform is negligible at larger wavenumbers

/** Index of the first of four neighbours of x in ascending values, and their weights in a cubic. */
function neighbours(values, x) {
  const first = Math.min(Math.max(indexIn(values, x) - 1, 0), values.length - 4);
  return { first, shares: lagrange(values.slice(first, first + 4), x) };
}

/** Sum of four values from an index on, with the weights of neighbours. */
const weighed = (values, from, s) => s[0] * values[from] + s[1] * values[from + 1] + s[2] * values[from + 2]
  + s[3] * values[from + 3];

/** A laterally infinite body: frequencies (f,) in Hz, wavenumbers k (k,) in 1/m and G (f, k) in m/Pa. */
export class RadialBody {
  constructor(pack) {
    Object.assign(this, pack, { tables: new Map() });
    this.distances = Float64Array.from({ length: pack.n_distances },
      (_, j) => j * pack.furthest / (pack.n_distances - 1));
    const { re, im } = this.k, m = this.distances.length;
    this.bessel = complexFrom(re.length * m, (j) => {
      const i = Math.floor(j / m), r = this.distances[j % m];
      return r ? besselJ0(re[i] * r, im[i] * r) : [1, 0];
    });
  }

  motion(load) { return new RadialMotion(this, load); }

  /** Factors {re, im} of G in the integral, S(k) k times the weights, for a height of the focus in metre. */
  spotFactors(height) {
    const variance = spotWidth(height) ** 2;
    const used = this.k.re.findIndex((a) => a * a * variance > BROADEST ** 2);
    return complexFrom(used < 0 ? this.k.re.length : used, (i) => {
      const a = this.k.re[i], b = this.k.im[i], wr = this.weights.re[i], wi = this.weights.im[i];
      const damp = variance * Math.exp(-(a * a - b * b) * variance / 2), angle = -a * b * variance;
      const sr = damp * Math.cos(angle), si = damp * Math.sin(angle);
      const pr = sr * a - si * b, pi = sr * b + si * a;
      return [pr * wr - pi * wi, pr * wi + pi * wr];
    });
  }

  /** Motion g {re, im} (f, r) in m/Pa at the distances from a focal spot, for a height in metre. */
  table(height) {
    return cached(this.tables, height, () => {
      const { re: sr, im: si } = this.spotFactors(height), { re: br, im: bi } = this.bessel;
      const nf = this.frequencies.length, n = this.k.re.length, m = this.distances.length;
      const { re, im } = zeros(nf * m);
      for (let f = 0; f < nf; f++) {
        for (let i = 0; i < sr.length; i++) {
          const gr = this.G.re[f * n + i], gi = this.G.im[f * n + i];
          const a = gr * sr[i] - gi * si[i], b = gr * si[i] + gi * sr[i];
          for (let to = f * m, from = i * m; to < (f + 1) * m; to++, from++) {
            re[to] += a * br[from] - b * bi[from];
            im[to] += a * bi[from] + b * br[from];
          }
        }
      }
      return { re, im };
    }, 3);
  }
}

/** Motion of a laterally infinite body under a load. */
class RadialMotion {
  constructor(body, load) {
    Object.assign(this, { body, load, lines: loadLines(load) });
    this.f = this.lines.f;
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const harmonics = new Map(this.harmonicsAt(x, y)), { parts } = this.lines;
    const { re, im } = zeros(this.f.length);
    this.f.forEach((f, l) => {
      const { first, shares } = neighbours(this.body.frequencies, f);
      for (const part of parts[l]) {
        const h = harmonics.get(part.n);
        if (!h) continue;
        const a = weighed(h.re, first, shares), b = weighed(h.im, first, shares);
        re[l] += 2 * (a * part.re - b * part.im);
        im[l] += 2 * (a * part.im + b * part.re);
      }
    });
    return { re, im };
  }

  /** Complex amplitudes (l, y, x) in metre on a grid. */
  onGrid(xs, ys) {
    const x = Float64Array.from({ length: xs.length * ys.length }, (_, k) => xs[k % xs.length]);
    return this.places(x, x.map((_, k) => ys[Math.floor(k / xs.length)]));
  }

  /** Complex amplitudes (l, p) in metre at places (p,), from the nearest entry of a fine table. */
  places(x, y) {
    const { body, load, lines: { w, samples } } = this, count = samples.x.length, n = x.length;
    const m = body.distances.length, step = body.distances[1] / FINER, fine = FINER * (m - 1) + 1;
    const index = new Uint16Array(n * count);
    for (let p = 0, k = 0; p < n; p++) {
      for (let q = 0; q < count; q++, k++) {
        index[k] = Math.min(Math.hypot(x[p] - samples.x[q], y[p] - samples.y[q]) / step + 0.5, fine - 1);
      }
    }
    const re = new Float32Array(this.f.length * n), im = new Float32Array(this.f.length * n);
    const g = body.table(load.height), [tr, ti] = [new Float32Array(fine), new Float32Array(fine)];
    const stencils = Array.from({ length: fine }, (_, j) => neighbours(body.distances, j * step));
    this.f.forEach((f, l) => {
      const { first: row, shares: ofRows } = neighbours(body.frequencies, f), { re: wr, im: wi } = w[l];
      const [gr, gi] = [g.re, g.im].map((own) => Float64Array.from({ length: m }, (_, j) => (
        ofRows.reduce((sum, share, k) => sum + share * own[(row + k) * m + j], 0))));
      for (let j = 0; j < fine; j++) {
        const { first, shares } = stencils[j];
        tr[j] = weighed(gr, first, shares);
        ti[j] = weighed(gi, first, shares);
      }
      for (let p = 0, k = 0, to = l * n; p < n; p++, to++) {
        let a = 0, b = 0;
        for (let q = 0; q < count; q++, k++) {
          const c = tr[index[k]], s = ti[index[k]];
          a += c * wr[q] - s * wi[q];
          b += c * wi[q] + s * wr[q];
        }
        re[to] = a;
        im[to] = b;
      }
    });
    return { re, im };
  }

  /**
   * Motion (t,) in metre of a place from rest, at equally spaced times (t,) in s from 0.
   *
   * u(w) = sum_n h_n(w) Q(w - n w_d), where Q is the transform of the pressure of a focus and h_n the
   * harmonic n of the path. The load ends with the times; the transform has room for the motion after it.
   */
  waveform(x, y, times) {
    const { body, load } = this, n = times.length, dt = times[1] - times[0];
    const coarser = Math.max(1, Math.floor(2e-4 / dt)), step = coarser * dt;
    const given = Math.ceil(n / coarser), size = powerOfTwo(given + Math.round(TAIL / step));
    const bins = Math.min(size / 2, Math.floor(HIGHEST * size * step) + 1);
    const gain = Float64Array.from({ length: given },
      (_, k) => gainAt(load, k * step) * meanFactor(load, (k - 0.5) * step, (k + 0.5) * step, LEVELS));
    const harmonics = this.harmonicsAt(x, y);
    const stencils = Array.from({ length: bins }, (_, k) => neighbours(body.frequencies, k / (size * step)));
    const { re: ur, im: ui } = zeros(size * coarser), { re: qr, im: qi } = zeros(size);
    const fd = drawingFrequency(load.path);
    for (const [order, { re, im }] of harmonics) {
      qr.fill(0);
      qi.fill(0);
      for (let k = 0; k < given; k++) {
        const angle = 2 * Math.PI * ((order * fd * k * step) % 1);
        qr[k] = gain[k] * Math.cos(angle);
        qi[k] = gain[k] * Math.sin(angle);
      }
      transform(qr, qi);
      for (let k = 0; k < bins; k++) {
        const { first, shares } = stencils[k];
        const a = weighed(re, first, shares), b = weighed(im, first, shares);
        ur[k] += a * qr[k] - b * qi[k];
        ui[k] += a * qi[k] + b * qr[k];
      }
    }
    // The motion is real: negative frequencies have the conjugate values.
    for (let k = 1; k < bins; k++) {
      ur[ur.length - k] = ur[k];
      ui[ui.length - k] = -ui[k];
    }
    ui[0] = 0;
    transform(ur, ui, true);
    return ur.subarray(0, n).map((value) => value / size);
  }

  /** Harmonics [order, {re, im} (f,)] of the path at a place, in m/Pa at the pack's frequencies. */
  harmonicsAt(x, y) {
    const { body, load, lines: { samples } } = this;
    const count = samples.x.length, fd = drawingFrequency(load.path);
    const tones = Math.max(...gainLines(load).map(({ f }) => Math.abs(f)));
    const most = fd > 0 ? Math.min(Math.floor((HIGHEST + tones) / fd), Math.floor((count - 1) / 2)) : 0;
    const key = JSON.stringify([x, y, samplesKey(load, samples), load.foci]);
    if (body.latest?.key !== key || body.latest.most < most) {
      const passing = this.passing(x, y), all = [];
      for (let order = -most; order <= most; order++) all.push(harmonic(passing, order, load));
      const largest = Math.max(...all.map(({ size }) => size));
      const harmonics = all.filter(({ size }) => size > NEGLIGIBLE_HARMONIC * largest);
      body.latest = { key, most, harmonics: harmonics.map(({ order, re, im }) => [order, { re, im }]) };
    }
    return body.latest.harmonics.filter(([order]) => Math.abs(order) <= most);
  }

  /** Motion g [{re, im} (f,)] in m/Pa at a place, for a focal spot at each sample of the path. */
  passing(x, y) {
    const { body, load, lines: { samples } } = this, m = body.distances.length, g = body.table(load.height);
    return Array.from(samples.x, (own, q) => {
      const { first, shares } = neighbours(body.distances, Math.hypot(x - own, y - samples.y[q]));
      const along = (values) => Float64Array.from(body.frequencies,
        (_, f) => weighed(values, f * m + first, shares));
      return { re: along(g.re), im: along(g.im) };
    });
  }
}

/** A harmonic of the path {order, re, im (f,), size} of motions at a place for each sample of the path. */
function harmonic(passing, order, load) {
  const w = pathHarmonic(load, order, passing.length), sum = zeros(passing[0].re.length), { re, im } = sum;
  passing.forEach((g, q) => addTimes(sum, [w.re[q], w.im[q]], g));
  return { order, re, im, size: Math.max(...re.map((value, f) => Math.hypot(value, im[f]))) };
}
