// Motion of a sheet in its modes q, of unit mass, under the forces F of a moving focus:
//   (diag(squared) + c(w) B - w^2) q = F
// where c is the modulus of bending over that of the modes, less 1; as skinwave.live.sheets packs it.

import { Grid, byPlace, heard, samplesKey } from "./fields.js";
import { loadLines, pathSamples, spotWidth } from "./load.js";
import { divided, oscillation, underRhythm } from "./time.js";

const RESIDUAL = 1e-5, MOST_STEPS = 30; // of coupled modes

/** A sheet of a pack. */
export class ModalBody {
  constructor(pack) {
    Object.assign(this, pack);
    this.modes = this.squared.length;
    this.together = Math.sqrt(this.between?.length ?? 0); // modes that loss couples
    this.grid = new Grid(pack);
    this.fields = byPlace(this.V, this.modes, this.inside);
    this.loads = new Map(); // load fields of a height
    this.paths = new Map(); // forces of unit pressure along a path
    this.factors = new Map(); // of coupled modes at a frequency
  }

  respond(load) {
    return new ModalMotion(this, load);
  }

  /** Modal forces (q, m) of 1 Pa at the samples of a path. */
  pathForces(load, samples) {
    const key = samplesKey(load, samples);
    if (!this.paths.has(key)) {
      if (this.paths.size > 3) this.paths.clear();
      if (!this.loads.has(load.height)) {
        if (this.loads.size > 3) this.loads.clear();
        this.loads.set(load.height, this.grid.smoothed(this.fields, this.modes, spotWidth(load.height)));
      }
      const fields = this.loads.get(load.height), count = samples.x.length;
      const forces = new Float64Array(count * this.modes);
      for (let q = 0; q < count; q++) {
        forces.set(this.grid.at(fields, this.modes, samples.x[q], samples.y[q]), q * this.modes);
      }
      this.paths.set(key, forces);
    }
    return this.paths.get(key);
  }

  /** Diagonal (m,) {re, im} of the dynamic stiffness at a frequency, and the factor c there. */
  stiffness(frequency) {
    const omega2 = (2 * Math.PI * frequency) ** 2, { modes } = this;
    const factor = lawAt(this.law_step, this.law, frequency);
    const re = Float64Array.from({ length: modes },
      (_, m) => this.squared[m] - omega2 + factor[0] * this.diagonal[m]);
    return { re, im: Float64Array.from(this.diagonal, (own) => factor[1] * own), factor };
  }

  /** Modal coordinates (m,) {re, im} of forces (m,) {re, im} at a frequency in Hz. */
  solve(frequency, force) {
    const { modes } = this, { re: dr, im: di, factor } = this.stiffness(frequency);
    const divide = (to, from, first) => {
      for (let m = first; m < modes; m++) {
        const size = dr[m] ** 2 + di[m] ** 2;
        to.re[m] = (from.re[m] * dr[m] + from.im[m] * di[m]) / size;
        to.im[m] = (from.im[m] * dr[m] - from.re[m] * di[m]) / size;
      }
    };
    const found = { re: new Float64Array(modes), im: new Float64Array(modes) };
    if (!this.between) {
      divide(found, force, 0);
      return found;
    }
    const block = this.lowBlock(frequency, dr, di, factor), scale = sizeOf(force);
    let left = { re: force.re.slice(), im: force.im.slice() };
    const change = { re: new Float64Array(modes), im: new Float64Array(modes) };
    for (let turn = 0; turn < MOST_STEPS && sizeOf(left) > RESIDUAL * scale; turn++) {
      divide(change, left, block.n);
      backSubstitute(block, left, change);
      for (let m = 0; m < modes; m++) {
        found.re[m] += change.re[m];
        found.im[m] += change.im[m];
      }
      left = this.residual(found, force, dr, di, factor);
    }
    return found;
  }

  /** force - (dynamic stiffness) q. */
  residual(q, force, dr, di, [c, s]) {
    const { modes, between, together: n } = this;
    const re = new Float64Array(modes), im = new Float64Array(modes);
    for (let m = 0, k = 0; m < modes; m++) {
      let a = 0, b = 0;
      if (m < n) {
        for (let i = 0; i < n; i++, k++) {
          a += between[k] * q.re[i];
          b += between[k] * q.im[i];
        }
        a -= between[m * n + m] * q.re[m];
        b -= between[m * n + m] * q.im[m];
      }
      re[m] = force.re[m] - dr[m] * q.re[m] + di[m] * q.im[m] - c * a + s * b;
      im[m] = force.im[m] - dr[m] * q.im[m] - di[m] * q.re[m] - c * b - s * a;
    }
    return { re, im };
  }

  /** Factors L D L^T of the stiffness between the modes below `coupled` times a frequency. */
  lowBlock(frequency, dr, di, [c, s]) {
    if (this.factors.has(frequency)) return this.factors.get(frequency);
    if (this.factors.size > 64) this.factors.clear();
    const { between, together } = this, limit = (2 * Math.PI * this.coupled * frequency) ** 2;
    let n = 0;
    while (n < together && this.squared[n] <= limit) n++;
    const re = new Float64Array(n * n), im = new Float64Array(n * n);
    for (let row = 0; row < n; row++) {
      for (let column = 0; column < row; column++) {
        re[row * n + column] = c * between[row * together + column];
        im[row * n + column] = s * between[row * together + column];
      }
      re[row * n + row] = dr[row];
      im[row * n + row] = di[row];
    }
    const block = factorise(re, im, n);
    this.factors.set(frequency, block);
    return block;
  }
}

/** Complex factor [re, im] at a frequency of a law (k, 2) tabulated every `step` Hz from 0 on. */
function lawAt(step, law, frequency) {
  const count = law.re.length, x = Math.min(frequency / step, count - 1);
  const first = Math.min(Math.floor(x), count - 2), part = x - first;
  return [law.re[first] + part * (law.re[first + 1] - law.re[first]),
    law.im[first] + part * (law.im[first + 1] - law.im[first])];
}

const sizeOf = ({ re, im }) => {
  let sum = 0;
  for (let k = 0; k < re.length; k++) sum += re[k] ** 2 + im[k] ** 2;
  return Math.sqrt(sum);
};

/** L D L^T of a complex symmetric matrix, of its lower triangle, in place. */
function factorise(re, im, n) {
  const ar = new Float64Array(n), ai = new Float64Array(n);
  for (let j = 0; j < n; j++) {
    // column j of L times D up to j
    let pr = re[j * n + j], pi = im[j * n + j];
    for (let k = 0; k < j; k++) {
      const lr = re[j * n + k], li = im[j * n + k], dr = re[k * n + k], di = im[k * n + k];
      ar[k] = lr * dr - li * di;
      ai[k] = lr * di + li * dr;
      pr -= lr * ar[k] - li * ai[k];
      pi -= lr * ai[k] + li * ar[k];
    }
    re[j * n + j] = pr;
    im[j * n + j] = pi;
    const size = pr * pr + pi * pi;
    for (let i = j + 1; i < n; i++) {
      let sr = re[i * n + j], si = im[i * n + j];
      for (let k = 0, at = i * n; k < j; k++, at++) {
        sr -= re[at] * ar[k] - im[at] * ai[k];
        si -= re[at] * ai[k] + im[at] * ar[k];
      }
      re[i * n + j] = (sr * pr + si * pi) / size;
      im[i * n + j] = (si * pr - sr * pi) / size;
    }
  }
  return { re, im, n };
}

/** Solve for the first n entries of a right side, into `to`. */
function backSubstitute({ re, im, n }, from, to) {
  for (let i = 0; i < n; i++) {
    let a = from.re[i], b = from.im[i];
    for (let k = 0, at = i * n; k < i; k++, at++) {
      a -= re[at] * to.re[k] - im[at] * to.im[k];
      b -= re[at] * to.im[k] + im[at] * to.re[k];
    }
    to.re[i] = a;
    to.im[i] = b;
  }
  for (let i = 0; i < n; i++) {
    const pr = re[i * n + i], pi = im[i * n + i], size = pr * pr + pi * pi;
    const a = to.re[i], b = to.im[i];
    to.re[i] = (a * pr + b * pi) / size;
    to.im[i] = (b * pr - a * pi) / size;
  }
  for (let i = n - 1; i >= 0; i--) {
    for (let k = i + 1; k < n; k++) {
      const lr = re[k * n + i], li = im[k * n + i];
      to.re[i] -= lr * to.re[k] - li * to.im[k];
      to.im[i] -= lr * to.im[k] + li * to.re[k];
    }
  }
}

/** Motion of a sheet under a load. */
class ModalMotion {
  constructor(body, load) {
    this.body = body;
    this.load = load;
    const samples = pathSamples(load);
    this.lines = loadLines(load, { lowest: 0, most: 120, samples });
    const forces = body.pathForces(load, samples), { modes } = body, count = samples.x.length;
    this.forces = this.lines.w.map(({ re: wr, im: wi }) => {
      const re = new Float64Array(modes), im = new Float64Array(modes);
      for (let q = 0, k = 0; q < count; q++) {
        const a = wr[q], b = wi[q];
        for (let m = 0; m < modes; m++, k++) {
          re[m] += a * forces[k];
          im[m] += b * forces[k];
        }
      }
      return { re, im };
    });
    this.coordinates = this.forces.map((force, l) => body.solve(this.lines.f[l], force));
    this.first = this.lines.f.length && this.lines.f[0] === 0 ? 1 : 0; // after the mean
    this.f = this.lines.f.slice(this.first);
  }

  /** Complex amplitudes (l,) in metre at a place in metre. */
  at(x, y) {
    const own = this.body.grid.at(this.body.fields, this.body.modes, x, y), count = this.f.length;
    const re = new Float64Array(count), im = new Float64Array(count);
    for (let l = 0; l < count; l++) [re[l], im[l]] = summed(own, this.coordinates[l + this.first]);
    return { re, im };
  }

  /** Complex amplitudes (l, p) in metre of all places of the body's grid. */
  onOwnGrid() {
    const { modes, fields, grid: { side } } = this.body, n = side * side;
    const re = new Float32Array(this.f.length * n), im = new Float32Array(re.length);
    for (const l of heard(this)) {
      const { re: qr, im: qi } = this.coordinates[l + this.first];
      for (let p = 0, k = 0; p < n; p++) {
        let a = 0, b = 0;
        for (let m = 0; m < modes; m++, k++) {
          a += fields[k] * qr[m];
          b += fields[k] * qi[m];
        }
        re[l * n + p] = a;
        im[l * n + p] = b;
      }
    }
    return { re, im };
  }

  onGrid(xs, ys) {
    return this.body.grid.resampled(this.onOwnGrid(), this.f.length, xs, ys);
  }

  /** Motion (t,) in metre of a place from rest, at equally spaced times (t,) in s from 0. */
  waveform(x, y, times) {
    const { body, lines: { f } } = this, own = body.grid.at(body.fields, body.modes, x, y);
    const steady = oscillation(f, this.coordinates.map((q) => summed(own, q)), times);
    return underRhythm(this.load, times, steady, () => this.lag(own, times),
      (start, jump, bend) => ({ poles: body.poles, amplitudes: this.startOf(own, start, jump, bend) }));
  }

  /**
   * Lag (t,) of a ramp of 1/s: sum_l D_l exp(i w t), D_l the force times the slope of -compliance, of
   * modes apart as in `startOf`, so that both cancel at a corner.
   */
  lag(own, times) {
    const { f } = this.lines;
    const { poles, residues, kinds } = this.body;
    const amplitudes = this.forces.map((force, l) => {
      let a = 0, b = 0;
      const omega = 2 * Math.PI * f[l];
      for (let m = 0; m < own.length; m++) {
        for (let j = 0, k = m * kinds; j < kinds; j++, k++) {
          for (const sign of [1, -1]) { // the pole and its conjugate
            const [cr, ci] = divided(1, 0, -poles.re[k], omega - sign * poles.im[k]);
            const [sr, si] = [cr * cr - ci * ci, 2 * cr * ci];
            const rr = own[m] * residues.re[k], ri = sign * own[m] * residues.im[k];
            const hr = rr * sr - ri * si, hi = rr * si + ri * sr;
            a += hr * force.re[m] - hi * force.im[m];
            b += hr * force.im[m] + hi * force.re[m];
          }
        }
      }
      return [a, b];
    });
    return oscillation(f, amplitudes, times);
  }

  /**
   * Complex amplitudes (m j,) of exp(pole t) at a place whose modes are `own` (m,), after a
   * jump and a bend of the level.
   */
  startOf(own, start, jump, bend) {
    const { poles, residues, kinds, modes } = this.body, count = modes * kinds;
    const re = new Float64Array(count), im = new Float64Array(count);
    const coupled = Boolean(this.body.between);
    const place = new Float64Array(modes), speed = new Float64Array(modes);
    this.lines.f.forEach((f, l) => {
      const omega = 2 * Math.PI * f, { re: fr, im: fi } = this.forces[l], q = this.coordinates[l];
      const turn = omega * start, c = Math.cos(turn), s = Math.sin(turn);
      const stiffness = coupled ? this.body.stiffness(f) : null;
      for (let m = 0, k = 0; m < modes; m++) {
        const ar = fr[m] * c - fi[m] * s, ai = fr[m] * s + fi[m] * c;
        for (let j = 0; j < kinds; j++, k++) {
          const [xr, xi] = divided(ar, ai, -poles.re[k], omega - poles.im[k]);
          const [yr, yi] = divided(ar, -ai, -poles.re[k], -omega - poles.im[k]);
          let [sr, si] = [-jump * (xr + yr), -jump * (xi + yi)];
          if (bend) {
            const [ur, ui] = divided(xr, xi, -poles.re[k], omega - poles.im[k]);
            const [vr, vi] = divided(yr, yi, -poles.re[k], -omega - poles.im[k]);
            sr += bend * (ur + vr);
            si += bend * (ui + vi);
          }
          re[k] += sr * residues.re[k] - si * residues.im[k];
          im[k] += sr * residues.im[k] + si * residues.re[k];
        }
        if (coupled) { // what coupling adds to the steady state begins at rest, too
          const [pr, pi] = divided(fr[m], fi[m], stiffness.re[m], stiffness.im[m]);
          const br = q.re[m] - pr, bi = q.im[m] - pi;
          const [tr, ti] = [br * c - bi * s, br * s + bi * c];
          place[m] -= jump * tr;
          speed[m] += jump * omega * ti;
        }
      }
    });
    if (coupled) {
      for (let m = 0, k = 0; m < modes; m++) {
        for (let j = 0; j < kinds; j++, k++) {
          const ar = poles.re[k] * place[m] + speed[m], ai = poles.im[k] * place[m];
          re[k] += 2 * (residues.re[k] * ar - residues.im[k] * ai);
          im[k] += 2 * (residues.re[k] * ai + residues.im[k] * ar);
        }
      }
    }
    for (let k = 0; k < count; k++) {
      const share = own[Math.floor(k / kinds)];
      re[k] *= share;
      im[k] *= share;
    }
    return { re, im };
  }
}

const summed = (own, { re, im }) => {
  let a = 0, b = 0;
  for (let m = 0; m < own.length; m++) {
    a += own[m] * re[m];
    b += own[m] * im[m];
  }
  return [a, b];
};
