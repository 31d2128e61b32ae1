"""Sensation level at a page's point: whether it is above threshold, and how far.

The level of a response is that of its steady line with the highest sensation level, of a rhythm
with its pauses, as in the table of lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshes.tetmesh import Floats
from simple_model import sensation_level
from simple_model.load_spectrum import pressure_lines
from simple_model.path_cells import path_samples
from skinwave.scene import Scene
from skinwave.web.model import FAINTEST_LEVEL, Answer, AreaMap, mean_level, places

FAINTEST = -60.0  # dB: what is less is not worth a number
WEAK = 1e-3  # of the strongest line of a load: one that is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """Levels in dB of the `kernel` (n,) and, once they are known, of the `waves` (n,), over the
    values `at` (n,) of the control of a `view`, whose present value is `current`.
    """

    view: str
    current: float
    at: Floats
    kernel: Floats
    waves: Floats | None = None

    @property
    def of(self) -> str:
        """Whose level `best` is: of "waves" if these are known at all values, else "kernel"."""
        return "kernel" if self.waves is None or np.isnan(self.waves).any() else "waves"

    @property
    def best(self) -> float | None:
        """The value with the highest level; None if none is known."""
        shown = self.waves if self.waves is not None and self.of == "waves" else self.kernel
        return float(self.at[np.nanargmax(shown)]) if np.isfinite(shown).any() else None


def level_of(scene: Scene, frequencies: Floats, lines: np.ndarray, unit: str = "m") -> float:
    """Highest sensation level in dB of steady lines (f,) of complex amplitudes (f,) at a point."""
    sizes = mean_level(scene.pressure) * np.abs(lines)
    moves = frequencies > 1e-6
    levels = sensation_level(sizes[moves], frequencies[moves], unit=unit)
    return float(np.max(levels, initial=FAINTEST_LEVEL))


def kernel_level(scene: Scene) -> float:
    """Level of the pressure at a scene's probe, under the load that a body receives."""
    f, lines = pressure_lines(scene.pressure, scene.probe_points, WEAK)
    return level_of(scene, f, lines[:, 0], unit="Pa")


def reach(scene: Scene, found: AreaMap) -> tuple[float, bool] | None:
    """How far in metre from the path a map is at threshold or above, and whether that goes on
    beyond the map; None if it nowhere is.
    """
    above = np.nan_to_num(found.level, nan=FAINTEST_LEVEL) >= 0.0
    if not above.any():
        return None
    at = np.concatenate([places()[above.ravel()], *found.threshold])
    away = cKDTree(path_samples(scene.pressure)).query(at)[0].max()
    return float(away), bool(above[[0, -1]].any() or above[:, [0, -1]].any())


def has_threshold(scene: Scene) -> bool:
    """Whether a threshold of skin says something of a response: of skin in normal displacement, and
    of the kernel alone.
    """
    kernel_alone = not scene.body.of_kind.discretise
    return kernel_alone or (scene.body.is_skin and scene.reading.is_plain)


def above_threshold(scene: Scene, answers: Sequence[Answer]) -> str:
    """Whether a response is above threshold at the selected point, at which line, and how far from
    the path it is; nothing of a body that is not skin.
    """
    kernel, waves = answers[0], answers[-1]
    own = waves is not kernel
    if not has_threshold(scene):
        return ""
    unit = "m" if own else "Pa"
    lines = [x for x in waves.lines if x.frequency > 0]
    sizes, frequencies = np.array([(x.amplitude, x.frequency) for x in lines]).reshape(-1, 2).T
    levels = dict(zip(lines, sensation_level(sizes, frequencies, unit=unit).tolist(), strict=True))
    line = max(levels, key=lambda each: levels[each], default=None)
    if line is None or levels[line] < FAINTEST:
        return "Above threshold at the point: no, next to nothing moves there."
    yes = "yes" if levels[line] >= 0 else "no"
    how = f"{levels[line]:+.0f} dB SL at {line.frequency:.0f} Hz ({line.name})"
    far = _far(reach(scene, waves.map))
    beside = f" (kernel: {_far(reach(scene, kernel.map))})" if own else ""
    return f"Above threshold at the point: {yes}, {how}; from the path {far}{beside}."


def _far(found: tuple[float, bool] | None) -> str:
    if found is None:
        return "nowhere"
    metre, beyond = found
    return f"{'beyond' if beyond else 'out to'} {1e3 * metre:.0f} mm"
