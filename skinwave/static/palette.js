// Colours of pictures: cividis for amounts, red and blue for signed values, as in skinwave.report.maps. Both
// are perceptually uniform and distinct for every kind of colour vision.

const CIVIDIS = `00224e 00285b 002e6a 053371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 535a6d 5a5f6e 61656f
  686a71 6f7073 767676 7d7c78 848279 8c8878 938e78 9b9476 a39a74 aba072 b4a76f bcae6c c4b468 cdbb63 d5c25e
  dec958 e7d150 f0d846 f9e03a fee838`;
const RED_AND_BLUE = "053061 2065ab 4393c3 90c4dd d1e5f0 f7f6f6 fddbc7 f3a481 d6604d b1182b 67001f";
export const TABLE_LENGTH = 256;

function table(text) {
  const channels = (hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
  const stops = text.trim().split(/\s+/).map(channels);
  const colours = new Uint8ClampedArray(4 * TABLE_LENGTH);
  for (let k = 0; k < TABLE_LENGTH; k++) {
    const exact = k / (TABLE_LENGTH - 1) * (stops.length - 1);
    const low = Math.min(Math.floor(exact), stops.length - 2), part = exact - low;
    stops[low].forEach((value, c) => { colours[4 * k + c] = value + part * (stops[low + 1][c] - value); });
    colours[4 * k + 3] = 255;
  }
  return colours;
}

/** Tables of 256 RGBA colours, from the lowest value to the highest. */
export const SEQUENTIAL = table(CIVIDIS);
export const SIGNED = table(RED_AND_BLUE);
