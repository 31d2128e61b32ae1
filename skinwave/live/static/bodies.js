// Bodies of the page's data, made ready to answer: steady lines anywhere, and waveforms from rest.

import { opened } from "./pack.js";
import { RadialBody } from "./radial.js";

const SIDE = 41, HALF = 0.044; // places along a side of a slab's part that is drawn, and half of it

const OPENERS = { radial: (pack, record) => Object.assign(new RadialBody(pack), { shape: slabShape(record) }) };

/** The body of a record: its fields, `respond(load)` and its `shape`. */
export function openBody(record) {
  const { pack, ...rest } = record;
  return Object.assign(OPENERS[pack.kind](opened(pack), record), rest);
}

/** A square part of a laterally infinite body: points in mm, z upwards, its sides at rest. */
function slabShape({ depth_mm: depth = 20 }) {
  const points = [], triangles = [], rim = [], mm = 1e3 * HALF;
  for (let row = 0; row < SIDE; row++) {
    for (let column = 0; column < SIDE; column++) {
      points.push(mm * (2 * column / (SIDE - 1) - 1), mm * (2 * row / (SIDE - 1) - 1), 0);
    }
  }
  for (let row = 0; row < SIDE - 1; row++) {
    for (let column = 0; column < SIDE - 1; column++) {
      const a = row * SIDE + column;
      triangles.push(a, a + 1, a + SIDE + 1, a, a + SIDE + 1, a + SIDE);
    }
  }
  for (let k = 0; k < SIDE - 1; k++) rim.push(k);
  for (let k = 0; k < SIDE - 1; k++) rim.push(k * SIDE + SIDE - 1);
  for (let k = SIDE - 1; k > 0; k--) rim.push((SIDE - 1) * SIDE + k);
  for (let k = SIDE - 1; k > 0; k--) rim.push(k * SIDE);
  const first = SIDE * SIDE, low = Math.min(depth, mm / 2);
  rim.forEach((k, j) => {
    const next = (j + 1) % rim.length;
    points.push(points[3 * k], points[3 * k + 1], -low);
    triangles.push(k, first + j, rim[next], rim[next], first + j, first + next);
  });
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles), side: SIDE };
}
