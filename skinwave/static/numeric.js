// Fourier transforms, interpolation and sums that several modules use.

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

/** Transform {re, im} of real values (n,) of any length, as `transform`: Bluestein's convolution. */
export function fourier(values) {
  const n = values.length, size = powerOfTwo(2 * n);
  const chirp = (k) => Math.PI * ((k * k) % (2 * n)) / n;
  const [ar, ai, br, bi] = Array.from({ length: 4 }, () => new Float64Array(size));
  for (let k = 0; k < n; k++) {
    const c = Math.cos(chirp(k)), s = Math.sin(chirp(k));
    ar[k] = values[k] * c;
    ai[k] = -values[k] * s;
    br[k] = br[(size - k) % size] = c;
    bi[k] = bi[(size - k) % size] = s;
  }
  transform(ar, ai);
  transform(br, bi);
  for (let k = 0; k < size; k++) {
    [ar[k], ai[k]] = [ar[k] * br[k] - ai[k] * bi[k], ar[k] * bi[k] + ai[k] * br[k]];
  }
  transform(ar, ai, true);
  const re = new Float64Array(n), im = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    const c = Math.cos(chirp(k)) / size, s = Math.sin(chirp(k)) / size;
    re[k] = ar[k] * c + ai[k] * s;
    im[k] = ai[k] * c - ar[k] * s;
  }
  return { re, im };
}

/** Index of the last of ascending values that is not above x, but not of the last of all; 0 at least. */
export function indexIn(values, x) {
  let low = 0, high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

/** Weights (n,) of the polynomial through n places `at`, read at x. */
export function lagrange(at, x) {
  const weights = new Float64Array(at.length).fill(1);
  for (let k = 0; k < at.length; k++) {
    for (let j = 0; j < at.length; j++) if (j !== k) weights[k] *= (x - at[j]) / (at[k] - at[j]);
  }
  return weights;
}

/** Largest size of values, 0 of none; what is not a number does not count. */
export const largestOf = (values) => values.reduce((most, v) => (Math.abs(v) > most ? Math.abs(v) : most), 0);

/** Quotient [re, im] of a + i b and c + i d. */
export function divided(a, b, c, d) {
  const size = c * c + d * d;
  return [(a * c + b * d) / size, (b * c - a * d) / size];
}
