// Fields of bounded bodies on a square grid, and their motion under a load. Value m of place p is at
// [p * count + m].

import { loadLines, spotWidth } from "./load.js";
import { addTimes, cached, complexFrom, lagrange, product, quotients, zeros } from "./numeric.js";
import { oscillation, underRhythm } from "./time.js";

const POINTS = 8, STEPS = Array.from({ length: POINTS }, (_, k) => k); // of polynomials between places
const PATH_PLACES = 12, NEGLIGIBLE_ON_MAPS = 2e-3; // places of the path; of the strongest line there

/** The square grid of a pack: its places, and which of them are on the body. */
export class Grid {
  constructor({ step, side, inside }) {
    Object.assign(this, { step, side, inside, half: step * (side - 1) / 2 });
  }

  /** Whether the place of the grid nearest to x, y in metre is on the body. */
  isInside(x, y) {
    const column = Math.round((x + this.half) / this.step), row = Math.round((y + this.half) / this.step);
    if (column < 0 || row < 0 || column >= this.side || row >= this.side) return false;
    return this.inside[row * this.side + column] === "1";
  }

  /** Places of the grid around x, y in metre, and their weights in an interpolated value. */
  stencil(x, y) {
    const across = neighbours((x + this.half) / this.step, this.side);
    const along = neighbours((y + this.half) / this.step, this.side);
    const places = new Int32Array(POINTS * POINTS), shares = new Float64Array(POINTS * POINTS);
    for (let j = 0, k = 0; j < POINTS; j++) {
      for (let i = 0; i < POINTS; i++, k++) {
        places[k] = (along.first + j) * this.side + across.first + i;
        shares[k] = along.weights[j] * across.weights[i];
      }
    }
    return { places, shares };
  }

  /** Values (count,) at x, y in metre of fields with `count` values at each place. */
  at(fields, count, x, y) {
    const { places, shares } = this.stencil(x, y), out = new Float64Array(count);
    for (let k = 0; k < places.length; k++) {
      const share = shares[k];
      for (let m = 0, from = places[k] * count; m < count; m++, from++) out[m] += share * fields[from];
    }
    return out;
  }

  /** Lines {re, im} (l, y, x) at other places, from those of the grid (l, p); NaN off the body. */
  resampled(lines, count, xs, ys) {
    const n = xs.length * ys.length, own = this.side * this.side;
    const stencils = Array.from({ length: n }, (_, k) => {
      const x = xs[k % xs.length], y = ys[Math.floor(k / xs.length)];
      return this.isInside(x, y) ? this.stencil(x, y) : null;
    });
    const [re, im] = [lines.re, lines.im].map((values) => {
      const made = new Float32Array(count * n);
      for (let l = 0, to = 0; l < count; l++) {
        for (let k = 0; k < n; k++, to++) made[to] = interpolated(values, l * own, stencils[k]);
      }
      return made;
    });
    return { re, im };
  }

  /** Fields smoothed by a Gaussian spot of 1 Pa and this width in metre: its forces on them. */
  smoothed(fields, count, width) {
    const { side, step } = this, reach = Math.ceil(5 * width / step);
    const taps = Float64Array.from({ length: 2 * reach + 1 },
      (_, k) => step * Math.exp(-(((k - reach) * step / width) ** 2) / 2));
    const pass = (from, stride, other) => {
      const out = new Float32Array(from.length);
      for (let a = 0; a < side; a++) {
        for (let b = 0; b < side; b++) {
          const to = (a * other + b * stride) * count;
          for (let j = Math.max(b - reach, 0); j <= Math.min(b + reach, side - 1); j++) {
            const tap = taps[j - b + reach], own = (a * other + j * stride) * count;
            for (let m = 0; m < count; m++) out[to + m] += tap * from[own + m];
          }
        }
      }
      return out;
    };
    return pass(pass(fields, 1, side), side, 1);
  }
}

/** Value at a stencil of the values that begin at an index; NaN without a stencil. */
function interpolated(values, from, stencil) {
  if (!stencil) return NaN;
  const { places, shares } = stencil;
  let sum = 0;
  for (let j = 0; j < places.length; j++) sum += shares[j] * values[from + places[j]];
  return sum;
}

/** Index of the first of POINTS neighbours of a place in steps of the grid, and their weights. */
function neighbours(place, side) {
  const first = Math.min(Math.max(Math.floor(place) - POINTS / 2 + 1, 0), side - POINTS);
  return { first, weights: lagrange(STEPS, Math.min(Math.max(place, 0), side - 1) - first) };
}

/** Fields (places, m), zero off the body, from rows (m, places on the body) of a pack. */
export function byPlace(rows, count, inside) {
  const out = new Float32Array(inside.length * count);
  for (let p = 0, k = 0; p < inside.length; p++) {
    if (inside[p] !== "1") continue;
    for (let m = 0, from = k, step = rows.length / count; m < count; m++, from += step) {
      out[p * count + m] = rows[from];
    }
    k++;
  }
  return out;
}

/** Forces of a focal spot on the fields through which the load acts on a body. */
export class PathForces {
  constructor(grid, fields, width) {
    Object.assign(this, { grid, fields, width, smoothed: new Map(), paths: new Map() });
  }

  /** Forces (q, width) of 1 Pa at the samples of a path. */
  along(load, samples) {
    const { grid, width } = this, count = samples.x.length;
    return cached(this.paths, samplesKey(load, samples), () => {
      const fields = cached(this.smoothed, load.height,
        () => grid.smoothed(this.fields, width, spotWidth(load.height)), 4);
      const forces = new Float32Array(count * width);
      for (let q = 0; q < count; q++) {
        forces.set(grid.at(fields, width, samples.x[q], samples.y[q]), q * width);
      }
      return forces;
    }, 4);
  }
}

/**
 * Motion of a body under a load. The body has `values` of its fields (place, width), PathForces as `pushed`
 * and `solve(f, force)`, which gives the complex amplitudes of the fields. For motion from rest it has
 * `poles` (p,), `onPoles(force)`, the forces on them {ahead, back} at positive and negative frequency, and
 * `outputs(values)`, the poles' fields at a place.
 */
export class FieldMotion {
  constructor(body, load) {
    Object.assign(this, { body, load, lines: loadLines(load, { lowest: 0 }) });
    const { f, w, samples } = this.lines, { width } = body, along = body.pushed.along(load, samples);
    this.forces = w.map(({ re: wr, im: wi }) => {
      const { re, im } = zeros(width);
      for (let q = 0, k = 0; q < wr.length; q++) {
        const a = wr[q], b = wi[q];
        for (let m = 0; m < width; m++, k++) {
          re[m] += a * along[k];
          im[m] += b * along[k];
        }
      }
      return { re, im };
    });
    this.amplitudes = this.forces.map((force, l) => body.solve(f[l], force));
    this.first = f[0] === 0 ? 1 : 0; // `f` leaves out the mean
    this.f = f.slice(this.first);
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const own = this.body.grid.at(this.body.values, this.body.width, x, y);
    return complexFrom(this.f.length, (l) => summed(own, this.amplitudes[l + this.first]));
  }

  /** Complex amplitudes (l, y, x) in metre on a grid. */
  onGrid(xs, ys) {
    const { values, width, grid } = this.body, n = grid.side ** 2;
    const re = new Float32Array(this.f.length * n), im = new Float32Array(re.length);
    for (const l of mappedLines(this)) {
      const { re: qr, im: qi } = this.amplitudes[l + this.first];
      for (let p = 0, k = 0; p < n; p++) {
        let a = 0, b = 0;
        for (let m = 0; m < width; m++, k++) {
          a += values[k] * qr[m];
          b += values[k] * qi[m];
        }
        re[l * n + p] = a;
        im[l * n + p] = b;
      }
    }
    return grid.resampled({ re, im }, this.f.length, xs, ys);
  }

  /** Motion (t,) in metre of a place from rest, at equally spaced times (t,) in s from 0. */
  waveform(x, y, times) {
    const { body, lines: { f } } = this, own = body.grid.at(body.values, body.width, x, y);
    const outputs = body.outputs(own);
    this.states ??= this.forces.map((force, l) => overPoles(body.poles, body.onPoles(force), f[l]));
    const steady = oscillation(f, this.amplitudes.map((each) => summed(own, each)), times);
    const lag = () => oscillation(f, this.states.map((state, l) => (
      stateAt(outputs, overPoles(body.poles, state, f[l])))), times);
    return underRhythm(this.load, times, steady, lag,
      (start, jump, bend) => ({ poles: body.poles, amplitudes: this.startOf(outputs, start, jump, bend) }));
  }

  /** Complex amplitudes (p,) of exp(pole t) at a place after a jump and a bend of the level. */
  startOf(outputs, start, jump, bend) {
    const { body } = this, own = zeros(outputs.re.length), { re, im } = own;
    this.lines.f.forEach((f, l) => {
      const angle = 2 * Math.PI * f * start;
      const add = ({ ahead, back }, share) => {
        const c = share * Math.cos(angle), s = share * Math.sin(angle);
        addTimes(own, [c, s], ahead);
        addTimes(own, [c, -s], back);
      };
      add(this.states[l], -jump);
      if (bend) add(overPoles(body.poles, this.states[l], f), bend);
    });
    body.addCoupled?.(own, this, start, jump);
    return complexFrom(re.length, (p) => [re[p] * outputs.re[p] - im[p] * outputs.im[p],
      re[p] * outputs.im[p] + im[p] * outputs.re[p]]);
  }
}

/** States {ahead / (i w - pole), back / (-i w - pole)} (p,) at a frequency in Hz. */
export function overPoles(poles, { ahead, back }, f) {
  const omega = 2 * Math.PI * f, over = (values, w) => quotients(values,
    { re: poles.re.map((own) => -own), im: poles.im.map((own) => w - own) });
  return { ahead: over(ahead, omega), back: over(back, -omega) };
}

/** Sum [re, im] over poles of outputs times the state ahead plus the conjugate for the state back. */
function stateAt(outputs, { ahead, back }) {
  const [[a, b], [c, d]] = [ahead, back].map((each) => product(outputs, each));
  return [a + c, b - d];
}

/** Sum [re, im] of real fields at a place times complex amplitudes. */
function summed(own, { re, im }) {
  let a = 0, b = 0;
  for (let m = 0; m < own.length; m++) {
    a += own[m] * re[m];
    b += own[m] * im[m];
  }
  return [a, b];
}

/** Indices of the lines of a motion that maps show: those that are not negligible along the path. */
function mappedLines(motion) {
  const { x, y } = motion.lines.samples, step = Math.ceil(x.length / PATH_PLACES);
  const largest = new Float64Array(motion.f.length);
  for (let q = 0; q < x.length; q += step) {
    const { re, im } = motion.at(x[q], y[q]);
    re.forEach((value, l) => { largest[l] = Math.max(largest[l], Math.hypot(value, im[l])); });
  }
  const strongest = Math.max(...largest);
  return [...largest.keys()].filter((l) => largest[l] > NEGLIGIBLE_ON_MAPS * strongest);
}

/** Key that is the same for loads with the same samples of the path, at any speed. */
export const samplesKey = ({ path, foci, height }, { x }) => JSON.stringify([
  { ...path, speed: Boolean(path.speed), drawn: 0 }, foci.length > 1 ? foci : 1, height, x.length]);
