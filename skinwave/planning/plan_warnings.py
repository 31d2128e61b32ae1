"""Warnings of a response that differs from the request, apart from its expected error."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from simple_model import Response, Statement
from simple_model.load.line_names import line_names
from simple_model.load.sampling import step
from simple_model.numbers import EN_DASH, significant
from skinwave.models import named
from skinwave.models.limits import cures_for, in_words
from skinwave.planning.estimates import mean_gain
from skinwave.planning.left_out import LINEAR, deflection_ratio
from skinwave.scene.scene import Scene

NONLINEAR = "plate-modes-nonlinear", "fem-nonlinear"  # the cheaper first
DENSITIES = 20.0, 23_000.0  # kg/m3 of solids, from foam to osmium
WEAK_LINE_RATIO = 0.05  # of the strongest line of a load: no warning if weaker ones are left out


def stated(
    scene: Scene, response: Response, statement: Statement, cautions: Iterable[str] = ()
) -> Response:
    """Return a response with the statement of its error, and with its warnings and `cautions`."""
    warnings = (*statement.warnings, *cautions, *response_warnings(scene, response))
    effort = replace(response.effort, errors=statement, warnings=warnings)
    return replace(response, load=scene.pressure, effort=effort)


def response_warnings(scene: Scene, response: Response) -> tuple[str, ...]:
    """Return warnings of a response beyond those of its plan."""
    return (
        *large_deflection(scene, response),
        *lines_left_out(scene, response),
        *implausible(scene),
    )


def large_deflection(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warn of a linear model of a sheet that deflects too much for it."""
    if named(response.model).is_nonlinear or not response.record.of_body:
        return ()
    ratio = deflection_ratio(scene, response)
    if ratio <= LINEAR:
        return ()
    each = [cures_for(scene, named(name)) for name in NONLINEAR] if scene.body.is_held else []
    cures = next(filter(None, each), [])
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
