"""Linear finite elements: reduced-order model, steady state line by line, and time integration."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from math import isfinite

import numpy as np

from meshes import MeshError
from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.numbers import significant
from skinwave.bodies.body import Body
from skinwave.bodies.parts import PHALANX, PLAIN
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import Limit, Model, register
from skinwave.models.full import harmonic_answer, transient_answer
from skinwave.models.laws import has_own_law
from skinwave.models.limits import of_air_in_a_frame, of_body, of_vacuum
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, prepare, reduction_tolerance
from skinwave.scene.scene import Scene

REDUCTION = (
    "Z. Bai, Y. Su: Dimension reduction of large-scale second-order dynamical systems via a "
    "second-order Arnoldi method. SIAM Journal on Scientific Computing 26 (2005) 1692-1709"
)
ARNOLDI = (
    "D. Lu, Y. Su, Z. Bai: Stability analysis of the two-level orthogonal Arnoldi procedure. SIAM "
    "Journal on Matrix Analysis and Applications 37 (2016) 195-214"
)
ALPHA = (
    "J. Chung, G. M. Hulbert: A time integration algorithm for structural dynamics with improved "
    "numerical dissipation: the generalized-alpha method. Journal of Applied Mechanics 60 (1993) "
    "371-375. doi 10.1115/1.2900803"
)
MACROELEMENTS = (
    "R. Stenberg: Analysis of mixed finite element methods for the Stokes problem: a unified "
    "approach. Mathematics of Computation 42 (1984) 9-23"
)
MOST_SLENDER = 10  # sides of a sheet, of which its default elements make a mesh
FINITE = 15e-3  # m: a finite depth in place of a half-space, or below its layers and probes
THICKER = 1.25  # from one thickness that is tried to the next


@lru_cache(maxsize=64)
def of_mesh(body: Body, h: float | None = None) -> tuple[Limit, ...]:
    """Limits of elements of h in metre, by default those of the body: what has no mesh."""
    if not isfinite(body.depth):
        return (
            Limit(
                why="takes a body of finite depth, not thickness_mm = inf",
                cure="give a finite thickness_mm", change=_of_finite_depth,
            ),
        )  # fmt: skip
    try:
        check_mesh(body, h or default_size(body))
    except MeshError as error:  # too many elements
        why = _cause(error)
        cure, change = _coarser(body)
    except ValueError as error:  # layers that its elements do not follow
        why = _cause(error)
        cure, change = 'take kind = "slab"', _as_slab
    else:
        return ()
    return (Limit(why=f"cannot mesh this body: {why}", cure=cure, change=change),)


def _of_finite_depth(scene: Scene) -> Scene:
    below = max(0.0, *scene.depths, *scene.body.interfaces[:-1])
    return of_body(depth=below + FINITE)(scene)


def _as_slab(scene: Scene) -> Scene:
    """The scene on a slab of the same size and layers."""
    return of_body(kind="slab", relief=PLAIN, bone=PHALANX, regions=())(scene)


def _cause(error: ValueError) -> str:
    """What is wrong, by a message that ends with a cure."""
    return str(error).rpartition("; ")[0]


def _coarser(body: Body) -> tuple[str, Callable[[Scene], Scene] | None]:
    """The change to a body whose default elements are large enough to be few: one that is thicker,
    or a sheet that is less long.
    """
    if body.of_kind.is_plate:
        longest = MOST_SLENDER * min(body.width, body.height)
        values = {"width": min(body.width, longest), "height": min(body.height, longest)}
        return f"make it at most {1e3 * longest:g} mm long", of_body(**values)
    depths = body.depth * THICKER ** np.arange(1, 40)
    for depth in (significant(1e3 * each, 2) for each in depths.tolist()):
        thicker = replace(body, depth=float(depth) / 1e3)
        if _fits(thicker):
            return f"give it thickness_mm = {depth} or more", of_body(depth=thicker.depth)
    return "", None


def _fits(body: Body) -> bool:
    try:
        check_mesh(body, default_size(body))
    except ValueError:
        return False
    return True


def _limits(
    of_air: Callable[[Body], Iterator[Limit]], may_move: bool, scene: Scene
) -> Iterator[Limit]:
    yield from of_mesh(scene.body)
    yield from of_air(scene.body)
    if scene.load.support_motion and not may_move:
        yield Limit(
            why=f"does not take {scene.load.support_motion.words}",
            cure="leave out support_motion",
            change=lambda scene: replace(scene, load=replace(scene.load, support_motion=None)),
        )


def _reduced(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    prepared = prepare(
        scene.body, scene.probe_points, options.progress, h=options.h, solver=options.solver,
        tolerance=reduction_tolerance(options.tolerance), reading=scene.reading, load=scene.load,
    )  # fmt: skip
    return answer(prepared, scene, options.progress, times=times)


FEM = register(
    Model(
        name="fem",
        method="10-node tetrahedra, reduced-order model",
        words="linear waves on 10-node tetrahedra by a reduced-order model",
        solve=_reduced,
        error=None,
        default_size=default_size,
        limits=partial(_limits, of_air_in_a_frame, True),
        colour="#0072B2",
        sources=(REDUCTION, ARNOLDI, MACROELEMENTS),
        is_reduced=True,
        takes_series=has_own_law,
    )
)
HARMONIC = register(
    replace(
        FEM,
        name="fem-harmonic",
        method="10-node tetrahedra, line by line",
        words="the steady state of linear waves on 10-node tetrahedra",
        solve=harmonic_answer,
        limits=partial(_limits, of_vacuum, True),
        colour="#CC79A7",
        sources=(MACROELEMENTS,),
        from_rest="fem",
        is_reduced=False,
        takes_series=lambda body: False,
    )
)
TRANSIENT = register(
    replace(
        FEM,
        name="fem-transient",
        method="10-node tetrahedra, step by step",
        words="linear waves on 10-node tetrahedra, step by step",
        solve=transient_answer,
        limits=partial(_limits, of_vacuum, False),
        colour="#D55E00",
        sources=(ALPHA, MACROELEMENTS),
        is_reduced=False,
        is_stepped=True,
    )
)
