// Surfaces for drawing: their ends, their shading, and where a place is on them.

const STEEP = 0.3; // cosine of the slope from where a surface is shaded flat

/** Ends {low, high} of x, y, z of points (3 n). */
export function bounds({ points }) {
  const low = [Infinity, Infinity, Infinity], high = low.map((v) => -v);
  points.forEach((v, k) => {
    low[k % 3] = Math.min(low[k % 3], v);
    high[k % 3] = Math.max(high[k % 3], v);
  });
  return { low, high };
}

/**
 * Write upward normals of what is not steep into the last three of every five floats of `out` (5 n);
 * `places` (3 n) have moved.
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

/** Where [x, y] in mm is on the upper side: corners of a triangle and their weights; null off the body. */
export function locate({ points, triangles }, x, y) {
  let found = null;
  for (let k = 0; k < triangles.length; k += 3) {
    const a = triangles[k], b = triangles[k + 1], c = triangles[k + 2];
    const ax = points[3 * a] - x, ay = points[3 * a + 1] - y, bx = points[3 * b] - x;
    const by = points[3 * b + 1] - y, cx = points[3 * c] - x, cy = points[3 * c + 1] - y;
    const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, area = wa + wb + wc;
    if (!area || Math.min(wa / area, wb / area, wc / area) < -1e-6) continue;
    const weights = [wa / area, wb / area, wc / area];
    const z = [a, b, c].reduce((sum, corner, j) => sum + weights[j] * points[3 * corner + 2], 0);
    if (!found || z > found.z) found = { corners: [a, b, c], weights, x, y, z };
  }
  return found;
}
