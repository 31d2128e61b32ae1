// Arrays of a pack: real or complex rows of 64-bit floats, or of integers with a scale for each row.

const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/** Bytes of a text in base 64. */
export const bytes = (text) => {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw.charCodeAt(k);
  return out.buffer;
};

/** Integers of 12 bits from two letters of base 64 each. */
function integers(text) {
  const of = new Uint8Array(128), out = new Int16Array(text.length / 2);
  [...LETTERS].forEach((letter, k) => { of[letter.charCodeAt(0)] = k; });
  for (let k = 0; k < out.length; k++) {
    out[k] = 64 * of[text.charCodeAt(2 * k)] + of[text.charCodeAt(2 * k + 1)] - 2048;
  }
  return out;
}

/** Array that skinwave.system.arrays packed: {re, im, shape} if it is complex, otherwise its values. */
export function unpack(packed) {
  const [rows, columns] = packed.shape, count = rows * columns, { real, f8, i2, i12 } = packed;
  const values = f8 ? new Float64Array(bytes(f8)) : i2 ? new Int16Array(bytes(i2)) : integers(i12);
  const re = new (real && !f8 ? Float32Array : Float64Array)(count);
  const im = real ? null : new Float64Array(count);
  for (let row = 0, k = 0; row < rows; row++) {
    const scale = packed.scale ? packed.scale[row] : 1;
    for (let column = 0; column < columns; column++, k++) {
      re[k] = (real ? values[k] : values[2 * k]) * scale;
      if (!real) im[k] = values[2 * k + 1] * scale;
    }
  }
  return real ? re : { re, im, shape: packed.shape };
}

/** A pack with its arrays, from JSON. */
export function unpacked(pack) {
  if (Array.isArray(pack)) return pack.map(unpacked);
  if (!pack || typeof pack !== "object") return pack;
  if (pack.f8 || pack.i2 || pack.i12) return unpack(pack);
  return Object.fromEntries(Object.entries(pack).map(([name, value]) => [name, unpacked(value)]));
}
