"""A measurement as a scene to compute and a run to draw beside those of models."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.quantities import DISPLACEMENT, QUANTITIES
from skinwave.measure.lines import evenly
from skinwave.measure.measured_study import MeasuredComparison, main_column
from skinwave.measure.measurement import Measurement
from skinwave.measure.resolvable_lines import lines_to_compare
from skinwave.models.prepared import Prepared, answer
from skinwave.planning.simulate import compute
from skinwave.report.surfaces import MeasuredPlaces
from skinwave.results.run import Run
from skinwave.scene.scene import Scene, check_motion

MEASURED = "measured"  # body and model of what is drawn beside the models
MOST_DRAWN = 8  # places


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


def in_quantity(run: Run, quantity: str, prepared: Mapping[str, Prepared]) -> Run:
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
    from scipy.interpolate import CubicSpline  # which takes long to import

    times = evenly(measurement)
    shifted = [
        CubicSpline(times, values)(np.clip(times + shift, times[0], times[-1]))
        for values, shift in zip(measurement.values, shifts, strict=True)
    ]
    return np.asarray(np.mean(shifted, axis=0))


def measured_places(comparison: MeasuredComparison) -> MeasuredPlaces:
    """Places of a measurement with the RMS of its lines, read as displacement, to mark on a map."""
    lines, record = comparison.lines, comparison.measurement.record
    factor = record.factor(2j * np.pi * lines.frequencies)[:, None]
    rms = np.sqrt((np.abs(lines.mean / factor) ** 2).sum(axis=0) / 2)
    return MeasuredPlaces(places=comparison.scene.probe_points, rms=rms)


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
