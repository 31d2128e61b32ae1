"""Small curves beside controls: focal spot over distance, force of the focus over its height."""

from functools import cache
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model.focus import focal_spot, relative_intensity
from skinwave.scene import Scene
from skinwave.web.controls import NUMBERS

FURTHEST = 40.0  # mm from the focus
POINTS, FINE = 81, 721  # of a curve, and of a path
# Of the view box: the curve's own part begins and ends here.
LEFT, RIGHT, TOP, BOTTOM = 30.0, 284.0, 6.0, 56.0


def beside(scene: Scene) -> dict[str, dict[str, Any]]:
    """The curves of a scene's focus with their present values: by height, and over the distance
    from the focus, on which the selected point is as near as the path comes to it.
    """
    pressure = scene.pressure
    height = 1e3 * pressure.height
    places = pressure.tacton.trajectory.at_phase(np.linspace(0, 1, FINE * pressure.tacton.n_paths))
    away = 1e3 * np.linalg.norm(places - scene.probe_points[0, :2], axis=1).min()
    distance = np.linspace(0, FURTHEST, POINTS)

    def spot(distances: Floats) -> Floats:
        offsets = np.column_stack([distances, np.zeros_like(distances)]) / 1e3
        return focal_spot(offsets, pressure.height, pressure.profile)

    present = float(spot(np.array([away]))[0])
    return {
        "height": _inset(*_by_height(), (height, relative_intensity(pressure.height)),
                         f"{height:g} mm", "height of the focus, mm"),
        "profile": _inset(distance, spot(distance), (float(away), present),
                          f"point at {away:.1f} mm", "distance D from the focus, mm"),
    }  # fmt: skip


@cache
def _by_height() -> tuple[Floats, Floats]:
    heights = np.linspace(NUMBERS["height"].low, NUMBERS["height"].high, POINTS)
    return heights, np.array([relative_intensity(height / 1e3) for height in heights])


def _inset(x: Floats, y: Floats, at: tuple[float, float], where: str, words: str) -> dict[str, Any]:
    """A curve of values 0..1 in the units of its view box, its ticks, and a value on it that is
    marked unless it lies beyond; `words` are those of its axis.
    """
    low, high = float(x[0]), float(x[-1])

    def along(value: float) -> float:
        return round(LEFT + (value - low) / (high - low) * (RIGHT - LEFT), 1)

    def up(value: float) -> float:
        return round(BOTTOM - value * (BOTTOM - TOP), 1)

    path = "L".join(f"{along(a)},{up(b)}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    beyond = not low <= at[0] <= high
    return {
        "path": f"M{path}", "words": words, "at": [] if beyond else [along(at[0]), up(at[1])],
        "said": f"{where}: {at[1]:.2f}",
        "ticks": [[along(tick), f"{tick:g}"] for tick in np.linspace(low, high, 3).tolist()],
    }  # fmt: skip
