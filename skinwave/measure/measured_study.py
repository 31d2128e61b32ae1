"""Models beside a measurement: lines, delay, gain, and differences that exceed the noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from meshes.tetmesh import Floats
from skinwave.measure.alignment import AS_GOOD, Alignment, align
from skinwave.measure.coherence import Coherence, coherence
from skinwave.measure.lines import MeasuredLines, lines_of
from skinwave.measure.measured_claims import MeasuredClaim, assess_measured, by_name
from skinwave.measure.measurement import Measurement
from skinwave.measure.resolvable_lines import lines_to_compare, spectrum_of
from skinwave.measure.significance import holm, significances
from skinwave.results.comparison import heard_phasors
from skinwave.results.run import Run
from skinwave.scene.scene import Scene

WITHIN = 0.75  # of a record, or of the Tacton, that is to lie within the other
LEVEL = 0.05  # chance that any difference at all is declared where there is none
AGREES, DIFFERS, NUMERICAL, SILENT, UNKNOWN = (
    "within the noise", "beyond the noise", "beyond the noise, within the numerical error",
    "no line above the noise", "noise unknown",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """A measurement to compare with, and its delay in s and its gain if they are known; the gain is
    that of bodies, since kernels are of another unit.
    """

    measurement: Measurement
    delay: float | None = None
    gain: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """A model beside a measurement.

    Parameters
    ----------
    run : Run, in the measurement's quantity or, of a kernel, in Pa
    alignment : Alignment
    model : (f, p) complex, its lines with gain and delay, in the unit of the measurement
    significance : (f, p) float, of differences, adjusted for their number (Holm); nan if unknown
    misfit : float, RMS difference of the lines over all places over that of the measured lines
    may_be_turned : bool, whether the measurement with its sign turned fits as well
    """

    run: Run
    alignment: Alignment
    model: np.ndarray
    significance: Floats
    misfit: float
    may_be_turned: bool = False

    @property
    def differs(self) -> np.ndarray:
        """Mask (f, p) of differences beyond the noise."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.significance < LEVEL)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredComparison:
    """A measurement beside models.

    Parameters
    ----------
    measurement : Measurement
    scene : Scene, at the places and in the quantity of the measurement
    names : names of each line by the first of them, in the order of the lines
    lines : MeasuredLines, of these
    present : (f, p) float, significance of each line, adjusted for their number; nan if unknown
    unresolved : names of lines of the load that the record cannot resolve
    coherence : Coherence
    columns : of the models
    claims : what the measurement alone says of the paper's claims
    """

    measurement: Measurement
    scene: Scene
    names: Mapping[str, tuple[str, ...]]
    lines: MeasuredLines
    present: Floats
    unresolved: tuple[str, ...]
    coherence: Coherence
    columns: tuple[Column, ...]
    claims: tuple[MeasuredClaim, ...]

    @property
    def noise(self) -> float:
        """Misfit that noise alone would leave; nan if it is unknown, and where it is of some lines
        they count as the others do.
        """
        known = self.lines.variance[np.isfinite(self.lines.variance)]
        whole = float((np.abs(self.lines.mean) ** 2).sum())
        return float(np.sqrt(known.mean() * self.lines.variance.size / whole)) if len(known) else (
            np.nan)  # fmt: skip

    def is_numerical(self, column: Column) -> np.ndarray:
        """Mask (f, p) of differences no larger than the numerical error that a model's waveform is
        expected to have at that place.
        """
        away = np.abs(self.lines.mean - column.model)
        error = np.nan_to_num(column.run.response.expected_error)
        return np.asarray(away <= error * np.linalg.norm(column.model, axis=0))

    def findings(self, column: Column) -> np.ndarray:
        """Finding (f, p) of each difference: one of `AGREES` to `UNKNOWN`."""
        with np.errstate(invalid="ignore"):
            silent = self.present >= LEVEL
        found = np.where(silent, SILENT, AGREES).astype(object)
        found[column.differs] = DIFFERS
        found[column.differs & self.is_numerical(column)] = NUMERICAL
        found[np.isnan(column.significance)] = UNKNOWN
        return found


def compare_measured(asked: Measured, runs: Sequence[Run]) -> MeasuredComparison:
    """Models beside a measurement, line by line.

    Parameters
    ----------
    asked : Measured
    runs : of one Tacton, at the places of the measurement and, of bodies, in its quantity

    Returns
    -------
    MeasuredComparison

    Raises
    ------
    ValueError
        If the record resolves no line of the load.
    """
    measurement, scene = asked.measurement, _scene_of(runs)
    names, frequencies, unresolved = lines_to_compare(measurement, scene)
    lines = lines_of(measurement, frequencies)
    columns = tuple(_column(asked, run, lines) for run in runs)
    named = by_name(scene, names, lines, unresolved, spectrum_of(measurement))
    return MeasuredComparison(
        measurement=measurement, scene=scene, names=names, lines=lines,
        present=holm(significances(lines.mean, lines)), unresolved=unresolved,
        coherence=coherence(measurement, frequencies), columns=columns,
        claims=tuple(assess_measured(named)),
    )  # fmt: skip


def _scene_of(runs: Sequence[Run]) -> Scene:
    """The scene of a body, whose load is the scene's own; of the last kernel if there is none."""
    bodies = [run for run in runs if run.response.record.of_body]
    return (bodies or list(runs))[-1].scene


def _column(asked: Measured, run: Run, lines: MeasuredLines) -> Column:
    z = heard_phasors(run.response, tuple(lines.frequencies.tolist()))
    gain = asked.gain if run.response.record.of_body else None
    window, centre = delay_window(asked.measurement, run, lines)
    aligned = partial(align, window=window, centre=centre, delay=asked.delay, gain=gain)
    found = aligned(lines, z)
    model = found.applied(lines.frequencies, z)
    away = lines.mean - model
    turned = aligned(replace(lines, each=-lines.each), z)
    fits = 2 * lines.variance.size * (turned.chi_square - found.chi_square) < AS_GOOD
    nearer = abs(turned.delay) < abs(found.delay) or turned.chi_square < found.chi_square
    return Column(
        run=run, alignment=found, model=model, significance=holm(significances(away, lines)),
        misfit=float(np.linalg.norm(away) / np.linalg.norm(lines.mean)),
        may_be_turned=bool(fits and nearer),
    )  # fmt: skip


def delay_window(measurement: Measurement, run: Run, lines: MeasuredLines) -> tuple[float, float]:
    """Width and centre in s of the delays at which most of a record lies within the Tacton, or most
    of the Tacton within the record; at least a period of the lowest line wide.
    """
    begin, end = (float(t) for t in run.response.times[[0, -1]])
    period = 1 / float(lines.frequencies.min())
    if measurement.is_spectrum:
        return 2 * max(end - begin, period), 0.0
    first, last = (float(t) for t in measurement.times[[0, -1]])
    within = WITHIN * min(last - first, end - begin)
    low, high = first + within - end, last - within - begin
    return max(high - low, period), (low + high) / 2


def overlap(measurement: Measurement, run: Run, delay: float) -> float:
    """Time in s of a record that lies within the Tacton, at a delay of the record."""
    begin, end = (float(t) + delay for t in run.response.times[[0, -1]])
    return min(float(measurement.times[-1]), end) - max(float(measurement.times[0]), begin)


def body_columns(comparison: MeasuredComparison) -> list[Column]:
    """The columns of waves: of the bodies, or of the last kernel if there is none."""
    bodies = [c for c in comparison.columns if c.run.response.record.of_body]
    return bodies or list(comparison.columns[-1:])


def main_column(comparison: MeasuredComparison) -> Column:
    """The last column of waves."""
    return body_columns(comparison)[-1]
