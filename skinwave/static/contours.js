// Contours of values on a square grid.

/** Straight parts [[[x, y], [x, y]], ...], in steps of the grid, of where values (n * n) are 0. */
export function contours(values, n) {
  const found = [];
  for (let j = 0; j + 1 < n; j++) {
    for (let i = 0; i + 1 < n; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const own = corners.map(([x, y]) => values[y * n + x]);
      if (own.some(Number.isNaN)) continue;
      const ends = corners.flatMap(([x, y], k) => {
        const next = (k + 1) % 4, part = own[k] / (own[k] - own[next]);
        if ((own[k] > 0) === (own[next] > 0)) return [];
        return [[x + part * (corners[next][0] - x), y + part * (corners[next][1] - y)]];
      });
      // Two lines through a cell are apart on the side of its mean.
      const turned = own.reduce((sum, v) => sum + v) > 0 === own[0] > 0;
      const order = ends.length === 4 && !turned ? [3, 0, 1, 2] : [0, 1, 2, 3];
      for (let k = 0; k + 1 < ends.length; k += 2) found.push([ends[order[k]], ends[order[k + 1]]]);
    }
  }
  return found;
}
