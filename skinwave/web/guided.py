"""Dispersion curves of a page's body, with the lines of its load, as a plot.

Curves are computed anew only for another body or band: lines of a load are found on them by
interpolation, so that the plot follows a slider.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model.dispersion import DispersionCurves, Mode
from simple_model.line_names import line_names
from skinwave.bodies import Body
from skinwave.bodies.analytic import dispersion
from skinwave.numbers import significant
from skinwave.scene import Scene
from skinwave.studies.driven_modes import LOWEST, WEAKEST, amplitudes_of, is_moving
from skinwave.web.drawings import written
from skinwave.web.plots import NAMED, PlotlyFigure, numbers

MODES = 6
APART = 20.0  # Hz between frequencies that are computed
FEWEST, DRAWN = 20, 160  # frequencies that are computed, and that are drawn
PALE = 0.3  # opacity of a curve where its mode is evanescent
ABOVE = 1.8  # of the fastest of typical speeds: what the axis shows


def has_curves(body: Body) -> bool:
    """Whether there are dispersion curves of a body."""
    return body.of_kind.dispersion is not None


@lru_cache(maxsize=8)
def curves_of(body: Body, highest: float) -> DispersionCurves:
    """Dispersion curves of a body up to a frequency in Hz."""
    count = max(FEWEST, round(highest / APART))
    return dispersion(body, np.linspace(LOWEST, highest, count), MODES)


def dispersion_plot(scene: Scene, highest: float) -> PlotlyFigure:
    """Phase speeds of the modes of a scene's body up to a frequency in Hz, the lines of its load on
    the mode that each drives, and the speed of the focus.
    """
    curves, pressure = curves_of(scene.body, highest), scene.pressure
    speed = pressure.tacton.trajectory.speed if is_moving(pressure) else 0.0
    data: list[dict[str, Any]] = []
    typical = [speed, 1.0]
    for n, mode in enumerate(curves.modes):
        typical += [float(np.median(mode.phase_speed[mode.is_wave]))] if mode.is_wave.any() else []
        data += _curve(mode, n)
    top = ABOVE * max(typical)
    data = [curve | {"y": np.minimum(curve["y"], 4 * top).tolist()} for curve in data]
    names = _names(scene, curves, highest)
    data += [{"role": "threshold", "dash": "dot", "axis": "y", "width": 0.9,
              "x": [name["x"]] * 2, "y": [0.0, top]} for name in names]  # fmt: skip
    if speed:
        data.append({"role": "kernel", "dash": "dash", "axis": "y", "name": "speed of the focus",
                     "x": [0.0, highest], "y": [speed, speed]})  # fmt: skip
    return {
        "title": "Dispersion, 1/e length at each line", "data": data,
        "kept": f"dispersion {highest}", "legend": True, "names": names,
        "x": {"said": "frequency, Hz", "range": [0.0, float(highest)]},
        "y": {"said": "phase speed, m/s", "range": [0.0, top]},
    }  # fmt: skip


def _curve(mode: Mode, n: int) -> list[dict[str, Any]]:
    """Curves of a mode: all of it, pale, and each part where it carries energy."""
    f = np.linspace(mode.frequencies[0], mode.frequencies[-1], DRAWN)
    k = np.abs(np.sqrt(mode.squared_at(f)).real)
    nearest = np.abs(f[:, None] - mode.frequencies).argmin(axis=1)
    wave = mode.is_wave[nearest] & (f >= mode.cut_on)
    known = np.isfinite(k)
    speed = 2 * np.pi * f / np.maximum(k, 1e-3)
    style = {"role": f"mode{1 + n % MODES}", "axis": "y"}
    found = [style | {**_points(f[known], speed[known]), "width": 1.0, "opacity": PALE}]
    for start, end in _runs(wave & known):
        name = {} if len(found) > 1 else {"name": mode.name}
        found.append(style | name | _points(f[start:end], speed[start:end]) | {"width": 2.0})
    return found


def _points(f: Floats, speed: Floats) -> dict[str, Any]:
    return {"x": numbers(f), "y": np.round(speed, 4).tolist()}


def _runs(wave: np.ndarray) -> list[tuple[int, int]]:
    """Start and end of each part of two or more places in a row that is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wave.astype(int), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a > 1]


def _names(scene: Scene, curves: DispersionCurves, highest: float) -> list[dict[str, Any]]:
    """Names of the strongest lines, each with the 1/e length of the mode that it drives most."""
    lines = line_names(scene.pressure, WEAKEST)
    sizes = np.nan_to_num(np.abs(amplitudes_of(curves.modes, scene.pressure)))
    found: list[dict[str, Any]] = []
    for k in np.argsort(-lines.strengths, kind="stable").tolist():
        f = float(lines.frequencies[k])
        far = all(abs(f - other["x"]) > 0.05 * highest for other in found)
        if not (curves.frequencies[0] <= f <= highest and far and len(found) < NAMED):
            continue
        at = int(np.abs(curves.frequencies - f).argmin())
        waves = [m for m, mode in enumerate(curves.modes) if mode.is_wave[at]]
        speed, said = 0.0, "no wave"
        if waves:
            squared = curves.modes[max(waves, key=lambda m: sizes[m, at])].squared_at([f])[0]
            speed = float(2 * np.pi * f / max(abs(np.sqrt(squared).real), 1e-3))
            said = f"{significant(1e3 / max(abs(np.sqrt(squared).imag), 1e-6))} mm"
        found.append({"x": round(f, 2), "y": float(f"{speed:.4g}"), "axis": "y",
                      "said": [written(lines.names[k]), said]})  # fmt: skip
    return found
