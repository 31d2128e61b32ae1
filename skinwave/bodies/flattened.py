"""Flat body of infinite width with the strata that a body has under the focus."""

from dataclasses import replace
from functools import lru_cache
from math import inf

import numpy as np

from meshes import TetMesh
from meshes.facets import heights_over
from meshes.tetmesh import FACES
from simple_model.layers.material import Material
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build, build
from skinwave.bodies.parts import FLAT, Layer
from skinwave.typing import Floats, Ints


def flatten(body: Body, places: Floats, h: float, rigid: float = 100.0) -> Body:
    """Return a flat body without reflecting sides, with the strata of a body under the focus.

    Solids become a slab with absorbing sides. Palms and discs are everywhere as deep as in their
    middle. In bodies with regions, the strata are those on the vertical line through the first of
    the places (n, 2) in m, in a mesh with elements of h in m. A stratum `rigid` times as stiff as
    the one above it, such as bone, is the clamped base. The slab contains all places. A sheet
    keeps its sides, because the sides of a stretched sheet cannot absorb. Raises a ValueError if
    the first place is not above the body.
    """
    if body.of_kind.is_plate:
        flat = replace(body.mounting, curl_x=0.0, curl_y=0.0)
        return replace(body, mounting=flat, placement=FLAT)
    width, height = np.maximum([body.width, body.height], 2 * np.abs(places).max(axis=0)).tolist()
    base, stiffness, depth = body.base, body.base_stiffness, body.depth
    layers, material = body.layers, body.material
    if "regions" in body.of_kind.keys:
        column = _column(body, places[0], h)
        moduli = [solid.shear_modulus + solid.fast_modulus for _, solid in column]
        held = [k for k in range(1, len(column)) if moduli[k] > rigid * moduli[k - 1]]
        if held:
            column, base, stiffness = column[: held[0]], "clamped", 0.0
        depth, material = sum(thickness for thickness, _ in column), column[-1][1]
        layers = tuple(Layer(thickness=part, material=solid) for part, solid in column[:-1])
    return Body(
        width=width, height=height, depth=depth, material=material, layers=layers, base=base,
        base_stiffness=stiffness, sides="absorbing",
    )  # fmt: skip


@lru_cache(maxsize=8)
def build_without_layers(body: Body, h: float) -> Build:
    """Return a body meshed without its layers, with elements of h in m."""
    return build(replace(body, layers=()), h)


def _column(
    body: Body, place: Floats, h: float, thinnest: float = 1e-6
) -> list[tuple[float, Material]]:
    """Thickness in m and material of each stratum below a place (2,) in m, down to a gap. Pieces of
    the vertical line shorter than `thinnest` in m are round-off.
    """
    built = build_without_layers(body, h)
    upper, lower, region = _crossed(built.mesh, place, thinnest)
    if not len(upper):
        x, y = 1e3 * place
        raise ValueError(
            f"the focus starts at ({x:g}, {y:g}) mm, which is not above the body; move the path or "
            "the body"
        )
    pieces: list[tuple[float, Material]] = []
    end = 0.0
    tops, bottoms = (upper[0] - upper).tolist(), (upper[0] - lower).tolist()
    for top, bottom, number in zip(tops, bottoms, region.tolist(), strict=True):
        if top > end + thinnest:
            break
        strata = body.strata if number == 0 else ((0.0, built.material[number]),)
        starts = [start for start, _ in strata]
        for (start, solid), below in zip(strata, [*starts[1:], inf], strict=True):
            thickness = min(bottom, below) - max(end, start)
            if thickness > thinnest:
                if pieces and pieces[-1][1] == solid:
                    thickness += pieces.pop()[0]
                pieces.append((thickness, solid))
        end = max(end, bottom)
    return pieces


def _crossed(mesh: TetMesh, place: Floats, thinnest: float) -> tuple[Floats, Floats, Ints]:
    """Heights in m at which a vertical line enters and leaves tetrahedra, and their regions, from
    the top downwards."""
    faces = mesh.points[mesh.tets[:, FACES[:, :3]]].reshape(-1, 3, 3)
    heights = heights_over(faces, place).reshape(-1, 4)
    upper, lower = heights.max(axis=1), np.where(heights > -inf, heights, inf).min(axis=1)
    crossed = np.flatnonzero(upper - lower > thinnest)
    crossed = crossed[np.argsort(-upper[crossed], kind="stable")]
    return upper[crossed], lower[crossed], mesh.region[crossed]
