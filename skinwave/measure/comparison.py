"""Models beside a measurement: lines, delay, gain, and differences that exceed the noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from simple_model import Response, resolved_lines, spectrum
from simple_model.load.sampling import step
from simple_model.quantities import DISPLACEMENT, QUANTITIES
from simple_model.response import SETTLE
from skinwave.measure.alignment import AS_GOOD, Alignment, align
from skinwave.measure.claims import MeasuredClaim, assess_measured, by_name
from skinwave.measure.lines import (
    MeasuredLines,
    as_response,
    bin_width,
    departures,
    evenly,
    holm,
    lines_of,
    measurable,
)
from skinwave.measure.measurement import Measurement
from skinwave.models.options import sample_times
from skinwave.models.reduced import ReducedBody, answer
from skinwave.planning.simulate import compute
from skinwave.report.maps import MeasuredPlaces
from skinwave.results.comparison import line_phasors
from skinwave.results.run import ASSESSED, Run, own_names
from skinwave.scene.scene import Scene, check_motion
from skinwave.typing import Floats

WITHIN = 0.75  # of a record, or of the Tacton, that is to lie within the other
LEVEL = 0.05  # chance that any difference at all is declared where there is none
AGREES, DIFFERS, NUMERICAL, SILENT, UNKNOWN = (
    "within the noise", "beyond the noise", "beyond the noise, within the numerical error",
    "no line above the noise", "noise unknown",
)  # fmt: skip
MEASURED = "measured"  # body and model of what is drawn beside the models
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
class ModelColumn:
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
    halves : (2, f, p) float, amplitudes in both halves of what is fitted of the record, which
        are the same if the motion is steady
    columns : of the models
    claims : what the measurement alone says of the paper's claims
    """

    measurement: Measurement
    scene: Scene
    names: Mapping[str, tuple[str, ...]]
    lines: MeasuredLines
    present: Floats
    unresolved: tuple[str, ...]
    halves: Floats
    columns: tuple[ModelColumn, ...]
    claims: tuple[MeasuredClaim, ...]

    @property
    def noise(self) -> float:
        """Misfit that noise alone would leave; nan if it is unknown. Lines of unknown noise count
        as the others do.
        """
        known = self.lines.variance[np.isfinite(self.lines.variance)]
        whole = float((np.abs(self.lines.mean) ** 2).sum())
        return float(np.sqrt(known.mean() * self.lines.variance.size / whole)) if len(known) else (
            np.nan)  # fmt: skip

    @property
    def bodies(self) -> list[ModelColumn]:
        """The columns of waves: of the bodies, or of the last kernel if there is none."""
        bodies = [c for c in self.columns if c.run.response.record.of_body]
        return bodies or list(self.columns[-1:])

    @property
    def main(self) -> ModelColumn:
        """The last column of waves."""
        return self.bodies[-1]

    def is_numerical(self, column: ModelColumn) -> np.ndarray:
        """Mask (f, p) of differences no larger than the numerical error that a model's waveform is
        expected to have at that place.
        """
        away = np.abs(self.lines.mean - column.model)
        error = np.nan_to_num(column.run.response.expected_error)
        return np.asarray(away <= error * np.linalg.norm(column.model, axis=0))

    def findings(self, column: ModelColumn) -> np.ndarray:
        """Finding (f, p) of each difference: one of `AGREES` to `UNKNOWN`."""
        with np.errstate(invalid="ignore"):
            silent = self.present >= LEVEL
        found = np.where(silent, SILENT, AGREES).astype(object)
        found[column.differs] = DIFFERS
        found[column.differs & self.is_numerical(column)] = NUMERICAL
        found[np.isnan(column.significance)] = UNKNOWN
        return found

    @property
    def drawn_places(self) -> np.ndarray:
        """Indices of the places that figures show: all, or some, the strongest and the weakest."""
        size = np.linalg.norm(self.lines.mean, axis=0)
        if len(size) <= MOST_DRAWN:
            return np.arange(len(size))
        order = np.argsort(-size, kind="stable")
        return np.sort(order[np.linspace(0, len(size) - 1, MOST_DRAWN).round().astype(int)])


def compare_measured(asked: Measured, runs: Sequence[Run]) -> MeasuredComparison:
    """Models beside a measurement, by runs of one Tacton at its places and, of bodies, in its
    quantity; raises a ValueError if the record resolves no line of the load.
    """
    measurement = asked.measurement
    bodies = [run for run in runs if run.response.record.of_body]
    scene = (bodies or list(runs))[-1].scene  # of a body, whose load is the scene's own
    names, frequencies, unresolved = lines_to_compare(measurement, scene)
    lines = lines_of(measurement, frequencies)
    named = by_name(scene, names, lines, unresolved, _spectrum_of(measurement))
    left = [half.mean for half in departures(measurement, frequencies)] or [0 * lines.mean] * 2
    return MeasuredComparison(
        measurement=measurement, scene=scene, names=names, lines=lines,
        present=holm(lines.significances(lines.mean)), unresolved=unresolved,
        halves=np.abs(lines.mean + np.array(left)),
        columns=tuple(_column(asked, run, lines) for run in runs),
        claims=tuple(assess_measured(named)),
    )  # fmt: skip


def lines_to_compare(
    measurement: Measurement, scene: Scene
) -> tuple[dict[str, tuple[str, ...]], Floats, tuple[str, ...]]:
    """Lines of the load that both the record and a response of the scene resolve: names by the
    first of each, frequencies (f,) in Hz, and the names of those left out. Raises a ValueError if
    there are none.
    """
    candidates = ASSESSED if len(scene.tacton.foci) == 1 else ()
    clocks = [*_clock(measurement), _silence(sample_times(scene))]
    highest = min(0.5 / step(clock.times) for clock in clocks)
    found: dict[str, float] = {}
    lost: dict[str, float] = {}
    for clock in clocks:
        good, bad = resolved_lines(scene.pressure, clock, candidates=candidates, highest=highest)
        found, lost = (found | good), (lost | bad)
    reached = dict(zip(found, measurable(measurement, np.array([*found.values()])), strict=True))
    lost |= {name: f for name, f in sorted(found.items(), key=lambda x: x[1]) if not reached[name]}
    kept = {n: f for n, f in sorted(found.items(), key=lambda x: x[1]) if n not in lost}
    if not kept:
        raise ValueError(
            "the measurement resolves no line of the scene's load; give a longer record, a higher "
            "sampling rate, or the scene that was measured"
        )
    own = own_names(scene, kept)
    names = {name: (name, *(n for n, o in own.items() if o == name != n)) for name in kept}
    return names, np.array([*kept.values()]), tuple(lost)


def _clock(measurement: Measurement) -> list[Response]:
    """Silence at the times of a measurement, by which lines are resolved; of a spectrum with equal
    bins at times whose transform has them.
    """
    if not measurement.is_spectrum:
        return [_silence(evenly(measurement))]
    width, rate = bin_width(measurement), 2.1 * measurement.frequencies[-1]
    return [_silence(np.arange(int(rate / width)) / rate / (1 - SETTLE))] if width else []


def _silence(times: Floats) -> Response:
    return Response(
        model=MEASURED, times=times, probes=np.zeros((1, 2)), values=np.zeros((len(times), 1))
    )


def _spectrum_of(measurement: Measurement) -> tuple[Floats, Floats]:
    """Amplitude spectrum of the mean, for peaks; empty of spectra of single lines."""
    if not measurement.is_spectrum:
        return spectrum(as_response(measurement))
    if not bin_width(measurement):
        return np.empty(0), np.empty((0, len(measurement.places)))
    return measurement.frequencies, np.abs(measurement.mean)


def _column(asked: Measured, run: Run, lines: MeasuredLines) -> ModelColumn:
    z = line_phasors(run.response, tuple(lines.frequencies.tolist()))
    gain = asked.gain if run.response.record.of_body else None
    window, centre = _delay_window(asked.measurement, run, lines)
    aligned = partial(align, window=window, centre=centre, delay=asked.delay, gain=gain)
    found = aligned(lines, z)
    model = found.applied(lines.frequencies, z)
    away = lines.mean - model
    turned = aligned(replace(lines, each=-lines.each), z)
    fits = 2 * lines.variance.size * (turned.chi_square - found.chi_square) < AS_GOOD
    nearer = abs(turned.delay) < abs(found.delay) or turned.chi_square < found.chi_square
    return ModelColumn(
        run=run, alignment=found, model=model, significance=holm(lines.significances(away)),
        misfit=float(np.linalg.norm(away) / np.linalg.norm(lines.mean)),
        may_be_turned=bool(fits and nearer),
    )  # fmt: skip


def _delay_window(measurement: Measurement, run: Run, lines: MeasuredLines) -> tuple[float, float]:
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


def at_measured(scene: Scene, measurement: Measurement) -> Scene:
    """The scene with probes where was measured or, where that is unknown, with as many; they read
    displacement, as every comparison, and are read in the measured quantity beside it.

    Raises a ValueError if the quantity is not of normal motion, places are unknown and not as many
    as probes, or the record resolves no line of the load.
    """
    if not measurement.record.is_normal:
        known = ", ".join(name for name, q in QUANTITIES.items() if q.is_normal and q.of_body)
        raise ValueError(
            f"a measured {measurement.record.words} cannot be compared; give one of {known}"
        )
    if scene.reading.is_on_surface and scene.reading.record.is_normal:
        scene = replace(scene, quantity=DISPLACEMENT.name)
    check_motion(scene, "a comparison with a measurement")
    if np.isfinite(measurement.places).all():
        scene = replace(scene, probes=tuple(map(tuple, measurement.places.tolist())))
    elif len(scene.probes) != len(measurement.places):
        raise ValueError(
            f"the places of the measurement's {len(measurement.places)} signals are unknown, and "
            f"the scene has {len(scene.probes)} probes; give as many, in the same order"
        )
    lines_to_compare(measurement, scene)
    return scene


def in_quantity(run: Run, quantity: str, prepared: Mapping[str, ReducedBody]) -> Run:
    """A body's run read in another quantity of normal motion; a kernel's as it is."""
    if not run.response.record.of_body or run.response.quantity == quantity:
        return run
    scene = replace(run.scene, quantity=quantity)
    if run.column in prepared:
        found = answer(replace(prepared[run.column], reading=scene.reading), scene)
    else:
        found = compute(scene, run.model)
    found = replace(found, expected_error=run.response.expected_error)
    return replace(run, scene=scene, response=found)


def measured_places(comparison: MeasuredComparison) -> MeasuredPlaces:
    """Places of a measurement with the RMS of its lines, read as displacement, to mark on a map."""
    lines, record = comparison.lines, comparison.measurement.record
    factor = record.factor(2j * np.pi * lines.frequencies)[:, None]
    rms = np.sqrt((np.abs(lines.mean / factor) ** 2).sum(axis=0) / 2)
    return MeasuredPlaces(places=comparison.scene.probe_points, rms=rms)


def beside(comparison: MeasuredComparison, group: Sequence[Run]) -> list[Run]:
    """Runs to draw: models in the measured quantity, and the measurement on their clock."""
    chosen = comparison.drawn_places
    return [_at_places(run, chosen) for run in (*group, _measured_run(comparison))]


def _measured_run(comparison: MeasuredComparison) -> Run:
    """The mean over the repetitions, each shifted as its lines were, as a run to draw on the clock
    of a model's response; of spectra the sum of the lines, since their waveform is not there.
    """
    measurement, like = comparison.measurement, comparison.main.run
    delay, shifts = comparison.main.alignment.delay, comparison.lines.shifts
    if measurement.is_spectrum:
        times = like.response.times
        turned = np.exp(2j * np.pi * np.multiply.outer(times + delay, comparison.lines.frequencies))
        values = (turned @ comparison.lines.mean).real
    else:
        from scipy.interpolate import CubicSpline  # which takes long to import

        at = evenly(measurement)
        each = (CubicSpline(at, x)(np.clip(at + shift, at[0], at[-1]))
                for x, shift in zip(measurement.values, shifts, strict=True))  # fmt: skip
        times, values = at - delay, np.mean([*each], axis=0) if shifts.any() else measurement.mean
    response = Response(
        model=MEASURED, times=times, probes=comparison.scene.probe_points, values=values,
        quantity=measurement.quantity,
    )  # fmt: skip
    return Run(tacton=like.tacton, body=MEASURED, scene=comparison.scene, response=response)


def _at_places(run: Run, chosen: np.ndarray) -> Run:
    """A run at some of its probes."""
    response = run.response
    scene = replace(run.scene, probes=tuple(run.scene.probes[k] for k in chosen), depth=0.0)
    return replace(run, scene=scene, response=replace(
        response, probes=response.probes[chosen], values=response.values[:, chosen]
    ))  # fmt: skip
