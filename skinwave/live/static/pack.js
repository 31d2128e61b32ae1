// Arrays of a pack: complex rows of 64-bit floats, or of whole numbers with a scale for each row.

/** Bytes of text in base 64. */
export const bytes = (text) => {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw.charCodeAt(k);
  return out.buffer;
};

/** Complex array {re, im, shape} of what skinwave.live.radial packs. */
export function unpack(packed) {
  const [rows, columns] = packed.shape, count = rows * columns;
  const pairs = packed.f8 ? new Float64Array(bytes(packed.f8)) : new Int16Array(bytes(packed.i2));
  const re = new Float64Array(count), im = new Float64Array(count);
  for (let row = 0, k = 0; row < rows; row++) {
    const scale = packed.scale ? packed.scale[row] : 1;
    for (let column = 0; column < columns; column++, k++) {
      re[k] = pairs[2 * k] * scale;
      im[k] = pairs[2 * k + 1] * scale;
    }
  }
  return { re, im, shape: packed.shape };
}

/** A pack as it is in the page's JSON, with its arrays. */
export function opened(pack) {
  return Object.fromEntries(Object.entries(pack).map(([name, value]) => [name,
    value && (value.f8 || value.i2) ? unpack(value) : value]));
}
