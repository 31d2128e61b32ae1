// What both maps show: the kernel, or the waves of A, beside the waves.

import { MAP_LINE } from "./evaluate.js";
import { difference, factorOf, fociAt, pathsOf, timeOf } from "./figures.js";
import { levelFactor, rhythmLevel } from "./load.js";
import { largestOf } from "./numeric.js";
import { synthesise } from "./surface3d.js";
import { cornersOf } from "./values.js";

const SIDE = MAP_LINE.length;

/** Pressure of the kernel in Pa on the map at a time in s. */
function kernelAt({ kernel }, time) {
  const values = new Float32Array(SIDE ** 2);
  kernel.snapshot(time, MAP_LINE, MAP_LINE, values);
  return values;
}

/** Steady motion in metre about the mean on the map at a time in s, with the level of a rhythm. */
function wavesAt({ maps: { waves }, load }, time) {
  const values = new Float32Array(SIDE ** 2), level = levelFactor(load, rhythmLevel(load, time));
  synthesise(waves, waves, time, values);
  return load.pulses ? values.map((v) => level * v) : values;
}

/**
 * Options of `drawMap` for both maps of a state of the page. `scale(name, largest)` gives the end of a scale
 * of colours.
 */
export function pictures(state, scale) {
  const { answer: b, look, playing } = state, a = state.pinned?.maps ? state.pinned : null;
  const isMotion = look === "motion", time = timeOf(state), kind = isMotion ? "motion" : "map";
  const top = ({ body, maps: { waves } }) => (
    scale(`${kind} waves ${body.name}`, isMotion ? waves.crest : largestOf(waves.rms)));
  let [topA, topB] = [a && top(a), top(b)];
  if (a && factorOf(topA, topB) === 1) topA = topB = Math.max(topA, topB);
  const map = (own, of) => ({
    path: pathsOf(own.load), corners: own === b ? cornersOf(own.values) : [], point: [own.x, own.y],
    foci: own === b || isMotion ? fociAt(own.load, time) : [], influenced: own.maps.kernel.rms,
    moving: playing, decibel: isMotion ? 0 : state.decibel,
    level: own.body.is_skin && !isMotion ? own.maps[of].level : null,
  });
  const waves = (own, largest, title) => ({
    ...map(own, "waves"), rms: isMotion ? wavesAt(own, time) : own.maps.waves.rms, unit: "m", largest,
    signed: isMotion, hatched: own.invalid, title,
  });
  const titleOf = (name, { body: { title } }) => (
    `${name}: ${title.length > 22 ? `${title.slice(0, 21)}…` : title}${isMotion ? ", motion" : ""}`);
  const left = a ? waves(a, topA, titleOf("A", a)) : {
    ...map(b, "kernel"), rms: isMotion ? kernelAt(b, time) : b.maps.kernel.rms, unit: "Pa",
    largest: scale(`${kind} kernel`, isMotion ? b.peaks.kernel : largestOf(b.maps.kernel.rms)),
    title: isMotion ? "Kernel, pressure" : "Kernel, RMS",
  };
  const alone = isMotion ? "Waves, motion into the body" : "Waves, RMS";
  const right = waves(b, topB, a ? titleOf("B", b) : alone);
  if (look === "difference") {
    Object.assign(right, { rms: difference(b.maps.waves.rms, a ? a.maps.waves.rms : b.maps.kernel.rms),
      level: null, unit: "dB", largest: 40, signed: true, title: a ? "B − A" : "Waves − kernel" });
  }
  return [left, right];
}
