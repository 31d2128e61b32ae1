// Of both pages: recorded lines, and what follows from them.
const recorded = __RECORDED__;
const by = id => document.getElementById(id);
const speeds = [...new Set(recorded.tactons.map(t => t.speed))];

function unpack(part, lines, places) {
  const bytes = Uint8Array.from(atob(part.values), c => c.charCodeAt(0));
  const raw = new DataView(bytes.buffer), re = [], im = [];
  for (let l = 0, at = 0; l < lines; l++) {
    re.push(new Float64Array(places)); im.push(new Float64Array(places));
    for (let p = 0; p < places; p++, at += 4) {
      re[l][p] = raw.getInt16(at, true) * part.scale[l];
      im[l][p] = raw.getInt16(at + 2, true) * part.scale[l];
    }
  }
  const rms = new Float64Array(places);
  for (let p = 0; p < places; p++) {
    let sum = 0;
    for (let l = 0; l < lines; l++) sum += re[l][p] ** 2 + im[l][p] ** 2;
    rms[p] = Math.sqrt(sum / 2);
  }
  return {re, im, rms, largest: Math.max(...rms)};
}
const ready = new Map();
function tacton() {
  const found = recorded.tactons.find(t => t.speed === speeds[+by("speed").value] && (t.am > 0) === by("am").checked);
  if (!ready.has(found)) {
    const n = found.frequencies.length, places = found.side ** 2;
    ready.set(found, {...found, kernel: unpack(found.kernel, n, places), waves: unpack(found.waves, n, places)});
  }
  return ready.get(found);
}

function at(part, frequencies, p, t) {
  let sum = 0;
  for (let l = 0; l < frequencies.length; l++) {
    const turn = 2 * Math.PI * frequencies[l] * t;
    sum += part.re[l][p] * Math.cos(turn) - part.im[l][p] * Math.sin(turn);
  }
  return sum;
}
// All places at once.
function field(part, frequencies, t) {
  const sum = new Float64Array(part.rms.length);
  frequencies.forEach((f, l) => {
    const cos = Math.cos(2 * Math.PI * f * t), sin = Math.sin(2 * Math.PI * f * t), re = part.re[l], im = part.im[l];
    for (let p = 0; p < sum.length; p++) sum[p] += re[p] * cos - im[p] * sin;
  });
  return sum;
}
function share(t) {
  let outside = 0, all = 0;
  t.waves.rms.forEach((u, p) => { all += u * u; if (t.kernel.rms[p] < 0.1 * t.kernel.largest) outside += u * u; });
  return outside / all;
}
const shown = x => x >= 9.95 ? x.toFixed(0) : x.toPrecision(2);

function told(t) {
  by("speed-shown").value = `${t.speed} m/s`;
  by("slow-shown").value = `${Math.round(10 ** +by("slow").value)} times`;
  by("found").textContent = `Waves carry ${Math.round(100 * share(t))} % of the mean-square motion shown here to where the point kernel has less than a tenth of its largest.`;
}

let time = 0, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, last = 0;
function say() { by("play").textContent = playing ? "Pause" : "Play"; }
by("play").onclick = () => { playing = !playing; say(); };
by("speed").max = speeds.length - 1; by("speed").value = speeds.length - 1;
