"""Absorbing (sponge) layer around and below a slab: grid lines, damping profile and far springs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.boundary import Support
from fem.load_and_probe import facet_normals, facet_points
from meshes import Grading, TetMesh, graded_axis
from skinwave.bodies.body import Body
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class AbsorbingLayer:
    """Absorbing layer of a `width` in m.

    Its mass-proportional damping rises with the square of the distance, up to `drag` in 1/s. Its
    cells grow by `growth` from one to the next, up to `coarsest` in m.
    """

    width: float
    drag: float
    growth: float
    coarsest: float


def has_layer(body: Body) -> bool:
    """Whether an absorbing layer is meshed around or below a body."""
    return body.of_kind.is_layer and "absorbing" in (body.base, *body.conditions)


def layer_of(body: Body, wider: float = 1.0, lowest_cut_on: float = 80.0) -> AbsorbingLayer:
    """Return the absorbing layer of a slab; `wider` multiplies its width to estimate its
    reflections.

    Dashpots alone reflect a quarter of a shear wave at 30 degrees. Lengths are multiples of the
    depth, or of the depth whose first mode cuts on at `lowest_cut_on` in Hz if that is smaller:
    below it, the motion of deeper slabs is near field at their sides. On a rigid base, waves are
    long near the cut-on and decay below it. A plane slab of 50 mm then reflects at most 1.4 % of
    the motion at the focus at any line, compared with 17 % for dashpots alone
    (`skinwave.verify.waves`). With a free or elastic base, bending waves propagate at all
    frequencies, and only the layer damps them. Above an absorbing base, waves are spherical, with
    the wavelength of the lowest material.
    """
    speed = body.solid.shear_speed
    longest = speed / (4 * lowest_cut_on)
    scale = longest if body.base == "absorbing" else min(body.depth, longest)
    # Width and coarsest cell over that scale; damping over the angular frequency of cut-on.
    width, coarsest, drag, growth = {
        "clamped": (7.0, 2.0, 0.35, 1.4),
        "absorbing": (13.0, 3.0, 0.25, 1.5),
    }.get(body.base, (20.0, 4.0, 0.25, 1.5))
    return AbsorbingLayer(
        width=wider * width * scale, drag=drag * 2 * np.pi * speed / (4 * scale),
        growth=growth, coarsest=coarsest * scale,
    )  # fmt: skip


def layer_line(layer: AbsorbingLayer, half: Floats) -> Floats:
    """Return grid lines of the absorbing layer, from the end of the body."""
    grading = Grading(radius=0.0, growth=layer.growth, coarsest=layer.coarsest)
    first = min(layer.growth * (half[-1] - half[-2]), layer.coarsest)
    return graded_axis(layer.width, first, grading)[1:]


def layer_drag(body: Body, layer: AbsorbingLayer, mesh: TetMesh) -> Floats:
    """Return the damping (m,) in 1/s of the elements: 0 in the body, quadratic beyond it."""
    ends = np.array([body.width / 2, body.height / 2, body.depth])
    middles = np.abs(mesh.points[mesh.tets[:, :4]].mean(axis=1))
    beyond = np.clip(middles - ends, 0.0, None).max(axis=1) / layer.width
    return layer.drag * beyond**2


def far_springs(body: Body, mesh: TetMesh) -> Support:
    """Return springs at the end of the absorbing layer of a slab on a half-space.

    The half-space is assumed to resist as under a force P at the origin. In incompressible tissue
    the traction is radial, 3 P c / (2 pi r^2), with c the cosine of the angle to the force. The
    displacement is P / (4 pi mu r) times 2 c radially and the sine of the angle normal to it
    (Johnson, Contact Mechanics (1985), section 3.2). Equal springs in all directions that do the
    same work have, for a normal n,

        k = 12 mu c^2 |n r| / (r (1 + 3 c^2))    with the unit vector r from the origin
    """
    facets = np.vstack([mesh.facets[name] for name in ("bottom", "sides")])
    points, normals = facet_points(mesh, facets), facet_normals(mesh, facets).reshape(-1, 3)
    away = np.linalg.norm(points, axis=1)
    outward = points / away[:, None]
    squared = outward[:, 2] ** 2
    across = np.abs((outward * normals).sum(axis=1))
    k = 12 * body.solid.shear_modulus * squared * across / (away * (1 + 3 * squared))
    return Support(facets=facets, stiffness=k, absorbed=np.zeros_like(k))
