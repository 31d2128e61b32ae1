// Fourier transforms, interpolation and complex arrays that several modules use.

/** Return the value of a key in a map of few entries; make it if it is missing. */
export function cached(entries, key, make, most = 8) {
  if (!entries.has(key)) {
    if (entries.size >= most) entries.clear();
    entries.set(key, make());
  }
  return entries.get(key);
}

/** Complex values (n,), all 0. */
export const zeros = (count) => ({ re: new Float64Array(count), im: new Float64Array(count) });

const unitCircles = new Map();

/** Cosines and sines (n,) of the angles 2 pi k / n. */
export const unitCircle = (n) => cached(unitCircles, n, () => {
  const [cos, sin] = [Math.cos, Math.sin].map((of) => (
    Float64Array.from({ length: n }, (_, k) => of(2 * Math.PI * k / n))));
  return { cos, sin };
}, 16);

const bitOrders = new Map();

/** Indices (n,) with their bits reversed. */
const bitReversed = (n) => cached(bitOrders, n, () => {
  const order = new Uint32Array(n);
  for (let k = 1, half = n >> 1; k < n; k++) order[k] = (order[k >> 1] >> 1) | (k & 1 ? half : 0);
  return order;
});

/**
 * Transform re, im (n,) in place, n a power of two: sum_t x_t exp(-2 pi i k t / n), or with + if
 * `inverse`. The sum is not divided by n.
 */
export function transform(re, im, inverse = false) {
  const n = re.length, order = bitReversed(n), { cos, sin } = unitCircle(n), sign = inverse ? 1 : -1;
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

/** Smallest power of two that is not below a number. */
export const powerOfTwo = (least) => 2 ** Math.ceil(Math.log2(Math.max(least, 2)));

/** Transform {re, im} of real values (n,) of any length by Bluestein's convolution. */
export function fourier(values) {
  const n = values.length, size = powerOfTwo(2 * n), { cos, sin } = unitCircle(2 * n);
  const [ar, ai, br, bi] = Array.from({ length: 4 }, () => new Float64Array(size));
  for (let k = 0; k < n; k++) {
    const c = cos[(k * k) % (2 * n)], s = sin[(k * k) % (2 * n)];
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
  const { re, im } = zeros(n);
  for (let k = 0; k < n; k++) {
    const c = cos[(k * k) % (2 * n)] / size, s = sin[(k * k) % (2 * n)] / size;
    re[k] = ar[k] * c + ai[k] * s;
    im[k] = ai[k] * c - ar[k] * s;
  }
  return { re, im };
}

/** Index of the interval of ascending values in which x lies; the first or last one if x is outside. */
export function indexIn(values, x) {
  let low = 0, high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

/** Weights (n,) of the values at n places `at` in the polynomial through them, at x. */
export function lagrange(at, x) {
  const weights = new Float64Array(at.length).fill(1);
  for (let k = 0; k < at.length; k++) {
    for (let j = 0; j < at.length; j++) if (j !== k) weights[k] *= (x - at[j]) / (at[k] - at[j]);
  }
  return weights;
}

/** Largest absolute value, without NaN; 0 for an empty array. */
export const largestOf = (values) => values.reduce((most, v) => (Math.abs(v) > most ? Math.abs(v) : most), 0);

/** Quotient [re, im] of a + i b over c + i d. */
export function divided(a, b, c, d) {
  const size = c * c + d * d;
  return [(a * c + b * d) / size, (b * c - a * d) / size];
}

/** Complex values {re, im} (n,) from a function of the index that gives [re, im]. */
export function complexFrom(count, valueAt) {
  const out = zeros(count);
  for (let k = 0; k < count; k++) [out.re[k], out.im[k]] = valueAt(k);
  return out;
}

/** Quotients (n,) of complex values. */
export const quotients = (above, below) => complexFrom(above.re.length, (k) => (
  divided(above.re[k], above.im[k], below.re[k], below.im[k])));

/** Sum [re, im] of products of complex values, without conjugation. */
export function product(a, b) {
  let re = 0, im = 0;
  for (let k = 0; k < a.re.length; k++) {
    re += a.re[k] * b.re[k] - a.im[k] * b.im[k];
    im += a.re[k] * b.im[k] + a.im[k] * b.re[k];
  }
  return [re, im];
}

/** Add a complex factor [c, s] times `from` to complex values, in place. */
export function addTimes({ re, im }, [c, s], from) {
  for (let k = 0; k < re.length; k++) {
    re[k] += c * from.re[k] - s * from.im[k];
    im[k] += c * from.im[k] + s * from.re[k];
  }
}

/** Index of the value that differs from x by less than `within`; -1 if there is none. */
export const indexNear = (values, x, within = 1e-6) => values.findIndex((own) => Math.abs(own - x) < within);
