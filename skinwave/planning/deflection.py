"""Deflection of a sheet, and the error of a linear model that leaves out its stretching.

A sheet of thickness h that deflects by w stiffens in proportion to (w / h)^2.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simple_model import Response
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.supports import FRAME
from skinwave.models import Model, plate_modes
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import FROM_REST, STRETCHED, first_part, linear_error
from skinwave.planning.estimates import mean_gain
from skinwave.scene.scene import Scene


def is_small(deflection: float, limit: float = 0.5) -> bool:
    """Whether bending is linear for a deflection over the thickness of a sheet."""
    return deflection <= limit


def linear_deflection(scene: Scene) -> float:
    """Return the largest linear deflection of a supported sheet relative to its thickness: at its
    probes and middle from rest, or at its middle under the mean load. It is 0 for other bodies, and
    for curled sheets, which are stiffened by their rise.
    """
    body = scene.body
    flat = body.of_kind.is_plate and not body.mounting.is_curled
    if not (flat and body.sides == "clamped"):
        return 0.0
    return max(_largest_deflection(_displacement_scene(scene)), mean_sag(scene) / body.depth)


@lru_cache(maxsize=64)
def _largest_deflection(scene: Scene) -> float:
    """Return the largest deflection over thickness in a response from rest, or 0."""
    x, y = (float(x) for x in scene.body.placement.offset)
    with_middle = replace(scene, probes=tuple(dict.fromkeys((*scene.probes, (x, y)))))
    if not takes(FROM_REST, with_middle):
        return 0.0
    u = FROM_REST.solve(with_middle, sample_times(scene), SolveOptions()).values
    return float(np.abs(u).max()) / scene.body.depth


@lru_cache(maxsize=64)
def _measured_linear_error(scene: Scene, samples: int) -> float:
    """Return the relative error of linear bending in the first samples of a displacement."""
    times = sample_times(scene)[:samples]
    return linear_error(scene, times, FROM_REST.solve(scene, times, SolveOptions()).values)


def _displacement_scene(scene: Scene) -> Scene:
    """Return the scene with probes that read the displacement of the surface."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0, name="", spreads=())


def stretching_error(scene: Scene, model: Model, tolerance: float) -> float:
    """Return the error of a linear model for a sheet that stretches; 0 for other models and bodies.

    If the deflection is small, its square bounds the error. Otherwise `plate-modes-nonlinear`
    measures it in the displacement over the whole record, if this model takes the scene.
    """
    is_linear = model.needs_body and not model.is_nonlinear
    if not (is_linear and scene.body.of_kind.is_plate):
        return 0.0
    plain = _displacement_scene(scene)
    bound, is_negligible = _stretching_bound(scene, tolerance)
    if not is_negligible and takes(STRETCHED, plain):
        return _measured_linear_error(plain, len(sample_times(plain)))
    return min(1.0, bound)


def _stretching_bound(
    scene: Scene, tolerance: float, *, negligible: float = 0.1, steepest: float = 7.0,
    hardening: float = 2.6,
) -> tuple[float, bool]:  # fmt: skip
    """Return a bound of the relative error of linear bending at small deflection, and whether it is
    a `negligible` share of the tolerance; the bound is no sharper than this decision needs.

    Away from a resonance the error is at most `steepest` times (w / h)^2: 0.4 to 3.3 times for
    paper sheets of 30 to 210 mm, on four edges, two or in clips, with tension and without. Under a
    mean deflection w, stretching raises natural frequencies by at most `hardening` times (w / h)^2:
    0.7 times for a clamped plate, 2.6 for a simply supported one. A resonance multiplies this.
    """
    squared, plain = linear_deflection(scene) ** 2, _displacement_scene(scene)
    bound = steepest * squared
    if squared and bound <= negligible * tolerance and takes(FROM_REST, plain):
        bound = max(bound, hardening * plate_modes.sensitivity(plain) * squared)
    return bound, bound <= negligible * tolerance


def stretches(scene: Scene, tolerance: float) -> float:
    """Return the error of a linear model of a sheet if it stretches or deflects too much for one,
    otherwise 0. The first part of the record decides, if it suffices.
    """
    if not takes(STRETCHED, scene):
        return 0.0
    plain = _displacement_scene(scene)
    if not _stretching_bound(scene, tolerance)[1]:
        error = _measured_linear_error(plain, len(first_part(plain, sample_times(plain))))
        if error > tolerance / 2:
            return error
    error = stretching_error(scene, FROM_REST, tolerance)
    is_linear = error <= tolerance / 2 and is_small(linear_deflection(scene))
    return 0.0 if is_linear else error


def deflection_ratio(scene: Scene, response: Response) -> float:
    """Return the largest deflection of a sheet relative to its thickness, at its probes in a
    response or from `linear_deflection`, without the rigid-body motion of an unconstrained sheet.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return 0.0
    u = response.displacement if response.record is DISPLACEMENT else np.zeros((1, 1))
    bending = u if body.is_held else u - u.mean(axis=1, keepdims=True)
    return max(float(np.abs(bending).max()) / body.depth, linear_deflection(scene))


def mean_sag(scene: Scene) -> float:
    """Return the linear deflection in m of the middle of a supported sheet under its mean load,
    applied there: 0.0056 F a^2 / D for a clamped square (Timoshenko and Woinowsky-Krieger 1959,
    table 37), otherwise from the modes of the plate.
    """
    body = scene.body
    if body.mounting == FRAME and body.solid.orthotropy is None:
        at_rest = plate_modes.relative_modulus(body, 0.0).real * body.bending_stiffness
        compliance_of_middle = 0.0056 * min(body.width, body.height) ** 2 / at_rest
    else:
        compliance_of_middle = plate_modes.middle_compliance(body)
    downwards = -scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0, 2]
    forces = [2 * np.pi * each.spot_scale ** 2 * mean_gain(replace(scene, pressure=each))
              for each in scene.loads]  # fmt: skip
    return float(downwards @ forces * compliance_of_middle)
