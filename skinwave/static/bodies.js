// Bodies of the page's data, made ready to answer: steady lines anywhere, and waveforms from rest.

import { ModalBody } from "./modal.js";
import { MAP_LINE } from "./numbers.js";
import { opened } from "./pack.js";
import { PoleBody } from "./poles.js";
import { RadialBody } from "./radial.js";

const SIDE = MAP_LINE.length;

const OPENERS = { radial: RadialBody, modal: ModalBody, poles: PoleBody };

/** The body of a record: its fields, `respond(load)` and its `shape`. */
export function openBody(record) {
  const { pack, ...rest } = record, body = new OPENERS[pack.kind](opened(pack));
  const respond = (load) => {
    const motion = OPENERS[pack.kind].prototype.respond.call(body, load);
    return Object.assign(motion, { surface: () => surfaceMotion(body, motion) });
  };
  const shape = body.grid ? bodyShape(body, record) : slabShape(record);
  return Object.assign(body, rest, { shape, respond });
}

/** Upward motion {re, im} (l, n) in metre of the points of a body's shape; its sides are at rest. */
function surfaceMotion(body, motion) {
  const { at } = body.shape, found = motion.onGrid(MAP_LINE, MAP_LINE), count = motion.f.length;
  const re = new Float32Array(count * at.length), im = new Float32Array(re.length);
  for (let l = 0; l < count; l++) {
    for (let k = 0; k < at.length; k++) {
      if (at[k] < 0) continue;
      re[l * at.length + k] = -found.re[l * SIDE * SIDE + at[k]];
      im[l * at.length + k] = -found.im[l * SIDE * SIDE + at[k]];
    }
  }
  return { re, im };
}

/** A square part of a laterally infinite body: points in mm, z upwards, its sides at rest. */
const slabShape = ({ depth_mm: depth = 20 }) => shapeOf(() => true, () => 0, depth);

/** The surface of a bounded body where it is on a map, and its sides. */
function bodyShape({ grid, heights }, { depth_mm: depth }) {
  const heightAt = (x, y) => (heights ? grid.at(heights, 1, x, y)[0] : 0);
  return shapeOf((x, y) => grid.isInside(x, y), heightAt, depth);
}

/**
 * Points (3 n,) in mm and triangles of a surface over the map, and of its sides down to a depth in
 * mm; `at` (n,) is the place of the map of each point, -1 of one at rest.
 */
function shapeOf(isInside, heightAt, depth) {
  const index = new Int32Array(SIDE * SIDE).fill(-1);
  const points = [], triangles = [], at = [], sides = new Map();
  for (let k = 0; k < SIDE * SIDE; k++) {
    const column = k % SIDE, row = Math.floor(k / SIDE);
    const x = MAP_LINE[column], y = MAP_LINE[row];
    if (!isInside(x, y)) continue;
    index[k] = at.length;
    at.push(k);
    points.push(1e3 * x, 1e3 * y, heightAt(x, y));
  }
  const edge = (a, b) => {
    if (sides.has(`${b} ${a}`)) sides.delete(`${b} ${a}`); else sides.set(`${a} ${b}`, [a, b]);
  };
  for (let row = 0; row < SIDE - 1; row++) {
    for (let column = 0; column < SIDE - 1; column++) {
      const k = row * SIDE + column;
      const [a, b, c, d] = [index[k], index[k + 1], index[k + SIDE + 1], index[k + SIDE]];
      if (Math.min(a, b, c, d) < 0) continue;
      triangles.push(a, b, c, a, c, d);
      for (const [from, to] of [[a, b], [b, c], [c, d], [d, a]]) edge(from, to);
    }
  }
  const low = Math.min(depth || 1, 1e3 * MAP_LINE[SIDE - 1] / 2), below = new Map();
  const lower = (k) => {
    if (!below.has(k)) {
      below.set(k, at.length);
      at.push(-1);
      points.push(points[3 * k], points[3 * k + 1], Math.min(points[3 * k + 2], 0) - low);
    }
    return below.get(k);
  };
  for (const [a, b] of sides.values()) triangles.push(a, lower(a), b, b, lower(a), lower(b));
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles), at };
}
