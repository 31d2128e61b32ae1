// An answer of the page: the response of the kernel and of a body to the load of the controls.

import { QUANTITIES, amplitudesOf, delayOf, levelOf, mapOf, namesOf, reach,
  shareOutside } from "./evaluate.js";
import { respond as respondOfKernel } from "./kernel.js";
import { pathSamples, spotWidth } from "./load.js";
import { largestOf } from "./numeric.js";
import { loadOf } from "./values.js";

const LARGE_DEFLECTION = 0.5; // of a sheet's thickness, above which a linear model is not valid
const EXAMINED = 0.06, STEP = 2e-4; // s of motion in which the largest is looked for, and the time step

/**
 * Numbers that each move of a control needs at once; those that need maps are in `mapsOf`. Throws an Error
 * with a sentence for users if the values contradict each other.
 */
export function respond(values, body) {
  const load = loadOf(values, body), x = values.x / 1e3, y = values.y / 1e3;
  const kernel = respondOfKernel(load), waves = body.respond(load);
  const [kernelAt, wavesAt] = [kernel.at(x, y), waves.at(x, y)];
  return { values, body, load, x, y, kernel, waves, kernelAt, wavesAt,
    level: body.is_skin ? levelOf(waves.f, wavesAt, "m") : null,
    kernelLevel: levelOf(kernel.f, kernelAt, "Pa") };
}

/** Typeset name of the line at a frequency in Hz, such as "2 f_d − f_AM"; "" if it is unknown. */
export function lineName(answer, f) {
  answer.names ??= namesOf(answer.load);
  return typeset(answer.names(f));
}

export const typeset = (name) => name.replace(/-/g, " − ").replace(/\+/g, " + ")
  .replace(/(\d)(?=f)/g, "$1 ").replace(/^ − /, "−");

/** Keys of the result of `mapsOf`. */
export const NUMBERS_OF_MAPS = ["maps", "share", "kernelShare", "reach", "kernelReach", "delay", "invalid",
  "warnings"];

/** Maps of the kernel and the waves, and the numbers that need them. */
export function mapsOf(answer) {
  const { kernel, waves, load, body } = answer;
  const maps = { kernel: mapOf(kernel), waves: mapOf(waves) };
  return {
    maps, share: shareOutside(maps.kernel.rms, maps.waves.rms),
    kernelShare: shareOutside(maps.kernel.rms, maps.kernel.rms),
    reach: body.is_skin ? reach(load, maps.waves) : null, kernelReach: reach(load, maps.kernel),
    delay: delayOf(kernel, waves, load)?.delay ?? NaN,
    invalid: invalidity(answer), warnings: warnings(answer),
  };
}

/** Reason why a result is outside the validity of its model; "" if it is valid. */
function invalidity({ body, waves, x, y }) {
  if (!body.thickness_mm) return "";
  const times = Float64Array.from({ length: EXAMINED / STEP }, (_, k) => k * STEP);
  const largest = Math.max(...[[0, 0], [x, y]].map((at) => largestOf(waves.waveform(...at, times))));
  const ratio = 1e3 * largest / body.thickness_mm;
  return ratio > LARGE_DEFLECTION ? `linear model, ${ratio.toPrecision(2)} × thickness` : "";
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
