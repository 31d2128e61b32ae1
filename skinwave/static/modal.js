// Motion of a sheet in its modes q, of unit mass, under the forces F of a moving focus:
//   (diag(squared) + c(w) B - w^2) q = F
// where c is the modulus of bending over that of the modes, less 1; as skinwave.live.sheets packs it.

import { FieldMotion, Grid, PathForces, byPlace, zeros } from "./fields.js";
import { divided } from "./numeric.js";

const RESIDUAL = 1e-5, MOST_STEPS = 30; // of coupled modes

/** A sheet of a pack. */
export class ModalBody {
  constructor(pack) {
    Object.assign(this, pack);
    this.modes = this.squared.length;
    this.together = Math.sqrt(this.between?.length ?? 0); // modes that loss couples
    this.width = this.modes;
    this.grid = new Grid(pack);
    this.values = byPlace(this.V, this.modes, this.inside);
    this.pushed = new PathForces(this.grid, this.values, this.modes);
    this.factors = new Map(); // of coupled modes at a frequency
  }

  respond(load) { return new FieldMotion(this, load); }

  /** Forces on the poles (m j,) {ahead, back} of those on the modes. */
  onPoles({ re, im }) {
    const count = this.poles.re.length, ahead = zeros(count), back = zeros(count);
    for (let k = 0; k < count; k++) {
      const m = Math.floor(k / this.kinds);
      ahead.re[k] = back.re[k] = re[m];
      ahead.im[k] = im[m];
      back.im[k] = -im[m];
    }
    return { ahead, back };
  }

  /** Residues (m j,) times the modes at a place. */
  outputs(own) {
    const each = (values) => values.map((value, k) => value * own[Math.floor(k / this.kinds)]);
    return { re: each(this.residues.re), im: each(this.residues.im) };
  }

  /** Add the free vibration after a jump of what coupling adds to the steady state, at rest before. */
  addCoupled({ re, im }, { lines, forces, amplitudes }, start, jump) {
    if (!this.between) return;
    const { poles, kinds, modes } = this, place = new Float64Array(modes), speed = new Float64Array(modes);
    lines.f.forEach((f, l) => {
      const omega = 2 * Math.PI * f, c = Math.cos(omega * start), s = Math.sin(omega * start);
      const { re: dr, im: di } = this.stiffness(f), force = forces[l], q = amplitudes[l];
      for (let m = 0; m < modes; m++) {
        const [pr, pi] = divided(force.re[m], force.im[m], dr[m], di[m]);
        const a = q.re[m] - pr, b = q.im[m] - pi;
        place[m] -= jump * (a * c - b * s);
        speed[m] += jump * omega * (a * s + b * c);
      }
    });
    for (let k = 0; k < modes * kinds; k++) {
      const m = Math.floor(k / kinds);
      re[k] += 2 * (poles.re[k] * place[m] + speed[m]);
      im[k] += 2 * poles.im[k] * place[m];
    }
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
    const found = zeros(modes);
    if (!this.between) {
      divide(found, force, 0);
      return found;
    }
    const block = this.lowBlock(frequency, dr, di, factor), scale = sizeOf(force);
    let left = { re: force.re.slice(), im: force.im.slice() };
    const change = zeros(modes);
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
