// The plots of an answer as data for plots.js, and what maps show of a load.

import { inQuantity, lineName } from "./answer.js";
import { drawingFrequency, fullPressure, gainAt, positionOf, rhythmLevel, rhythmPeriod } from "./load.js";
import { QUANTITIES, amplitudesOf, derivative, meanLevel, spectrum, thresholdAt } from "./evaluate.js";
import { largestOf } from "./numeric.js";
import { niceTop } from "./plots.js";
import { rounded, signed } from "./text.js";
import { NUMBERS } from "./values.js";

export const OVER = { speed: [0.5, 40], size: [2, 60], am: [10, 400], height: [100, 400] };
const FEWEST_POINTS = 450, LONGEST_STEP = 2.5e-4; // of a waveform; s between its points
const POINTS_PER_PERIOD = 12, MOST_POINTS = 6000; // of the commanded signal
const LEVEL_RANGE = 60; // dB that the plot of levels over a control shows
const STEM_SPACING = 3.5; // px between stems of the same line
const MOST_NAMES = 7, LEAST_NAMED = 0.02; // lines with a name; share of the tallest line that they need
const LARGE_RATIO = 10; // of A and B, above which A is drawn with a factor
const LOWEST_LOG = 10; // Hz where a logarithmic axis begins
const FLOOR = -40; // dB re the largest: smaller values count as this in a difference of maps
const SHORTEST_PLAYED = 0.06; // s
const PRESSURE = { per: 1, rate: 0 };

const isOn = (axis) => ({ role }) => (role === "kernel") === (axis === "y");
const inMs = (span) => span.map((t) => 1e3 * t);

/** Start and end in s of a choice of time span for a load. */
export function spanOf(name, load) {
  const { duration, pulses } = load, period = pulses && rhythmPeriod(load);
  if (name === "last 60 ms") return [Math.max(0, duration - 0.06), duration];
  return [0, name === "all" ? duration : Math.min(period || 0.06, duration)];
}

/** Length in s of the part of a load that is played slowly: a period of its signal or rhythm. */
export function playedOf(load) {
  const tone = drawingFrequency(load.path) || load.am || load.envelope || 100;
  const period = load.pulses ? rhythmPeriod(load) : 1 / tone;
  return Math.min(Math.max(period, SHORTEST_PLAYED), load.duration);
}

/** Time in s of a state of the page: that of its clock, from the start of the plots' span. */
export const timeOf = ({ span, clock, answer }) => spanOf(span, answer.load)[0] + clock;

/** Waveform {x in ms, y} within a span in s, in the unit of a quantity. */
function waveform(motion, [x, y], [start, end], { per, rate }) {
  const count = Math.max(FEWEST_POINTS, Math.ceil(end / LONGEST_STEP)), dt = end / count;
  const times = Float64Array.from({ length: count + 1 }, (_, k) => k * dt);
  const values = derivative(motion.waveform(x, y, times), dt, rate);
  const scaled = (own, factor) => Array.from(own.subarray(Math.floor(start / dt)), (v) => factor * v);
  return { x: scaled(times, 1e3), y: scaled(values, per) };
}

/** Plot of the commanded signal: amplitude of the sound at a focus, in per cent of full drive. */
export function commandedPlot({ load }, [start, end]) {
  const tones = load.am + load.am2 + load.envelope + 50;
  const count = Math.min(Math.max(400, Math.ceil((end - start) * tones * POINTS_PER_PERIOD)), MOST_POINTS);
  const full = fullPressure(load);
  const x = new Array(count + 1), y = new Array(count + 1), own = { ...load };
  for (let k = 0; k <= count; k++) {
    const t = start + (end - start) * k / count;
    own.amplitude = load.amplitude * rhythmLevel(load, t);
    const driven = gainAt(own, t) / full;
    x[k] = 1e3 * t;
    y[k] = 100 * (load.drive === "linear" ? driven : Math.sqrt(Math.max(driven, 0)));
  }
  return {
    label: "Commanded signal over time, in per cent of full drive",
    x: { label: "time, ms", range: inMs([start, end]) }, y: { label: "%", range: [-108, 108] },
    curves: [y, y.map((v) => -v)].map((half) => ({ role: "drive", x, y: half, fill: true })),
  };
}

/** Power of ten by which A is drawn larger or smaller, if it differs from B by more than a factor of 10. */
export function factorOf(a, b) {
  const ratio = b / a;
  const isFar = Number.isFinite(ratio) && ratio > 0 && Math.max(ratio, 1 / ratio) > LARGE_RATIO;
  return isFar ? 10 ** Math.round(Math.log10(ratio)) : 1;
}

function nameOfA(factor) {
  if (factor === 1) return "A";
  return `A × ${factor > 1 ? factor : factor.toFixed(-Math.log10(factor))}`;
}

/**
 * Plot of the waveforms. `scale(name, largest)` gives the top of an axis. An axis has room for the largest
 * value where the kernel or the waves are strongest, so that a silent one is drawn as a flat line.
 */
export function waveformPlot(answer, span, { pinned, measured, scale }) {
  const { kernel, waves, values, x, y } = answer, quantity = QUANTITIES[values.quantity];
  const curves = [{ role: "kernel", name: "kernel", ...waveform(kernel, [x, y], span, PRESSURE) }];
  const own = waveform(waves, [x, y], span, quantity);
  if (pinned) {
    const other = waveform(pinned.waves, [pinned.x, pinned.y], span, quantity);
    const factor = factorOf(largestOf(other.y), largestOf(own.y));
    curves.push({ role: "pinned", name: nameOfA(factor), x: other.x, y: other.y.map((v) => factor * v) });
  }
  curves.push({ role: "waves", name: pinned ? "B" : "waves", ...own });
  if (measured?.times && measured.quantity === values.quantity) {
    curves.push({ role: "measured", name: "measured", x: inMs(measured.times),
      y: nearestPlace(measured, answer, measured.values).map((v) => quantity.per * v) });
  }
  const axes = { y: { label: "Pa", role: "kernel" }, y2: { label: quantity.unit, role: "waves" } };
  let below = 0.04; // share of the top; the same on both axes, so that their zeros are level
  for (const [name, axis] of Object.entries(axes)) {
    const drawn = curves.filter(isOn(name)).flatMap((curve) => curve.y);
    const peak = name === "y" ? answer.peaks?.kernel : quantity.per * (answer.peaks?.waves ?? 0);
    axis.top = scale(`waveform ${name} ${values.quantity}`, Math.max(largestOf(drawn), peak || 0));
    below = Math.max(below, -drawn.reduce((least, v) => Math.min(least, v), 0) / axis.top);
  }
  const low = scale("waveform below", below);
  for (const axis of Object.values(axes)) axis.range = [-axis.top * low, axis.top];
  return {
    label: "Waveform at the point: pressure of the kernel in Pa and motion of the body",
    x: { label: "time, ms", range: inMs(span) }, ...axes, curves, hatched: answer.invalid,
  };
}

/** Row of a measurement's curves at the place nearest to the point. */
function nearestPlace({ places }, { x, y }, rows) {
  const away = places.map((at) => (at ? Math.hypot(at[0] - x, at[1] - y) : 0));
  return rows[away.indexOf(Math.min(...away))];
}

/** Spectrum {x in Hz, y} of a measurement near the point. */
function measuredSpectrum(measured, answer, per, highest) {
  let f = measured.frequencies, a = f && nearestPlace(measured, answer, measured.amplitudes);
  if (!f) {
    const values = nearestPlace(measured, answer, measured.values);
    const mean = values.reduce((sum, v) => sum + v, 0) / values.length;
    const lines = spectrum(values.map((v) => v - mean), measured.times[1] - measured.times[0]);
    [f, a] = [Array.from(lines.f), Array.from(lines.amplitudes)];
  }
  const count = f.filter((at) => at <= highest).length;
  return { x: f.slice(0, count), y: a.slice(0, count).map((v) => per * v) };
}

/**
 * Plot of the spectra as stems side by side, averaged over the rhythm. The threshold of skin is drawn for
 * lines that exceed it while a pulse is on.
 */
export function spectrumPlot(answer, { pinned, measured, highest, log, scale }) {
  const { kernel, waves, body, values: { quantity: name } } = answer, { unit, per, rate } = QUANTITIES[name];
  const mean = meanLevel(answer.load);
  const stems = (role, title, f, amplitudes, offset, factor = mean) => {
    const visible = Array.from(f.keys()).filter((k) => f[k] <= highest);
    return { role, name: title, stems: true, offset, x: visible.map((k) => f[k]),
      y: visible.map((k) => factor * amplitudes[k]) };
  };
  const wide = pinned ? 2 * STEM_SPACING : STEM_SPACING, moved = inQuantity(waves.f, answer.wavesAt, name);
  const own = stems("waves", pinned ? "B" : "waves", waves.f, moved, wide / 2);
  const pressure = amplitudesOf(kernel.f, answer.kernelAt);
  const curves = [stems("kernel", "kernel", kernel.f, pressure, -wide / 2), own];
  if (pinned) {
    const moves = meanLevel(pinned.load), amplitudes = inQuantity(pinned.waves.f, pinned.wavesAt, name);
    const factor = factorOf(moves * largestOf(amplitudes), largestOf(own.y));
    curves.push(stems("pinned", nameOfA(factor), pinned.waves.f, amplitudes, 0, factor * moves));
  }
  const axes = { y: { label: "Pa", role: "kernel" }, y2: { label: unit, role: "waves" } };
  const ofMap = ({ per: scaled, rate: order }, { f, largest } = { f: [], largest: [] }) => largest.reduce(
    (most, v, l) => Math.max(most, scaled * (2 * Math.PI * f[l]) ** order * v || 0), 0);
  for (const [axis, each] of Object.entries(axes)) {
    const drawn = curves.filter(isOn(axis)).map(({ y }) => largestOf(y));
    const tallest = Math.max(...drawn, mean * (axis === "y" ? ofMap(PRESSURE, answer.maps?.kernel)
      : ofMap({ per, rate }, answer.maps?.waves)));
    each.range = [0, scale(`spectrum ${axis} ${name}`, 1.2 * tallest)];
  }
  if (measured?.quantity === name) {
    curves.push({ role: "measured", name: "measured",
      ...measuredSpectrum(measured, answer, per, highest) });
  }
  if (body.is_skin && !rate) {
    const x = Array.from({ length: 120 }, (_, k) => 10 + k * (highest - 10) / 119);
    curves.push({ role: "threshold", name: "threshold", dash: "5 3", x,
      y: x.map((f) => per * mean * thresholdAt(f)) });
  }
  const names = own.x.map((f, k) => ({ x: f, y: own.y[k], text: lineName(answer, f) }));
  const least = LEAST_NAMED * largestOf(own.y);
  const named = names.filter(({ text, y }) => text && y > least).sort((a, b) => b.y - a.y)
    .slice(0, MOST_NAMES);
  return {
    label: "Spectrum at the point: lines of the kernel in Pa and of the waves, side by side",
    x: { label: "frequency, Hz", range: [log ? LOWEST_LOG : 0, highest], log }, ...axes, curves, names: named,
    hatched: answer.invalid,
  };
}

/** Plot of the phase speeds of a body's waves with the lines of the load. */
export function dispersionPlot(answer, highest) {
  const { body, load: { path }, waves } = answer, { dispersion } = body;
  if (!dispersion) {
    const text = body.isRequested && !body.hasFailed ? "The dispersion curves are being computed."
      : "Dispersion curves are not available for this body.";
    return { label: text, x: { label: "frequency, Hz", range: [0, highest] },
      y: { label: "m/s", range: [0, 10] }, curves: [], names: [{ x: highest / 2, y: 5, text }] };
  }
  const speed = drawingFrequency(path) ? path.speed : 0, across = [0, highest];
  const typical = dispersion.branches.map(({ c }) => c.filter((v) => v !== null).sort((a, b) => a - b))
    .map((c) => c[Math.floor(c.length / 2)]).filter(Number.isFinite);
  const top = niceTop(1.5 * Math.max(speed || 0, ...typical, 1));
  const curves = dispersion.branches.slice(0, 4).map(({ name, c }, k) => (
    { role: `m${k + 1}`, name, x: dispersion.f, y: c.map((v) => v ?? NaN) }));
  if (speed) curves.push({ role: "kernel", name: "focus", dash: "5 3", x: across, y: [speed, speed] });
  const sizes = amplitudesOf(waves.f, answer.wavesAt);
  const strong = Array.from(waves.f.keys()).filter((k) => waves.f[k] <= highest)
    .sort((a, b) => sizes[b] - sizes[a]).slice(0, MOST_NAMES).map((k) => waves.f[k]);
  for (const f of strong) curves.push({ role: "now", x: [f, f], y: [0, top], width: 1, dash: "2 3" });
  return {
    label: "Phase speed of the body's waves over frequency, with the lines of the load",
    x: { label: "frequency, Hz", range: across }, y: { label: "m/s", range: [0, top] }, curves,
    names: strong.map((f) => ({ x: f, y: 0.8 * top, text: lineName(answer, f) })),
  };
}

/** Plot of levels {x, kernel, waves, best} over a control. */
export function levelPlot(answer, key, { x, kernel, waves, best }) {
  const { label, unit } = NUMBERS[key], now = answer.values[key];
  const known = [...waves, ...kernel].filter(Number.isFinite);
  const top = 5 * Math.ceil(Math.max(...known, 6) / 5 + 0.6);
  const low = Math.max(5 * Math.floor(Math.min(...known, -5) / 5), top - LEVEL_RANGE);
  const text = best && `${rounded(best.at)} ${unit}: ${signed(best.level)} dB`;
  return {
    label: `Sensation level over ${label}`, x: { label: `${label}, ${unit}`, range: OVER[key] },
    y: { label: "dB above threshold", range: [low, top] },
    curves: [
      { role: "kernel", x, y: kernel,
        name: answer.body.is_skin ? "kernel" : "kernel only: this body is not skin" },
      ...(answer.body.is_skin ? [{ role: "waves", name: "waves", x, y: waves }] : []),
      { role: "threshold", x: OVER[key], y: [0, 0], dash: "5 3" },
      { role: "now", name: "now", x: [now, now], y: [low, top], dash: "2 3" },
    ],
    names: best ? [{ x: best.at, y: best.level, text }] : [],
  };
}

/** Points [[x, y]] in metre of each path of a load. */
export function pathsOf({ path }) {
  const own = path.paths?.map((each) => ({ speed: 1, sweep: "one_way", ...each })) ?? [path];
  return own.map((each) => {
    const at = positionOf(each), count = each.shape === "circle" ? 90 : 180;
    return Array.from({ length: count + 1 }, (_, k) => at(Math.min(k / count, 1 - 1e-9)));
  });
}

/** Places [[x, y]] in metre of the foci at a time in s. */
export function fociAt(load, t) {
  const fd = drawingFrequency(load.path), at = positionOf(load.path);
  return load.foci.map((ahead) => at((fd * t + ahead) % 1));
}

/** Difference of two maps in dB, each relative to its largest value. */
export function difference(one, other) {
  const largest = [one, other].map(largestOf);
  const level = (v, k) => Math.max(20 * Math.log10(v / largest[k]), FLOOR);
  return Float32Array.from(one, (v, k) => (Number.isNaN(v) ? NaN : level(v, 0) - level(other[k], 1)));
}
