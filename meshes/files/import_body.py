"""Import of a body from a surface or mesh file, placed under the device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes.facets import geometry, seen_from_above, tag_boundary
from meshes.files import mesh_files, surface_files
from meshes.reading import PathLike
from meshes.shapes.structured import Grading
from meshes.surface.alignment import aligned, clipped, cut_to, on_planes
from meshes.surface.repair import check, repaired
from meshes.surface.triangulation import Surface, volume
from meshes.surface.winding import check_inside
from meshes.tetmesh import MeshError, TetMesh, boundary_facets, corner_volumes
from meshes.volume.inner import REST
from meshes.volume.quality import dihedral_angles, edge_lengths
from meshes.volume.tetrahedralise import EPSILON, check_size, graded, tetrahedralise

FINE_RADIUS, GROWTH, COARSEST = 30e-3, 1.25, 2.0  # m about the palm's middle; elements; of h
SMALLEST, LARGEST = 5e-3, 2.0  # m: diagonal of what can be a hand, or part of one

Say = Callable[[str], None]
Progress = Callable[[str, float], None]


def _unsaid(*said: object) -> None:
    """Progress that nobody follows."""


def body_from_file(
    path: PathLike,
    h: float,
    *,
    unit: str = "m",
    up: str = "+z",
    inner: Sequence[PathLike] = (),
    clip: Sequence[float] | None = None,
    timeout: float = 600.0,
    say: Say = _unsaid,
    progress: Progress = _unsaid,
) -> TetMesh:
    """Tetrahedra of the body in a file, placed under the device, with its boundary named.

    A surface (`.stl .ply .obj .glb .vtp`) is repaired where that takes no guess, turned so that
    `up` is +z, moved so that the middle of its palm is the origin and its top there is z = 0,
    cut to `clip` and filled with tetrahedra of h that grow beyond 30 mm from the middle. A mesh
    (`.vtu .msh .inp .vtk .mesh`) is taken as it is.

    Parameters
    ----------
    path : file of a surface or mesh
    h : float, metre, edge length aimed at in the middle of the palm.
    unit : of the coordinates in the file: m, cm, mm, um or in.
    up : axis of the file that points to the device: +x, -x, ... -z.
    inner : files of closed surfaces inside that of a surface file, in its frame and unit, such as
        those of bones, each of which becomes a region by the name of its file
    clip : least and greatest x, least and greatest y, metre from the middle of the palm.
    timeout : float, second, of the mesher.
    say : gets a sentence on each thing that was found or done.
    progress : gets the phase, and 0.

    Returns
    -------
    TetMesh with the facet sets `surface`, `top` (seen from above), `cut` (the planes of the clip)
    and `bottom`, the rest; a mesh that has one of these names keeps its own. Its regions are those
    of a mesh, or `tissue` and one for each inner surface

    Raises
    ------
    MeshError
        If the file cannot be read, what is wrong with its surface cannot be repaired, or the mesher
        takes longer.
    """
    progress(f"reading {Path(path).name}", 0.0)
    if Path(path).suffix.lower() in mesh_files.VOLUME_FORMATS:
        if clip is not None or up != "+z" or inner:
            raise MeshError(
                f"{path} is a mesh already; only surfaces can be clipped, turned, and filled "
                "around inner ones"
            )
        mesh = mesh_files.read(path, unit=unit)
        say(f"read {len(mesh.tets):,} tetrahedra of {(4, 10)[mesh.order - 1]} nodes")
        return _described(_with_sides(mesh), say)
    surface = sound_surface(path, unit=unit, up=up, say=say)
    bones = _inner_surfaces(inner, surface, unit=unit, up=up, say=say)
    surface, shift = aligned(surface)
    bones = {name: replace(bone, points=bone.points + shift) for name, bone in bones.items()}
    say(
        "moved by ({:.1f}, {:.1f}, {:.1f}) mm, the palm's middle to the origin".format(*1e3 * shift)
    )
    planes = []
    if clip is not None:
        surface, said = clipped(surface, clip)
        for sentence in said:
            say(sentence)
        check(surface)
        planes = list(clip)
        bones = {name: part for name, bone in bones.items() if (part := cut_to(bone, clip)[0])}
    progress("filling it with tetrahedra", 0.0)
    check_size(surface, "h", h)
    grading = Grading(radius=FINE_RADIUS, growth=GROWTH, coarsest=COARSEST * h)
    mesh = tetrahedralise(surface, h, inner=bones, sizing=graded(h, grading), timeout=timeout)
    return _described(_with_sides(mesh, planes, 2 * EPSILON * h), say)


def _inner_surfaces(
    paths: Sequence[PathLike], outer: Surface, *, unit: str, up: str, say: Say
) -> dict[str, Surface]:
    """Surfaces inside another by the names of their files, repaired and checked."""
    names = [REST, *(Path(path).stem for path in paths)]
    if twice := [str(path) for path in paths if names.count(Path(path).stem) > 1]:
        raise MeshError(
            f"{twice[-1]} would be a second region '{Path(twice[-1]).stem}'; rename the file, "
            "whose name is that of its region"
        )
    found: dict[str, Surface] = {}
    for path in paths:
        try:
            found[Path(path).stem] = sound_surface(path, unit=unit, up=up, say=say)
        except MeshError as error:
            raise MeshError(f"{path}: {str(error).removeprefix(f'{path} ')}") from None
    if found:
        check_inside(outer, found)
    return found


def sound_surface(path: PathLike, *, unit: str = "m", up: str = "+z", say: Say) -> Surface:
    """Surface in a file, repaired and checked.

    Parameters
    ----------
    path, unit, up, say : as for `body_from_file`

    Returns
    -------
    Surface, metre

    Raises
    ------
    MeshError
        If it cannot be read or repaired, or is of a size that no hand has.
    """
    raw = surface_files.read_surface(path, unit=unit, up=up)
    if not SMALLEST < raw.diagonal < LARGEST:
        raise MeshError(
            f"{path} is {1e3 * raw.diagonal:.3g} mm from corner to corner with its unit taken as "
            f"{unit}, and must be from {1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm; pass another "
            "unit"
        )
    say(f"read {len(raw.triangles):,} triangles and {len(raw.points):,} points")
    surface, said = repaired(raw.points, raw.triangles)
    for sentence in said:
        say(sentence)
    check(surface)
    size = " x ".join(f"{1e3 * side:.0f}" for side in np.ptp(surface.points, axis=0))
    say(f"closed surface of {size} mm, {1e6 * volume(surface):.1f} cm3")
    return surface


def _with_sides(mesh: TetMesh, planes: Sequence[float] = (), tolerance: float = 0.0) -> TetMesh:
    """The mesh with `surface`, `top`, `cut` and `bottom`, of which it keeps what it has."""
    seen = seen_from_above(mesh)
    sides = {"top": seen}
    if planes:
        is_cut = on_planes(planes, tolerance)(*geometry(mesh, boundary_facets(mesh.tets)))
        sides = {"cut": is_cut, "top": seen & ~is_cut}
    made = tag_boundary(mesh, rest="bottom", **sides)
    return replace(mesh, facets={**made.facets, **mesh.facets})


def _described(mesh: TetMesh, say: Say) -> TetMesh:
    volumes = corner_volumes(mesh.points, mesh.tets)
    for number, name in sorted(mesh.region_names.items()):
        own = mesh.region == number
        say(f"region {name}: {own.sum():,} tetrahedra, {1e6 * volumes[own].sum():.3g} cm3")
    say(
        f"{len(mesh.tets):,} tetrahedra, {1e6 * volumes.sum():.1f} cm3, edges of "
        f"{1e3 * np.median(edge_lengths(mesh)):.1f} mm, dihedral angles from "
        f"{dihedral_angles(mesh).min():.1f} degrees"
    )
    return mesh
