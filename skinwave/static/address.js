// The values of the controls in the page's address, and their history for undo and redo.

import { NUMBERS, STARTS, check } from "./values.js";

/** Text for an address with the values that differ from the starts. */
export function toAddress(values, starts = STARTS) {
  return Object.keys(STARTS).filter((key) => values[key] !== starts[key]).map((key) => {
    const text = key in NUMBERS ? Number(values[key].toPrecision(10)) : values[key];
    return `${key}=${encodeURIComponent(text).replace(/%(2F|3A|2C)/g, decodeURIComponent)}`;
  }).join("&");
}

/** Values in the text of an address, and a sentence about what is ignored, or "": {values, refused}. */
export function fromAddress(text, starts = STARTS) {
  const values = { ...starts }, parts = [], reasons = [];
  for (const [key, given] of new URLSearchParams(text.replace(/^[#?]/, ""))) {
    try {
      values[key] = check(key, given);
    } catch (error) {
      parts.push(`${key}=${given}`);
      reasons.push(error.message);
    }
  }
  const refused = parts.length > 1 ? `These parts of the address are ignored: ${parts.join(", ")}.`
    : reasons.map((why) => `This part of the address is ignored. ${why}`).join("");
  return { values, refused };
}

/** History {steps, at} of values with one more step, unless the values are those of the present one. */
export function withStep({ steps, at }, next) {
  if (toAddress(next) === toAddress(steps[at])) return { steps, at };
  return { steps: [...steps.slice(0, at + 1), next], at: at + 1 };
}

/** Values and view in this page's address: {values, refused, view}. `starts` are those of the page. */
export function readAddress(starts) {
  const given = new URLSearchParams(location.hash.slice(1)), view = {};
  for (const key of ["selftest", "view", "tab"]) {
    if (given.has(key)) view[key] = given.get(key);
    given.delete(key);
  }
  return { ...fromAddress(given.toString(), starts), view };
}

/** Address of this page with values and view. */
export function addressOf(values, starts, view) {
  const changes = Object.entries(view).filter(([, value]) => value).map(([key, value]) => `${key}=${value}`);
  const text = [toAddress(values, starts), ...changes].filter(Boolean).join("&");
  return `${location.href.split("#")[0]}${text ? `#${text}` : ""}`;
}
