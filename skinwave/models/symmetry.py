"""Mirror symmetry of a body: which half of it is modelled, and the even part of a load.

With respect to a symmetry plane of a body, each load and each motion is the sum of an even and an
odd part. Normal motion on the plane is that of the even part alone: of one half of the body, with
symmetry conditions on the plane, under the mean of the load and its mirror image.
"""

import numpy as np
from scipy import sparse

from skinwave.bodies.body import Body
from skinwave.bodies.parts import FLAT
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import Reading
from skinwave.typing import Floats


def mirrored_axes(body: Body, reading: Reading, load: Load) -> str:
    """Return the axes across which a body is symmetric and its probes' quantity is even."""
    if not body.of_kind.is_symmetric or body.placement != FLAT:
        return ""
    # Other quantities change sign, and other loads may have a direction.
    if not reading.record.is_normal or load.moving != PRESSURE:
        return ""
    return body.symmetry


def axes_of_probes(probes: Floats, among: str) -> str:
    """Return the axes, `among` "xy", on whose middle planes all probes (p, 2) in m lie."""
    on_plane = 1e-9  # m, distance up to which a probe is on a plane
    return "".join(axis for axis in among if np.abs(probes[:, "xy".index(axis)]).max() < on_plane)


def modelled_axes(body: Body, probes: Floats, symmetry: str, reading: Reading, load: Load) -> str:
    """Return the axes, out of "xy", across which only one half of a body is modelled: those of
    `symmetry`, across which the load is symmetric at all times, and those on which all probes lie.
    """
    on_plane = axes_of_probes(probes, mirrored_axes(body, reading, load))
    return "".join(axis for axis in "xy" if axis in symmetry or axis in on_plane)


def images(probes: Floats, axes: str) -> Floats:
    """Return the mirror images (p, 2) of probes in the half of a body with positive coordinates."""
    mirrored = probes.copy()
    for axis in ("xy".index(a) for a in axes):
        mirrored[:, axis] = np.abs(mirrored[:, axis])
    return mirrored


def even_part(P: sparse.csr_array, points: Floats, axes: str) -> tuple[sparse.csr_array, Floats]:
    """Return the load operator (3 n, j k) of the even part of a load, on the half of a body with
    positive coordinates. It acts on the load at the points (k, 3) of an operator P (3 n, k) and at
    their mirror images across the axes; these points (j k, 3) in m are also returned.
    """
    for axis in axes:
        image = points.copy()
        image[:, "xyz".index(axis)] *= -1
        P, points = sparse.hstack([P / 2, P / 2], format="csr"), np.vstack([points, image])
    return P, points
