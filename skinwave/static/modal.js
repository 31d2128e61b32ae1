// Motion of a sheet in its modes q, of unit mass, under the forces F of a moving focus:
//   (diag(squared) + c(w) B - w^2) q = F
// where c is the modulus of bending over that of the modes, less 1; as skinwave.live.sheets packs it.

import { FieldMotion, Grid, PathForces, byPlace } from "./fields.js";
import { divided, zeros } from "./numeric.js";

const RESIDUAL = 1e-5, MOST_STEPS = 300; // of coupled modes

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

  /** Diagonal (m,) {re, im} of the dynamic stiffness at a frequency in Hz, and the `factor` c there. */
  stiffness(frequency) {
    const omega2 = (2 * Math.PI * frequency) ** 2, { modes } = this;
    const factor = lawAt(this.law_step, this.law, frequency);
    const re = Float64Array.from({ length: modes },
      (_, m) => this.squared[m] - omega2 + factor[0] * this.diagonal[m]);
    return { re, im: Float64Array.from(this.diagonal, (own) => factor[1] * own), factor };
  }

  /**
   * Modal coordinates (m,) {re, im} of forces (m,) {re, im} at a frequency in Hz: conjugate gradients of a
   * complex symmetric matrix, with its diagonal as preconditioner.
   */
  solve(frequency, force) {
    const diagonal = this.stiffness(frequency), over = (own) => quotients(own, diagonal);
    if (!this.between) return over(force);
    const found = zeros(this.modes), left = { re: force.re.slice(), im: force.im.slice() };
    let way = over(left), before = product(left, way);
    for (let turn = 0; turn < MOST_STEPS && sizeOf(left) > RESIDUAL * sizeOf(force); turn++) {
      const pushed = this.push(way, diagonal), step = divided(...before, ...product(way, pushed));
      addTimes(found, step, way);
      addTimes(left, step.map((value) => -value), pushed);
      const next = over(left), now = product(left, next);
      addTimes(next, divided(...now, ...before), way);
      [way, before] = [next, now];
    }
    return found;
  }

  /** The dynamic stiffness times modal coordinates (m,). */
  push(q, { re: dr, im: di, factor: [c, s] }) {
    const { modes, between, together: n } = this, found = zeros(modes);
    for (let m = 0, k = 0; m < modes; m++) {
      let a = 0, b = 0;
      for (let i = 0; m < n && i < n; i++, k++) {
        if (i === m) continue; // its own part is in the diagonal
        a += between[k] * q.re[i];
        b += between[k] * q.im[i];
      }
      found.re[m] = dr[m] * q.re[m] - di[m] * q.im[m] + c * a - s * b;
      found.im[m] = dr[m] * q.im[m] + di[m] * q.re[m] + c * b + s * a;
    }
    return found;
  }
}

/** Complex factor [re, im] at a frequency of a law (k, 2) tabulated every `step` Hz from 0 on. */
function lawAt(step, law, frequency) {
  const count = law.re.length, x = Math.min(frequency / step, count - 1);
  const first = Math.min(Math.floor(x), count - 2), part = x - first;
  return [law.re, law.im].map((own) => own[first] + part * (own[first + 1] - own[first]));
}

const sizeOf = ({ re, im }) => Math.sqrt(re.reduce((sum, v, k) => sum + v * v + im[k] * im[k], 0));

/** Quotients (m,) of complex values. */
function quotients({ re, im }, below) {
  const found = zeros(re.length);
  for (let m = 0; m < re.length; m++) {
    [found.re[m], found.im[m]] = divided(re[m], im[m], below.re[m], below.im[m]);
  }
  return found;
}

/** Sum [re, im] of products of complex values, neither of them conjugated. */
function product(a, b) {
  let re = 0, im = 0;
  for (let m = 0; m < a.re.length; m++) {
    re += a.re[m] * b.re[m] - a.im[m] * b.im[m];
    im += a.re[m] * b.im[m] + a.im[m] * b.re[m];
  }
  return [re, im];
}

/** Add a complex factor times values to others. */
function addTimes({ re, im }, [c, s], from) {
  for (let m = 0; m < re.length; m++) {
    re[m] += c * from.re[m] - s * from.im[m];
    im[m] += c * from.im[m] + s * from.re[m];
  }
}
