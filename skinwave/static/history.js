// Undo and redo of the controls' values, and the state in the page's address.

import { fromAddress, toAddress } from "./values.js";

/** Steps of values: `add` one; `go(-1)` to the one before, `go(1)` to the next, if it `has` one. */
export function createHistory(values) {
  let steps = [toAddress(values)], at = 0;
  const has = (way) => at + way in steps;
  return {
    add(own) {
      const text = toAddress(own);
      if (text !== steps[at]) at = (steps = [...steps.slice(0, at + 1), text]).length - 1;
    },
    go(way) {
      if (!has(way)) return null;
      at += way;
      return fromAddress(steps[at]).values;
    },
    has,
  };
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
  const shown = Object.entries(view).filter(([, value]) => value).map(([key, value]) => `${key}=${value}`);
  const text = [toAddress(values, starts), ...shown].filter(Boolean).join("&");
  return `${location.href.split("#")[0]}${text ? `#${text}` : ""}`;
}
