// Fast Fourier transform of complex sequences whose length is a power of two (Cooley and Tukey).

const tables = new Map();

function tableOf(n) {
  if (!tables.has(n)) {
    const cos = new Float64Array(n / 2), sin = new Float64Array(n / 2), order = new Uint32Array(n);
    for (let k = 0; k < n / 2; k++) {
      cos[k] = Math.cos(2 * Math.PI * k / n);
      sin[k] = Math.sin(2 * Math.PI * k / n);
    }
    for (let k = 1, half = n >> 1; k < n; k++) order[k] = (order[k >> 1] >> 1) | (k & 1 ? half : 0);
    tables.set(n, { cos, sin, order });
  }
  return tables.get(n);
}

/**
 * Transform re, im (n,) in place: sum_t x_t exp(-+ 2 pi i k t / n), with + if `inverse`; not divided
 * by n.
 */
export function transform(re, im, inverse = false) {
  const n = re.length, { cos, sin, order } = tableOf(n), sign = inverse ? 1 : -1;
  for (let k = 0; k < n; k++) {
    const j = order[k];
    if (j > k) {
      [re[k], re[j]] = [re[j], re[k]];
      [im[k], im[j]] = [im[j], im[k]];
    }
  }
  for (let half = 1; half < n; half *= 2) {
    const stride = n / (2 * half);
    for (let first = 0; first < n; first += 2 * half) {
      for (let k = 0, t = 0; k < half; k++, t += stride) {
        const a = first + k, b = a + half, c = cos[t], s = sign * sin[t];
        const xr = re[b] * c - im[b] * s, xi = re[b] * s + im[b] * c;
        re[b] = re[a] - xr; im[b] = im[a] - xi;
        re[a] += xr; im[a] += xi;
      }
    }
  }
}

/** The least power of two that is not below a number. */
export const powerOfTwo = (least) => 2 ** Math.ceil(Math.log2(Math.max(least, 2)));
