"""Linear finite elements: reduced-order model, steady state line by line, and time integration."""

from functools import partial

from simple_model import Response
from skinwave.bodies.body import Body
from skinwave.bodies.sizes import default_size
from skinwave.models import Model, Request, register
from skinwave.models.full import harmonic_answer, transient_answer
from skinwave.models.laws import has_own_law
from skinwave.models.prepared import answer, prepare, reduction_tolerance
from skinwave.models.sources import ALPHA, ARNOLDI, MACROELEMENTS, REDUCTION
from skinwave.scene import Scene


def vacuum_only(model: str, body: Body) -> None:
    """Refuse a body with air, whose added-mass operator is dense.

    Raises
    ------
    ValueError
        If it has air.
    """
    if body.air:
        raise ValueError(
            f"{model} solves sparse equations, and the added mass of air is a dense operator; "
            "leave air out, or use --model fem, fem-nonlinear, plate-modes or flat-body"
        )


def _reduced(scene: Scene, request: Request) -> Response:
    prepared = prepare(
        scene.body, scene.probe_points, request.report, h=request.h, solver=request.solver,
        tolerance=reduction_tolerance(request.tolerance), reading=scene.reading, load=scene.load,
    )  # fmt: skip
    return answer(prepared, scene, request.report)


FEM = register(
    Model(
        name="fem",
        method="10-node tetrahedra, reduced-order model",
        words="linear waves on 10-node tetrahedra by a reduced-order model",
        solve=_reduced,
        error=None,
        default_size=default_size,
        reads=lambda scene: True,
        takes_load=lambda scene: True,
        colour="#0072B2",
        sources=(REDUCTION, ARNOLDI, MACROELEMENTS),
        is_reduced=True,
        fits_damping=True,
        takes_series=has_own_law,
    )
)
HARMONIC = register(
    Model(
        name="fem-harmonic",
        method="10-node tetrahedra, line by line",
        words="the steady state of linear waves on 10-node tetrahedra",
        solve=harmonic_answer,
        refuse=partial(vacuum_only, "fem-harmonic"),
        error=None,
        default_size=default_size,
        reads=lambda scene: True,
        takes_load=lambda scene: True,
        colour="#CC79A7",
        sources=(MACROELEMENTS,),
        from_rest="fem",
    )
)
TRANSIENT = register(
    Model(
        name="fem-transient",
        method="10-node tetrahedra, step by step",
        words="linear waves on 10-node tetrahedra, step by step",
        solve=transient_answer,
        refuse=partial(vacuum_only, "fem-transient"),
        error=None,
        default_size=default_size,
        reads=lambda scene: True,
        takes_load=lambda scene: not scene.load.support_motion,
        colour="#D55E00",
        sources=(ALPHA, MACROELEMENTS),
        is_stepped=True,
        fits_damping=True,
        takes_series=has_own_law,
    )
)
