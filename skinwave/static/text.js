// Numbers and names as text.

/** Return a number with some significant digits and a typeset minus. */
export function rounded(value, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  const number = Number(value.toPrecision(digits));
  if (number === 0) return "0";
  const decimals = Math.max(0, Math.min(digits - 1 - Math.floor(Math.log10(Math.abs(number))), 9));
  return number.toFixed(decimals).replace("-", "−");
}

/** Return a value in an SI unit with a prefix and three digits: 1.2e-6 m becomes "1.20 µm". */
export function withUnit(value, unit) {
  const size = Math.abs(value);
  if (!Number.isFinite(value)) return "none";
  if (unit === "dB") return `${value.toFixed(1).replace("-", "−")} dB`;
  const [prefix, scale] = unit[0] !== "m" || size === 0 ? ["", 1]
    : [["n", 1e9, 1e-7], ["µ", 1e6, 1e-3], ["m", 1e3, 1], ["", 1, Infinity]].find((p) => size < p[2]);
  return `${rounded(scale * value)} ${prefix}${unit}`;
}

/** Return a level with its sign: whole, with one decimal if it is below 1, "< −120" if it is round-off. */
export function signed(value) {
  if (!Number.isFinite(value)) return "–";
  if (value < -120) return "< −120";
  const text = Math.abs(value).toFixed(Math.abs(value) < 0.95 ? 1 : 0);
  return Number(text) === 0 ? text : `${value > 0 ? "+" : "−"}${text}`;
}

/** Return text with its special characters escaped for SVG and HTML. */
export const escaped = (text) => String(text).replace(/[&<>"]/g,
  (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
