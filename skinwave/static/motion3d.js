// Motion by its lines: which are seen, and their sum at a time; the dots of a path.

const NEGLIGIBLE = 3e-3; // of the strongest line at its largest: weaker ones are not drawn
const CREST = 2; // times the largest RMS: where colours end
const STEP = 0.5; // mm between dots of a path

/**
 * {n, lines, crest}: lines above NEGLIGIBLE, with their largest amplitudes, and CREST times the largest
 * RMS of n points; re, im (l * n).
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
  const kept = lines.filter((line) => line.largest > NEGLIGIBLE * most);
  return { n, lines: kept, crest: CREST * Math.sqrt(Math.max(0, ...squares)) };
}

/** Sum of lines at a time in s into `out` (n,). */
export function synthesise({ n, lines }, { re, im }, time, out) {
  out.fill(0);
  for (const { f, from } of lines) {
    const c = Math.cos(2 * Math.PI * f * time), s = Math.sin(2 * Math.PI * f * time);
    for (let k = 0; k < n; k++) out[k] += re[from + k] * c - im[from + k] * s;
  }
}

/** Points [x, y] in mm along paths of points in metre, close enough to look like a line. */
export function dots(paths) {
  const found = [];
  for (const line of paths) {
    for (let k = 1; k < line.length; k++) {
      const [x, y] = line[k - 1].map((v) => 1e3 * v), [u, v] = line[k].map((w) => 1e3 * w);
      const parts = Math.ceil(Math.hypot(u - x, v - y) / STEP) || 1;
      for (let j = 0; j < parts; j++) found.push([x + (u - x) * j / parts, y + (v - y) * j / parts]);
    }
  }
  return found;
}
