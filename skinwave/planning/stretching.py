"""Stretching of a sheet at large deflection, and what linear bending leaves out.

A sheet that deflects by w stiffens in proportion to (w / h)^2 of its thickness h. The linear motion
of office paper in a frame without tension is 1 to 3 % off at a tenth of a thickness and 25 to 60 %
at a half.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.quantities import DISPLACEMENT
from skinwave.models import Model
from skinwave.models.advice import takes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.stretched_plate import STRETCHED, first_part, linear_error
from skinwave.planning.extent import mean_sag
from skinwave.scene.scene import Scene

LINEAR = 0.5  # deflection over thickness up to which bending of a sheet may be taken as linear
# Relative error of linear bending over (w / h)^2: 0.4 to 3.3 of paper sheets of 30 to 210 mm, on
# four edges, two or in clips, with tension and without; 7 with a tenth of their loss.
STEEPEST = 7.0
NEGLIGIBLE = 0.1  # of the tolerance, of an error that is bounded rather than measured


def deflection(scene: Scene) -> float:
    """Largest linear deflection of a held sheet over its thickness: at its probes and in its middle
    from rest, or in its middle under its mean load. It is 0 of other bodies, and of curled sheets,
    whose rise stiffens them.
    """
    body = scene.body
    flat = body.of_kind.is_plate and not body.mounting.is_curled
    if not (flat and body.sides == "clamped"):
        return 0.0
    return max(_from_rest(_plain(scene)), mean_sag(scene) / body.depth)


@lru_cache(maxsize=64)
def _from_rest(scene: Scene) -> float:
    """Largest deflection over thickness in the first part of a response; 0 if modes have none."""
    middle = tuple(float(x) for x in scene.body.placement.offset)
    seen = replace(scene, probes=tuple(dict.fromkeys((*scene.probes, (middle[0], middle[1])))))
    if not takes(FROM_REST, seen):
        return 0.0
    u = FROM_REST.solve(seen, _first_part(seen), SolveOptions()).values
    return float(np.abs(u).max()) / scene.body.depth


@lru_cache(maxsize=64)
def _measured(scene: Scene) -> float:
    """Relative error of linear bending in the first part of a displacement."""
    times = _first_part(scene)
    return linear_error(scene, times, FROM_REST.solve(scene, times, SolveOptions()).values)


def _plain(scene: Scene) -> Scene:
    """The scene with probes that read displacement, as deflection is that."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0, name="", spreads=())


def _first_part(scene: Scene) -> Floats:
    times: Floats = first_part(scene.pressure, sample_times(scene))
    return times


def stretching_left_out(scene: Scene, model: Model, tolerance: float) -> float:
    """Relative error of a linear model of a sheet that stretches.

    Bounded by the square of the deflection where that is small, else measured in the displacement
    by `plate-modes-nonlinear` where it takes the scene.

    Parameters
    ----------
    scene : Scene
    model : Model
    tolerance : relative error that is asked for

    Returns
    -------
    float; 0 of a nonlinear model, and of other bodies
    """
    if model.is_nonlinear or not model.needs_body:
        return 0.0
    bound = STEEPEST * deflection(scene) ** 2
    plain = _plain(scene)
    if bound > NEGLIGIBLE * tolerance and takes(STRETCHED, plain):
        return _measured(plain)
    return min(1.0, bound)


def beyond_linear(scene: Scene, tolerance: float) -> bool:
    """Whether a sheet is for `plate-modes-nonlinear`: it stretches by more than half the tolerance,
    or deflects by more than `LINEAR` thicknesses.
    """
    if not takes(STRETCHED, scene):
        return False
    share = stretching_left_out(scene, FROM_REST, tolerance)
    return share > tolerance / 2 or deflection(scene) > LINEAR


def bent(scene: Scene, response: Response) -> float:
    """Largest deflection of a sheet over its thickness: at its probes in a response, or as of
    `deflection`. The rigid-body motion of an unconstrained sheet is none.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return 0.0
    u = response.displacement if response.record is DISPLACEMENT else np.zeros((1, 1))
    from_rest = u if body.is_held else u - u.mean(axis=1, keepdims=True)
    return max(float(np.abs(from_rest).max()) / body.depth, deflection(scene))
