"""Tetrahedral meshes of closed surfaces by fTetWild (Hu et al. 2020, doi 10.1145/3386569.3392385).

The mesher varies between runs, crashes on invalid input, hangs on some sizes, and returns nothing
for bodies thinner than its envelope. Its input and result are therefore checked, it runs in a
separate process with a time limit, and results are cached on disk.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import replace
from importlib.util import find_spec
from types import MappingProxyType

import numpy as np

from meshes import cache, subprocess_call
from meshes.facets import tag_boundary
from meshes.shapes.structured import Grading, extrude
from meshes.surface.repair import check, repair
from meshes.surface.triangulation import Surface, areas_of, n_pieces, thinnest, volume
from meshes.surface.winding import join, winding_number
from meshes.tetmesh import MeshError, TetMesh, boundary_facets, corner_volumes
from meshes.typing import Floats
from meshes.volume.quality import dihedral_angles
from meshes.volume.smoothing import Sizing, smooth

log = logging.getLogger(__name__)

EPSILON = 0.05  # of h: largest distance of the mesh from the surface, its envelope
SHARPEST = 5.0  # degrees: least acceptable dihedral angle
REST = "tissue"  # name of the region outside inner surfaces


def tetrahedralise(
    surface: Surface,
    h: float,
    *,
    inner: Mapping[str, Surface] = MappingProxyType({}),
    sizing: Sizing | None = None,
    timeout: float = 600.0,
) -> TetMesh:
    """Fill a closed surface with four-node tetrahedra, with facets on the surfaces inside it.

    Parameters
    ----------
    h : float, m, target edge length
    inner : region name -> closed surface inside the outer one, or cut at the same plane
    sizing : function of points (n, 3) that returns target edge lengths (n,) in m; None for h
        everywhere
    timeout : float, s, limit for the mesher

    Returns
    -------
    TetMesh with its facets in the set `surface`. With inner surfaces, region 0 is outside them, and
    each has a named region, from 1.

    Raises a MeshError if the surface is not sound, if h or a size is out of range, or if the mesher
    fails, takes too long or returns a bad mesh.
    """
    check(surface)
    check_edge_length(surface, "h", h)
    epsilon = _envelope(surface, h, inner.values())
    if not 0 < timeout < np.inf:
        raise MeshError(f"timeout = {timeout} s must be finite and above 0")
    grid = _size_grid(surface, h, sizing)
    whole = join([surface, *inner.values()])
    inputs = {
        "points": whole.points, "triangles": whole.triangles,
        "h": grid["grid_sizes"].max(),  # sizes above it are not reached
        "epsilon": np.array(epsilon / surface.diagonal), **grid,
    }  # fmt: skip
    name = cache.key("tetrahedralise 3", *(inputs[part] for part in sorted(inputs)))
    entry = cache.load(name) or {}
    is_cached = {"points", "tets"} <= entry.keys()
    raw = (entry["points"], entry["tets"]) if is_cached else _run(inputs, timeout)
    mesh = _with_regions(_checked_result(surface, epsilon, *raw), inner)
    if is_cached:
        return mesh
    mesh = smooth(mesh, sizing)
    cache.store(name, {}, {"points": mesh.points, "tets": mesh.tets})
    return mesh


def graded_sizing(h: float, grading: Grading) -> Sizing:
    """Return a sizing function: h within `grading.radius` of the origin, growing to `coarsest`."""
    slope = float(np.log(grading.growth))

    def sizes(points: Floats) -> Floats:
        beyond = np.maximum(np.linalg.norm(points, axis=1) - grading.radius, 0.0)
        return np.minimum(h + slope * beyond, max(h, grading.coarsest))

    return sizes


def _envelope(surface: Surface, h: float, inner: Collection[Surface]) -> float:
    """Largest distance in m of a mesh from its surfaces; smaller ones take longer if curved."""
    thickness, diagonal = thinnest(surface), surface.diagonal
    of_thickness = 0.1  # of the body, which a larger envelope would swallow
    of_inner = 0.025  # of the thickness of an inner surface, whose volume may change by 2 %
    of_diagonal = 1e-4  # below it, the mesher takes minutes to hours
    most, least = of_thickness * thickness, of_diagonal * diagonal
    if most < least:
        raise MeshError(
            f"the body is {1e3 * thickness:.3g} mm thick and {1e3 * diagonal:.3g} mm long, too "
            f"thin for the mesher, whose limit is 1:{of_thickness / of_diagonal:g}; use "
            "`meshes.sheet` or `meshes.block`"
        )
    return max(min([EPSILON * h, most, *(of_inner * thinnest(each) for each in inner)]), least)


def check_edge_length(surface: Surface, name: str, length: float) -> None:
    """Refuse a length in m above the longest side of the body, or below a thousandth of it."""
    longest = float(np.ptp(surface.points, axis=0).max())
    if not 1e-3 * longest <= length <= longest:
        raise MeshError(f"{name} = {length} m must be from {1e-3 * longest:.2g} to {longest:.2g} m")


def _size_grid(surface: Surface, h: float, sizing: Sizing | None) -> dict[str, np.ndarray]:
    """Background mesh around the body, with the target edge length (n,) at each point."""
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    pad = 0.05 * (high - low).max()
    grid_cells = 32  # along the longest side of the background grid of sizes
    cells = np.maximum(2, np.ceil(grid_cells * (high - low) / (high - low).max())).astype(int)
    cells = cells if sizing else np.full(3, 2)
    lines = [np.linspace(a - pad, b + pad, n + 1) for a, b, n in zip(low, high, cells, strict=True)]
    grid = extrude(*lines, order=1)
    sizes = np.full(len(grid.points), float(h))
    if sizing:
        sizes = np.asarray(sizing(grid.points), np.float64)
        if sizes.shape != (len(grid.points),) or not np.isfinite(sizes).all():
            raise MeshError(
                f"sizing returned shape {sizes.shape}; return one finite length per point"
            )
        check_edge_length(surface, "least size", float(sizes.min()))
        sizes = np.minimum(sizes, (high - low).max())
    expected = (corner_volumes(grid.points, grid.tets) / sizes[grid.tets].mean(axis=1) ** 3).sum()
    expected *= 8.5 * volume(surface) / np.prod(high - low + 2 * pad)
    most_tetrahedra = 1_000_000
    if expected > most_tetrahedra:
        raise MeshError(
            f"the mesh would have at least {expected:.2g} tetrahedra, more than the limit of "
            f"{most_tetrahedra:,}; use larger elements"
        )
    return {"grid_points": grid.points, "grid_tets": grid.tets, "grid_sizes": sizes}


def _run(inputs: dict[str, np.ndarray], timeout: float) -> tuple[Floats, np.ndarray]:
    """Run the mesher in a separate process."""
    if find_spec("pytetwild") is None:
        raise MeshError(
            "filling a surface needs the package pytetwild, which has no wheel for Intel Macs; "
            "install it, or give a file with a volume mesh"
        )
    try:
        return subprocess_call.call(mesh_by_tetwild, inputs, timeout=timeout)
    except TimeoutError:
        raise MeshError(
            f"the mesher was stopped after {timeout:g} s; use larger elements or a longer timeout"
        ) from None
    except Exception as error:
        raise MeshError(f"the mesher failed: {error}; simplify or smooth the surface") from None


def mesh_by_tetwild(inputs: Mapping[str, np.ndarray]) -> tuple[Floats, np.ndarray]:
    """Return the points and tetrahedra of the mesher, which may crash or hang, and writes files."""
    from pytetwild import tetrahedralize

    points, tets = tetrahedralize(
        inputs["points"],
        inputs["triangles"].astype(np.int32),
        edge_length_abs=float(inputs["h"]),
        epsilon=float(inputs["epsilon"]),
        vtk_ordering=True,
        bg_vertices=inputs["grid_points"],
        bg_tets=inputs["grid_tets"].astype(np.int32),
        bg_values=inputs["grid_sizes"],
    )
    return points, tets.astype(np.int64)


def _with_regions(mesh: TetMesh, inner: Mapping[str, Surface]) -> TetMesh:
    """The mesh with a region for each inner surface, from 1: that of the smallest surface whose
    winding number about the middle of a tetrahedron is above 1/2.
    """
    if not inner:
        return mesh
    middles = mesh.points[mesh.tets].mean(axis=1)
    region = np.zeros(len(mesh.tets), np.int64)
    volumes, enclosed = corner_volumes(mesh.points, mesh.tets), [volume(s) for s in inner.values()]
    inner_volume_error = 0.02  # relative to the volume within a surface
    for k in np.argsort(enclosed)[::-1].tolist():
        name, surface = list(inner.items())[k]
        inside = winding_number(surface, middles) > 0.5
        region[inside] = k + 1
        ratio = volumes[inside].sum() / enclosed[k]
        if not abs(ratio - 1) <= inner_volume_error:
            raise MeshError(
                f"the region {name} has {100 * ratio:.3g} % of the volume within its surface, a "
                f"difference above {100 * inner_volume_error:g} %; use smaller elements"
            )
    return replace(mesh, region=region, region_names=dict(enumerate([REST, *inner])))


def _checked_result(surface: Surface, epsilon: float, points: Floats, tets: np.ndarray) -> TetMesh:
    """The mesh, checked to fill the surface and to have no bad element."""
    if not len(tets):
        raise MeshError("the mesher returned no tetrahedra; give a thicker body")
    used, numbers = np.unique(tets, return_inverse=True)
    mesh = tag_boundary(TetMesh(points=points[used], tets=numbers.reshape(-1, 4)))
    boundary = boundary_facets(mesh.tets)
    outside, _ = repair(mesh.points, boundary)  # refuses open and crowded edges
    if (n := n_pieces(outside)) != 1 or len(outside.triangles) != len(boundary):
        raise MeshError(
            f"the boundary of the mesh has {n} pieces instead of one; smooth the surface"
        )
    enclosed = volume(surface)
    ratio = corner_volumes(mesh.points, mesh.tets).sum() / enclosed
    volume_error = 0.005  # relative to the volume within the surface
    lost_shell = 0.3  # of the volume between surface and envelope that straight facets may cut off
    limit = volume_error + lost_shell * epsilon * areas_of(surface).sum() / enclosed
    if not abs(ratio - 1) <= limit:
        raise MeshError(
            f"the mesh has {100 * ratio:.2f} % of the volume within the surface, a difference "
            f"above {100 * limit:.2g} %; use smaller elements"
        )
    angles = dihedral_angles(mesh).min(axis=1)
    if not angles.min() >= SHARPEST:
        raise MeshError(
            f"{(angles < SHARPEST).sum():,} tetrahedra have dihedral angles below {SHARPEST:g} "
            f"degrees, down to {angles.min():.2g} degrees; smooth the surface or use smaller "
            "elements"
        )
    log.info("%d tetrahedra, least dihedral angle %.1f degrees", len(mesh.tets), angles.min())
    return mesh
