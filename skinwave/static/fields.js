// Fields of bounded bodies on a square grid, place after place: value m of place p at [p * count + m],
// and their motion under a load.

import { loadLines, spotWidth } from "./load.js";
import { divided, lagrange } from "./numeric.js";
import { oscillation, underRhythm } from "./time.js";

const POINTS = 8, STEPS = Array.from({ length: POINTS }, (_, k) => k); // of polynomials between places
const LOOKED = 12, UNHEARD = 2e-3; // places of the path, and the share of the strongest line there

/** The square grid of a pack, its places and what is on the body. */
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

  /** Places of the grid about x, y in metre, and their shares in an interpolated value. */
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

  /** Values (count,) at a place of fields with `count` values at each. */
  at(fields, count, x, y) {
    const { places, shares } = this.stencil(x, y), found = new Float64Array(count);
    for (let k = 0; k < places.length; k++) {
      const share = shares[k];
      for (let m = 0, from = places[k] * count; m < count; m++, from++) found[m] += share * fields[from];
    }
    return found;
  }

  /** Lines {re, im} (l, p) of the grid's places at others (l, y, x); not a number off the body. */
  resampled({ re, im }, count, xs, ys) {
    const n = xs.length * ys.length, own = this.side * this.side;
    const found = { re: new Float32Array(count * n), im: new Float32Array(count * n) };
    for (let k = 0; k < n; k++) {
      const x = xs[k % xs.length], y = ys[Math.floor(k / xs.length)], on = this.isInside(x, y);
      const { places, shares } = on ? this.stencil(x, y) : {};
      for (let l = 0; l < count; l++) {
        let a = on ? 0 : NaN, b = a;
        for (let j = 0; on && j < places.length; j++) {
          a += shares[j] * re[l * own + places[j]];
          b += shares[j] * im[l * own + places[j]];
        }
        found.re[l * n + k] = a;
        found.im[l * n + k] = b;
      }
    }
    return found;
  }

  /** Fields under a Gaussian of amplitude 1 and this width in metre: forces of a focal spot of 1 Pa. */
  smoothed(fields, count, width) {
    const { side, step } = this, reach = Math.ceil(5 * width / step);
    const taps = Float64Array.from({ length: 2 * reach + 1 },
      (_, k) => step * Math.exp(-(((k - reach) * step / width) ** 2) / 2));
    const pass = (from, stride, other) => {
      const found = new Float32Array(from.length);
      for (let a = 0; a < side; a++) {
        for (let b = 0; b < side; b++) {
          const to = (a * other + b * stride) * count;
          for (let j = Math.max(b - reach, 0); j <= Math.min(b + reach, side - 1); j++) {
            const tap = taps[j - b + reach], own = (a * other + j * stride) * count;
            for (let m = 0; m < count; m++) found[to + m] += tap * from[own + m];
          }
        }
      }
      return found;
    };
    return pass(pass(fields, 1, side), side, 1);
  }
}

/** Weights of POINTS neighbours of a place (in steps of the grid) and the first of them. */
function neighbours(place, side) {
  const first = Math.min(Math.max(Math.floor(place) - POINTS / 2 + 1, 0), side - POINTS);
  return { first, weights: lagrange(STEPS, Math.min(Math.max(place, 0), side - 1) - first) };
}

/** Rows (m, places on the body) as they are packed, place after place; zero off the body. */
export function byPlace(rows, count, inside) {
  const found = new Float32Array(inside.length * count);
  for (let p = 0, k = 0; p < inside.length; p++) {
    if (inside[p] !== "1") continue;
    for (let m = 0, from = k, step = rows.length / count; m < count; m++, from += step) {
      found[p * count + m] = rows[from];
    }
    k++;
  }
  return found;
}

/** Forces of a focal spot on the fields of a body that take up the load. */
export class PathForces {
  constructor(grid, fields, width) {
    Object.assign(this, { grid, fields, width, smoothed: new Map(), paths: new Map() });
  }

  /** Forces (q, width) of 1 Pa at the samples of a path. */
  along(load, samples) {
    const { grid, width } = this, count = samples.x.length;
    return kept(this.paths, samplesKey(load, samples), () => {
      const fields = kept(this.smoothed, load.height,
        () => grid.smoothed(this.fields, width, spotWidth(load.height)));
      const forces = new Float32Array(count * width);
      for (let q = 0; q < count; q++) {
        forces.set(grid.at(fields, width, samples.x[q], samples.y[q]), q * width);
      }
      return forces;
    });
  }
}

/** Value of a key in a map that keeps a few; made if it is not there. */
function kept(known, key, make) {
  if (!known.has(key)) {
    if (known.size > 3) known.clear();
    known.set(key, make());
  }
  return known.get(key);
}

/**
 * Motion of a body under a load. The body has `values` of its fields (place, width), their `pushed`
 * PathForces and `solve(f, force)`, the complex amplitudes of the fields; for motion from rest, `poles`
 * (p,), the forces on them {ahead, back} of a line at positive and negative frequency, and `outputs`.
 */
export class FieldMotion {
  constructor(body, load) {
    Object.assign(this, { body, load, lines: loadLines(load, { lowest: 0, most: 120 }) });
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
    this.first = f[0] === 0 ? 1 : 0; // after the mean
    this.f = f.slice(this.first);
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const own = this.body.grid.at(this.body.values, this.body.width, x, y), found = zeros(this.f.length);
    for (let l = 0; l < this.f.length; l++) {
      [found.re[l], found.im[l]] = summed(own, this.amplitudes[l + this.first]);
    }
    return found;
  }

  /** Complex amplitudes (l, y, x) in metre on a grid. */
  onGrid(xs, ys) {
    const { values, width, grid } = this.body, n = grid.side ** 2;
    const re = new Float32Array(this.f.length * n), im = new Float32Array(re.length);
    for (const l of heard(this)) {
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
      read(outputs, overPoles(body.poles, state, f[l])))), times);
    return underRhythm(this.load, times, steady, lag,
      (start, jump, bend) => ({ poles: body.poles, amplitudes: this.startOf(outputs, start, jump, bend) }));
  }

  /** Complex amplitudes (p,) of exp(pole t) at a place after a jump and a bend of the level. */
  startOf(outputs, start, jump, bend) {
    const { body } = this, found = zeros(outputs.re.length), { re, im } = found;
    this.lines.f.forEach((f, l) => {
      const turn = 2 * Math.PI * f * start, c = Math.cos(turn), s = Math.sin(turn);
      const add = ({ ahead, back }, share) => {
        for (let p = 0; p < re.length; p++) {
          re[p] += share * ((ahead.re[p] + back.re[p]) * c - (ahead.im[p] - back.im[p]) * s);
          im[p] += share * ((ahead.im[p] + back.im[p]) * c + (ahead.re[p] - back.re[p]) * s);
        }
      };
      add(this.states[l], -jump);
      if (bend) add(overPoles(body.poles, this.states[l], f), bend);
    });
    body.addCoupled?.(found, this, start, jump);
    for (let p = 0; p < re.length; p++) {
      [re[p], im[p]] = [re[p] * outputs.re[p] - im[p] * outputs.im[p],
        re[p] * outputs.im[p] + im[p] * outputs.re[p]];
    }
    return found;
  }
}

export const zeros = (count) => ({ re: new Float64Array(count), im: new Float64Array(count) });

/** States ahead / (i w - pole) and back / (-i w - pole) (p,) at a frequency in Hz. */
export function overPoles(poles, { ahead, back }, f) {
  const omega = 2 * Math.PI * f, over = ({ re, im }, w) => {
    const found = zeros(re.length);
    for (let p = 0; p < re.length; p++) {
      [found.re[p], found.im[p]] = divided(re[p], im[p], -poles.re[p], w - poles.im[p]);
    }
    return found;
  };
  return { ahead: over(ahead, omega), back: over(back, -omega) };
}

/** Sum [re, im] over poles of outputs times a state ahead, and the conjugate of that back. */
function read(outputs, { ahead, back }) {
  let a = 0, b = 0;
  for (let p = 0; p < outputs.re.length; p++) {
    a += outputs.re[p] * (ahead.re[p] + back.re[p]) - outputs.im[p] * (ahead.im[p] + back.im[p]);
    b += outputs.re[p] * (ahead.im[p] - back.im[p]) + outputs.im[p] * (ahead.re[p] - back.re[p]);
  }
  return [a, b];
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

/** Indices of the lines of a motion that are not negligible along the path: those that maps show. */
function heard(motion) {
  const { x, y } = motion.lines.samples, step = Math.ceil(x.length / LOOKED);
  const largest = new Float64Array(motion.f.length);
  for (let q = 0; q < x.length; q += step) {
    const { re, im } = motion.at(x[q], y[q]);
    re.forEach((value, l) => { largest[l] = Math.max(largest[l], Math.hypot(value, im[l])); });
  }
  const strongest = Math.max(...largest);
  return [...largest.keys()].filter((l) => largest[l] > UNHEARD * strongest);
}

/** Text that is the same for loads whose foci pass the same samples, however fast. */
export const samplesKey = ({ path, foci, height }, { x }) => JSON.stringify([
  { ...path, speed: Boolean(path.speed), drawn: 0 }, foci.length > 1 ? foci : 1, height, x.length]);
