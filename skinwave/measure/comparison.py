"""Comparison of models with a measurement: lines, delay, gain, and differences beyond the noise."""

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
    evenly,
    holm,
    lines_of,
    measurable,
)
from skinwave.measure.measurement import Measurement, strongest
from skinwave.models.options import sample_times
from skinwave.models.reduced import ReducedBody, answer
from skinwave.planning.simulate import compute
from skinwave.report.maps import MeasuredPlaces
from skinwave.results.comparison import line_phasors
from skinwave.results.run import ASSESSED, Run, own_names
from skinwave.scene.scene import Scene, check_motion
from skinwave.typing import Floats

AGREES, DIFFERS, NUMERICAL, NO_LINE, UNKNOWN = (
    "within the noise", "beyond the noise", "beyond the noise, within the numerical error",
    "no line above the noise", "noise unknown",
)  # fmt: skip
MEASURED = "measured"  # body and model of the measurement in figures


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """A measurement to compare with; its delay in s and its gain relative to bodies, if known."""

    measurement: Measurement
    delay: float | None = None
    gain: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelColumn:
    """A model compared with a measurement."""

    run: Run  # in the measured quantity or, for a kernel, in Pa
    alignment: Alignment
    model: np.ndarray  # (f, p) complex, its lines with gain and delay
    p_values: Floats  # (f, p), of differences, adjusted for their number (Holm); nan if unknown
    may_be_flipped: bool = False  # whether the opposite sign fits as well
    significance: float = 0.05  # probability of any false difference

    @property
    def differs(self) -> np.ndarray:
        """Mask (f, p) of differences beyond the noise."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.p_values < self.significance)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredComparison:
    """Models compared with a measurement."""

    measurement: Measurement
    scene: Scene  # at the places and in the quantity of the measurement
    names: Mapping[str, tuple[str, ...]]  # all names of each line by the first
    lines: MeasuredLines
    present: Floats  # (f, p), adjusted p-value of each line in noise; nan if unknown
    unresolved: tuple[str, ...]  # lines of the load that the record cannot resolve
    columns: tuple[ModelColumn, ...]
    claims: tuple[MeasuredClaim, ...]  # of the paper, assessed on the measurement alone

    @property
    def noise(self) -> float:
        """Misfit of a perfect model, from noise alone; nan if unknown."""
        known = self.lines.variance[np.isfinite(self.lines.variance)]
        if not len(known):
            return float("nan")
        power = float((np.abs(self.lines.mean) ** 2).sum())
        return float(np.sqrt(known.mean() * self.lines.variance.size / power))

    @property
    def bodies(self) -> list[ModelColumn]:
        """Columns of bodies, or that of the last kernel if there are none."""
        bodies = [c for c in self.columns if c.run.response.record.of_body]
        return bodies or list(self.columns[-1:])

    @property
    def main(self) -> ModelColumn:
        """The last of the bodies."""
        return self.bodies[-1]

    def is_numerical(self, column: ModelColumn) -> np.ndarray:
        """Return a mask (f, p) of differences within the expected numerical error of a model."""
        away = np.abs(self.lines.mean - column.model)
        error = column.run.response.expected_error
        error = error if np.isfinite(error) else 0.0
        return np.asarray(away <= error * np.linalg.norm(column.model, axis=0))

    def findings(self, column: ModelColumn) -> np.ndarray:
        """Return one of `AGREES` to `UNKNOWN` (f, p) for each difference."""
        with np.errstate(invalid="ignore"):
            is_noise = self.present >= column.significance
        findings = np.where(is_noise, NO_LINE, AGREES).astype(object)
        findings[column.differs] = DIFFERS
        findings[column.differs & self.is_numerical(column)] = NUMERICAL
        findings[np.isnan(column.p_values)] = UNKNOWN
        return findings

    @property
    def figure_places(self) -> np.ndarray:
        """Indices of the places that figures show: those with the strongest lines."""
        most_drawn = 8  # places
        return strongest(np.linalg.norm(self.lines.mean, axis=0), most_drawn)


def compare_measured(measured: Measured, runs: Sequence[Run]) -> MeasuredComparison:
    """Compare runs of one Tacton with a measurement, at its places."""
    measurement = measured.measurement
    bodies = [run for run in runs if run.response.record.of_body]
    scene = (bodies or list(runs))[-1].scene  # a body has the load of the scene file
    names, frequencies, unresolved = lines_to_compare(measurement, scene)
    lines = lines_of(measurement, frequencies)
    whole = measurement.frequencies, np.abs(measurement.mean)
    if not measurement.is_spectrum:
        whole = spectrum(as_response(measurement))
    elif not bin_width(measurement):  # single lines
        whole = np.empty(0), np.empty((0, len(measurement.places)))
    named = by_name(scene, names, lines, unresolved, whole)
    return MeasuredComparison(
        measurement=measurement, scene=scene, names=names, lines=lines,
        present=holm(lines.p_values(lines.mean)), unresolved=unresolved,
        columns=tuple(_column(measured, run, lines) for run in runs),
        claims=tuple(assess_measured(named)),
    )  # fmt: skip


def lines_to_compare(
    measurement: Measurement, scene: Scene
) -> tuple[dict[str, tuple[str, ...]], Floats, tuple[str, ...]]:
    """Return names and frequencies (f,) of lines that are resolved, and unresolved names."""
    candidates = ASSESSED if len(scene.tacton.foci) == 1 else ()
    clocks = [*_clock(measurement), _silence(sample_times(scene))]
    highest = min(0.5 / step(clock.times) for clock in clocks)
    lines: dict[str, float] = {}
    lost: dict[str, float] = {}
    for clock in clocks:
        good, bad = resolved_lines(scene.pressure, clock, candidates=candidates, highest=highest)
        lines, lost = (lines | good), (lost | bad)
    lines = dict(sorted(lines.items(), key=lambda line: line[1]))
    sampled = measurable(measurement, np.array([*lines.values()]))
    lost |= {name: lines[name] for name, is_sampled in zip(lines, sampled, strict=True)
             if not is_sampled}  # fmt: skip
    kept = {name: f for name, f in lines.items() if name not in lost}
    if not kept:
        raise ValueError("the record resolves no line of the scene's load; check rate and Tacton")
    own = own_names(scene, kept)
    names = {name: (name, *(n for n, o in own.items() if o == name != n)) for name in kept}
    return names, np.array([*kept.values()]), tuple(lost)


def _clock(measurement: Measurement) -> list[Response]:
    """Return a response of zeros at the times, or with the bins, of a measurement."""
    if not measurement.is_spectrum:
        return [_silence(evenly(measurement))]
    width, rate = bin_width(measurement), 2.1 * measurement.frequencies[-1]
    return [_silence(np.arange(int(rate / width)) / rate / (1 - SETTLE))] if width else []


def _silence(times: Floats) -> Response:
    return Response(
        model=MEASURED, times=times, probes=np.zeros((1, 2)), values=np.zeros((len(times), 1))
    )


def _column(measured: Measured, run: Run, lines: MeasuredLines) -> ModelColumn:
    z = line_phasors(run.response, tuple(lines.frequencies.tolist()))
    gain = measured.gain if run.response.record.of_body else None
    window, centre = _delay_window(measured.measurement, run, lines)
    aligned = partial(align, window=window, centre=centre, delay=measured.delay, gain=gain)
    best = aligned(lines, z)
    model = best.apply(lines.frequencies, z)
    flipped = aligned(replace(lines, each=-lines.each), z)
    fits = 2 * lines.variance.size * (flipped.chi_square - best.chi_square) < AS_GOOD
    is_nearer = abs(flipped.delay) < abs(best.delay) or flipped.chi_square < best.chi_square
    return ModelColumn(
        run=run, alignment=best, model=model, p_values=holm(lines.p_values(lines.mean - model)),
        may_be_flipped=bool(fits and is_nearer),
    )  # fmt: skip


def _delay_window(measurement: Measurement, run: Run, lines: MeasuredLines) -> tuple[float, float]:
    """Return width and centre in s of delays at which record and Tacton overlap enough."""
    begin, end = (float(t) for t in run.response.times[[0, -1]])
    period = 1 / float(lines.frequencies.min())
    if measurement.is_spectrum:
        return 2 * max(end - begin, period), 0.0
    first, last = (float(t) for t in measurement.times[[0, -1]])
    least_overlap = 0.75  # of the shorter one of record and Tacton
    within = least_overlap * min(last - first, end - begin)
    low, high = first + within - end, last - within - begin
    return max(high - low, period), (low + high) / 2


def overlap(measurement: Measurement, run: Run, delay: float) -> float:
    """Return the time in s that a record, at its delay, shares with the Tacton."""
    begin, end = (float(t) + delay for t in run.response.times[[0, -1]])
    return min(float(measurement.times[-1]), end) - max(float(measurement.times[0]), begin)


def at_measured_places(scene: Scene, measurement: Measurement) -> Scene:
    """Return the scene with probes at the measured places, which read displacement.

    Raises a ValueError if the quantity is not normal motion, if there is not one probe for each
    unknown place, or if the record resolves no line of the load.
    """
    if not measurement.record.is_normal:
        known = ", ".join(name for name, q in QUANTITIES.items() if q.is_normal and q.of_body)
        raise ValueError(f"{measurement.record.words} cannot be compared; give one of {known}")
    if scene.reading.is_on_surface and scene.reading.record.is_normal:
        scene = replace(scene, quantity=DISPLACEMENT.name)
    check_motion(scene, "a comparison with a measurement")
    if np.isfinite(measurement.places).all():
        scene = replace(scene, probes=tuple(map(tuple, measurement.places.tolist())))
    elif len(scene.probes) != len(measurement.places):
        signals = f"{len(measurement.places)} signals at unknown places"
        raise ValueError(f"{len(scene.probes)} probes do not fit {signals}; give a probe for each")
    lines_to_compare(measurement, scene)
    return scene


def in_quantity(run: Run, quantity: str, prepared: Mapping[str, ReducedBody]) -> Run:
    """Return a body's run in another quantity of normal motion; kernels stay the same."""
    if not run.response.record.of_body or run.response.quantity == quantity:
        return run
    scene = replace(run.scene, quantity=quantity)
    if run.column in prepared:
        response = answer(replace(prepared[run.column], reading=scene.reading), scene)
    else:
        response = compute(scene, run.model)
    effort = replace(response.effort, errors=run.response.effort.errors)
    return replace(run, scene=scene, response=replace(response, effort=effort))


def measured_places(comparison: MeasuredComparison) -> MeasuredPlaces:
    """Return the places of a measurement with the RMS of its lines as displacement, for maps."""
    lines, record = comparison.lines, comparison.measurement.record
    factor = record.factor(2j * np.pi * lines.frequencies)[:, None]
    rms = np.sqrt((np.abs(lines.mean / factor) ** 2).sum(axis=0) / 2)
    return MeasuredPlaces(places=comparison.scene.probe_points, rms=rms)


def runs_to_draw(comparison: MeasuredComparison) -> list[Run]:
    """Return models and measurement on one clock, at the places that figures show."""
    drawn = comparison.figure_places
    runs = []
    for run in (*(column.run for column in comparison.columns), _measured_run(comparison)):
        scene = replace(run.scene, probes=tuple(run.scene.probes[k] for k in drawn), depth=0.0)
        response = replace(run.response, probes=run.response.probes[drawn],
                           values=run.response.values[:, drawn])  # fmt: skip
        runs.append(replace(run, scene=scene, response=response))
    return runs


def _measured_run(comparison: MeasuredComparison) -> Run:
    """Return the mean of the aligned repetitions, or the sum of lines, on the model's clock."""
    measurement, main = comparison.measurement, comparison.main
    delay, shifts = main.alignment.delay, comparison.lines.shifts
    if measurement.is_spectrum:
        times = main.run.response.times
        turned = np.exp(2j * np.pi * np.multiply.outer(times + delay, comparison.lines.frequencies))
        values = (turned @ comparison.lines.mean).real
    else:
        from scipy.interpolate import CubicSpline  # slow to import

        at = evenly(measurement)
        each = (CubicSpline(at, x)(np.clip(at + shift, at[0], at[-1]))
                for x, shift in zip(measurement.values, shifts, strict=True))  # fmt: skip
        times, values = at - delay, np.mean([*each], axis=0) if shifts.any() else measurement.mean
    response = Response(
        model=MEASURED, times=times, probes=comparison.scene.probe_points, values=values,
        quantity=measurement.quantity,
    )  # fmt: skip
    return Run(tacton=main.run.tacton, body=MEASURED, scene=comparison.scene, response=response)
