"""Motion of a whole body, with its expected error and all warnings."""

import warnings
from dataclasses import dataclass, replace

import numpy as np

from meshes import TetMesh
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.quantities import DISPLACEMENT
from skinwave.effort import Progress, SkinwaveWarning
from skinwave.models.reduction import from_rest, oscillating
from skinwave.pictures.motion import Waves, check_values, probe_lines, probe_response, waves
from skinwave.planning.assessment import told
from skinwave.scene import Scene


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Displacement (t, n, 3) in metre of the nodes of `mesh` at `times` (t,) in s, and the relative
    error that is expected of the probes' waveforms, nan if unknown.
    """

    mesh: TetMesh
    times: Floats
    displacement: Floats
    effort: Effort
    expected_error: float = np.nan


def field(
    scene: Scene,
    times: Floats,
    tolerance: float = 0.02,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> Field:
    """Motion of a scene's whole body from rest.

    The body is reduced to the subspace of the load along the path: what it takes grows with the
    length of the path, and another path needs another reduction. The error
    against a coarser mesh and all else that falls short of the request is in `effort.warnings`,
    each sentence issued once as a `SkinwaveWarning`.

    Parameters
    ----------
    scene : Scene
    times : (t,) float, s, equally spaced from 0
    tolerance, progress, h, solver : as for `simulate`

    Returns
    -------
    Field, displacement (t, n, 3) in metre

    Raises
    ------
    ValueError
        If the scene has no body, a number is out of range or the tolerance is out of reach.
    """
    moved = waves(scene, tolerance, progress, h=h, solver=solver)
    check_values(len(times), len(moved.mesh.points))
    displacement = (from_rest(moved.motion, times) @ moved.basis.T).reshape(len(times), -1, 3)
    surface = replace(scene, depth=0.0, quantity=DISPLACEMENT.name)  # what is assessed is motion
    at_probes = assessed_probes(surface, moved, h, tolerance, solver)
    for sentence in at_probes.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(
        mesh=moved.mesh, times=times, displacement=displacement, effort=at_probes.effort,
        expected_error=at_probes.expected_error,
    )  # fmt: skip


def assessed_probes(
    scene: Scene, moved: Waves, h: float | None, tolerance: float, solver: str
) -> Response:
    """Response of the probes with its expected error, from a coarser mesh, and all warnings.

    Parameters
    ----------
    scene : Scene
    moved : Waves, of the scene
    h, tolerance, solver : as for `simulate`

    Returns
    -------
    Response, (t, p) of the scene's quantity
    """
    found = probe_response(scene, moved)
    if scene.body.is_held:
        return told(scene, found, found.values, h, tolerance, solver)
    lines = oscillating(probe_lines(scene, moved)).lines
    return told(scene, found, lines, h, tolerance, solver)
