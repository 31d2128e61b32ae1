// Surfaces for drawing: closed from below, outside out, with edges where they are sharp.

const SHARP = 0.55; // cosine between two faces that share no shading
const CELLS = 32; // along a side of what finds triangles
const BELOW = 0.5; // mm below the top: an open rim there is closed

/** Normal, not of length 1, of the triangle with corners at a, b, c of places (3 n). */
function normalOf(places, a, b, c, out) {
  const ux = places[3 * b] - places[3 * a], uy = places[3 * b + 1] - places[3 * a + 1];
  const uz = places[3 * b + 2] - places[3 * a + 2], vx = places[3 * c] - places[3 * a];
  const vy = places[3 * c + 1] - places[3 * a + 1], vz = places[3 * c + 2] - places[3 * a + 2];
  out[0] = uy * vz - uz * vy;
  out[1] = uz * vx - ux * vz;
  out[2] = ux * vy - uy * vx;
  return out;
}

/** Edges [a, b] of one triangle alone, in its direction. */
function rim(triangles) {
  const edges = new Map();
  for (let k = 0; k < triangles.length; k++) {
    const a = triangles[k], b = triangles[k % 3 === 2 ? k - 2 : k + 1];
    const key = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
    edges.set(key, edges.has(key) ? null : [a, b]);
  }
  return [...edges.values()].filter(Boolean);
}

/**
 * A surface made ready to be drawn.
 * @param {{points: Float32Array, triangles: Uint32Array}} shape points in mm, z upwards
 * @returns {{places, triangles, source, isClosed, low, high}} source: point of the shape that each place
 *   moves with, as many as there are points for none; low, high: ends of x, y, z in mm
 */
export function prepare({ points, triangles }) {
  const count = points.length / 3, ends = [0, 1, 2].map((axis) => {
    let low = Infinity, high = -Infinity;
    for (let k = axis; k < points.length; k += 3) {
      low = Math.min(low, points[k]);
      high = Math.max(high, points[k]);
    }
    return [low, high];
  });
  const faces = Array.from(triangles), at = Array.from(points);
  const open = rim(faces), top = ends[2][1];
  const isClosed = open.every(([a]) => points[3 * a + 2] < top - BELOW);
  if (isClosed && open.length) {
    const sum = (axis) => open.reduce((all, [a]) => all + points[3 * a + axis], 0);
    at.push(...[0, 1, 2].map((axis) => sum(axis) / open.length));
    for (const [a, b] of open) faces.push(b, a, count);
  }
  const n = [0, 0, 0];
  if (isClosed) {
    let volume = 0;
    for (let k = 0; k < faces.length; k += 3) {
      normalOf(at, faces[k], faces[k + 1], faces[k + 2], n);
      for (let axis = 0; axis < 3; axis++) volume += n[axis] * at[3 * faces[k] + axis];
    }
    for (let k = 0; volume < 0 && k < faces.length; k += 3) {
      [faces[k], faces[k + 1]] = [faces[k + 1], faces[k]];
    }
  }
  // Places of a point: one for each direction in which faces about it look.
  const ways = new Map(), source = [], places = [], corners = new Uint32Array(faces.length);
  for (let k = 0; k < faces.length; k += 3) {
    normalOf(at, faces[k], faces[k + 1], faces[k + 2], n);
    const size = Math.hypot(...n) || 1, own = n.map((v) => v / size);
    for (let c = k; c < k + 3; c++) {
      const point = faces[c], known = ways.get(point) || [];
      let found = known.find(({ way }) => way[0] * own[0] + way[1] * own[1] + way[2] * own[2] > SHARP);
      if (!found) {
        found = { way: own, place: source.length };
        ways.set(point, [...known, found]);
        source.push(point);
        places.push(at[3 * point], at[3 * point + 1], at[3 * point + 2]);
      }
      corners[c] = found.place;
    }
  }
  return { places: Float32Array.from(places), triangles: corners, source: Uint32Array.from(source),
    isClosed, low: ends.map((e) => e[0]), high: ends.map((e) => e[1]) };
}

/** Write normals into the last three of every five floats of `out` (5 n); `places` (3 n) have moved. */
export function shade({ triangles }, places, out) {
  const n = [0, 0, 0];
  for (let p = 0; p < out.length; p += 5) out[p + 2] = out[p + 3] = out[p + 4] = 0;
  for (let k = 0; k < triangles.length; k += 3) {
    normalOf(places, triangles[k], triangles[k + 1], triangles[k + 2], n);
    for (let c = k; c < k + 3; c++) {
      const p = 5 * triangles[c];
      out[p + 2] += n[0];
      out[p + 3] += n[1];
      out[p + 4] += n[2];
    }
  }
}

/** Triangles that reach into each of CELLS * CELLS equal cells of the area from above. */
function cellsOf({ places, triangles, low, high }) {
  const cells = Array.from({ length: CELLS ** 2 }, () => []);
  const cell = (value, axis) => cellOf(value, low[axis], high[axis]);
  for (let k = 0; k < triangles.length; k += 3) {
    const corners = [0, 1, 2].map((c) => 3 * triangles[k + c]);
    const [xs, ys] = [0, 1].map((axis) => corners.map((c) => places[c + axis]));
    for (let j = cell(Math.min(...ys), 1); j <= cell(Math.max(...ys), 1); j++) {
      for (let i = cell(Math.min(...xs), 0); i <= cell(Math.max(...xs), 0); i++) cells[j * CELLS + i].push(k);
    }
  }
  return cells;
}

const cellOf = (value, low, high) => {
  const cell = Math.floor(CELLS * (value - low) / (high - low));
  return Math.min(Math.max(cell, 0), CELLS - 1);
};

/** Where [x, y] in mm is on the upper side: corners of a triangle and their weights; null off the body. */
export function locate(mesh, x, y) {
  const { places, triangles, low, high } = mesh;
  let found = null;
  mesh.cells ||= cellsOf(mesh);
  for (const k of mesh.cells[cellOf(y, low[1], high[1]) * CELLS + cellOf(x, low[0], high[0])]) {
    const a = triangles[k], b = triangles[k + 1], c = triangles[k + 2];
    const ax = places[3 * a] - x, ay = places[3 * a + 1] - y, bx = places[3 * b] - x;
    const by = places[3 * b + 1] - y, cx = places[3 * c] - x, cy = places[3 * c + 1] - y;
    const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, area = wa + wb + wc;
    if (!area || Math.min(wa / area, wb / area, wc / area) < -1e-6) continue;
    const weights = [wa / area, wb / area, wc / area];
    const z = [a, b, c].reduce((sum, corner, k) => sum + weights[k] * places[3 * corner + 2], 0);
    if (!found || z > found.z) found = { corners: [a, b, c], weights, x, y, z };
  }
  return found;
}
