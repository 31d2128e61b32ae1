"""A page on which waves move in a browser without Python, by recorded fields.

Of each Tacton the page has the complex amplitudes of the strongest lines of the load, at every
place of a grid, as the point kernel has them and as the skin slab moves: Re sum a exp(2 pi i f t)
is all that moving, listening at a point and a spectrum need.
"""

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SPEEDS = (2.0, 4.0, 6.0, 8.0, 12.0)  # m/s
AM = (0.0, 140.0)  # Hz
SIZE, REACH, STEP = 0.020, 0.030, 1.2e-3  # m, diameter of the path; the grid and its step
MOST, FAINT = 10, 0.02  # lines of a Tacton, and what they are at least of the strongest
PAGE = "moving-waves.html"
TEMPLATES = Path(__file__).parents[1] / "_templates"


def _packed(a: Any) -> dict[str, Any]:
    """Complex amplitudes (f, p) as 16-bit integers in base64, and the value of 1 of each line."""
    scale = np.maximum(np.abs(np.stack([a.real, a.imag])).max(axis=(0, 2)), 1e-300) / 32767
    both = np.stack([a.real, a.imag], axis=-1) / scale[:, None, None]
    text = base64.b64encode(np.round(both).astype("<i2").tobytes()).decode("ascii")
    return {"scale": [float(f"{s:.6g}") for s in scale], "values": text}


def _strongest(f: Any, *fields: Any) -> Any:
    """Indices, ascending, of the lines above 0 Hz that are strongest in either field (f, p)."""
    strength = sum(np.abs(a).max(axis=1) / np.abs(a).max() for a in fields) * (f > 1e-9)
    return np.sort(np.argsort(-strength)[: min(MOST, np.count_nonzero(strength))])


def recordings() -> Iterator[dict[str, Any]]:
    """Lines of the kernel and of the skin for every Tacton of the page."""
    from simple_model import MovingPressure, Tacton, Trajectory
    from simple_model.compliance import slab
    from simple_model.flat_body import steady_lines
    from simple_model.load_spectrum import pressure_lines
    from simple_model.material import PRESETS

    line = np.arange(-REACH, REACH + STEP / 2, STEP)
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    skin = slab(PRESETS["palm"], 0.015)
    for am in AM:
        for speed in SPEEDS:
            path = Trajectory(shape="circle", size=SIZE, speed=speed)
            load = MovingPressure(tacton=Tacton(am_frequency=am, trajectory=path))
            f, q = pressure_lines(load, places, FAINT)
            _, u = steady_lines(skin, load, places, threshold=FAINT)
            kept = _strongest(f, q, u)
            yield {
                "am": am, "speed": speed, "side": len(line), "reach": REACH, "size": SIZE,
                "frequencies": [float(f"{x:.9g}") for x in f[kept]],
                "kernel": _packed(q[kept]), "waves": _packed(u[kept]),
            }  # fmt: skip


def thresholds() -> dict[str, list[float]]:
    """The detection threshold in metre over frequency in Hz."""
    from simple_model import threshold

    f = np.geomspace(10, 1000, 60)
    return {"f": [float(f"{x:.5g}") for x in f], "u": [float(f"{x:.5g}") for x in threshold(f)]}


def page(tactons: list[dict[str, Any]]) -> str:
    """Text of the page of these recordings."""
    data = json.dumps({"tactons": tactons, "threshold": thresholds()})
    parts = {
        "__STYLE__": (TEMPLATES / "recorded.css").read_text("utf-8"),
        "__SHARED__": (TEMPLATES / "recorded.js").read_text("utf-8").replace("__RECORDED__", data),
    }
    text = (TEMPLATES / PAGE).read_text("utf-8")
    for key, part in parts.items():
        text = text.replace(key, part)
    return text


def write(app: "Sphinx", exception: Exception | None) -> None:
    """Write the page beside the others."""
    if exception is None and app.builder.format == "html":
        (Path(app.outdir) / PAGE).write_text(page([*recordings()]), "utf-8")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the writer."""
    app.connect("build-finished", write)
    return {"parallel_read_safe": True}
