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
from skinwave.models.plate_modes import (
    FROM_REST,
    STRETCHED,
    first_part,
    linear_error,
    middle_compliance,
    relative_modulus,
)
from skinwave.planning.estimates import mean_gain
from skinwave.scene.scene import Scene

LINEAR = 0.5  # deflection over thickness up to which bending of a sheet may be taken as linear
NEGLIGIBLE = 0.1  # of the tolerance, of an error that is bounded rather than measured


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
    middle = tuple(float(x) for x in scene.body.placement.offset)
    with_middle = replace(
        scene, probes=tuple(dict.fromkeys((*scene.probes, (middle[0], middle[1]))))
    )
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
    plain, negligible = _displacement_scene(scene), NEGLIGIBLE * tolerance
    bound = _stretching_bound(scene, negligible)
    if bound > negligible and takes(STRETCHED, plain):
        return _measured_linear_error(plain, len(sample_times(plain)))
    return min(1.0, bound)


def _stretching_bound(scene: Scene, negligible: float) -> float:
    """Return a bound of the relative error of linear bending at small deflection, no sharper than
    to decide whether it is negligible: stretching raises natural frequencies by at most
    2.6 (w / h)^2, and a resonance multiplies this.
    """
    squared, plain = linear_deflection(scene) ** 2, _displacement_scene(scene)
    # Relative error of linear bending over (w / h)^2 away from a resonance: 0.4 to 3.3 for paper
    # sheets of 30 to 210 mm, on four edges, two or in clips, with tension and without.
    steepest = 7.0
    bound = steepest * squared
    if not squared or bound > negligible or not takes(FROM_REST, plain):
        return bound
    # Relative change of natural frequencies over (w / h)^2, under a mean deflection w: 0.7 of a
    # clamped plate, 2.6 of a simply supported one.
    hardening = 2.6
    return max(bound, hardening * plate_modes.sensitivity(plain) * squared)


def stretches(scene: Scene, tolerance: float) -> float:
    """Return the error of a linear model of a sheet if it stretches or deflects too much for one,
    otherwise 0. The first part of the record decides, if it suffices.
    """
    if not takes(STRETCHED, scene):
        return 0.0
    plain, negligible = _displacement_scene(scene), NEGLIGIBLE * tolerance
    if _stretching_bound(scene, negligible) > negligible:
        error = _measured_linear_error(plain, len(first_part(plain, sample_times(plain))))
        if error > tolerance / 2:
            return error
    error = stretching_error(scene, FROM_REST, tolerance)
    is_beyond = error > tolerance / 2 or linear_deflection(scene) > LINEAR
    return error if is_beyond else 0.0


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
        at_rest = relative_modulus(body, 0.0).real * body.bending_stiffness
        compliance_of_middle = 0.0056 * min(body.width, body.height) ** 2 / at_rest
    else:
        compliance_of_middle = middle_compliance(body)
    return float(_mean_force(scene) * compliance_of_middle)


def _mean_force(scene: Scene) -> float:
    """Return the mean force in N on the middle of a flat body."""
    downwards = -scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0, 2]
    forces = [2 * np.pi * each.spot_scale ** 2 * mean_gain(replace(scene, pressure=each))
              for each in scene.loads]  # fmt: skip
    return float(downwards @ forces)
