"""A page with a view that can be rotated in a browser, with the code of the live page."""

from importlib import resources
from typing import Any

import numpy as np

from simple_model import MovingPressure
from skinwave.report.palette import label
from skinwave.report.render import outer_surface
from skinwave.results.views import View
from skinwave.system.arrays import base64_text, quantise
from skinwave.system.scripts import bundle, json_for_script
from skinwave.system.templates import render
from skinwave.typing import Complex, Floats


def turntable(view: View, frame: int) -> str:
    """Return a page with a moving view that starts at a frame."""
    nodes, triangles = outer_surface(view)
    frequencies, upwards = motion_lines(view.motion[:, nodes, 2], view.period)
    paths, foci = focus_places(view.scene.pressure, view.times)
    data = {
        "title": label(view.column), "unit": view.quantity.unit, "period": view.period,
        "time": float(view.times[frame]), "frequencies": frequencies.tolist(),
        "motion": quantise(upwards), "points": base64_text(1e3 * view.points[nodes], "<f4"),
        "triangles": base64_text(triangles, "<u4"), "path": paths.tolist(), "foci": foci.tolist(),
        "probes": view.scene.probe_points[:, :2].tolist(),
    }  # fmt: skip
    static = resources.files("skinwave") / "static"
    return render(
        "turntable.html", title=data["title"], data=json_for_script(data),
        script="\n" + bundle(static, "turntable.js"),
    )  # fmt: skip


def motion_lines(
    frames: Any, period: float, most: int = 32, negligible: float = 3e-3
) -> tuple[Floats, Complex]:
    """Return the strongest lines above 0 Hz of motion (t, n) sampled over its period in s.

    Frequencies (l,) in Hz ascend; with amplitudes a (l, n) the motion is Re sum a exp(2 pi i f t).
    There are at most `most` lines, and none is below `negligible` times the strongest.
    """
    count = len(frames)
    lines = 2 / count * np.fft.rfft(np.asarray(frames, np.float64), axis=0)
    if count % 2 == 0:
        lines[-1] /= 2
    strength = np.abs(lines).max(axis=1)
    strength[0] = 0.0
    strongest = np.argsort(-strength)[:most]
    strong = np.sort(strongest[strength[strongest] > negligible * strength.max()])
    return strong / period, lines[strong]


def focus_places(pressure: MovingPressure, times: Floats) -> tuple[Floats, Floats]:
    """Return the paths (m, q, 2) and the foci (t, k, 2) at times (t,), in m."""
    tacton, path = pressure.tacton, pressure.tacton.trajectory
    n = tacton.n_paths
    # No line connects the end of a path to the beginning of the next.
    along = (np.arange(n)[:, None] + np.linspace(0, 1 - 1e-6, 121)) / n
    paths = path.at_phase(along) if tacton.drawing_frequency else np.zeros((0, 0, 2))
    within = np.mod(tacton.drawing_frequency * times, 1.0) / n  # each focus stays on its own path
    foci = [path.at_phase((within + phase) % 1) for phase in tacton.foci]
    return paths, np.stack(foci, axis=1)
