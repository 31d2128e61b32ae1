"""Goal-oriented size fields: edge lengths as the error of the probes' motion asks for.

A coarse mesh and its dual solutions say where elements leave that error (`skinwave.models.goal`).
Edge lengths that spread it evenly, as fine as a tolerance needs, are given to the mesher.
"""

import numpy as np
from numpy.typing import NDArray

from meshes.files.import_body import COARSEST, GROWTH
from meshes.tetmesh import Floats
from meshes.volume.size_field import equidistributed_sizes, error_density, size_field
from skinwave.bodies.sizes import default_size
from skinwave.models.goal import element_errors
from skinwave.planning.estimates import path_places, spot_scale
from skinwave.planning.goal_meshes import PER_WAVELENGTH, SPOT, Estimated, Family, GoalMesh
from skinwave.planning.refinement import (
    CONTROLLER,
    compared_with,
    element_sizes,
    finer_sizes,
)
from skinwave.scene import Body, Scene

SAFETY = 1.1  # errors are extrapolated by the order of uniform meshes, as theirs are
SLOPE = float(np.log(GROWTH))
BESIDE = 2.0  # standard deviations of the focal spot on either side of its path, which it passes


def family_of_sizes(scene: Scene, body: Body, axes: str, tolerance: float, solver: str) -> Family:
    """Goal-oriented meshes of tetrahedra that fill a surface.

    Parameters
    ----------
    scene : Scene
    body : Body that is meshed, of a kind whose elements may have any size
    axes : of "xy", of which a half is modelled
    tolerance, solver : as for `element_errors`

    Returns
    -------
    Family
    """
    sized, size = body.of_kind.sized, _coarse_size(scene, body)
    assert sized  # else not asked for

    def estimated(frequencies: Floats, sizes: Floats, dofs: int) -> Estimated:
        found = element_errors(
            scene, body, frequencies, sizes, h=size, axes=axes, tolerance=tolerance, solver=solver
        )
        known = error_density(found.mesh, found.along.sum(axis=1), order=CONTROLLER.order)
        limits = np.full(len(known.points), _coarsest(body, size, float(frequencies.max())))
        passed = _passed(scene, body, known.points)
        spot = max(SPOT * spot_scale(scene.pressure), default_size(body) / 2)
        limits[passed] = np.minimum(limits[passed], spot)
        whole, elements = found.along.sum(), len(found.mesh.tets)

        def finer(ratio: float, before: GoalMesh, most: float) -> GoalMesh:
            lengths = equidistributed_sizes(
                known, ratio * whole, slope=SLOPE, coarsest=limits, most=most * elements / dofs
            )
            field = size_field(known.points, lengths, SLOPE)
            return GoalMesh(
                discretise=sized.by(field), follows=field, ratio=known.error(lengths) / whole,
                words=f"{1e3 * lengths.min():.1f} to {1e3 * lengths.max():.1f} mm",
                widest=float(lengths[passed].max(initial=0.0)),
            )  # fmt: skip

        return Estimated(error=float(found.error.max()), finer=finer)

    return Family(coarse=GoalMesh(widest=size), size=size, safety=SAFETY, estimated=estimated)


def _coarse_size(scene: Scene, body: Body) -> float:
    """Size in metre of the coarsest elements that still have the force of the focal spot."""
    sizes = element_sizes(body)
    # With which the first uniform mesh is compared, so that it is there where that was not enough.
    coarsest = compared_with(body, float(finer_sizes(sizes, sizes[0])[0]))
    return min(coarsest, max(2 * spot_scale(scene.pressure), default_size(body)))


def _coarsest(body: Body, size: float, frequency: float) -> float:
    """Largest element in metre: as large as those of the coarse mesh, of elements of a size under
    the focus, and such that it resolves shear waves at a frequency in Hz.
    """
    slowest = min(solid.shear_speed for solid in body.solids)
    return min(COARSEST * size, slowest / frequency / PER_WAVELENGTH)


def _passed(scene: Scene, body: Body, points: Floats) -> NDArray[np.bool_]:
    """Whether each point (n, 3) in metre, of a body before it is placed, is below the focal spot on
    its path.
    """
    path = path_places(scene.tacton.trajectory)
    places = body.placement.undone(np.column_stack([path, np.zeros(len(path))]))
    apart = np.linalg.norm(points[:, None, :2] - places[:, :2], axis=2).min(axis=1)
    return np.asarray(apart < BESIDE * spot_scale(scene.pressure))
