"""Warnings where a request is not met, each with its number and its cure."""

import numpy as np

from simple_model import Response
from simple_model.load.line_names import line_names
from simple_model.load.sampling import step
from skinwave.models import Model, named
from skinwave.models.limits import cures_for, in_words
from skinwave.models.reduced import BAND
from skinwave.planning.estimates import mean_gain, spot_scale
from skinwave.planning.left_out import LINEAR, bent, stretching_left_out
from skinwave.planning.refinement import enough
from skinwave.scene.scene import Scene

NONLINEAR = "plate-modes-nonlinear", "fem-nonlinear"  # the cheaper first
DENSITIES = 20.0, 23_000.0  # kg/m3 of solids, from foam to osmium
LEFT_OUT = 0.05  # of the strongest line of a load: weaker ones are left out without a warning


def of_ends_and_band(
    scene: Scene, at_ends: float, sudden: float, tolerance: float
) -> tuple[str, ...]:
    """Warnings of what a reduced body leaves out beside the error of its elements: at its absorbing
    ends, and of sudden motion above `BAND`.
    """
    return (
        *over_tolerance("the absorbing layer", at_ends, tolerance, "a larger body is"),
        *sudden_over_tolerance(scene, BAND, sudden, tolerance),
    )


def sudden_over_tolerance(
    scene: Scene, band: float, sudden: float, tolerance: float
) -> tuple[str, ...]:
    """Warning of motion above the band in Hz of a response, which it leaves out."""
    smooth = "a load that begins smoothly"
    cure = f"the displacement, or {smooth}," if scene.reading.asked.rate else smooth
    what = f"the {scene.quantity} above {band:g} Hz"
    return over_tolerance(what, sudden, tolerance, f"{cure} is")


def of_elements(scene: Scene, h: float, error: float, tolerance: float) -> tuple[str, ...]:
    """Warnings of linear elements of h in metre, with their expected relative error or nan."""
    size = 1e3 * enough(scene.body, h, error, tolerance)
    return (
        *error_unknown(error),
        *rigid_body_drift(scene),
        *over_tolerance(
            f"elements of {1e3 * h:.3g} mm", error, tolerance, f"about {size:.2g} mm is"
        ),
        *under_resolved(h, spot_scale(scene.pressure)),
    )


def of_stretching(scene: Scene, response: Response, tolerance: float) -> tuple[str, ...]:
    """Warning of a linear model of a sheet that deflects by more than `LINEAR` thicknesses, or
    whose stretching changes its motion by more than the tolerance.
    """
    model = named(response.model)
    if model.is_nonlinear or not response.record.of_body:
        return ()
    factor, left = bent(scene, response), stretching_left_out(scene, model, tolerance)
    if factor <= LINEAR and left <= tolerance:
        return ()
    makers = [cures_for(scene, named(name)) for name in NONLINEAR] if scene.body.is_held else []
    cures = next(filter(None, makers), [])
    cure = in_words(cures, "") if cures else "take a thicker sheet or a lower pressure"
    change = f"changes its motion by about {100 * left:.2g} %" if left else "is left out"
    return (
        f"this sheet deflects {factor:.2g} times its thickness, and its stretching {change}; "
        f"{cure}",
    )


def implausible(scene: Scene) -> tuple[str, ...]:
    """Warnings of a density that no solid has, and of a probe that is given twice."""
    lightest, heaviest = DENSITIES
    odd = sorted({solid.density for solid in scene.body.solids
                  if not lightest <= solid.density <= heaviest})  # fmt: skip
    found = [
        f"density_kg_m3 = {density:g} is that of no solid, {lightest:g} to {heaviest:g}; "
        "give it in kg/m3"
        for density in odd
        if scene.body.of_kind.discretise
    ]
    places = [(*probe, depth) for probe, depth in zip(scene.probes, scene.depths, strict=True)]
    for x, y, _ in sorted({place for place in places if places.count(place) > 1}):
        found.append(f"points_mm has ({1e3 * x:g}, {1e3 * y:g}) mm more than once; leave one out")
    return tuple(found)


def beyond_sampling(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warning of lines of the load that the response leaves out: above half its sampling rate."""
    lines, highest = line_names(scene.pressure, LEFT_OUT), 0.5 / step(response.times)
    above = np.flatnonzero(lines.frequencies >= highest)
    if not len(above):
        return ()
    f, strongest = lines.frequencies[above], above[np.argmax(lines.strengths[above])]
    others = f" and {len(above) - 1} more" if len(above) > 1 else ""
    return (
        f"the load's lines above {highest:.4g} Hz, half the sampling rate, are left out: "
        f"{lines.names[strongest]} at {lines.frequencies[strongest]:.4g} Hz{others}; give times in "
        f"steps below {500 / f.max():.2g} ms",
    )


def error_unknown(error: float) -> tuple[str, ...]:
    """Warning of an unknown discretisation error: a file with a single mesh."""
    if np.isfinite(error):
        return ()
    return (
        "the discretisation error of this mesh is not known, because its file has only one; give a "
        "finer one and compare",
    )


def error_not_estimated(model: str, error: float) -> tuple[str, ...]:
    """Warning of a model that states no error of its own, as one from outside may."""
    if np.isfinite(error):
        return ()
    return (f"the error of {model} is not estimated; compare its response with another model's",)


def rigid_body_drift(scene: Scene) -> tuple[str, ...]:
    """Warning of rigid-body drift under a load with non-zero mean."""
    if scene.body.is_held or not mean_gain(scene):
        return ()
    half_space = ", or take thickness_mm = inf" if scene.body.of_kind.is_layer else ""
    return (
        "this body is unconstrained and drifts under a pressure with non-zero mean: only motion "
        f"about the mean counts; clamp its base or its sides{half_space}",
    )


def over_tolerance(what: str, error: float, tolerance: float, cure: str) -> tuple[str, ...]:
    """Warning of an expected error above the tolerance, of `what` has it; the cure is a sentence's
    end before "enough".
    """
    if not error > tolerance:
        return ()
    percent = f"{100 * error:.0f}" if error > 0.1 else f"{100 * error:.2g}"
    return (
        f"{what} will have a relative error of about {percent} %, more than the tolerance of "
        f"{100 * tolerance:g} %; {cure} enough",
    )


def beyond_prediction(
    scene: Scene, response: Response, predicted: float, tolerance: float
) -> tuple[str, ...]:
    """Warning of an error above the tolerance that the model measured, and no plan predicted."""
    error = response.expected_error
    if not error > np.fmax(predicted, tolerance):
        return ()
    return (
        f"{response.model} has a relative error of about {100 * error:.2g} % in this "
        f"{scene.reading.asked.words}, more than the tolerance of {100 * tolerance:g} %: a thin "
        "plate with the same linear motion differs by that; take the displacement, or smaller "
        "elements and shorter time steps",
    )


def start_over_tolerance(model: Model, start: float, tolerance: float) -> tuple[str, ...]:
    """Warning of a steady-state model that leaves out a start above the tolerance."""
    what = f"{model.name}, which leaves out the initial transient,"
    return over_tolerance(what, start, tolerance, f"{model.from_rest} is")


def under_resolved(h: float, width: float) -> tuple[str, ...]:
    """Warning of elements that do not resolve the focal spot."""
    if h <= 2 * width:
        return ()
    kept = "neither its force nor its shape" if h > 3 * width else "its force but not its shape"
    return (
        f"elements of {1e3 * h:.3g} mm are wider than twice the standard deviation of the focal "
        f"spot, {1e3 * width:.2g} mm: they preserve {kept}; make them smaller",
    )
