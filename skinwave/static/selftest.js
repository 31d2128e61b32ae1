// The page's test of itself: random Tactons with lines that Python computed by another way.

import { escaped, rounded } from "./text.js";
import { STARTS } from "./values.js";

const NEAR = 1e-3; // Hz between a line of the page and the same of Python

/** Largest error of lines {f, re, im} relative to their own size: {error, f}. */
function compare(motion, at, lines) {
  let worst = { error: 0, f: 0 };
  for (const { f, re, im } of lines) {
    const k = Array.from(motion.f).findIndex((own) => Math.abs(own - f) < NEAR);
    const off = k < 0 ? 1 : Math.hypot(at.re[k] - re, at.im[k] - im) / Math.hypot(re, im);
    if (off > worst.error) worst = { error: off, f };
  }
  return worst;
}

/** Run all tests and show their table; `bodyOf(name)`, `loadOf(values)`. */
export async function runSelftest(data, bodyOf, loadOf) {
  const dialog = document.getElementById("selftest"), said = document.getElementById("selftest-said");
  if (!dialog.open) dialog.showModal();
  const rows = [];
  let largest = 0, failed = 0;
  for (const { body, values, lines, error: allowed } of data.selftest ?? []) {
    // While the page loads all run at once, so that a screenshot of a browser without a display has the result.
    if (document.readyState === "complete") await new Promise((resolve) => setTimeout(resolve));
    const own = { ...STARTS, ...values, body }, motion = bodyOf(body).respond(loadOf(own));
    const { error, f } = compare(motion, motion.at(own.x / 1e3, own.y / 1e3), lines);
    largest = Math.max(largest, error);
    if (!(error <= allowed)) failed++;
    const cells = [own.shape, lines.length, `${rounded(f)} Hz`, `${(100 * error).toFixed(2)} %`,
      `${(100 * allowed).toFixed(1)} %`].map((text) => `<td>${escaped(text)}</td>`);
    rows.push(`<tr><th scope="row">${escaped(bodyOf(body).title)}</th>${cells.join("")}</tr>`);
    said.textContent = `self-test: ${rows.length} of ${data.selftest.length}`;
  }
  said.textContent = rows.length ? `self-test: largest error ${(100 * largest).toFixed(2)} %`
    : "self-test: this file holds no test data";
  said.dataset.error = largest;
  document.getElementById("selftest-table").innerHTML =
    `<p>${rows.length - failed} of ${rows.length} Tactons agree with Python within the stated error. The error
      is that of the worst line that is compared, relative to the line.</p>
    <table><thead><tr>${["Body", "path", "lines", "worst at", "error", "allowed"].map((head) => (
      `<th scope="col">${head}</th>`)).join("")}</tr></thead><tbody>${rows.join("")}</tbody></table>`;
}
