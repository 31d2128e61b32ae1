"""Models beside a measurement: lines, delay, gain, and differences that exceed the noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.line_table import resolved_lines
from simple_model.quantities import DISPLACEMENT, QUANTITIES
from simple_model.response import SETTLE, spectrum, step
from skinwave.comparison import heard_phasors
from skinwave.measurements.alignment import Alignment, align
from skinwave.measurements.coherence import Coherence, coherence
from skinwave.measurements.lines import (
    MeasuredLines,
    as_response,
    bin_width,
    evenly,
    holm,
    lines_of,
    measurable,
    significances,
)
from skinwave.measurements.measurement import Measurement
from skinwave.models.prepared import Prepared, answer, sample_times
from skinwave.run import ASSESSED, Run, own_names
from skinwave.scene import Scene
from skinwave.studies.measured_claims import MeasuredClaim, assess_measured, by_name

MEASURED = "measured"  # body and model of what is drawn beside the models
LEVEL = 0.05  # chance that any difference at all is declared where there is none
AGREES, DIFFERS, NUMERICAL, SILENT, UNKNOWN = (
    "within the noise", "beyond the noise", "beyond the noise, within the numerical error",
    "no line above the noise", "noise unknown",
)  # fmt: skip
MOST_DRAWN = 8  # places


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
    """

    run: Run
    alignment: Alignment
    model: np.ndarray
    significance: Floats
    misfit: float

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
        """Misfit that noise alone would leave; nan if it is unknown."""
        return float(np.sqrt(self.lines.variance.sum() / (np.abs(self.lines.mean) ** 2).sum()))

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


def at_measured(scene: Scene, measurement: Measurement) -> Scene:
    """The scene with probes where was measured or, where that is unknown, with as many; they read
    displacement, as every comparison, and are read in the measured quantity beside it.

    Raises
    ------
    ValueError
        If the quantity is not of normal motion, places are unknown and not as many as probes, or
        the record resolves no line of the load.
    """
    if not measurement.record.is_normal:
        known = ", ".join(name for name, q in QUANTITIES.items() if q.is_normal and q.of_body)
        raise ValueError(
            f"a measured {measurement.record.words} cannot be compared; give one of {known}"
        )
    if scene.reading.is_on_surface and scene.reading.asked.is_normal:
        scene = replace(scene, quantity=DISPLACEMENT.name)
    if np.isfinite(measurement.places).all():
        scene = replace(scene, probes=tuple(map(tuple, measurement.places.tolist())))
    elif len(scene.probes) != len(measurement.places):
        raise ValueError(
            f"the places of the measurement's {len(measurement.places)} signals are unknown, and "
            f"the scene has {len(scene.probes)} probes; give as many, in the same order"
        )
    lines_to_compare(measurement, scene)
    return scene


def in_quantity(run: Run, quantity: str, prepared: Mapping[str, Prepared]) -> Run:
    """A body's run read in another quantity of normal motion; a kernel's as it is."""
    if not run.response.record.of_body or run.response.quantity == quantity:
        return run
    scene = replace(run.scene, quantity=quantity)
    found = answer(replace(prepared[run.column], reading=scene.reading), scene)
    found = replace(found, expected_error=run.response.expected_error)
    return replace(run, scene=scene, response=found)


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
    named = by_name(scene, names, lines, unresolved, _spectrum(measurement))
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
    window = 2 * max(float(np.ptp(run.response.times)), 1 / float(lines.frequencies.min()))
    found = align(lines, z, window=window, delay=asked.delay, gain=gain)
    model = found.applied(lines.frequencies, z)
    away = lines.mean - model
    return Column(
        run=run, alignment=found, model=model, significance=holm(significances(away, lines)),
        misfit=float(np.linalg.norm(away) / np.linalg.norm(lines.mean)),
    )  # fmt: skip


def lines_to_compare(
    measurement: Measurement, scene: Scene
) -> tuple[dict[str, tuple[str, ...]], Floats, tuple[str, ...]]:
    """Lines of the load that both the record and a response of the scene resolve, and the others.

    Returns
    -------
    names by the first of each, frequencies (f,) in Hz, and the names of those left out

    Raises
    ------
    ValueError
        If the record resolves none.
    """
    candidates = ASSESSED if len(scene.tacton.foci) == 1 else ()
    clocks = [*_clock(measurement), _silence(sample_times(scene))]
    highest = min(0.5 / step(clock.times) for clock in clocks)
    found: dict[str, float] = {}
    lost: dict[str, float] = {}
    for clock in clocks:
        good, bad = resolved_lines(scene.pressure, clock, candidates=candidates, highest=highest)
        found, lost = (found | good), (lost | bad)
    kept = {name: f for name, f in sorted(found.items(), key=lambda x: x[1]) if name not in lost}
    there = measurable(measurement, np.array([*kept.values()])) if kept else ()
    lost |= {name: f for (name, f), is_there in zip(kept.items(), there, strict=True)
             if not is_there}  # fmt: skip
    kept = {name: f for name, f in kept.items() if name not in lost}
    if not kept:
        raise ValueError(
            "the measurement resolves no line of the scene's load; give a longer record, a higher "
            "sampling rate, or the scene that was measured"
        )
    own = own_names(scene, kept)
    names = {
        name: tuple(dict.fromkeys([name, *(n for n, o in own.items() if o == name)]))
        for name in kept
    }
    return names, np.array([*kept.values()]), tuple(lost)


def _clock(measurement: Measurement) -> list[Response]:
    """Silence at the times of a measurement, by which lines are resolved; of a spectrum with equal
    bins at times whose transform has them.
    """
    if not measurement.is_spectrum:
        times = evenly(measurement)
    else:
        width = bin_width(measurement)
        if not width:
            return []
        rate = 2.1 * measurement.frequencies[-1]
        times = np.arange(int(rate / width)) / rate / (1 - SETTLE)
    return [_silence(times)]


def _silence(times: Floats) -> Response:
    return Response(
        model=MEASURED, times=times, probes=np.zeros((1, 2)), values=np.zeros((len(times), 1))
    )


def _spectrum(measurement: Measurement) -> tuple[Floats, Floats]:
    """Amplitude spectrum of the mean, for peaks; empty of spectra of single lines."""
    if not measurement.is_spectrum:
        return spectrum(as_response(measurement, measurement.mean))
    if not bin_width(measurement):
        return np.empty(0), np.empty((0, len(measurement.places)))
    return measurement.frequencies, np.abs(measurement.mean)


def measured_run(comparison: MeasuredComparison, like: Run, delay: float) -> Run:
    """The mean over the repetitions as a run to draw, on the clock of a model's response; of
    spectra the sum of the lines, since their waveform is not there.
    """
    measurement = comparison.measurement
    if measurement.is_spectrum:
        times = like.response.times
        turned = np.exp(2j * np.pi * np.multiply.outer(times + delay, comparison.lines.frequencies))
        values = (turned @ comparison.lines.mean).real
    else:
        times, values = evenly(measurement) - delay, _mean_in_step(comparison)
    response = Response(
        model=MEASURED, times=times, probes=comparison.scene.probe_points, values=values,
        quantity=measurement.quantity,
    )  # fmt: skip
    return Run(tacton=like.tacton, body=MEASURED, scene=comparison.scene, response=response)


def _mean_in_step(comparison: MeasuredComparison) -> Floats:
    """Mean (t, p) of repetitions, each shifted as its lines were."""
    measurement, shifts = comparison.measurement, comparison.lines.shifts
    if not shifts.any():
        return measurement.mean
    times = evenly(measurement)
    shifted = [
        CubicSpline(times, values)(np.clip(times + shift, times[0], times[-1]))
        for values, shift in zip(measurement.values, shifts, strict=True)
    ]
    return np.asarray(np.mean(shifted, axis=0))


def body_columns(comparison: MeasuredComparison) -> list[Column]:
    """The columns of waves: of the bodies, or of the last kernel if there is none."""
    bodies = [c for c in comparison.columns if c.run.response.record.of_body]
    return bodies or list(comparison.columns[-1:])


def main_column(comparison: MeasuredComparison) -> Column:
    """The last column of waves."""
    return body_columns(comparison)[-1]


def at_places(run: Run, chosen: np.ndarray) -> Run:
    """A run at some of its probes."""
    response = run.response
    scene = replace(run.scene, probes=tuple(run.scene.probes[k] for k in chosen), depth=0.0)
    return replace(run, scene=scene, response=replace(
        response, probes=response.probes[chosen], values=response.values[:, chosen]
    ))  # fmt: skip


def drawn_places(comparison: MeasuredComparison) -> np.ndarray:
    """Indices of the places that figures show: all, or some from the strongest to the weakest."""
    size = np.linalg.norm(comparison.lines.mean, axis=0)
    if len(size) <= MOST_DRAWN:
        return np.arange(len(size))
    order = np.argsort(-size, kind="stable")
    return np.sort(order[np.linspace(0, len(size) - 1, MOST_DRAWN).round().astype(int)])


def beside(comparison: MeasuredComparison, group: Sequence[Run]) -> list[Run]:
    """Runs to draw: models in the measured quantity, and the measurement on their clock."""
    main, chosen = main_column(comparison), drawn_places(comparison)
    runs = [*group, measured_run(comparison, main.run, main.alignment.delay)]
    return [at_places(run, chosen) for run in runs]
