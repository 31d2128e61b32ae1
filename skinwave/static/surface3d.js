// A moving surface for drawing: its extent, shading, strong lines and their sum at a time, and places on it.

import { largestOf } from "./numeric.js";

const STEEP = 0.3; // cosine of the slope below which a surface is shaded flat
const NEGLIGIBLE = 3e-3; // of the strongest line at its largest: weaker lines are not drawn
const CREST = 2; // times the largest RMS: end of the scale of colours
const STEP = 0.5; // mm between dots of a path

/** Smallest and largest {low, high} x, y, z of points (3 n). */
export function bounds({ points }) {
  const low = [Infinity, Infinity, Infinity], high = low.map((v) => -v);
  points.forEach((v, k) => {
    low[k % 3] = Math.min(low[k % 3], v);
    high[k % 3] = Math.max(high[k % 3], v);
  });
  return { low, high };
}

/**
 * Write upward normals of triangles that are not steep into the last three of every five floats of `out`
 * (5 n), for moved points `places` (3 n).
 */
export function shade({ triangles }, places, out) {
  for (let p = 0; p < out.length; p += 5) out[p + 2] = out[p + 3] = out[p + 4] = 0;
  for (let k = 0; k < triangles.length; k += 3) {
    const a = 3 * triangles[k], b = 3 * triangles[k + 1], c = 3 * triangles[k + 2];
    const ux = places[b] - places[a], uy = places[b + 1] - places[a + 1], uz = places[b + 2] - places[a + 2];
    const vx = places[c] - places[a], vy = places[c + 1] - places[a + 1], vz = places[c + 2] - places[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    if (Math.abs(z) < STEEP * Math.hypot(x, y, z)) continue;
    for (const corner of [a, b, c]) {
      const p = 5 * corner / 3, sign = Math.sign(z);
      out[p + 2] += sign * x;
      out[p + 3] += sign * y;
      out[p + 4] += sign * z;
    }
  }
}

/** Place of [x, y] in mm on the upper side, as corners of a triangle and their weights; null off the body. */
export function locate({ points, triangles }, x, y) {
  let upper = null;
  for (let k = 0; k < triangles.length; k += 3) {
    const a = triangles[k], b = triangles[k + 1], c = triangles[k + 2];
    const ax = points[3 * a] - x, ay = points[3 * a + 1] - y, bx = points[3 * b] - x;
    const by = points[3 * b + 1] - y, cx = points[3 * c] - x, cy = points[3 * c + 1] - y;
    const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, area = wa + wb + wc;
    if (!area || Math.min(wa / area, wb / area, wc / area) < -1e-6) continue;
    const weights = [wa / area, wb / area, wc / area];
    const z = [a, b, c].reduce((sum, corner, j) => sum + weights[j] * points[3 * corner + 2], 0);
    if (!upper || z > upper.z) upper = { corners: [a, b, c], weights, x, y, z };
  }
  return upper;
}

/**
 * Strong lines of a motion re, im (l * n) of n points: {n, lines, largest, crest}, with the largest
 * amplitude of each line (l,), and CREST times the largest RMS.
 */
export function strongLines({ f, re, im }) {
  const n = f.length ? re.length / f.length : 0, lines = [], squares = new Float64Array(n);
  for (let line = 0; line < f.length; line++) {
    let largest = 0;
    for (let k = line * n; k < (line + 1) * n; k++) {
      const power = re[k] * re[k] + im[k] * im[k];
      squares[k - line * n] += power / 2;
      if (power > largest) largest = power;
    }
    lines.push({ f: f[line], from: line * n, largest: Math.sqrt(largest) });
  }
  const most = Math.max(0, ...lines.map((line) => line.largest));
  const strong = lines.filter((line) => line.largest > NEGLIGIBLE * most);
  const largest = lines.map((line) => line.largest), crest = CREST * Math.sqrt(largestOf(squares));
  return { n, lines: strong, largest, crest };
}

/** Write the sum of lines at a time in s into `out` (n,). */
export function synthesise({ n, lines }, { re, im }, time, out) {
  out.fill(0);
  for (const { f, from } of lines) {
    const c = Math.cos(2 * Math.PI * f * time), s = Math.sin(2 * Math.PI * f * time);
    for (let k = 0; k < n; k++) out[k] += re[from + k] * c - im[from + k] * s;
  }
}

/** Points [x, y] in mm, at most STEP apart, along a path of points in metre. */
export function dots(path) {
  return path.flatMap(([x, y], k) => {
    const [u, v] = path[k + 1] ?? [x, y], parts = Math.ceil(1e3 * Math.hypot(u - x, v - y) / STEP) || 1;
    return Array.from({ length: parts }, (_, j) => [x + (u - x) * j / parts, y + (v - y) * j / parts])
      .map((at) => at.map((metre) => 1e3 * metre));
  });
}
