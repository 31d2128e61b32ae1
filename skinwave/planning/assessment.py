"""Expected error and warnings of a response that was computed on a given mesh.

The error of a mesh is extrapolated from a coarser one, as in `refinement`.
"""

from functools import lru_cache

from simple_model import Response, Statement
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import ReducedBody, answer, reduce_scene
from skinwave.planning import errors, refinement
from skinwave.planning.extent import absorbing_error
from skinwave.planning.plan import plan
from skinwave.planning.plan_warnings import response_warnings
from skinwave.scene.scene import Scene, without_tacton
from skinwave.typing import Array


def assess(
    scene: Scene, response: Response, moved: ReducedBody | Array, options: SolveOptions = DEFAULT,
    *, compared: ReducedBody | None = None,
) -> Response:  # fmt: skip
    """Return a response of linear elements with its expected error and all warnings.

    `moved` is the reduced body of the response, or the quantity of interest of another model:
    waveforms (t, p), or the lines (f, p) of an unconstrained body. `compared` is the
    body on another mesh, chosen here if not given.
    """
    if isinstance(moved, ReducedBody):
        moved = refinement.quantity_of_interest(moved, scene, response)
    body, tolerance = scene.body, options.tolerance
    size = options.h or default_size(body)
    coarse = compared or coarser_body(scene, options)
    ratio = refinement.refinement_ratio(body, coarse.effort, response.effort)
    fine = values = refinement.about_its_rest(scene, moved)
    if ratio != 1:
        values = refinement.quantity_of_interest(coarse, scene, answer(coarse, scene))
    mesh = refinement.mesh_error(scene, ratio, (values, fine))
    parts = errors.element_parts(
        scene, tolerance, size, mesh=mesh, reduction=response.effort.estimate,
        absorbing=absorbing_error(scene, body, options),
        above_band=refinement.above_band(response.values, response.times[1] - response.times[0]),
    )  # fmt: skip
    parts += errors.left_out_parts(scene, named(response.model), tolerance, coarse)
    statement = Statement(parts=tuple(parts), tolerance=tolerance)
    warnings = errors.element_warnings(scene, size)
    return errors.with_statement(scene, response, statement, warnings)


def coarser_body(
    scene: Scene, options: SolveOptions = DEFAULT, usual: float | None = None
) -> ReducedBody:
    """Return the body on the mesh that `assess` compares with. The `usual` size in m is that of a
    study, in place of the default size.
    """
    size = options.h or usual or default_size(scene.body)
    other = refinement.comparison_size(scene.body, size)
    return _reduced(without_tacton(scene), other, options.solver, options.tolerance)


def all_warnings(scene: Scene, response: Response, h: float | None = None) -> tuple[str, ...]:
    """Return all warnings of a response without solving another mesh. For linear elements of h in m
    these are warnings that do not depend on their error, for other models those of the plan.
    """
    if named(response.model).default_size and h:
        warnings = errors.element_warnings(scene, h)
    else:
        planned = plan(scene, SolveOptions(model=response.model, times=response.times))
        statement = planned.statement.with_parts(response.effort.errors.parts)
        warnings = (*statement.warnings, *planned.cautions)
    return (*warnings, *response_warnings(scene, response))


@lru_cache(maxsize=4)  # of Tactons on the same bodies
def _reduced(scene: Scene, h: float, solver: str, tolerance: float) -> ReducedBody:
    return reduce_scene(scene, SolveOptions(h=h, solver=solver, tolerance=tolerance))
