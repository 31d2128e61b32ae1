// An answer of the page: the response of the kernel and of a body to the load of the controls.

import { QUANTITIES, amplitudesOf, delayOf, levelOf, mapOf, namesOf, peakAt, reach,
  shareOutside } from "./evaluate.js";
import { kernelMotion } from "./kernel.js";
import { pathSamples, spotWidth } from "./load.js";
import { loadOf } from "./values.js";

const LARGE_DEFLECTION = 0.5; // of a sheet's thickness, above which a linear model is not valid
const TOLERANCE = 0.05; // of the error of a sheet's lines by its stretching

/**
 * Numbers that each move of a control needs at once; those that need maps are in `mapsOf`. Throws an Error
 * with a sentence for users if the values contradict each other.
 */
export function respond(values, body) {
  const load = loadOf(values, body), x = values.x / 1e3, y = values.y / 1e3;
  const kernel = kernelMotion(load), waves = body.motion(load);
  const [kernelAt, wavesAt] = [kernel.at(x, y), waves.at(x, y)];
  return { values, body, load, x, y, kernel, waves, kernelAt, wavesAt,
    level: body.is_skin ? levelOf(waves.f, wavesAt, "m") : null,
    kernelLevel: levelOf(kernel.f, kernelAt, "Pa") };
}

/** Typeset name of the line at a frequency in Hz, such as "2 f_d − f_AM", or "" if it is unknown. */
export function lineName(answer, f) {
  answer.names ??= namesOf(answer.load);
  return typeset(answer.names(f));
}

export const typeset = (name) => name.replace(/-/g, " − ").replace(/\+/g, " + ")
  .replace(/(\d)(?=f)/g, "$1 ").replace(/^ − /, "−");

/**
 * Maps of the kernel and the waves, and the numbers that need them: a record that completes the answer.
 * `peaks` are the largest values of both, in Pa and in SI units of the quantity, at the place where each is
 * strongest.
 */
export function mapsOf(answer) {
  const { kernel, waves, load, body } = answer;
  const maps = { kernel: mapOf(kernel), waves: mapOf(waves) };
  const { rate } = QUANTITIES[answer.values.quantity];
  return {
    maps, peaks: { kernel: peakAt(kernel, maps.kernel.strongest),
      waves: peakAt(waves, maps.waves.strongest, rate) },
    share: shareOutside(maps.kernel.rms, maps.waves.rms),
    kernelShare: shareOutside(maps.kernel.rms, maps.kernel.rms),
    reach: body.is_skin ? reach(load, maps.waves) : null, kernelReach: reach(load, maps.kernel),
    delay: delayOf(kernel, waves, load)?.delay ?? NaN,
    ...validity(answer), warnings: warnings(answer),
  };
}

/**
 * Validity {stretching, invalid} of an answer. `stretching` is the error of a sheet's lines by its
 * stretching, which this page leaves out. `invalid` is the reason why the result is not valid, or "".
 */
function validity({ body, waves, x, y }) {
  if (!body.thickness_mm) return { stretching: 0, invalid: "" };
  if (!body.stretching) {
    const most = Math.max(...[[0, 0], [x, y]].map((at) => peakAt(waves, at)));
    const ratio = 1e3 * most / body.thickness_mm;
    return { stretching: 0,
      invalid: ratio > LARGE_DEFLECTION ? `linear model, ${ratio.toPrecision(2)} × thickness` : "" };
  }
  const stretching = body.stretchingOf(waves);
  // A large error has no bound, because stretching shifts resonances.
  const invalid = stretching > TOLERANCE ? `no stretching: error above ${100 * TOLERANCE} %` : "";
  return { stretching, invalid };
}

function warnings({ load, body }) {
  const sentences = [], { x, y } = pathSamples(load);
  const furthest = 1e3 * Math.max(...x.map((own, q) => Math.hypot(own, y[q])));
  const half = 1e3 * (body.grid?.half ?? Infinity), spot = 3e3 * spotWidth(load.height);
  if (furthest > body.reach_mm) {
    sentences.push(`The focus moves up to ${furthest.toFixed(0)} mm from the middle. Beyond ${
      body.reach_mm} mm the motion of this body is less accurate.`);
  }
  if (furthest + spot > half && Math.max(...body.extent_mm ?? []) > half) {
    sentences.push(`The focal spot extends beyond ${half.toFixed(0)} mm from the middle, where this page has `
      + "no data. Weak lines are less accurate.");
  }
  return sentences;
}

/** Amplitudes (l,) of complex lines in the unit of a quantity. */
export function inQuantity(f, at, name) {
  const { rate, per } = QUANTITIES[name];
  return amplitudesOf(f, at, rate).map((v) => v * per);
}
