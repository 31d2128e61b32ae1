// The view of a report: a moving body, from the data of skinwave.report.turntable.

import { bytes, unpack } from "./pack.js";
import { openView } from "./view3d.js";

const data = JSON.parse(document.getElementById("data").textContent);
const view = openView(document.getElementById("view"));
const { re, im } = unpack(data.motion);

view.show({
  shape: { points: new Float32Array(bytes(data.points)), triangles: new Uint32Array(bytes(data.triangles)) },
  motion: { f: data.frequencies, re, im },
  path: data.path, foci: data.foci, points: data.probes, period: data.period, unit: data.unit,
});
view.seek(data.time);
