"""Warnings of a response that differs from the request, apart from its expected error."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from simple_model import MovingPressure, Response, resolved_lines
from simple_model.load.line_names import FEWEST_CYCLES, line_names, named_lines
from simple_model.load.sampling import step
from simple_model.load.tacton import LONGEST, exact_period
from simple_model.numbers import EN_DASH, plural, significant
from simple_model.response import LINE_BINS, SETTLE, resolution
from skinwave.models import named
from skinwave.models.limits import cures_for, in_words
from skinwave.planning.deflection import deflection_ratio, is_small
from skinwave.planning.estimates import mean_gain
from skinwave.scene.scene import Scene

WithRange = tuple[str, float, str, float, float, str]  # key, value, whose range, low, high, unit
WEAK_LINE_RATIO = 0.05  # of the strongest line of a load: no warning if weaker ones are left out


def response_warnings(scene: Scene, response: Response) -> tuple[str, ...]:
    """Return warnings of a response beyond those of its plan."""
    return (
        *implausible(scene),  # first, as at the end of those of the plan
        *large_deflection(scene, response),
        *lines_left_out(scene, response),
        *lines_unresolved(scene, response),
        *rhythm_unresolved(scene, response),
    )


def large_deflection(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warn of a linear model of a sheet that deflects too much for it."""
    if named(response.model).is_nonlinear or not response.record.of_body:
        return ()
    ratio = deflection_ratio(scene, response)
    if is_small(ratio):
        return ()
    nonlinear = ("plate-modes-nonlinear", "fem-nonlinear") if scene.body.is_held else ()
    cures = next(filter(None, (cures_for(scene, named(name)) for name in nonlinear)), [])
    cure = in_words(cures, "") if cures else "use a thicker sheet or a lower pressure"
    return (
        f"the sheet deflects by {significant(ratio, 2)} times its thickness, and its stretching is "
        f"left out; {cure}",
    )


def lines_left_out(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warn of lines of the load above half the sampling rate of the response."""
    lines, highest = line_names(scene.pressure, WEAK_LINE_RATIO), 0.5 / step(response.times)
    above = np.flatnonzero(lines.frequencies >= highest)
    if not len(above):
        return ()
    strongest = above[np.argmax(lines.strengths[above])]
    others = f" and {len(above) - 1} more" if len(above) > 1 else ""
    return (
        f"lines of the load above {highest:.4g} Hz, half the sampling rate, are left out: "
        f"{lines.names[strongest]} at {lines.frequencies[strongest]:.4g} Hz{others}; use a time "
        f"step below {500 / lines.frequencies[above].max():.2g} ms",
    )


def lines_unresolved(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warn of a response too short for the strongest line of a load without a rhythm."""
    if scene.tacton.rhythm:
        return ()
    lines = line_names(scene.pressure, WEAK_LINE_RATIO)
    least = resolution(response)
    oscillating = np.where(lines.frequencies > 0, lines.strengths, 0.0)
    if not oscillating.any() or (f := lines.frequencies[oscillating.argmax()]) >= least:
        return ()
    length, name = np.ptp(response.times), lines.names[oscillating.argmax()]
    return (
        f"the response of {1e3 * length:.3g} ms is too short for the strongest line of the load, "
        f"{name} at {f:.4g} Hz, so that tables of lines leave it out; use "
        f"duration_s = {1.1 * length * least / f:.2g} or more",
    )


def rhythm_unresolved(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warn of strong lines of a rhythm that the response is too short to resolve."""
    tacton, rhythm, dt = scene.tacton, scene.tacton.rhythm, step(response.times)
    seconds = dt * len(response.times)
    lost = rhythm is not None and _count_unresolved(scene.pressure, seconds, dt)
    if not (rhythm and lost):
        return ()
    many = LINE_BINS / (1 - SETTLE) * rhythm.period * 2.0 ** np.arange(8)
    enough = (
        longer for longer in sorted([FEWEST_CYCLES * exact_period(tacton), *many])
        if tacton.duration < longer <= LONGEST and not _count_unresolved(
            replace(scene.pressure, tacton=replace(tacton, duration=longer)), longer, dt
        )
    )  # fmt: skip
    longer = next(enough, 0.0)
    duration = np.ceil(1e3 * (longer or FEWEST_CYCLES * rhythm.period) - 1e-6) / 1e3
    cure = f"set duration_s to {duration:g}"
    if not longer:
        cure = (
            f"use frequencies that are multiples of {1 / rhythm.period:.6g} Hz, and duration_s = "
            f"{duration:g} or more"
        )
    return (
        f"{plural(lost, 'line')} of the rhythm, whose period is {rhythm.period:g} s, cannot be "
        f"resolved in {seconds:.3g} s; {cure}",
    )


def _count_unresolved(pressure: MovingPressure, seconds: float, dt: float) -> int:
    """Return the number of strong lines that a response of some seconds does not resolve, or 1 if a
    rhythm does not repeat often enough to make lines.
    """
    strong, rhythm = named_lines(pressure, WEAK_LINE_RATIO), pressure.tacton.rhythm
    if rhythm and not strong:
        return int(seconds < FEWEST_CYCLES * rhythm.period)
    times = np.linspace(0.0, seconds, round(seconds / dt), endpoint=False)
    still = Response(
        model="", times=times, probes=np.zeros((1, 2)), values=np.zeros((len(times), 1))
    )
    return len(strong.keys() & resolved_lines(pressure, still)[1])


def implausible(scene: Scene) -> tuple[str, ...]:
    """Warn of numbers that probably have another unit, and of a probe that is given twice."""
    warnings = [
        f"{key} = {value:g} is implausible: {whose} usually {low:g}{EN_DASH}{high:g}{unit}; "
        f"{'if it is a quality factor Q, write 1 / Q' if 'loss' in key else 'check its unit'}"
        for key, value, whose, low, high, unit in sorted({*_with_ranges(scene)})
        if 0 < value < low or high < value < np.inf
    ]
    places = [(*probe, depth) for probe, depth in zip(scene.probes, scene.depths, strict=True)]
    warnings += [
        f"points_mm contains ({1e3 * x:g}, {1e3 * y:g}) mm more than once; remove the duplicate"
        for x, y, _ in sorted({place for place in places if places.count(place) > 1})
    ]
    return tuple(warnings)


def _with_ranges(scene: Scene) -> Iterator[WithRange]:
    """Yield numbers of a scene whose unit may be wrong, each with the range that it usually has."""
    body, kind, trajectory = scene.body, scene.body.of_kind, scene.tacton.trajectory
    if scene.load.of_kind.is_of_device:
        path = 1e3 * float(np.ptp(trajectory.outline, axis=0).max())
        yield (
            "size_mm" if trajectory.size else "points_mm",
            path,
            "sizes of paths are",
            0.5,
            1e3,
            " mm",
        )
        yield "speed_m_per_s", trajectory.speed, "speeds are", 0, 340, " m/s"
    farthest = 1e3 * float(np.abs(scene.probes).max())
    yield "points_mm", farthest, "the farthest probes are at", 0.1, 1e4, " mm"
    if not kind.discretise:
        return
    densities = 20.0, 23_000.0  # kg/m3 of solids, from foam to osmium
    for solid in body.solids:
        yield "density_kg_m3", solid.density, "densities are", *densities, " kg/m³"
        yield "shear_modulus_pa", solid.shear_modulus, "moduli are", 100, 1e12, " Pa"
        yield "loss_factor", solid.loss_factor, "loss factors are", 0, 2, ""
    thinnest = 1e-3 if kind.is_plate else 0.1
    for layer in body.layers:
        yield "thickness_mm", 1e3 * layer.thickness, "layers are", 1e-3, 1e3, " mm"
    if not kind.is_bounded:
        return
    yield "thickness_mm", 1e3 * body.depth, f"bodies of kind {kind.name} are", thinnest, 1e3, " mm"
    for key, side in (("size_x_mm", body.width), ("size_y_mm", body.height)):
        yield key, 1e3 * side, "bodies are", 1, 1e4, " mm"


def rigid_body_drift(scene: Scene) -> tuple[str, ...]:
    """Warn of rigid-body drift under a load whose mean is not 0."""
    if scene.body.is_held or not mean_gain(scene):
        return ()
    half_space = ", or set thickness_mm = inf" if scene.body.of_kind.is_layer else ""
    return (
        "the body is unconstrained and drifts because the mean pressure is not zero, so only "
        f"motion about the mean is meaningful; clamp its base or its sides{half_space}",
    )


def under_resolved(h: float, width: float) -> tuple[str, ...]:
    """Warn of elements of h that do not resolve a focal spot of standard deviation `width`."""
    if h <= 2 * width:
        return ()
    effect = "neither its force nor its shape" if h > 3 * width else "its force but not its shape"
    return (
        f"elements of {1e3 * h:.3g} mm are too coarse for the focal spot, whose standard deviation "
        f"is {1e3 * width:.2g} mm: they preserve {effect}; use smaller elements",
    )
