// Motion of a body of finite elements by its poles (see skinwave.live.elements):
//   u(x, w) = sum_p O_p(x) F_p(w) / (i w - pole_p) + conj(O_p(x) F_p(-w) / (-i w - pole_p))
// with complex fields O_p (p, place), through which the load acts and the motion is read.

import { FieldMotion, Grid, PathForces, byPlace, overPoles } from "./fields.js";
import { zeros } from "./numeric.js";

/** A body of a pack. Its real fields (2 p,) are the real, then the imaginary parts of O. */
export class PoleBody {
  constructor(pack) {
    Object.assign(this, pack);
    const { fields: { re, im }, cosines } = this, width = 2 * this.poles.re.length;
    const rows = new Float64Array(2 * re.length);
    rows.set(re);
    rows.set(im, re.length);
    this.width = width;
    this.grid = new Grid(pack);
    this.values = byPlace(rows, width, this.inside);
    const loaded = this.values.map((value, k) => value * cosines[Math.floor(k / width)]);
    this.pushed = new PathForces(this.grid, loaded, width);
  }

  motion(load) { return new FieldMotion(this, load); }

  /** Amplitudes {re, im} (2 p,) of the real fields under forces {re, im} (2 p,) at a frequency in Hz. */
  solve(frequency, force) {
    const { ahead, back } = overPoles(this.poles, this.onPoles(force), frequency), out = zeros(this.width);
    for (let p = 0, j = this.width / 2; j < this.width; p++, j++) {
      out.re[p] = ahead.re[p] + back.re[p];
      out.re[j] = -ahead.im[p] - back.im[p];
      out.im[p] = ahead.im[p] - back.im[p];
      out.im[j] = ahead.re[p] - back.re[p];
    }
    return out;
  }

  /** Forces on the poles {ahead, back} (p,), from those on the real fields. */
  onPoles({ re: a, im: b }) {
    const count = this.width / 2, ahead = zeros(count), back = zeros(count);
    for (let p = 0, j = count; p < count; p++, j++) {
      [ahead.re[p], ahead.im[p]] = [a[p] - b[j], a[j] + b[p]];
      [back.re[p], back.im[p]] = [a[p] + b[j], a[j] - b[p]];
    }
    return { ahead, back };
  }

  /** Fields O {re, im} (p,) at a place, from the real fields there. */
  outputs(own) {
    return { re: own.subarray(0, this.width / 2), im: own.subarray(this.width / 2) };
  }
}
