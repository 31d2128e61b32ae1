// Motion of a laterally infinite body, by its compliance G over wavenumber and frequency:
//   g(r, f) = 1 / (2 pi) int S(k) G(k, f) J0(k r) k dk
// along a path of complex k, as skinwave.live.radial packs it.

import { samplesKey } from "./fields.js";
import { indexIn, lagrange, powerOfTwo, transform } from "./numeric.js";
import { drawingFrequency, gainAt, gainLines, levelFactor, loadLines, pathHarmonic, rhythmLevel,
  spotWidth } from "./load.js";

/** Bessel function J0 of a complex argument with a positive real part: [re, im], to about 1e-7. */
function besselJ0(a, b) {
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

const TAIL = 0.4; // s that motion may last after the load
const HIGHEST = 1200; // Hz up to which a body's motion from rest is computed
const FINER = 8; // places of a map's table in each interval of the distances
const LEVELS = 8; // of a rhythm that are averaged in a step
const NEGLIGIBLE = 1e-4; // of the largest harmonic of a path

/** Mean share of the pressure that the rhythm leaves in the step about a time in s, 0 before the start. */
function meanLevel(load, t, step) {
  let sum = 0;
  for (let k = 0; k < LEVELS; k++) {
    const at = t + ((k + 0.5) / LEVELS - 0.5) * step;
    if (at > 0) sum += levelFactor(load, rhythmLevel(load, at));
  }
  return sum / LEVELS;
}

/** First of four neighbours of x among ascending values, and their weights in a cubic through them. */
function neighbours(values, x) {
  const first = Math.min(Math.max(indexIn(values, x) - 1, 0), values.length - 4);
  return { first, shares: lagrange(values.slice(first, first + 4), x) };
}

/** Values from a place on, weighed by the four shares of neighbours. */
const weighed = (values, from, s) => s[0] * values[from] + s[1] * values[from + 1] + s[2] * values[from + 2]
  + s[3] * values[from + 3];

/** A laterally infinite body of a pack: frequencies (f,) in Hz, k (k,) and G (f, k) {re, im}. */
export class RadialBody {
  constructor(pack) {
    Object.assign(this, pack);
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
    this.shares = new Map(); // of a height
    this.known = new Map(); // g (r,) of a height and a frequency
  }

  respond(load) {
    return new RadialMotion(this, load);
  }

  /** Shares (k,) of the path of integration: S(k) k times the weights, for a height in metre. */
  spotShares(height) {
    if (!this.shares.has(height)) {
      if (this.shares.size > 8) this.shares.clear();
      const variance = spotWidth(height) ** 2, n = this.k.re.length;
      const re = new Float64Array(n), im = new Float64Array(n);
      let used = n;
      for (let i = 0; i < n; i++) {
        const a = this.k.re[i], b = this.k.im[i];
        const damp = variance * Math.exp(-(a * a - b * b) * variance / 2), turn = -a * b * variance;
        const sr = damp * Math.cos(turn), si = damp * Math.sin(turn);
        const pr = sr * a - si * b, pi = sr * b + si * a;
        const wr = this.weights.re[i], wi = this.weights.im[i];
        re[i] = pr * wr - pi * wi;
        im[i] = pr * wi + pi * wr;
        if (a * a * variance > 6.5 ** 2) { used = i; break; } // the spot has nothing beyond
      }
      this.shares.set(height, { re, im, used });
    }
    return this.shares.get(height);
  }

  /** Products (k,) of the compliance at a frequency in Hz and the shares of a height. */
  products(height, frequency) {
    const { re: sr, im: si, used } = this.spotShares(height), n = this.k.re.length;
    const re = new Float64Array(used), im = new Float64Array(used);
    const { first, shares } = neighbours(this.frequencies, frequency);
    for (let i = 0; i < used; i++) {
      let a = 0, b = 0;
      for (let k = 0, from = first * n + i; k < 4; k++, from += n) {
        a += shares[k] * this.G.re[from];
        b += shares[k] * this.G.im[from];
      }
      re[i] = a * sr[i] - b * si[i];
      im[i] = a * si[i] + b * sr[i];
    }
    return { re, im, used };
  }

  /** Motion g (r,) in m/Pa about a focal spot, at the distances, as {re, im}. */
  alongDistance(height, frequency) {
    const key = `${height} ${frequency}`;
    if (!this.known.has(key)) {
      if (this.known.size > 400) this.known.clear();
      const { re: pr, im: pi, used } = this.products(height, frequency), m = this.distances.length;
      const re = new Float64Array(m), im = new Float64Array(m), { re: br, im: bi } = this.bessel;
      for (let i = 0; i < used; i++) {
        const a = pr[i], b = pi[i];
        for (let j = 0, from = i * m; j < m; j++, from++) {
          re[j] += a * br[from] - b * bi[from];
          im[j] += a * bi[from] + b * br[from];
        }
      }
      this.known.set(key, { re, im });
    }
    return this.known.get(key);
  }

  /** Bessel functions J0(k r) (used, r) at distances (r,) in metre, by cubics, as {re, im}. */
  besselAt(distances, used) {
    const m = this.distances.length, count = distances.length;
    const re = new Float64Array(used * count), im = new Float64Array(used * count);
    for (let q = 0; q < count; q++) {
      const { first, shares } = neighbours(this.distances, distances[q]);
      for (let i = 0, from = first, to = q; i < used; i++, from += m, to += count) {
        re[to] = weighed(this.bessel.re, from, shares);
        im[to] = weighed(this.bessel.im, from, shares);
      }
    }
    return { re, im };
  }
}

/** Motion of a laterally infinite body under a load. */
class RadialMotion {
  constructor(body, load) {
    this.body = body;
    this.load = load;
    this.lines = loadLines(load);
    this.f = this.lines.f;
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const harmonics = new Map(this.harmonicsAt(x, y)), { parts } = this.lines;
    const re = new Float64Array(this.f.length), im = new Float64Array(this.f.length);
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
    const x = new Float64Array(xs.length * ys.length), y = new Float64Array(x.length);
    for (let k = 0; k < x.length; k++) {
      x[k] = xs[k % xs.length];
      y[k] = ys[Math.floor(k / xs.length)];
    }
    return this.places(x, y);
  }

  /** Complex amplitudes (l, p) in metre at places (p,), by the nearest entry of a fine table. */
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
    const tr = new Float32Array(fine), ti = new Float32Array(fine);
    const stencils = Array.from({ length: fine }, (_, j) => neighbours(body.distances, j * step));
    this.f.forEach((f, l) => {
      const g = body.alongDistance(load.height, f), { re: wr, im: wi } = w[l];
      for (let j = 0; j < fine; j++) {
        const { first, shares } = stencils[j];
        tr[j] = weighed(g.re, first, shares);
        ti[j] = weighed(g.im, first, shares);
      }
      for (let p = 0, k = 0, to = l * n; p < n; p++, to++) {
        let a = 0, b = 0;
        for (let q = 0; q < count; q++, k++) {
          const gr = tr[index[k]], gi = ti[index[k]];
          a += gr * wr[q] - gi * wi[q];
          b += gr * wi[q] + gi * wr[q];
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
   * u(w) = sum_n h_n(w) Q(w - n w_d), where Q is the transform of the pressure of a focus and h_n
   * the harmonic n of the path; the load ends with the times, and motion after it is padded for.
   */
  waveform(x, y, times) {
    const { body, load } = this, n = times.length, dt = times[1] - times[0];
    const coarser = Math.max(1, Math.floor(2e-4 / dt)), step = coarser * dt;
    const given = Math.ceil(n / coarser), size = powerOfTwo(given + Math.round(TAIL / step));
    const bins = Math.min(size / 2, Math.floor(HIGHEST * size * step) + 1);
    const gain = Float64Array.from({ length: given },
      (_, k) => gainAt(load, k * step) * meanLevel(load, k * step, step));
    const harmonics = this.harmonicsAt(x, y);
    const stencils = Array.from({ length: bins }, (_, k) => neighbours(body.frequencies, k / (size * step)));
    const ur = new Float64Array(size * coarser), ui = new Float64Array(size * coarser);
    const fd = drawingFrequency(load.path), qr = new Float64Array(size), qi = new Float64Array(size);
    for (const [order, { re, im }] of harmonics) {
      qr.fill(0);
      qi.fill(0);
      for (let k = 0; k < given; k++) {
        const turn = 2 * Math.PI * ((order * fd * k * step) % 1);
        qr[k] = gain[k] * Math.cos(turn);
        qi[k] = gain[k] * Math.sin(turn);
      }
      transform(qr, qi);
      for (let k = 0; k < bins; k++) {
        const { first, shares } = stencils[k];
        const a = weighed(re, first, shares), b = weighed(im, first, shares);
        ur[k] += a * qr[k] - b * qi[k];
        ui[k] += a * qi[k] + b * qr[k];
      }
    }
    // The transform of a real signal, from that at positive frequencies.
    for (let k = 1; k < bins; k++) {
      ur[ur.length - k] = ur[k];
      ui[ui.length - k] = -ui[k];
    }
    ui[0] = 0;
    transform(ur, ui, true);
    return ur.subarray(0, n).map((value) => value / size);
  }

  /** Harmonics [order, {re, im} (f,)] of the path as a place sees them, at the pack's frequencies. */
  harmonicsAt(x, y) {
    const { body, load, lines: { samples } } = this;
    const count = samples.x.length, fd = drawingFrequency(load.path);
    const tones = Math.max(...gainLines(load).map(({ f }) => Math.abs(f)));
    const most = fd > 0 ? Math.min(Math.floor((HIGHEST + tones) / fd), Math.floor((count - 1) / 2)) : 0;
    const key = JSON.stringify([x, y, samplesKey(load, samples), load.foci]);
    if (body.seen?.key === key && body.seen.most >= most) {
      return body.seen.harmonics.filter(([order]) => Math.abs(order) <= most);
    }
    const { used } = body.spotShares(load.height);
    const away = Float64Array.from(samples.x, (own, q) => Math.hypot(x - own, y - samples.y[q]));
    const bessel = body.besselAt(away, used), nf = body.frequencies.length;
    const found = [];
    for (let order = -most; order <= most; order++) {
      const { re: wr, im: wi } = pathHarmonic(load, order, count);
      const re = new Float64Array(used), im = new Float64Array(used);
      let size = 0;
      for (let i = 0, k = 0; i < used; i++) {
        for (let q = 0; q < count; q++, k++) {
          re[i] += bessel.re[k] * wr[q] - bessel.im[k] * wi[q];
          im[i] += bessel.re[k] * wi[q] + bessel.im[k] * wr[q];
        }
      }
      const spot = body.spotShares(load.height);
      for (let i = 0; i < used; i++) {
        size += Math.hypot(re[i], im[i]) * Math.hypot(spot.re[i], spot.im[i]);
        [re[i], im[i]] = [re[i] * spot.re[i] - im[i] * spot.im[i], re[i] * spot.im[i] + im[i] * spot.re[i]];
      }
      found.push([order, { re, im }, size]);
    }
    const largest = Math.max(...found.map(([, , size]) => size)), n = body.k.re.length;
    const harmonics = found.filter(([, , size]) => size > NEGLIGIBLE * largest).map(([order, h]) => {
      const re = new Float64Array(nf), im = new Float64Array(nf);
      for (let f = 0; f < nf; f++) {
        let a = 0, b = 0;
        for (let i = 0, from = f * n; i < used; i++, from++) {
          a += body.G.re[from] * h.re[i] - body.G.im[from] * h.im[i];
          b += body.G.re[from] * h.im[i] + body.G.im[from] * h.re[i];
        }
        re[f] = a;
        im[f] = b;
      }
      return [order, { re, im }];
    });
    body.seen = { key, most, harmonics };
    return harmonics;
  }
}
