// Motion of a sheet in its modes q, of unit mass, under the forces F of a moving focus:
//   (diag(squared) + c(w) B - w^2) q = F
// where c is the complex modulus of bending over that of the modes, minus 1 (see skinwave.live.sheets).

import { FieldMotion, Grid, PathForces, byPlace } from "./fields.js";
import { addTimes, complexFrom, divided, product, quotients, zeros } from "./numeric.js";

// Cubic stiffness acts on a sinusoid 3/2 times as much as the mean of its square. Single lines change up to
// several times as much as all, and free vibration after the start stretches the sheet, too.
const HARMONIC = 1.5, WORST = 4.5;
const RESIDUAL = 1e-5, MOST_STEPS = 300; // of the iteration for coupled modes

/** A sheet of a pack. */
export class ModalBody {
  constructor(pack) {
    Object.assign(this, pack);
    this.modes = this.squared.length;
    this.coupled = Math.sqrt(this.between?.length ?? 0); // number of modes that loss couples
    this.width = this.modes;
    this.grid = new Grid(pack);
    this.values = byPlace(this.V, this.modes, this.inside);
    this.pushed = new PathForces(this.grid, this.values, this.modes);
  }

  motion(load) { return new FieldMotion(this, load); }

  /** Forces on the poles {ahead, back} (m j,), from those on the modes. */
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

  /** Fields of the poles (m j,) at a place: residues times the modes there. */
  outputs(own) {
    const each = (values) => values.map((value, k) => value * own[Math.floor(k / this.kinds)]);
    return { re: each(this.residues.re), im: each(this.residues.im) };
  }

  /** Add the free vibration after a jump that belongs to the coupled part of the steady state. */
  addCoupled({ re, im }, { lines, forces, amplitudes }, start, jump) {
    if (!this.between) return;
    const { poles, kinds, modes } = this, place = new Float64Array(modes), speed = new Float64Array(modes);
    lines.f.forEach((f, l) => {
      const omega = 2 * Math.PI * f, c = Math.cos(omega * start), s = Math.sin(omega * start);
      const plain = quotients(forces[l], this.stiffness(f)), q = amplitudes[l];
      for (let m = 0; m < modes; m++) {
        const a = q.re[m] - plain.re[m], b = q.im[m] - plain.im[m];
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

  /** Diagonal {re, im} (m,) of the dynamic stiffness at a frequency in Hz, and `factor`, which is c. */
  stiffness(frequency) {
    const omega = 2 * Math.PI * frequency, omega2 = omega ** 2, { modes } = this;
    const factor = lawAt(this.law_step, this.law, frequency);
    const re = Float64Array.from({ length: modes },
      (_, m) => this.squared[m] - omega2 + factor[0] * this.diagonal[m]);
    const im = Float64Array.from(this.diagonal, (own, m) => factor[1] * own + omega * this.damping[m]);
    return { re, im, factor };
  }

  /**
   * Modal coordinates {re, im} (m,) under forces {re, im} (m,) at a frequency in Hz, by conjugate gradients
   * for a complex symmetric matrix with its diagonal as preconditioner.
   */
  solve(frequency, force) {
    const diagonal = this.stiffness(frequency), precondition = (own) => quotients(own, diagonal);
    if (!this.between) return precondition(force);
    const q = zeros(this.modes), residual = { re: force.re.slice(), im: force.im.slice() };
    let direction = precondition(residual), before = product(residual, direction);
    for (let k = 0; k < MOST_STEPS && sizeOf(residual) > RESIDUAL * sizeOf(force); k++) {
      const image = this.multiplied(direction, diagonal);
      const step = divided(...before, ...product(direction, image));
      addTimes(q, step, direction);
      addTimes(residual, step.map((value) => -value), image);
      const next = precondition(residual), now = product(residual, next);
      addTimes(next, divided(...now, ...before), direction);
      [direction, before] = [next, now];
    }
    return q;
  }

  /**
   * Largest change of a line of a motion by the tension of the stretched sheet, relative to the strongest
   * line. The tension follows the mean square of the slopes (see `skinwave.live.sheets.stretching_of`).
   */
  stretchingOf({ lines: { f }, forces, amplitudes }) {
    const { slopes, tension } = this.stretching;
    const squares = amplitudes.map((q, l) => slopes.reduce(
      (sum, own, m) => sum + own * (q.re[m] ** 2 + q.im[m] ** 2), 0) / (f[l] ? 2 : 1));
    const stretched = HARMONIC * tension * squares.reduce((sum, own) => sum + own, 0);
    let change = 0, all = 0;
    f.forEach((at, l) => {
      if (!at) return;
      const { re, im } = this.stiffness(at), linear = quotients(forces[l], { re, im });
      const stiffer = quotients(forces[l], { re: re.map((own, m) => own + stretched * slopes[m]), im });
      for (let m = 0; m < this.modes; m++) {
        all += linear.re[m] ** 2 + linear.im[m] ** 2;
        change += (linear.re[m] - stiffer.re[m]) ** 2 + (linear.im[m] - stiffer.im[m]) ** 2;
      }
    });
    return all ? WORST * Math.sqrt(change / all) : 0;
  }

  /** The dynamic stiffness times modal coordinates (m,). */
  multiplied(q, { re: dr, im: di, factor: [c, s] }) {
    const { between, coupled: n } = this;
    return complexFrom(this.modes, (m) => {
      let a = 0, b = 0;
      for (let i = 0, k = m * n; m < n && i < n; i++, k++) {
        if (i === m) continue; // part of the diagonal
        a += between[k] * q.re[i];
        b += between[k] * q.im[i];
      }
      return [dr[m] * q.re[m] - di[m] * q.im[m] + c * a - s * b,
        dr[m] * q.im[m] + di[m] * q.re[m] + c * b + s * a];
    });
  }
}

/** Complex factor [re, im] at a frequency in Hz of a law that is tabulated every `step` Hz from 0 on. */
function lawAt(step, law, frequency) {
  const count = law.re.length, x = Math.min(frequency / step, count - 1);
  const first = Math.min(Math.floor(x), count - 2), part = x - first;
  return [law.re, law.im].map((own) => own[first] + part * (own[first + 1] - own[first]));
}

const sizeOf = ({ re, im }) => Math.sqrt(re.reduce((sum, v, k) => sum + v * v + im[k] * im[k], 0));
