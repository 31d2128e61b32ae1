// Contours of values on a square grid.

/**
 * Closed and open lines [[[x, y], ...], ...], in steps of the grid, where values (n * n) are 0:
 * marching squares.
 */
export function contours(values, n) {
  const links = new Map(); // crossed edge -> the edges that its line leads to
  const link = (a, b) => {
    links.set(a, [...(links.get(a) || []), b]);
    links.set(b, [...(links.get(b) || []), a]);
  };
  for (let j = 0; j + 1 < n; j++) {
    for (let i = 0; i + 1 < n; i++) {
      const k = j * n + i, corners = [values[k], values[k + 1], values[k + n + 1], values[k + n]];
      if (corners.some(Number.isNaN)) continue;
      const edges = [2 * k, 2 * (k + 1) + 1, 2 * (k + n), 2 * k + 1]; // below, right, above, left
      const crossed = edges.filter((_, e) => (corners[e] > 0) !== (corners[(e + 1) % 4] > 0));
      if (crossed.length === 2) link(...crossed);
      if (crossed.length < 4) continue;
      const joined = (corners[0] + corners[1] + corners[2] + corners[3] > 0) === (corners[0] > 0);
      for (const [a, b] of joined ? [[0, 1], [2, 3]] : [[0, 3], [1, 2]]) link(edges[a], edges[b]);
    }
  }
  const at = (edge) => {
    const k = edge >> 1, next = edge % 2 ? k + n : k + 1, part = values[k] / (values[k] - values[next]);
    const [i, j] = [k % n, Math.floor(k / n)];
    return edge % 2 ? [i, j + part] : [i + part, j];
  };
  const lines = [], seen = new Set();
  const ends = [...links.keys()].filter((edge) => links.get(edge).length === 1);
  for (const first of [...ends, ...links.keys()]) {
    if (seen.has(first)) continue;
    const line = [];
    let edge = first;
    while (edge !== undefined) {
      seen.add(edge);
      line.push(at(edge));
      edge = links.get(edge).find((other) => !seen.has(other));
    }
    const last = line.length > 2 && links.get(first).length === 2;
    lines.push(last ? [...line, line[0]] : line);
  }
  return lines;
}
