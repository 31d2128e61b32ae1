// Undo and redo of the controls' values, and the state in the page's address.

import { fromAddress, toAddress } from "./values.js";

const MOST = 200; // steps that are kept

/** Steps of values as text; the last of `done` is what is shown. */
export function createHistory(values) {
  const done = [toAddress(values)], undone = [];
  const restore = () => fromAddress(done[done.length - 1]).values;
  return {
    /** Keep values as a step, unless they are those of the last one. */
    add(own) {
      const text = toAddress(own);
      if (text === done[done.length - 1]) return;
      done.push(text);
      if (done.length > MOST) done.shift();
      undone.length = 0;
    },
    undo() {
      if (done.length < 2) return null;
      undone.push(done.pop());
      return restore();
    },
    redo() {
      if (!undone.length) return null;
      done.push(undone.pop());
      return restore();
    },
    get undoable() { return done.length > 1; },
    get redoable() { return undone.length > 0; },
  };
}

/** Values and view in this page's address: {values, refused, view}. `starts` are those of the page. */
export function readAddress(starts) {
  const given = new URLSearchParams(location.search.slice(1)), view = {};
  for (const [key, value] of new URLSearchParams(location.hash.slice(1))) given.set(key, value);
  for (const key of ["token", "selftest", "view", "tab"]) {
    if (given.has(key)) view[key] = given.get(key);
    given.delete(key);
  }
  return { ...fromAddress(given.toString(), starts), view };
}

/** Address of this page with values and view. */
export function addressOf(values, starts, view) {
  const shown = Object.entries(view).filter(([, value]) => value).map(([key, value]) => `${key}=${value}`);
  const text = [toAddress(values, starts), ...shown].filter(Boolean).join("&");
  return `${location.href.split(/[?#]/)[0]}${text ? `#${text}` : ""}`;
}
