"""Mesh, material, boundary conditions and absorbing layer of a scene's body."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from scipy import sparse

from fem.added_mass import AddedMass, added_mass
from fem.assembly import LOSS_BAND, Operators, assemble
from fem.boundary import Support
from fem.load_and_probe import facet_normals, facet_points, load_operator, probe_operator
from fem.materials import Material, rayleigh_damping
from meshes import Grading, TetMesh, extrude, graded_axis, half, sheet
from meshes.files.import_body import FINE_RADIUS
from meshes.shapes.structured import check_size, round_up, with_planes
from meshes.tetmesh import Floats, Ints
from simple_model import flat_body, steady_state
from simple_model.compliance import AIR_DENSITY, Compliance, half_space, slab, thin_sheet
from skinwave.models import hands
from skinwave.scene import Body

SLAB_CELL = 3e-3  # m: two thirds of the focal spot's standard deviation
# From cell to cell along the surface and downwards, and the coarsest cell over the finest.
GROWTH, COARSEST = (1.4, 1.25), (3.0, 2.0)
# An absorbing (sponge) layer around absorbing sides; its mass-proportional damping rises with the
# square of the distance: dashpots alone reflect a quarter of a shear wave at 30 degrees. Near the
# cut-on of a slab on a rigid base, c_s/(4 depth), waves are long, and only a wide layer absorbs
# them. Its cells may grow fast. The reflection of a plane slab of 50 mm is at most 1.4 % of the
# motion at the focus at any line, that of dashpots alone 17 % (`skinwave.verify.sides`).
LAYER_WIDTH, LAYER_DRAG = 7.0, 0.35  # of the depth; of the angular frequency of cut-on
LAYER_GROWTH, LAYER_COARSEST = 1.4, 2.0  # from cell to cell; of the depth
LOWEST_CUT_ON = 80.0  # Hz: what deeper slabs carry below it is still near field at their sides
HAND_CELL = 5e-3  # m: within 1.2 % of elements of 3 mm at every probe, at a third of the cost
FINE_PALM = 2e-3  # m: elements of a palm with thin layers, 300,000 dofs; finer ones on request only
FINEST_HAND = 1e-3  # m: finer elements of a hand exceed the limits of its mesher
NORMAL_PATCH = 3e-3  # m, standard deviation: two thirds of the focal spot's
THINNEST = 0.5  # of an element that does not follow layers: the thinnest of them that it resolves
COMPARED = (
    4 / 3
)  # of a size that is asked for: a mesh that it is compared with may be so much coarser
SHEET_CELLS = 60  # along the shorter side: f1 within 0.3 %, deflection within 0.6 %
# A sheet bends like one of this relative thickness with the same bending stiffness and mass per
# area, and thicker elements are far more accurate: thin ones lock.
SHEET_THICKNESS = 0.01


EXACT = {"flat-body": flat_body, "flat-body-harmonic": steady_state}  # by wavenumber integral


@dataclass(frozen=True, kw_only=True, eq=False)
class Build:
    """Meshed body: arguments of `fem.assemble`; `drag` (m,) in 1/s of the absorbing layer, or None;
    `support` of a hand, or None.
    """

    mesh: TetMesh
    material: dict[int, Material]
    fixed: dict[str, str]
    absorbing: Ints | None
    drag: Floats | None = None
    support: Support | None = None
    symmetry: str = ""


def build(
    body: Body, h: float | None = None, symmetry: str = "", thickness: float | None = None
) -> Build:
    """Mesh a body with elements of h in metre, or as fine as the scene set needs.

    Parameters
    ----------
    symmetry : axes, of "xy", across whose middle plane the load is its own mirror image: only the
        part with positive coordinates is meshed, with symmetry conditions on these planes
    thickness : of the equivalent of a sheet in metre, `SHEET_THICKNESS` of its shorter side if not
        given, and no less than the sheet's own

    Raises
    ------
    ValueError
        If the body is "none", or would have too many degrees of freedom.
    """
    size, drag = _checked(body, h or default_size(body), COMPARED), None
    if body.kind == "sheet":
        thickness = thickness or SHEET_THICKNESS * min(body.width, body.height)
        thickness = max(body.depth, thickness)
        mesh = sheet(body.width, body.height, thickness, size)
        materials: Sequence[Material] = [bending_equivalent(body.solid, body.depth / thickness)]
    else:
        starts, materials = zip(*body.strata, strict=True)
        if body.kind == "slab":
            mesh = extrude(*slab_lines(body, size))
            depth = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
        else:
            mesh = hands.hand(body, size)
            depth = hands.depths(mesh)
        mesh = replace(mesh, region=np.searchsorted(starts[1:], depth, side="right"))
    ends = {"bottom": body.base, "sides": body.sides}
    ends = {name: end for name, end in ends.items() if len(mesh.facets.get(name, ()))}
    fixed = {name: "xyz" for name, end in ends.items() if end == "clamped"}
    for axis in symmetry:
        mesh = half(mesh, axis)
        fixed[f"mirror_{axis}"] = axis
    if has_layer(body):
        drag = layer_drag(body, mesh)
    support = hands.support(body, mesh) if body.kind in hands.KINDS else None
    if body.is_held and "xyz" not in fixed.values() and not (support and support.stiffness.any()):
        raise ValueError(
            f"the sides are clamped, but {body.file} has no facets 'sides' or 'cut' to fix; clamp "
            "its base, or name them in the file"
        )
    mesh = replace(mesh, points=body.placement(mesh.points))
    leaky = [mesh.facets[name] for name, end in ends.items() if end == "absorbing"]
    return Build(
        mesh=mesh,
        material=dict(enumerate(materials)),
        fixed=fixed,
        absorbing=np.vstack(leaky) if leaky else None,
        drag=drag,
        support=support,
        symmetry=symmetry,
    )


def operators(build: Build) -> Operators:
    """Stiffness, damping and mass of a meshed body."""
    return assemble(
        build.mesh,
        build.material,
        fixed=build.fixed,
        absorbing=build.absorbing,
        drag=build.drag,
        support=build.support,
    )


def air(body: Body, build: Build, operators: Operators) -> AddedMass | None:
    """Added mass of the air around a meshed sheet, for `fem.reduce`; None in vacuum.

    Raises
    ------
    ValueError
        If the sheet has no frame: air would flow around a free edge.
    """
    if not body.air:
        return None
    if body.sides != "clamped":
        raise ValueError(
            f"elements have air around a sheet in a frame, not with {body.sides} sides; clamp "
            "them, leave air out, or use --model flat-body"
        )
    by_mass, _ = rayleigh_damping(body.solid.loss_factor, LOSS_BAND)
    sides = body.placement.rotation.T[:2]
    return added_mass(
        build.mesh, operators, AIR_DENSITY, axes=sides, mirrored=build.symmetry, rate=by_mass
    )


def vacuum_only(body: Body, model: str) -> None:
    """Refuse a body with air, whose added-mass operator is dense.

    Raises
    ------
    ValueError
        If it has air.
    """
    if body.air:
        raise ValueError(
            f"{model} solves sparse equations, and the added mass of air is a dense operator; "
            "leave air out, or use --model fem, fem-nonlinear or flat-body"
        )


def surface_load(build: Build) -> tuple[sparse.csr_array, Floats]:
    """Load operator P (3 n, k): nodal forces in N of the pressure in Pa on a surface across the
    beam, and the points (k, 3) in metre where it is taken.

    Radiation pressure goes with the square of the cosine of incidence: once for the beam that is
    spread over a sloping surface, and once for the momentum that is reflected along its normal.
    """
    cosine = np.maximum(facet_normals(build.mesh)[:, 2], 0.0)
    return load_operator(build.mesh) * cosine**2, facet_points(build.mesh)


def surface_motion(body: Body, build: Build, probes: Floats) -> sparse.csr_array:
    """Probe operator S (p, 3 n): displacement into a meshed body, in metre, at probes (p, 2) in
    metre.

    The surface in a file is made of flat triangles, at whose edges its own normals jump: there the
    direction into the body is that of the mean normal about a probe.
    """
    patch = NORMAL_PATCH if body.kind == "mesh" else 0.0
    return probe_operator(build.mesh, probes, patch=patch)


def check_mesh(body: Body, h: float) -> None:
    """Refuse, before anything is computed, what `build` cannot mesh with elements of h in metre.

    Raises
    ------
    ValueError
        If elements are larger than the body, or more than can be solved for.
    """
    h = _checked(body, h)
    if body.kind == "sheet":
        check_size(2 * max(1, round_up(side / (2 * h))) for side in (body.width, body.height))
    elif body.kind == "slab":
        check_size(len(line) - 1 for line in slab_lines(body, h))


def slab_lines(body: Body, h: float) -> tuple[Floats, Floats, Floats]:
    """Grid lines along x, y and z: fine where the focus travels, with any absorbing layer."""
    along = Grading(radius=FINE_RADIUS, growth=GROWTH[0], coarsest=COARSEST[0] * h)
    halves = [graded_axis(side / 2, h, along) for side in (body.width, body.height)]
    if has_layer(body):
        halves = [np.concatenate([half, half[-1] + _layer_line(body, half)]) for half in halves]
    x, y = (np.concatenate([-half[:0:-1], half]) for half in halves)
    return x, y, -_depth_line(body, h)[::-1]


def _depth_line(body: Body, h: float) -> Floats:
    """Grid lines of a slab from its top downwards."""
    down = Grading(radius=0.0, growth=GROWTH[1], coarsest=COARSEST[1] * h)
    return with_planes(graded_axis(body.depth, h, down), [start for start, _ in body.strata[1:]])


def cell_layers(body: Body, h: float) -> int:
    """Number of cells of h in metre through the depth of a slab."""
    return len(_depth_line(body, h)) - 1


def has_layer(body: Body) -> bool:
    """Whether an absorbing layer is meshed around a body."""
    return body.kind == "slab" and body.sides == "absorbing"


def layer_scale(body: Body) -> float:
    """Reference length of an absorbing layer, metre: the depth, at most that of `LOWEST_CUT_ON`."""
    return min(body.depth, body.solid.shear_speed / (4 * LOWEST_CUT_ON))


def _layer_line(body: Body, half: Floats) -> Floats:
    """Grid lines of the absorbing layer, from where the body ends."""
    scale = layer_scale(body)
    grading = Grading(radius=0.0, growth=LAYER_GROWTH, coarsest=LAYER_COARSEST * scale)
    first = min(LAYER_GROWTH * (half[-1] - half[-2]), grading.coarsest)
    return graded_axis(LAYER_WIDTH * scale, first, grading)[1:]


def layer_drag(body: Body, mesh: TetMesh) -> Floats:
    """Damping profile (m,) in 1/s of the absorbing layer: 0 in the body, quadratic beyond it."""
    scale, ends = layer_scale(body), np.array([body.width, body.height]) / 2
    middles = np.abs(mesh.points[mesh.tets[:, :4], :2].mean(axis=1))
    beyond = np.clip(middles - ends, 0.0, None).max(axis=1) / (LAYER_WIDTH * scale)
    return LAYER_DRAG * 2 * np.pi * body.solid.shear_speed / (4 * scale) * beyond**2


def _checked(body: Body, h: float, slack: float = 1.0) -> float:
    if body.kind == "none":
        raise ValueError("body kind 'none' has nothing to mesh; choose a sheet or a slab")
    _check_layers(body, h, slack)
    if body.kind == "mesh":
        return h
    if not isfinite(body.depth):
        exact = "use --model flat-body or " if has_exact_waves(body) else ""
        raise ValueError(f"depth_mm = inf has no mesh; {exact}give a finite depth")
    longest = max(body.width, body.height, body.depth)
    if h > longest:
        raise ValueError(
            f"elements of {1e3 * h:g} mm are larger than the body, whose longest side is "
            f"{1e3 * longest:g} mm; take smaller ones"
        )
    return h


def _check_layers(body: Body, h: float, slack: float) -> None:
    """Refuse layers that elements which do not follow them cannot resolve."""
    coarsest = coarsest_size(body)
    thin, slab = 1e3 * THINNEST * coarsest, "or a slab, whose elements follow its layers"
    if coarsest < FINEST_HAND * (1 - 1e-9):
        raise ValueError(
            f"a layer of {thin:g} mm of a {body.kind} is thinner than half of its finest elements, "
            f"{1e3 * THINNEST * FINEST_HAND:g} mm; take thicker layers, {slab}"
        )
    if h > slack * coarsest * (1 + 1e-9):
        raise ValueError(
            f"a layer of {thin:g} mm is thinner than half an element of {1e3 * h:g} mm; take "
            f"elements of {1e3 * coarsest:g} mm, thicker layers, {slab}"
        )


def default_size(body: Body) -> float:
    """Default element size of a body, metre."""
    if body.kind == "sheet":
        return min(body.width, body.height) / SHEET_CELLS
    if body.kind == "mesh":  # whose depth is that of its file
        return min(HAND_CELL, max(coarsest_size(body), FINE_PALM))
    cell = HAND_CELL if body.kind == "palm" else SLAB_CELL
    return min(cell, body.depth / 2, max(coarsest_size(body), FINE_PALM))


def coarsest_size(body: Body) -> float:
    """Coarsest element size in metre that resolves a body's layers; those of a slab follow them."""
    starts = [start for start, _ in body.strata]
    followed = body.kind not in hands.KINDS
    return np.inf if followed else float(np.diff(starts).min(initial=np.inf)) / THINNEST


def bending_equivalent(material: Material, ratio: float) -> Material:
    """Material of a thicker sheet of the same bending stiffness and mass per area; `ratio` is that
    of the thicknesses, original over equivalent.

    Bending stiffness goes with E d^3, mass per area with rho d. Valid for linear bending only.
    """
    return replace(material.scaled(modulus=ratio**3), density=material.density * ratio)


def has_exact_waves(body: Body) -> bool:
    """Whether the wavenumber integral of an infinite slab is the solution for a body, but for
    reflections from its sides.

    Without any loss a slab's resonances are unbounded.
    """
    return is_plain_layer(body) and body.solid.has_loss


def is_plain_layer(body: Body) -> bool:
    """Whether a body is a half-space or a slab on a rigid base, of one material, across the beam:
    without loss it has a wavenumber integral from rest, but no steady state.
    """
    layer = body.kind == "slab" and (body.base == "clamped" or not isfinite(body.depth))
    return layer and body.is_plain


def exact_waves(body: Body, model: str) -> Compliance:
    """Compliance of a body for a wavenumber-integral model.

    Raises
    ------
    ValueError
        If there is no body, or it has no wavenumber integral.
    """
    if not body.is_plain:
        raise ValueError(
            f"{model} takes one material that lies flat across the beam, not layers or a "
            "placement; use fem"
        )
    return compliance(body)


def compliance(body: Body) -> Compliance:
    """Compliance of an infinite body of the same section.

    Raises
    ------
    ValueError
        If there is no body, or it has no wavenumber integral.
    """
    solid = body.solid
    if body.kind == "sheet":
        return thin_sheet(solid, body.depth, air_density=AIR_DENSITY if body.air else 0.0)
    if body.kind not in ("sheet", "slab") or (body.base != "clamped" and isfinite(body.depth)):
        raise ValueError(
            "flat-body is for a sheet, a slab on a clamped base, or depth_mm = inf; use fem"
        )
    return slab(solid, body.depth) if isfinite(body.depth) else half_space(solid)
