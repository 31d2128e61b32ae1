"""Lines of a load in a measurement, as `skinwave.measure.lines` has them, and those that are
left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure, resolved_lines
from simple_model.load.line_names import line_names
from simple_model.typing import Complex
from skinwave.measure import Measurement
from skinwave.measure.lines import MeasuredLines, as_response, lines_of, measurable
from skinwave.measure.predicted import SAME, Target
from skinwave.measure.significance import holm, significances
from skinwave.models.parametric import FAINTEST

WEAK = 0.05  # of the load's strongest line: unresolved ones below it are left out
NAMED = 3  # of lines in a sentence
SURE = 0.01  # probability of as strong a line in noise alone, below which it is more than noise
FAINT = (
    f"in the reduced body weaker than {FAINTEST:g} of the strongest line, for every material of "
    "the ranges"
)
TOO_CLOSE = "weak in the load, and the record is too short to resolve it from other lines"


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Line of the load that is not fitted: its name, frequency in Hz, and why. Its `share` is that
    of the measured power of all lines, less what noise has; nan if the record does not resolve it,
    and 0 if it is no stronger than noise.
    """

    name: str
    frequency: float
    why: str
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """Measured lines of a load: their `names` (f,) and what was `found` of them; `lost` are strong
    lines of the load that the record is too short to resolve, which leak into others; others that
    are not fitted are `left_out`.
    """

    names: tuple[str, ...]
    found: MeasuredLines
    lost: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()

    @property
    def frequencies(self) -> Floats:
        """Frequencies (f,) in Hz."""
        return self.found.frequencies

    @property
    def amplitudes(self) -> Complex:
        """Mean complex amplitudes (f, p) of the repetitions."""
        return self.found.mean

    @property
    def is_known(self) -> bool:
        """Whether errors are known."""
        return bool(np.isfinite(self.found.variance).all())

    @property
    def error(self) -> Floats:
        """Standard error (f, p) of each real or imaginary part; the same for all if unknown."""
        a = self.amplitudes
        if self.is_known:
            return above_none(self.found.amplitude_error, a)
        return np.full(a.shape, np.sqrt((np.abs(a) ** 2).mean()) if a.size else 1.0)

    @property
    def noise(self) -> str:
        """How errors are known."""
        if not self.is_known:
            return "errors the same for all, as there is one repetition"
        runs = len(self.found.each)
        return f"errors from {runs} repetitions" if runs > 1 else "errors from the noise floor"


def measured_lines(measured: Measurement, aim: Target) -> Lines:
    """Lines of a load in a measurement, as far as they are predicted.

    Raises
    ------
    ValueError
        If there is none.
    """
    found = predicted_part(measured, aim)
    if found.lost:
        duration = float(np.ptp(measured.times))
        raise ValueError(
            f"the record of {1e3 * duration:.4g} ms is too short to resolve {some(found.lost)} "
            "from other lines of the load; fit waveforms from rest, or a longer record"
        )
    if not len(found.frequencies):
        raise ValueError(
            "the measurement resolves no line of the scene's load; give the scene's Tacton the "
            "frequencies and the path that were measured, or fit waveforms"
        )
    return found


def predicted_part(measured: Measurement, aim: Target) -> Lines:
    """Lines of a load in a measurement, as far as they are predicted, none if there are none."""
    kept, lost = _resolved(measured, aim.scene.pressure)
    found = lines_of(measured, np.array(list(kept.values())))
    predicted = aim.predicts(found.frequencies)
    strong = _strong(aim.scene.pressure, lost)
    close = (
        LeftOut(name=name, frequency=f, why=TOO_CLOSE, share=np.nan)
        for name, f in lost.items()
        if name not in strong
    )
    return Lines(
        names=tuple(np.array(list(kept))[predicted].tolist()), found=found.taken(predicted),
        lost=strong, left_out=(*_faint(list(kept), found, ~predicted), *close),
    )  # fmt: skip


def _resolved(
    measured: Measurement, pressure: MovingPressure
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Names and frequencies in Hz of the lines of a load that a record resolves, and the others."""
    if not measured.is_spectrum:
        return resolved_lines(pressure, as_response(measured, measured.mean))
    load = line_names(pressure)
    away = np.abs(measured.frequencies[:, None] - load.frequencies).min(axis=0)
    near = (away <= SAME * load.frequencies) & measurable(measured, load.frequencies)
    return {load.names[k]: float(load.frequencies[k]) for k in np.flatnonzero(near)}, {}


def _faint(names: list[str], found: MeasuredLines, faint: np.ndarray) -> list[LeftOut]:
    """Those of measured lines that no reduced body predicts, the strongest first."""
    more = np.abs(found.mean) ** 2 - np.nan_to_num(found.variance)
    whole = max(float(np.maximum(more, 0.0).sum()), 1e-300)
    chance = significances(found.mean, found)
    each = []
    for k in np.flatnonzero(faint).tolist():
        is_noise = holm(chance[k]).min(initial=1.0) >= SURE  # of unknown noise nan
        share = 0.0 if is_noise else max(float(more[k].sum()), 0.0) / whole
        each.append(LeftOut(name=names[k], frequency=float(found.frequencies[k]), why=FAINT,
                            share=share))  # fmt: skip
    return sorted(each, key=lambda line: -line.share)


def _strong(pressure: MovingPressure, lost: Mapping[str, float]) -> tuple[str, ...]:
    """Those of unresolved lines that are not weak beside the load's strongest."""
    load = line_names(pressure)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    least = WEAK * float(load.strengths.max(initial=0.0))
    return tuple(name for name in lost if strengths.get(name, 0.0) > least)


def above_none(error: Floats, values: np.ndarray) -> Floats:
    """Errors that are not 0, as those of repetitions without noise would be."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def some(names: tuple[str, ...]) -> str:
    """The first of some names."""
    return ", ".join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)
