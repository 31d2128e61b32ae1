"""A sheet at large deflection, in its modes or with all dofs."""

from functools import partial

from skinwave.bodies.body import Body
from skinwave.bodies.sheet import refuse_open_air
from skinwave.models import Model, register
from skinwave.models.laws import without_own_law
from skinwave.models.linear_elements import vacuum_only
from skinwave.models.sources import ALPHA, NEWTON
from skinwave.models.stretching import (
    expected_error,
    full_answer,
    reduced_answer,
    sheet_only,
    stretching_size,
)
from skinwave.scene import Scene

METHOD = "large deflection, step by step from rest"


def _error(scene: Scene, h: float | None) -> float:
    assert h
    return expected_error(scene.body, h)


def _refuse_of_reduced(body: Body) -> None:
    sheet_only(body, "fem-nonlinear")
    refuse_open_air(body)
    without_own_law("fem-nonlinear", body)


def _refuse_of_full(body: Body) -> None:
    sheet_only(body, "fem-nonlinear-transient")
    vacuum_only("fem-nonlinear-transient", body)
    without_own_law("fem-nonlinear-transient", body)


REDUCED = register(
    Model(
        name="fem-nonlinear",
        method=METHOD,
        words="a sheet that stretches as it bends, in its modes, from rest",
        solve=reduced_answer,
        refuse=_refuse_of_reduced,
        error=_error,
        default_size=partial(stretching_size, reduced=True),
        reads=lambda scene: True,
        sources=(ALPHA, NEWTON),
        is_nonlinear=True,
    )
)
FULL = register(
    Model(
        name="fem-nonlinear-transient",
        method=METHOD,
        words="a sheet that stretches as it bends, on 10-node tetrahedra, step by step",
        solve=full_answer,
        refuse=_refuse_of_full,
        error=_error,
        default_size=partial(stretching_size, reduced=False),
        reads=lambda scene: True,
        sources=(ALPHA, NEWTON),
        is_nonlinear=True,
    )
)
