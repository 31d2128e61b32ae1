// Motion by its lines: which are seen, their sum at a time, and how long a loop of it is.

const NEGLIGIBLE = 3e-3; // of the strongest line at its largest: weaker ones are not drawn
const LOUD = 0.03; // of the strongest line: those of which a loop is made
const LONGEST = 0.4, CLOSED = 0.02; // s of a loop; RMS misfit at its seam that is not seen
const STEP = 0.4; // mm between dots of a path

/** 1, 1.5, 2, 3, 5 or 7 times a power of ten, at most `value`. */
export function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [7, 5, 3, 2, 1.5, 1].find((step) => step * power <= value * (1 + 1e-9));
}

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

/** Sum of lines at a time in s at points `at` (all if not given), into `out`. */
export function synthesise({ n, lines }, { re, im }, time, out, at = null) {
  out.fill(0);
  for (const { f, from } of lines) {
    const c = Math.cos(2 * Math.PI * f * time), s = Math.sin(2 * Math.PI * f * time);
    if (at) at.forEach((k, j) => { out[j] += re[from + k] * c - im[from + k] * s; });
    else for (let k = 0; k < n; k++) out[k] += re[from + k] * c - im[from + k] * s;
  }
  return out;
}

/** Time in s after which lines are the same again, or nearly so, and whether they are. */
export function loopOf(lines) {
  const most = Math.max(0, ...lines.map((line) => line.largest));
  const heard = lines.filter((line) => line.f > 0 && line.largest > LOUD * most);
  const power = heard.reduce((sum, line) => sum + line.largest ** 2, 0) || 1;
  const fastest = Math.max(1, ...heard.map((line) => line.f));
  const slowest = Math.min(fastest, ...heard.map((line) => line.f));
  let best = { period: LONGEST, misfit: Infinity };
  for (let period = 0.9 / slowest; period <= Math.max(LONGEST, 1.1 / slowest); period += 0.05 / fastest) {
    let misfit = 0;
    for (const { f, largest } of heard) misfit += 2 * largest ** 2 * (1 - Math.cos(2 * Math.PI * f * period));
    misfit = Math.sqrt(misfit / power);
    if (misfit < best.misfit) best = { period, misfit };
    else if (best.misfit < CLOSED) break;
  }
  return { period: best.period, repeats: best.misfit < 5 * CLOSED };
}

/** Points [x, y] in mm along paths in metre, close enough to look like a line. */
export function dots(path) {
  const found = [];
  for (const line of path.length && typeof path[0][0] === "number" ? [path] : path) {
    for (let k = 1; k < line.length; k++) {
      const [x, y] = line[k - 1].map((v) => 1e3 * v), [u, v] = line[k].map((w) => 1e3 * w);
      const parts = Math.ceil(Math.hypot(u - x, v - y) / STEP) || 1;
      for (let j = 0; j < parts; j++) found.push([x + (u - x) * j / parts, y + (v - y) * j / parts]);
    }
  }
  return found;
}
