// Motion of a body of elements by its poles, as skinwave.live.elements packs it:
//   u(x, w) = sum_p O_p(x) F_p(w) / (i w - pole_p) + conj(O_p(x) F_p(-w) / (-i w - pole_p))
// with complex fields O_p (p, place), which read the motion and take up the load.

import { Grid, byPlace, heard, samplesKey } from "./fields.js";
import { loadLines, pathSamples, spotWidth } from "./load.js";
import { divided, oscillation, underRhythm } from "./time.js";

/** A body of elements of a pack. */
export class PoleBody {
  constructor(pack) {
    Object.assign(this, pack);
    this.count = this.poles.re.length;
    this.grid = new Grid(pack);
    // Real and imaginary parts of all poles after each other at a place.
    const { fields: { re, im }, count, inside } = this, width = 2 * count;
    const rows = new Float64Array(2 * re.length);
    rows.set(re);
    rows.set(im, re.length);
    this.values = byPlace(rows, width, inside);
    this.pushed = this.values.map((value, k) => value * this.cosines[Math.floor(k / width)]);
    this.loads = new Map(); // load fields of a height
    this.paths = new Map(); // forces of unit pressure along a path
  }

  respond(load) {
    return new PoleMotion(this, load);
  }

  /** Forces (q, 2 p) of 1 Pa at the samples of a path. */
  pathForces(load, samples) {
    const key = samplesKey(load, samples), width = 2 * this.count;
    if (!this.paths.has(key)) {
      if (this.paths.size > 3) this.paths.clear();
      if (!this.loads.has(load.height)) {
        if (this.loads.size > 3) this.loads.clear();
        this.loads.set(load.height, this.grid.smoothed(this.pushed, width, spotWidth(load.height)));
      }
      const fields = this.loads.get(load.height), count = samples.x.length;
      const forces = new Float32Array(count * width);
      for (let q = 0; q < count; q++) {
        forces.set(this.grid.at(fields, width, samples.x[q], samples.y[q]), q * width);
      }
      this.paths.set(key, forces);
    }
    return this.paths.get(key);
  }
}

/** Motion of a body of elements under a load. */
class PoleMotion {
  constructor(body, load) {
    this.body = body;
    this.load = load;
    const samples = pathSamples(load);
    this.lines = loadLines(load, { lowest: 0, most: 120, samples });
    const forces = body.pathForces(load, samples), { count } = body, width = 2 * count;
    // States of each line: `ahead` F / (i w - pole) and `back` F(-w) / (-i w - pole), {re, im} (p,).
    this.states = this.lines.f.length ? Array.from(this.lines.f, (f, l) => {
      const { re: wr, im: wi } = this.lines.w[l], a = new Float64Array(width), b = new Float64Array(width);
      for (let q = 0, k = 0; q < wr.length; q++) {
        const c = wr[q], s = wi[q];
        for (let m = 0; m < width; m++, k++) {
          a[m] += c * forces[k];
          b[m] += s * forces[k];
        }
      }
      return this.stateOf(f, a, b);
    }) : [];
    this.first = this.lines.f.length && this.lines.f[0] === 0 ? 1 : 0; // after the mean
    this.f = this.lines.f.slice(this.first);
  }

  /** State of a line of forces a + i b, whose parts are each complex over the poles (2 p,). */
  stateOf(f, a, b) {
    const { count, poles } = this.body, omega = 2 * Math.PI * f;
    const of = () => ({ re: new Float64Array(count), im: new Float64Array(count) });
    const ahead = of(), back = of();
    for (let p = 0; p < count; p++) {
      const j = p + count;
      [ahead.re[p], ahead.im[p]] = divided(a[p] - b[j], a[j] + b[p], -poles.re[p], omega - poles.im[p]);
      [back.re[p], back.im[p]] = divided(a[p] + b[j], a[j] - b[p], -poles.re[p], -omega - poles.im[p]);
    }
    return { ahead, back };
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const own = this.body.grid.at(this.body.values, 2 * this.body.count, x, y), count = this.f.length;
    const re = new Float64Array(count), im = new Float64Array(count);
    for (let l = 0; l < count; l++) [re[l], im[l]] = read(own, this.states[l + this.first]);
    return { re, im };
  }

  onGrid(xs, ys) {
    const { values, count, grid: { side } } = this.body, n = side * side, width = 2 * count;
    const re = new Float32Array(this.f.length * n), im = new Float32Array(re.length);
    const sum = new Float64Array(width), difference = new Float64Array(width);
    for (const l of heard(this)) {
      const { ahead, back } = this.states[l + this.first];
      for (let p = 0; p < count; p++) {
        sum[p] = ahead.re[p] + back.re[p];
        sum[p + count] = -ahead.im[p] - back.im[p];
        difference[p] = ahead.im[p] - back.im[p];
        difference[p + count] = ahead.re[p] - back.re[p];
      }
      for (let place = 0, k = 0; place < n; place++) {
        let a = 0, b = 0;
        for (let m = 0; m < width; m++, k++) {
          a += values[k] * sum[m];
          b += values[k] * difference[m];
        }
        re[l * n + place] = a;
        im[l * n + place] = b;
      }
    }
    return this.body.grid.resampled({ re, im }, this.f.length, xs, ys);
  }

  /** Motion (t,) in metre of a place from rest, at equally spaced times (t,) in s from 0. */
  waveform(x, y, times) {
    const { body, lines: { f } } = this, own = body.grid.at(body.values, 2 * body.count, x, y);
    const steady = oscillation(f, this.states.map((state) => read(own, state)), times);
    const lag = () => oscillation(f, this.states.map(({ ahead, back }, l) => read(own, {
      ahead: this.over(ahead, f[l]), back: this.over(back, -f[l]),
    })), times);
    return underRhythm(this.load, times, steady, lag,
      (start, jump, bend) => ({ poles: body.poles, amplitudes: this.startOf(own, start, jump, bend) }));
  }

  /** A state (p,) divided by (i w - pole) once more. */
  over({ re, im }, f) {
    const { poles } = this.body, found = { re: new Float64Array(re.length), im: new Float64Array(re.length) };
    for (let p = 0; p < re.length; p++) {
      [found.re[p], found.im[p]] = divided(re[p], im[p], -poles.re[p], 2 * Math.PI * f - poles.im[p]);
    }
    return found;
  }

  /** Complex amplitudes (p,) of exp(pole t) at a place after a jump and a bend of the level. */
  startOf(own, start, jump, bend) {
    const { count } = this.body, re = new Float64Array(count), im = new Float64Array(count);
    this.lines.f.forEach((f, l) => {
      const turn = 2 * Math.PI * f * start, c = Math.cos(turn), s = Math.sin(turn);
      const { ahead, back } = this.states[l];
      const add = (state, share, sign) => {
        for (let p = 0; p < count; p++) {
          re[p] += share * (state.re[p] * c - sign * state.im[p] * s);
          im[p] += share * (state.im[p] * c + sign * state.re[p] * s);
        }
      };
      add(ahead, -jump, 1);
      add(back, -jump, -1);
      if (bend) {
        add(this.over(ahead, f), bend, 1);
        add(this.over(back, -f), bend, -1);
      }
    });
    for (let p = 0; p < count; p++) {
      [re[p], im[p]] = [re[p] * own[p] - im[p] * own[p + count], re[p] * own[p + count] + im[p] * own[p]];
    }
    return { re, im };
  }
}

/** Complex amplitude [re, im] of a state at a place whose fields are `own` (2 p,). */
function read(own, { ahead, back }) {
  const count = own.length / 2;
  let a = 0, b = 0;
  for (let p = 0, j = count; p < count; p++, j++) {
    a += own[p] * (ahead.re[p] + back.re[p]) - own[j] * (ahead.im[p] + back.im[p]);
    b += own[p] * (ahead.im[p] - back.im[p]) + own[j] * (ahead.re[p] - back.re[p]);
  }
  return [a, b];
}
