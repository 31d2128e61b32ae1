"""Sensation level at a page's point over one of the controls, and where it is highest."""

from typing import Any

import numpy as np

from skinwave.pictures.styles import LABELS
from skinwave.scene import Scene
from skinwave.web import controls, scenes
from skinwave.web.levels import FAINTEST, Levels, kernel_level
from skinwave.web.model import Answer
from skinwave.web.plots import PlotlyFigure, numbers

VALUES = 33  # of a control
LEVELS: dict[str, tuple[str, float, float]] = {  # the view: a control, and the range that is shown
    "level by speed": ("speed", 0.5, 40.0),
    "level by size": ("size", 2.0, 60.0),
    "level by AM": ("am", 10.0, 400.0),
    "level by height": ("height", 100.0, 400.0),
}


def variants(view: str, values: controls.Values, *given: Any) -> tuple[Levels, tuple[Scene, ...]]:
    """Levels of the kernel over values of the control of a view, the present one among them, and
    the scene of each.

    Parameters
    ----------
    view : one of `LEVELS`
    values : of all controls
    given : the body and the spreads of a file, as `scenes.scene_of` takes them
    """
    key, low, high = LEVELS[view]
    current = float(values[key])
    at, found = [], []
    for value in np.union1d(np.linspace(low, high, VALUES), [current]).tolist():
        try:
            found.append(scenes.scene_of(values | {key: value}, *given))
        except ValueError:
            continue  # a path that leaves the area, say
        at.append(value)
    kernel = np.array([kernel_level(scene) for scene in found])
    levels = Levels(view=view, current=current, at=np.array(at), kernel=kernel)
    return levels, tuple(found)


def level_plot(levels: Levels, waves: Answer | None) -> PlotlyFigure:
    """Levels over a control, with its present value and where they are highest."""
    key, low, high = LEVELS[levels.view]
    number = controls.NUMBERS[key]
    curves = [("kernel", f"{LABELS['point-kernel']}, dB SL", levels.kernel)]
    if waves is not None and levels.waves is not None and np.isfinite(levels.waves).any():
        of_waves, count = f"waves ({waves.response.model}), dB SL", np.isfinite(levels.waves).sum()
        name = of_waves if levels.of == "waves" else f"{of_waves} (at {count} of {len(levels.at)})"
        curves.append(("waves", name, levels.waves))
    data: list[dict[str, Any]] = []
    for role, name, own in curves:
        known = np.isfinite(own)
        data.append({"role": role, "axis": "y", "name": name, "x": numbers(levels.at[known]),
                     "y": numbers(np.maximum(own[known], FAINTEST))})  # fmt: skip
    shown = [value for curve in data for value in curve["y"]]
    ends = [max(FAINTEST, min([-6.0, *shown])) - 2.0, 1.3 * max([6.0, *shown])]
    data += [
        {"role": "threshold", "axis": "y", "name": "threshold", "dash": "dash",
         "x": [low, high], "y": [0.0, 0.0]},
        {"role": "pinned", "axis": "y", "name": "present value", "dash": "dot",
         "x": [levels.current] * 2, "y": ends},
    ]  # fmt: skip
    best, names = levels.best, []
    if best is not None:
        level = float(getattr(levels, levels.of)[levels.at == best][0])
        names = [{"x": best, "y": max(level, FAINTEST), "axis": "y",
                  "said": [f"{best:.3g} {number.unit}", f"{level:+.0f} dB"]}]  # fmt: skip
    words = number.label[0].lower() + number.label[1:] if key != "am" else number.label
    return {
        "title": f"Sensation level at the point by {words} (highest: {levels.of})",  # never cut
        "data": data,
        "kept": levels.view, "legend": True, "names": names,
        "x": {"said": f"{words}, {number.unit}", "range": [low, high]},
        "y": {"said": "sensation level, dB", "range": ends},
    }  # fmt: skip
