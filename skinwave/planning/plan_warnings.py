"""Warnings of a response that differs from the request, apart from its expected error."""

from dataclasses import replace

import numpy as np

from simple_model import MovingPressure, Response, resolved_lines
from simple_model.load.line_names import FEWEST_CYCLES, line_names, named_lines
from simple_model.load.sampling import step
from simple_model.load.tacton import LONGEST, exact_period
from simple_model.numbers import EN_DASH, plural, significant
from simple_model.response import LINE_BINS, SETTLE
from skinwave.models import named
from skinwave.models.limits import cures_for, in_words
from skinwave.models.relative_change import change_text
from skinwave.planning.estimates import mean_gain
from skinwave.planning.left_out import LINEAR, deflection_ratio, stretching_error
from skinwave.scene.scene import Scene

NONLINEAR = "plate-modes-nonlinear", "fem-nonlinear"  # the cheaper first
ERROR_UNKNOWN = (
    "the discretisation error is unknown because the file has only one mesh; provide a finer mesh "
    "and compare the results"
)
NO_ERROR = "{} does not estimate its error; compare its response with that of another model"
DENSITIES = 20.0, 23_000.0  # kg/m3 of solids, from foam to osmium
WEAK_LINE_RATIO = 0.05  # of the strongest line of a load: no warning if weaker ones are left out


def response_warnings(
    scene: Scene, response: Response, predicted: float, tolerance: float
) -> tuple[str, ...]:
    """Return warnings of a response beyond those of its plan, with its `predicted` error."""
    return (
        *larger_error(scene, response, predicted, tolerance),
        *stretching(scene, response, tolerance),
        *lines_left_out(scene, response),
        *rhythm_unresolved(scene, response),
        *implausible(scene),
    )


def larger_error(
    scene: Scene, response: Response, predicted: float, tolerance: float
) -> tuple[str, ...]:
    """Warn of an error measured by the model above both tolerance and prediction."""
    error = response.expected_error
    if not error > np.fmax(predicted, tolerance):
        return ()
    return (
        f"{response.model}, {scene.reading.record.words}: expected error {change_text(error)}, "
        f"tolerance {100 * tolerance:g} %, by comparison with the linear motion of a thin plate; "
        "read the displacement, or use smaller elements and shorter time steps",
    )


def stretching(scene: Scene, response: Response, tolerance: float) -> tuple[str, ...]:
    """Warn of a linear model of a sheet that deflects or stretches too much."""
    model = named(response.model)
    if model.is_nonlinear or not response.record.of_body:
        return ()
    ratio = deflection_ratio(scene, response)
    error = stretching_error(scene, model, tolerance)
    if ratio <= LINEAR and error <= tolerance:
        return ()
    each = [cures_for(scene, named(name)) for name in NONLINEAR] if scene.body.is_held else []
    cures = next(filter(None, each), [])
    cure = in_words(cures, "") if cures else "use a thicker sheet or a lower pressure"
    effect = f" and changes the motion by about {change_text(error)}" if error else ""
    return (
        f"the sheet deflects by {significant(ratio, 2)} times its thickness, and its stretching is "
        f"left out{effect}; {cure}",
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
    """Warn of a density that no solid has, and of a probe that is given twice."""
    warnings = []
    lightest, heaviest = DENSITIES
    if scene.body.of_kind.discretise:
        warnings += [
            f"density_kg_m3 = {density:g} is implausible; solids have "
            f"{lightest:g}{EN_DASH}{heaviest:g} "
            "kg/m³, so check its unit"
            for density in sorted({solid.density for solid in scene.body.solids})
            if not lightest <= density <= heaviest
        ]
    places = [(*probe, depth) for probe, depth in zip(scene.probes, scene.depths, strict=True)]
    warnings += [
        f"points_mm contains ({1e3 * x:g}, {1e3 * y:g}) mm more than once; remove the duplicate"
        for x, y, _ in sorted({place for place in places if places.count(place) > 1})
    ]
    return tuple(warnings)


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
