// The self-test: random Tactons with lines that independent models in Python computed.

import { indexNear } from "./numeric.js";
import { escaped, rounded } from "./text.js";
import { STARTS } from "./values.js";

const SAME_LINE = 1e-3; // Hz between a line of the page and that of Python

/** Largest relative error of lines {f, re, im}: {error, f}. */
function compare(motion, at, lines) {
  let worst = { error: 0, f: 0 };
  for (const { f, re, im } of lines) {
    const k = indexNear(motion.f, f, SAME_LINE);
    const error = k < 0 ? 1 : Math.hypot(at.re[k] - re, at.im[k] - im) / Math.hypot(re, im);
    if (error > worst.error) worst = { error, f };
  }
  return worst;
}

/** Run all tests and show their table. */
export async function runSelftest(data, bodyOf, loadOf) {
  const dialog = document.getElementById("selftest"), title = document.getElementById("selftest-title");
  if (!dialog.open) dialog.showModal();
  const rows = [];
  let largest = 0, failed = 0;
  for (const { body, values, lines, error: allowed } of data.selftest ?? []) {
    // Tests run at once while the page loads, so that a screenshot of it has the result.
    if (document.readyState === "complete") await new Promise((resolve) => setTimeout(resolve));
    const own = { ...STARTS, ...values, body }, motion = bodyOf(body).motion(loadOf(own));
    const { error, f } = compare(motion, motion.at(own.x / 1e3, own.y / 1e3), lines);
    largest = Math.max(largest, error);
    if (!(error <= allowed)) failed++;
    const cells = [own.shape, lines.length, `${rounded(f)} Hz`, `${(100 * error).toFixed(2)} %`,
      `${(100 * allowed).toFixed(1)} %`].map((text) => `<td>${escaped(text)}</td>`);
    rows.push(`<tr><th scope="row">${escaped(bodyOf(body).title)}</th>${cells.join("")}</tr>`);
    title.textContent = `self-test: ${rows.length} of ${data.selftest.length}`;
  }
  title.textContent = rows.length ? `self-test: largest error ${(100 * largest).toFixed(2)} %`
    : "self-test: this page has no test data";
  Object.assign(title.dataset, { error: largest, failed });
  document.getElementById("selftest-table").innerHTML =
    `<p>${rows.length - failed} of ${rows.length} Tactons agree with Python within the stated error. The
      error is the largest of all compared lines, relative to the line.</p>
    <table><thead><tr>${["Body", "Path", "Lines", "Largest error at", "Error", "Allowed"].map((head) => (
      `<th scope="col">${head}</th>`)).join("")}</tr></thead><tbody>${rows.join("")}</tbody></table>`;
}
