// Motion by its lines: which are seen, their sum at a time, and its RMS; the dots of a path.

const NEGLIGIBLE = 3e-3; // of the strongest line at its largest: weaker ones are not drawn
const STEP = 0.4; // mm between dots of a path

/** Lines above NEGLIGIBLE, with their largest amplitudes; re, im (l * n). */
export function strongLines({ f, re, im }) {
  const n = f.length ? re.length / f.length : 0, lines = [];
  for (let line = 0; line < f.length; line++) {
    let largest = 0;
    for (let k = line * n; k < (line + 1) * n; k++) {
      const power = re[k] * re[k] + im[k] * im[k];
      if (power > largest) largest = power;
    }
    lines.push({ f: f[line], from: line * n, largest: Math.sqrt(largest) });
  }
  const most = Math.max(0, ...lines.map((line) => line.largest));
  return { n, lines: lines.filter((line) => line.largest > NEGLIGIBLE * most) };
}

/** Sum of lines at a time in s into `out` (n,). */
export function synthesise({ n, lines }, { re, im }, time, out) {
  out.fill(0);
  for (const { f, from } of lines) {
    const c = Math.cos(2 * Math.PI * f * time), s = Math.sin(2 * Math.PI * f * time);
    for (let k = 0; k < n; k++) out[k] += re[from + k] * c - im[from + k] * s;
  }
}

/** RMS (n,) of lines, which are above 0 Hz. */
export function rmsOf({ n, lines }, { re, im }) {
  const rms = new Float32Array(n);
  for (const { from } of lines) {
    for (let k = 0; k < n; k++) rms[k] += (re[from + k] * re[from + k] + im[from + k] * im[from + k]) / 2;
  }
  return rms.map(Math.sqrt);
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
