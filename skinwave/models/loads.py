"""Load and probes of a meshed body under a moving pressure."""

import numpy as np
from scipy import sparse

from fem.load_and_probe import facet_normals, facet_points, load_operator, probe_operator
from meshes.tetmesh import Floats
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build


def surface_load(build: Build) -> tuple[sparse.csr_array, Floats]:
    """Load operator P (3 n, k): nodal forces in N of the pressure in Pa on a surface across the
    beam, and the points (k, 3) in metre where it is taken.

    Radiation pressure goes with the square of the cosine of incidence: once for the beam that is
    spread over a sloping surface, and once for the momentum that is reflected along its normal.
    """
    cosine = np.maximum(facet_normals(build.mesh)[:, 2], 0.0)
    return load_operator(build.mesh) * cosine**2, facet_points(build.mesh)


def surface_motion(body: Body, build: Build, probes: Floats) -> sparse.csr_array:
    """Probe operator S: displacement into a meshed body.

    The surface in a file is made of flat triangles, at whose edges its own normals jump: there the
    direction into the body is that of the mean normal about a probe.

    Parameters
    ----------
    body : Body
    build : its mesh
    probes : (p, 2) float, metre

    Returns
    -------
    (p, 3 n) sparse, without unit
    """
    return probe_operator(build.mesh, probes, patch=body.of_kind.normal_patch)
