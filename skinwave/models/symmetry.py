"""Mirror symmetry of a body, which halves what has to be modelled.

Across a plane of symmetry of a body every load is the sum of an even and an odd part, and so is the
motion. Normal motion on the plane is that of the even part alone: that of the part of the body on
one side, with symmetry conditions on the plane, under the mean of the load and its mirror image.
"""

import numpy as np
from scipy import sparse

from meshes.tetmesh import Floats
from skinwave.bodies.body import Body
from skinwave.bodies.parts import FLAT
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import Reading

ON_PLANE = 1e-9  # m: nearer to a plane a probe is on it


def mirrored_axes(body: Body, reading: Reading, load: Load) -> str:
    """Axes, of "xy", across whose middle planes a body is its own mirror image, and what its probes
    read keeps its sign.

    Parameters
    ----------
    body : Body
    reading : what the probes read
    load : what pushes

    Returns
    -------
    str
    """
    if not body.of_kind.is_symmetric or body.placement != FLAT:
        return ""
    if not reading.asked.is_normal:  # others change sign, or are recovered across the plane
        return ""
    if load.moving != PRESSURE:  # which may have a direction
        return ""
    return body.symmetry


def axes_of_probes(probes: Floats, among: str) -> str:
    """Axes, of some of "xy", on whose middle planes all probes (p, 2) in metre lie."""
    return "".join(axis for axis in among if np.abs(probes[:, "xy".index(axis)]).max() < ON_PLANE)


def modelled_axes(body: Body, probes: Floats, symmetry: str, reading: Reading, load: Load) -> str:
    """Axes, of "xy", across whose middle planes only one side of a body is modelled.

    Parameters
    ----------
    body : Body
    probes : (p, 2) float, metre
    symmetry : axes across which the load is its own mirror image at all times
    reading, load : as for `mirrored_axes`

    Returns
    -------
    str
    """
    seen = axes_of_probes(probes, mirrored_axes(body, reading, load))
    return "".join(axis for axis in "xy" if axis in symmetry or axis in seen)


def images(probes: Floats, axes: str) -> Floats:
    """Mirror images (p, 2) of probes in the part of a body with positive coordinates."""
    found = probes.copy()
    for axis in ("xy".index(a) for a in axes):
        found[:, axis] = np.abs(found[:, axis])
    return found


def even_part(P: sparse.csr_array, points: Floats, axes: str) -> tuple[sparse.csr_array, Floats]:
    """Load operator of the even part of a load, on the part of a body with positive coordinates.

    Parameters
    ----------
    P : (3 n, k) sparse, load operator of this part
    points : (k, 3) float, metre, where it takes the load
    axes : of "xy", across which the body is mirrored

    Returns
    -------
    load operator (3 n, j k) that takes the load at the points and at their mirror images, and these
    (j k, 3) in metre
    """
    for axis in axes:
        image = points.copy()
        image[:, "xyz".index(axis)] *= -1
        P, points = sparse.hstack([P / 2, P / 2], format="csr"), np.vstack([points, image])
    return P, points
