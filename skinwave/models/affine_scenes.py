"""Scenes that one affine sum of matrices gives the response to, for all materials of a range."""

from collections.abc import Sequence

import numpy as np

from simple_model.load.spectrum import load_lines
from simple_model.quantities import STRAIN
from skinwave.bodies.mounting import FRAME
from skinwave.bodies.sheet import refuse_open_air
from skinwave.models.free_keys import FreeKey
from skinwave.models.laws import check_laws
from skinwave.scene.scene import Body, Scene

MOST_LINES = 400


def has_affine_operators(body: Body) -> bool:
    """Whether the operators of a body are sums over its materials: those of a sheet that is
    stretched, not held by all of its edges, or orthotropic have other terms.
    """
    return body.mounting == FRAME and body.solid.orthotropy is None


def check_scene(scene: Scene, keys: Sequence[FreeKey], tolerance: float) -> None:
    """Refuse what no affine sum gives.

    Parameters
    ----------
    scene : Scene
    keys : free keys of its body
    tolerance : float, relative error of a line

    Raises
    ------
    ValueError
        If it is so.
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    _check_load(scene)
    check_laws(scene.body, scene.pressure)
    _check_body(scene.body)
    _check_reading(scene, keys)
    each = [load_lines(pressure).frequencies for pressure in scene.loads]
    if (count := len(np.unique(np.concatenate(each)))) > MOST_LINES:
        raise ValueError(
            f"the load has {count:,} lines, the limit with free materials is {MOST_LINES}; leave "
            "out the rhythm or signal"
        )


def _check_load(scene: Scene) -> None:
    if scene.load.gravity:
        raise ValueError(
            "a body with free materials has no gravity: the static deflection is that of each "
            "modulus and density; leave gravity out, or reduce the body of each material"
        )
    if scene.load.support_motion:
        raise ValueError(
            f"a body with free materials does not take {scene.load.support_motion.words}, whose "
            "inertial force goes with the density; leave support_motion out, or reduce the body of "
            "each material"
        )


def _check_body(body: Body) -> None:
    if not has_affine_operators(body):
        raise ValueError(
            "a body with free materials is an isotropic sheet in a frame, or none: tension and "
            "other mountings do not scale with its modulus; reduce the body of each material"
        )
    refuse_open_air(body)


def _check_reading(scene: Scene, keys: Sequence[FreeKey]) -> None:
    asked, solid = scene.reading.asked, scene.body.solid
    if any(key.is_thickness for key in keys):
        _check_thick(scene)
    rows, doubled = (asked.rows(each) for each in (solid, solid.scaled(modulus=2.0)))
    if asked.relaxes or not np.array_equal(rows, doubled):
        raise ValueError(
            f"{scene.reading.words} depends on the material beyond the motion, which is all that a "
            "body with free materials gives; take a displacement, velocity or strain"
        )


def _check_thick(scene: Scene) -> None:
    """Refuse what depends on a free thickness beyond the motion of the mesh."""
    asked = scene.reading.asked
    if scene.body.of_kind.equivalent and not asked.is_normal:
        raise ValueError(
            f"{scene.reading.words} goes with the thickness of a sheet beyond the motion of its "
            "middle; take the normal displacement, velocity or acceleration"
        )
    if asked.field == STRAIN:
        raise ValueError(
            f"{scene.reading.words} of elements that move with a thickness is not smooth in it; "
            "take a displacement, velocity or acceleration"
        )
