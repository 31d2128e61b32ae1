// Fields of bounded bodies on a square grid, place after place: value m of place p at [p * count + m].

const POINTS = 8; // of the polynomials between places of the grid
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
  const at = Math.min(Math.max(place, 0), side - 1) - first, weights = new Float64Array(POINTS).fill(1);
  for (let k = 0; k < POINTS; k++) {
    for (let j = 0; j < POINTS; j++) if (j !== k) weights[k] *= (at - j) / (k - j);
  }
  return { first, weights };
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

/** Indices of the lines of a motion that are not negligible along the path: those that maps show. */
export function heard(motion) {
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
