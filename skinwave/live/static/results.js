// What the page shows of an answer: tiles, plots, tables and maps, as data for what draws them.

import { inQuantity, lineName, typeset } from "./answer.js";
import { drawingFrequency, gainAt, positionOf, relativeIntensity, rhythmLevel } from "./load.js";
import { QUANTITIES, amplitudesOf, lineTable, spectrum, thresholdAt } from "./numbers.js";
import { escaped, niceTop, rounded, subscripted } from "./plots.js";
import { LABELS, NUMBERS, STARTS, shown } from "./values.js";

export const OVER = { speed: [0.5, 40], size: [2, 60], am: [10, 400], height: [100, 400] };
const SAMPLES = 700, FINEST = 2.5e-4; // points of a curve at least; s between them at most
const DENSE = 12; // points in a period of the fastest tone
const DYNAMIC = 60; // dB that a spectrum shows
const APART = 3.5; // px between stems of the same line
const NAMED = 7; // lines that have a name
const PRESSURE = { per: 1, rate: 0 };

/** Start and end in s of what a choice shows of a load. */
export function spanOf(name, load) {
  const { duration, pulses } = load, period = pulses?.reduce((sum, [on, gap]) => sum + on + gap, 0);
  if (name === "last 60 ms") return [Math.max(0, duration - 0.06), duration];
  if (name === "whole Tacton") return [0, duration];
  if (period && (name === "one rhythm" || name === "auto")) return [0, Math.min(period, duration)];
  return [0, Math.min(name === "first 20 ms" ? 0.02 : 0.06, duration)];
}

/** Waveform {x in ms, y} within a span in s, in the unit of a quantity. */
function waveform(motion, [x, y], [start, end], { per, rate }) {
  const count = Math.max(SAMPLES, Math.ceil(end / FINEST)), dt = end / count;
  const times = Float64Array.from({ length: count + 1 }, (_, k) => k * dt);
  let values = motion.waveform(x, y, times);
  for (let n = 0; n < rate; n++) {
    const own = values;
    values = own.map((_, k) => (own[Math.min(k + 1, count)] - own[Math.max(k - 1, 0)])
      / (dt * (Math.min(k + 1, count) - Math.max(k - 1, 0))));
  }
  const first = Math.floor(start / dt);
  return { x: Array.from(times.subarray(first), (t) => 1e3 * t), y: Array.from(values.subarray(first),
    (v) => per * v) };
}

/** Amplitude of the sound at a focus over a span: {x in ms, y in % of full drive}. */
function commanded(load, [start, end]) {
  const tones = load.am + load.am2 + load.envelope + 50;
  const count = Math.min(Math.max(400, Math.ceil((end - start) * tones * DENSE)), 6000);
  const full = load.peak * relativeIntensity(load.height) / load.foci.length;
  const x = new Array(count + 1), y = new Array(count + 1), own = { ...load };
  for (let k = 0; k <= count; k++) {
    const t = start + (end - start) * k / count;
    own.amplitude = load.amplitude * rhythmLevel(load, t);
    const driven = gainAt(own, t) / full;
    x[k] = 1e3 * t;
    y[k] = 100 * (load.drive === "linear" ? driven : Math.sqrt(Math.max(driven, 0)));
  }
  return { x, y };
}

/** Plot of the commanded signal. */
export function commandedPlot(answer, span) {
  const { x, y } = commanded(answer.load, span), mirrored = y.map((v) => -v);
  return {
    label: "Commanded signal over time, in per cent of full drive", kept: `${span}`,
    x: { label: "time, ms", range: span.map((t) => 1e3 * t) }, y: { label: "%", range: [-108, 108] },
    curves: [{ role: "drive", axis: "y", x, y, fill: true }, { role: "drive", axis: "y", x, y: mirrored,
      fill: true }],
  };
}

const largestOf = (values) => values.reduce((most, v) => Math.max(most, Math.abs(v)), 0);

/** A power of ten by which A is drawn larger or smaller if it differs from B by more than ten times. */
export function factorOf(a, b) {
  const ratio = Math.log10(b / a);
  return Number.isFinite(ratio) && Math.abs(ratio) > 1 ? 10 ** Math.round(ratio) : 1;
}

const nameOfA = (factor) => (factor === 1 ? "A" : `A × ${factor > 1 ? factor
  : factor.toFixed(-Math.log10(factor))}`);

/** Plot of the waveforms; `scale(name, largest)` gives the top of an axis. */
export function waveformPlot(answer, span, { pinned, measured, scale }) {
  const quantity = QUANTITIES[answer.values.quantity], at = [answer.x, answer.y];
  const curves = [{ role: "kernel", axis: "y", name: "kernel", ...waveform(answer.kernel, at, span,
    PRESSURE) }];
  if (answer.published) {
    curves.push({ role: "published", axis: "y", name: "as published", dash: "4 3",
      ...waveform(answer.published, at, span, PRESSURE) });
  }
  const own = waveform(answer.waves, at, span, quantity);
  if (pinned) {
    const { x, y } = waveform(pinned.waves, [pinned.x, pinned.y], span, quantity);
    const factor = factorOf(largestOf(y), largestOf(own.y));
    curves.push({ role: "pinned", axis: "y2", name: nameOfA(factor), x, y: y.map((v) => factor * v) });
  }
  curves.push({ role: "waves", axis: "y2", name: pinned ? "B" : "waves", ...own });
  if (measured?.times && measured.quantity === answer.values.quantity) {
    curves.push({ role: "measured", axis: "y2", name: "measured", x: measured.times.map((t) => 1e3 * t),
      y: nearestPlace(measured, answer, measured.values).map((v) => quantity.per * v) });
  }
  const axis = (name, label, role) => {
    const values = curves.filter((curve) => curve.axis === name).flatMap((curve) => curve.y);
    const top = scale(`waveform ${name} ${answer.values.quantity}`, largestOf(values));
    const least = Math.min(0, ...values.map((v) => v));
    return { label, role, top, least };
  };
  const [y, y2] = [axis("y", "Pa", "kernel"), axis("y2", quantity.unit, "waves")];
  const below = scale("waveform below", Math.max(-y.least / y.top, -y2.least / y2.top, 0.04));
  for (const own of [y, y2]) own.range = [-own.top * below, own.top];
  return { label: "Waveform at the point: pressure of the kernel in Pa and motion of the body",
    kept: `${span}`,
    x: { label: "time, ms", range: span.map((t) => 1e3 * t) }, y, y2, curves, hatched: answer.invalid };
}

/** Row of a measurement's curves at the place nearest the point. */
function nearestPlace({ places }, { x, y }, rows) {
  const away = places.map((at) => (at ? Math.hypot(at[0] - x, at[1] - y) : 0));
  return rows[away.indexOf(Math.min(...away))];
}

function measuredSpectrum(measured, answer, per, highest) {
  let f = measured.frequencies, a = f ? nearestPlace(measured, answer, measured.amplitudes) : null;
  if (!f) {
    const values = nearestPlace(measured, answer, measured.values), mean = values.reduce((sum, v) => sum
      + v, 0) / values.length;
    const found = spectrum(values.map((v) => v - mean), measured.times[1] - measured.times[0]);
    [f, a] = [Array.from(found.f), Array.from(found.amplitudes)];
  }
  const count = f.filter((at) => at <= highest).length;
  return [{ role: "measured", axis: "y2", name: "measured", x: f.slice(0, count), y: a.slice(0,
    count).map((v) => per * v) }];
}

/** Plot of the spectra as stems side by side, with the detection threshold of skin. */
export function spectrumPlot(answer, { pinned, measured, highest, decibel, scale }) {
  const quantity = QUANTITIES[answer.values.quantity], { f } = answer.waves;
  const stem = (role, axis, name, at, y, offset, head) => {
    const kept = Array.from(at, (_, k) => k).filter((k) => at[k] <= highest);
    return { role, axis, name, stems: true, offset, head, x: kept.map((k) => at[k]), y: kept.map((k) =>
      y[k]) };
  };
  const wide = pinned ? 2 * APART : APART;
  const curves = [
    stem("kernel", "y", "kernel", answer.kernel.f, amplitudesOf(answer.kernel.f, answer.kernelAt),
      -wide / 2, "square"),
    stem("waves", "y2", pinned ? "B" : "waves", f, inQuantity(f, answer.wavesAt, answer.values.quantity),
      wide / 2),
  ];
  if (answer.published) {
    curves.push({ ...stem("published", "y", "as published", answer.published.f,
      amplitudesOf(answer.published.f, answer.publishedAt), -1.5 * wide, "square") });
  }
  if (pinned) {
    const found = inQuantity(pinned.waves.f, pinned.wavesAt, answer.values.quantity);
    const factor = decibel ? 1 : factorOf(largestOf(found), largestOf(curves[1].y));
    curves.push(stem("pinned", "y2", nameOfA(factor), pinned.waves.f, found.map((v) => factor * v), 0));
  }
  const tops = { y: scale("spectrum y", 1.2 * Math.max(largestOf(curves[0].y), largestOf(curves.find((c) =>
    c.role === "published")?.y ?? []))),
    y2: scale(`spectrum y2 ${answer.values.quantity}`, 1.2 * Math.max(...curves.filter((c) =>
      c.axis === "y2").map((c) => largestOf(c.y)))) };
  if (measured && measured.quantity === answer.values.quantity) curves.push(...measuredSpectrum(measured,
    answer, quantity.per, highest));
  if (answer.body.is_skin && !quantity.rate) {
    const x = Array.from({ length: 120 }, (_, k) => 5 + k * (highest - 5) / 119);
    curves.push({ role: "threshold", axis: "y2", name: "threshold", dash: "5 3", x, y: x.map((at) =>
      1e6 * thresholdAt(at)) });
  }
  const beside = (x) => curves[0].y[curves[0].x.findIndex((own) => Math.abs(own - x) < 1e-3)] ?? 0;
  const named = curves[1].y.map((y, k) => ({ x: curves[1].x[k], y, axis: "y2", text: lineName(answer,
    curves[1].x[k]),
    above: { y: beside(curves[1].x[k]), axis: "y" } }))
    .filter(({ text }) => text).sort((a, b) => b.y - a.y).slice(0, NAMED);
  const axes = { y: { label: "Pa", role: "kernel", range: [0, tops.y] }, y2: { label: quantity.unit,
    role: "waves", range: [0, tops.y2] } };
  if (decibel) {
    for (const axis of ["y", "y2"]) {
      const top = 10 * Math.ceil(2 * Math.log10(tops[axis]) + 0.2), low = top - DYNAMIC;
      Object.assign(axes[axis], { label: `dB re 1 ${axes[axis].label}`, range: [low, top] });
      const level = (v) => Math.max(20 * Math.log10(Math.max(Math.abs(v), 1e-30)), low);
      for (const curve of curves) if (curve.axis === axis) Object.assign(curve, { y: curve.y.map(level),
        decibel: true });
      for (const { own } of named.flatMap((name) => [{ own: name }, { own: name.above }])) {
        if (own.axis === axis) own.y = level(own.y);
      }
    }
  }
  return { label: "Spectrum at the point: lines of the kernel in Pa and of the waves, side by side",
    kept: `${highest}`,
    x: { label: "frequency, Hz", range: [0, highest] }, ...axes, curves, names: named,
      hatched: answer.invalid };
}

/** Plot of the phase speeds of a body's waves with the lines of the load; null if it has none. */
export function dispersionPlot(answer, highest) {
  const { dispersion } = answer.body;
  if (!dispersion) return null;
  const speed = drawingFrequency(answer.load.path) ? answer.load.path.speed : 0;
  const slow = dispersion.branches.map(({ c }) => c.filter((v) => v !== null).sort((a, b) => a - b))
    .map((c) => c[Math.floor(c.length / 2)]).filter(Number.isFinite);
  const top = niceTop(1.5 * Math.max(speed, ...slow, 1));
  const curves = dispersion.branches.slice(0, 4).map(({ name, c }, k) => ({ role: `m${k + 1}`, axis: "y",
    name,
    x: dispersion.f, y: c.map((v) => v ?? NaN) }));
  if (speed) curves.push({ role: "kernel", axis: "y", name: "focus", dash: "5 3", x: [0, highest],
    y: [speed, speed] });
  const strong = Array.from(amplitudesOf(answer.waves.f, answer.wavesAt), (y, k) => ({ y,
    f: answer.waves.f[k] }))
    .filter((line) => line.f <= highest).sort((a, b) => b.y - a.y).slice(0, NAMED);
  for (const { f } of strong) curves.push({ role: "now", axis: "y", x: [f, f], y: [0, top], width: 1,
    dash: "2 3" });
  return { label: "Phase speed of the body's waves over frequency, with the lines of the load",
    kept: "dispersion",
    x: { label: "frequency, Hz", range: [0, highest] }, y: { label: "m/s", range: [0, top] }, curves,
    names: strong.map(({ f }) => ({ x: f, y: 0.8 * top, axis: "y", text: lineName(answer, f) })) };
}

/** Plot of levels {x, kernel, waves} over a control. */
export function levelPlot(answer, key, levels, best) {
  const { label, unit } = NUMBERS[key], now = answer.values[key];
  const ends = [...levels.waves, ...levels.kernel].filter(Number.isFinite), top =
    Math.ceil(Math.max(...ends, 6) / 5 + 0.6) * 5;
  const low = Math.max(Math.floor(Math.min(...ends, -5) / 5) * 5, top - 60);
  return { label: `Sensation level over ${label}`, kept: key,
    x: { label: `${label}, ${unit}`, range: OVER[key] }, y: { label: "dB above threshold", range: [low,
      top] },
    curves: [
      { role: "kernel", axis: "y", name: "kernel", x: levels.x, y: levels.kernel },
      { role: "waves", axis: "y", name: "waves", x: levels.x, y: levels.waves },
      { role: "threshold", axis: "y", x: OVER[key], y: [0, 0], dash: "5 3" },
      { role: "now", axis: "y", name: "now", x: [now, now], y: [low, top], dash: "2 3" },
    ],
    names: best ? [{ x: best.at, y: best.level, axis: "y",
      text: `${rounded(best.at)} ${unit}: ${signed(best.level)} dB` }] : [] };
}

export const signed = (value) => (Number.isFinite(value) ? `${value >= 0 ? "+"
  : "−"}${Math.abs(value).toFixed(0)}` : "–");

/** HTML of a tile; `kernel` and `pinned` are texts in small letters. */
const tile = (name, title, { value, detail = "", kernel = "", pinned = "" }) =>
  `<div class="tile" title="${escaped(title)}">
  <span class="name">${name}</span><span class="value">${value}</span><span class="detail">${detail}</span>
  <span class="kernel">${kernel}</span><span class="of-a">${pinned ? `A: ${pinned}` : ""}</span></div>`;

const subscript = (name) => escaped(name).replace(/_(\w+)/g, "<sub>$1</sub>");
const far = (reach) => (!reach ? "nowhere" : `${reach.beyond ? "> "
  : ""}${(1e3 * reach.metre).toFixed(0)} mm`);
const percent = (share) => (Number.isFinite(share) ? `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`
  : "–");
const delayed = (seconds) => (Number.isFinite(seconds) ? `${(1e3 * seconds).toFixed(1)} ms` : "–");

/** HTML of the four tiles. */
export function tiles(answer, pinned) {
  const { body, level, kernelLevel, reach, kernelReach, share, delay } = answer, a = pinned;
  const felt = body.is_skin;
  return [
    tile("Level at the point", "Largest component over the detection threshold of skin", {
      value: felt ? `${signed(level?.dB)} dB` : "–",
      detail: felt ? (level ? `${level.f.toFixed(0)} Hz (${subscript(lineName(answer, level.f) || "line")})`
        : "") : "no threshold: not skin",
      kernel: `kernel ${signed(kernelLevel?.dB)} dB`, pinned: a && (a.body.is_skin
        ? `${signed(a.level?.dB)} dB` : "–") }),
    tile("Reach above threshold", "Largest distance from the path at which a component is above threshold", {
      value: felt ? far(reach) : "–", detail: felt ? (reach ? "from the path" : "")
        : "no threshold: not skin",
      kernel: `kernel ${far(kernelReach)}`, pinned: a && (a.body.is_skin ? far(a.reach) : "–") }),
    tile("Outside the kernel's region", "Share of the mean-square motion where the kernel is below −20 dB of its largest", {
      value: percent(share), detail: "of the motion", kernel: `kernel ${percent(answer.kernelShare)}`,
        pinned: a && percent(a.share) }),
    tile("Delay", "Lag of the motion behind the pressure on the path, at the strongest component", {
      value: delayed(delay), detail: "behind the pressure", kernel: "kernel 0.0 ms", pinned: a
        && delayed(a.delay) }),
  ].join("");
}

/** HTML of the table of lines. */
export function linesTable(answer, pinned) {
  const quantity = QUANTITIES[answer.values.quantity];
  const rows = lineTable(answer);
  const nearest = (f) => {
    const k = pinned.waves.f.findIndex((at) => Math.abs(at - f) < 0.5);
    return k < 0 ? "–" : rounded(inQuantity(pinned.waves.f, pinned.wavesAt, answer.values.quantity)[k]);
  };
  return `<thead><tr><th scope="col">Line</th><th scope="col">Hz</th><th scope="col">kernel, Pa</th><th
    scope="col">waves, ${
    quantity.unit}</th>${pinned ? '<th scope="col" class="of-a">A</th>'
      : ""}<th scope="col" title="dB above the detection threshold">dB SL</th></tr></thead>
    <tbody>${rows.map(({ name, f, pressure, motion, level }) =>
      `<tr><th scope="row">${subscript(typeset(name)) || "–"}</th><td>${f.toFixed(1)}</td><td>${
    rounded(pressure)}</td><td class="waves-ink">${rounded(quantity.per * motion)}</td>${pinned
      ? `<td class="of-a">${nearest(f)}</td>` : ""}<td>${
    level === null ? "–" : signed(level)}</td></tr>`).join("")}</tbody>`;
}

/** HTML of what differs between A and B. */
export function comparison(a, b) {
  const rows = Object.keys(STARTS).filter((key) => a.values[key] !== b.values[key]).map((key) => [LABELS[key],
    ...[a, b].map((own) => (key === "body" ? own.body.title : shown(key, own.values[key]))), true]);
  if (a.body.title === b.body.title) {
    for (const key of a.body.keys ?? []) {
      const other = b.body.keys?.find((own) => own.key === key.key);
      if (other && other.value !== key.value) rows.push([key.label, `${key.value} ${key.unit}`,
        `${other.value} ${other.unit}`, true]);
    }
  }
  const levels = [a, b].map((own) => (own.body.is_skin ? `${signed(own.level?.dB)} dB` : "–"));
  rows.push(["Level at the point", ...levels], ["Reach above threshold", ...[a, b].map((own) =>
    (own.body.is_skin ? far(own.reach) : "–"))],
    ["Outside the kernel's region", percent(a.share), percent(b.share)], ["Delay", delayed(a.delay),
      delayed(b.delay)]);
  return `<table><thead><tr><th scope="col">Scene</th><th scope="col" class="of-a">A, pinned</th><th
    scope="col" class="waves-ink">B, shown</th></tr></thead>
    <tbody>${rows.map(([name, own, other, set]) => `<tr${set ? ' class="different"'
      : ""}><th scope="row">${escaped(name)}</th><td>${
    escaped(own)}</td><td>${escaped(other)}</td></tr>`).join("")}</tbody></table>`;
}

/** Points [[x, y]] in metre of each path of a load. */
export function pathsOf(load) {
  const own = load.path.shape === "joined" ? load.path.paths.map((path) => ({ speed: 1, sweep: "one_way",
    ...path })) : [load.path];
  return own.map((path) => {
    const at = positionOf(path), count = path.shape === "circle" ? 90 : 180;
    return Array.from({ length: count + 1 }, (_, k) => at(Math.min(k / count, 1 - 1e-9)));
  });
}

/** Places [[x, y]] in metre of the foci at a time in s. */
export function fociAt(load, t) {
  const fd = drawingFrequency(load.path), at = positionOf(load.path);
  return load.foci.map((ahead) => at((fd * t + ahead) % 1));
}

/** Where waves move more (positive) or less than the kernel predicts, in dB, each re its largest. */
export function difference(waves, kernel) {
  const largest = [waves, kernel].map((values) => values.reduce((most, v) => (v > most ? v : most), 0));
  const level = (v, k) => Math.max(20 * Math.log10(v / largest[k]), -40);
  return Float32Array.from(waves, (v, k) => (Number.isNaN(v) ? NaN : level(v, 0) - level(kernel[k], 1)));
}
