"""A sheet at large deflection, in its modes or with all dofs."""

from collections.abc import Callable, Iterator
from functools import partial

from skinwave.bodies.body import Body
from skinwave.models import Model, register
from skinwave.models.laws import has_own_law
from skinwave.models.limits import Limit, load_limit
from skinwave.models.linear_elements import of_mesh
from skinwave.models.sheet_limits import (
    of_air_in_a_frame,
    of_held_sheet,
    of_vacuum,
)
from skinwave.models.sources import ALPHA, NEWTON
from skinwave.models.stretching import (
    expected_error,
    full_answer,
    reduced_answer,
    stretching_size,
)
from skinwave.scene.scene import Scene

METHOD = "large deflection, step by step from rest"


def _error(scene: Scene, h: float | None) -> float:
    assert h
    return expected_error(scene.body, h)


def _limits(
    of_air: Callable[[Body], Iterator[Limit]], size: Callable[[Body], float], scene: Scene
) -> Iterator[Limit]:
    body = scene.body
    if not body.of_kind.is_plate:
        yield Limit(why=f"takes a sheet, not a {body.kind}")
        return
    yield from of_held_sheet(body)
    yield from of_air(body)
    yield from of_mesh(body, size(body))
    if not scene.load.is_plain:
        yield load_limit(scene)


REDUCED_SIZE, FULL_SIZE = (partial(stretching_size, reduced=which) for which in (True, False))


REDUCED = register(
    Model(
        name="fem-nonlinear",
        method=METHOD,
        words="a sheet that stretches as it bends, in its modes, from rest",
        solve=reduced_answer,
        limits=partial(_limits, of_air_in_a_frame, REDUCED_SIZE),
        error=_error,
        default_size=REDUCED_SIZE,
        sources=(ALPHA, NEWTON),
        is_nonlinear=True,
        takes_series=has_own_law,
    )
)
FULL = register(
    Model(
        name="fem-nonlinear-transient",
        method=METHOD,
        words="a sheet that stretches as it bends, on 10-node tetrahedra, step by step",
        solve=full_answer,
        limits=partial(_limits, of_vacuum, FULL_SIZE),
        error=_error,
        default_size=FULL_SIZE,
        sources=(ALPHA, NEWTON),
        is_nonlinear=True,
        takes_series=has_own_law,
    )
)
