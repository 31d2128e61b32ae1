// Motion over time: sums of lines and of decaying poles, and motion under the pulses of a rhythm.

import { levelFactor } from "./load.js";
import { zeros } from "./numeric.js";

const RAMP_PARTS = 8; // straight parts of a ramp
const NEGLIGIBLE = 1e-6; // of the largest vibration: smaller ones are left out
const AT_ONCE = 64; // instants whose exponentials follow from each other by multiplication

/** Re sum_l amplitudes [re, im] exp(2 pi i f t) at equally spaced times (t,) in s from 0. */
export function oscillation(f, amplitudes, times) {
  const motion = new Float64Array(times.length), part = (k) => amplitudes.map((own) => own[k]);
  addDecay(motion, times, 0, { re: zeros(f.length).re, im: f.map((at) => 2 * Math.PI * at) },
    { re: part(0), im: part(1) });
  return motion;
}

/**
 * Straight pieces {start, end, level, slope} in s and 1/s of the rhythm's factor on the pressure, up to a
 * time; the level is that at their start.
 */
function rhythmPieces(load, until) {
  if (!load.pulses) return [{ start: 0, end: Infinity, level: 1, slope: 0 }];
  const pieces = [], { ramp } = load;
  for (let at = 0, k = 0; at <= until; k++) {
    const [on, gap] = load.pulses[k % load.pulses.length];
    const add = (length, level, slope) => {
      if (length > 0) pieces.push({ start: at, end: at + length, level, slope });
      at += length;
    };
    const slopes = (from, to) => {
      for (let j = 0; ramp && j < RAMP_PARTS; j++) {
        const [a, b] = [j, j + 1].map((k) => levelFactor(load, from + (to - from) * k / RAMP_PARTS));
        add(ramp / RAMP_PARTS, a, (b - a) * RAMP_PARTS / ramp);
      }
    };
    slopes(0, 1);
    add(on - 2 * ramp, 1, 0);
    slopes(1, 0);
    add(gap, 0, 0);
  }
  return pieces;
}

/**
 * Add Re sum_k amplitudes exp(pole (t - start)) to `motion` (t,) from `start` in s on, without negligible
 * terms. Poles in 1/s and amplitudes are {re, im} (k,).
 */
function addDecay(motion, times, start, poles, amplitudes) {
  const dt = times[1] - times[0], n = times.length, first = Math.ceil(start / dt - 1e-9);
  let largest = 0;
  for (let k = 0; k < poles.re.length; k++) {
    largest = Math.max(largest, Math.hypot(amplitudes.re[k], amplitudes.im[k]));
  }
  for (let k = 0; k < poles.re.length; k++) {
    const size = Math.hypot(amplitudes.re[k], amplitudes.im[k]);
    if (!(size > NEGLIGIBLE * largest)) continue;
    const lasting = Math.log(size / (NEGLIGIBLE * largest)) / Math.abs(poles.re[k]);
    const last = Math.min(n, first + Math.ceil(lasting / dt) + 1);
    const decay = Math.exp(poles.re[k] * dt), c = decay * Math.cos(poles.im[k] * dt);
    const s = decay * Math.sin(poles.im[k] * dt);
    for (let t = first; t < last; t += AT_ONCE) {
      const since = t * dt - start, grown = Math.exp(poles.re[k] * since);
      const angle = poles.im[k] * since, gr = grown * Math.cos(angle), gi = grown * Math.sin(angle);
      let zr = amplitudes.re[k] * gr - amplitudes.im[k] * gi;
      let zi = amplitudes.re[k] * gi + amplitudes.im[k] * gr;
      for (let i = t, end = Math.min(t + AT_ONCE, last); i < end; i++) {
        motion[i] += zr;
        const next = zr * c - zi * s;
        zi = zr * s + zi * c;
        zr = next;
      }
    }
  }
}

/**
 * Motion (t,) under a load with the rhythm of a Tacton: the steady state times the level, minus the lag in
 * ramps, plus free vibration after each jump and bend of the level.
 *
 * `steady` (t,) is for a level of 1, `lag()` (t,) for a slope of 1/s. `free(start, jump, bend)` gives
 * {poles, amplitudes} after a jump of the level and a change of its slope.
 */
export function underRhythm(load, times, steady, lag, free) {
  const pieces = rhythmPieces(load, times[times.length - 1]), dt = times[1] - times[0];
  const motion = new Float64Array(times.length);
  const lagging = pieces.some(({ slope }) => slope) ? lag() : null;
  let before = { level: 0, slope: 0, start: 0, end: 0 };
  for (const piece of pieces) {
    const { start, end, level, slope } = piece;
    const from = Math.ceil(start / dt - 1e-9), to = Math.min(Math.ceil(end / dt - 1e-9), times.length);
    for (let k = from; k < to; k++) {
      motion[k] += (level + slope * (times[k] - start)) * steady[k] - (lagging ? slope * lagging[k] : 0);
    }
    const jump = level - (before.level + before.slope * (before.end - before.start));
    const bend = slope - before.slope;
    if (Math.abs(jump) > 1e-9 || Math.abs(bend) > 1e-9) {
      const { poles, amplitudes } = free(start, jump, bend);
      addDecay(motion, times, start, poles, amplitudes);
    }
    before = piece;
  }
  return motion;
}
