// Bodies of the page's data, opened for computing: steady lines anywhere, and waveforms from rest.

import { ModalBody } from "./modal.js";
import { MAP_LINE } from "./evaluate.js";
import { unpacked } from "./pack.js";
import { PoleBody } from "./poles.js";
import { RadialBody } from "./radial.js";

const SIDE = MAP_LINE.length;

const BODIES = { radial: RadialBody, modal: ModalBody, poles: PoleBody };

/** Open the body of a record: its fields, with its `shape` and `motion(load)`. */
export function openBody({ pack, ...rest }) {
  const body = new BODIES[pack.kind](unpacked(pack));
  return Object.assign(body, rest, { shape: shapeOf(body) });
}

/** Upward motion {f, re, im} (l, n) in metre of the points of a shape, from a map. */
export function surfaceMotion({ at }, map) {
  const n = at.length, upwards = (values) => {
    const out = new Float32Array(map.f.length * n);
    for (let k = 0; k < out.length; k++) out[k] = -values[Math.floor(k / n) * SIDE * SIDE + at[k % n]];
    return out;
  };
  return { f: map.f, re: upwards(map.re), im: upwards(map.im) };
}

/**
 * Surface of a body as far as it is on a map, flat by default: points (3 n,) in mm, z upwards, triangles, and
 * the place on the map of each point `at` (n,).
 */
export function shapeOf({ grid, heights }) {
  const index = new Int32Array(SIDE * SIDE).fill(-1), points = [], triangles = [], at = [];
  for (let k = 0; k < SIDE * SIDE; k++) {
    const x = MAP_LINE[k % SIDE], y = MAP_LINE[Math.floor(k / SIDE)];
    if (grid && !grid.isInside(x, y)) continue;
    index[k] = at.length;
    at.push(k);
    points.push(1e3 * x, 1e3 * y, heights ? grid.at(heights, 1, x, y)[0] : 0);
  }
  for (let row = 0; row < SIDE - 1; row++) {
    for (let column = 0; column < SIDE - 1; column++) {
      const k = row * SIDE + column;
      const [a, b, c, d] = [index[k], index[k + 1], index[k + SIDE + 1], index[k + SIDE]];
      if (Math.min(a, b, c, d) >= 0) triangles.push(a, b, c, a, c, d);
    }
  }
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles), at };
}
