"""Import of a body from a surface or mesh file, placed under the device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes.facets import geometry, tag_boundary, visible_from_above
from meshes.files.mesh_files import UNITS, Contents, mesh_of, read_contents, scale_of
from meshes.reading import PathLike
from meshes.shapes.structured import Grading
from meshes.surface.alignment import (
    align,
    clip_to_box,
    cut_to_box,
    on_planes,
    rotation_to_z,
    shift_to_origin,
)
from meshes.surface.repair import check, in_mm, repair
from meshes.surface.triangulation import Surface, compact, volume
from meshes.surface.winding import check_inside
from meshes.tetmesh import MeshError, TetMesh, boundary_facets, corner_volumes
from meshes.volume.quality import check_one_body, dihedral_angles, edge_lengths
from meshes.volume.tetrahedralise import (
    EPSILON,
    REST,
    check_edge_length,
    graded_sizing,
    tetrahedralise,
)

FINE_RADIUS = 30e-3  # m about the middle of the palm, within which elements have the size h
GROWTH = 1.25  # of elements beyond it: size ratio of neighbours

Say = Callable[[str], None]
Progress = Callable[[str, float], None]


def body_from_file(
    path: PathLike,
    h: float,
    *,
    unit: str = "m",
    up: str = "+z",
    inner: Sequence[PathLike] = (),
    clip: Sequence[float] | None = None,
    keep_largest: bool = False,
    cap: bool = False,
    timeout: float = 600.0,
    say: Say = lambda sentence: None,
    progress: Progress = lambda phase, share: None,
) -> TetMesh:
    """Return the tetrahedra of a body in a file, placed under the device, with named boundaries.

    A surface is repaired, rotated so that `up` becomes +z, and moved so that the middle of its palm
    is the origin. It is then cut to `clip` and filled with tetrahedra of size h, which grow beyond
    30 mm from the middle. A mesh is checked and rotated, and moved only if the origin does not lie
    on its top.

    Parameters
    ----------
    path : surface or mesh file in one of `FORMATS`
    h : float, m, edge length in the middle of the palm
    unit : unit of the coordinates in the file: m, cm, mm, um or in
    up : axis of the file that points to the device: +x, -x, ... -z
    inner : files of closed surfaces inside it, such as bones. Each becomes a region with the name
        of its file.
    clip : smallest and largest x, then y, m from the middle of the palm
    keep_largest : keep only the largest of several separate pieces
    cap : close holes of a surface whose edges lie in a plane, such as an open wrist
    timeout : float, s, limit for the mesher
    say : receives a sentence about each defect and change
    progress : receives the name of each phase, and 0

    Returns
    -------
    TetMesh with its regions, or `tissue` and one region per inner surface. Its facet sets are those
        of the file, `surface`, `top` (visible from above), `cut` (the sides of the clip) and
        `bottom`.

    Raises a MeshError if the file cannot be read or repaired, if its size is not that of a hand, or
    if the mesher fails.
    """
    progress(f"reading {Path(path).name}", 0.0)
    scale, contents = scale_of(unit), read_contents(path)
    for note in contents.notes:
        say(note)
    _check_size_of_hand(path, contents, unit)
    if len(contents.tets):
        if clip is not None or inner:
            raise MeshError(
                f"{path} is a mesh, which cannot be clipped or get inner surfaces; give its surface"
            )
        say(f"read {len(contents.tets):,} tetrahedra with {contents.tets.shape[1]} nodes each")
        mesh = mesh_of(replace(contents, points=contents.points @ rotation_to_z(up).T), scale)
        mesh = check_one_body(mesh, keep_largest=keep_largest, say=say)
        return _with_summary(_with_sides(_on_top(mesh, say)), say)
    surface = _sound_surface(contents, scale, up, say, keep_largest=keep_largest, cap=cap)
    bones = _inner_surfaces(inner, surface, unit=unit, up=up, say=say)
    surface, shift = align(surface)
    bones = {name: replace(bone, points=bone.points + shift) for name, bone in bones.items()}
    say(f"moved by {in_mm(shift)}, so that the middle of the palm is the origin")
    planes = []
    if clip is not None:
        surface, notes = clip_to_box(surface, clip)
        for note in notes:
            say(note)
        check(surface)
        planes = list(clip)
        bones = {name: cut for name, bone in bones.items() if (cut := cut_to_box(bone, clip)[0])}
    progress("filling it with tetrahedra", 0.0)
    check_edge_length(surface, "h", h)
    sizing = graded_sizing(h, Grading(radius=FINE_RADIUS, growth=GROWTH, coarsest=2 * h))
    mesh = tetrahedralise(surface, h, inner=bones, sizing=sizing, timeout=timeout)
    return _with_summary(_with_sides(mesh, planes, 2 * EPSILON * h), say)


def _inner_surfaces(
    paths: Sequence[PathLike], outer: Surface, *, unit: str, up: str, say: Say
) -> dict[str, Surface]:
    """Surfaces inside another one, repaired and checked, by the names of their files."""
    names = [REST, *(Path(path).stem for path in paths)]
    if twice := [str(path) for path in paths if names.count(Path(path).stem) > 1]:
        raise MeshError(
            f"{twice[-1]} would be a second region '{Path(twice[-1]).stem}'; rename the file"
        )
    surfaces: dict[str, Surface] = {}
    for path in paths:
        try:
            contents = read_contents(path)
            if len(contents.tets):
                raise MeshError(f"{path} is a mesh; give a closed surface")
            surfaces[Path(path).stem] = _sound_surface(contents, scale_of(unit), up, say)
        except MeshError as error:
            raise MeshError(f"{path}: {str(error).removeprefix(f'{path} ')}") from None
    if surfaces:
        check_inside(outer, surfaces)
    return surfaces


def _check_size_of_hand(path: PathLike, contents: Contents, unit: str) -> None:
    """Check that a body has the size of a hand, or of part of one, in the unit of its file."""
    used = contents.points[np.unique(contents.tets if len(contents.tets) else contents.triangles)]
    size = float(np.linalg.norm(np.ptp(used, axis=0)))
    smallest, largest = 5e-3, 1.0  # m: diagonal of a hand or part of one
    if smallest < size * scale_of(unit) < largest:
        return
    typical = 0.1  # m, likewise
    likely = min(UNITS, key=lambda name: abs(np.log(max(size, 1e-300) * UNITS[name] / typical)))
    raise MeshError(
        f"{path} is {1e3 * size * scale_of(unit):.3g} mm from corner to corner if its unit is "
        f"{unit}, but a hand or part of one has {1e3 * smallest:g} to {1e3 * largest:g} mm; give "
        f'its unit, probably {likely} (--unit {likely}, or unit = "{likely}" in [body])'
    )


def _sound_surface(
    contents: Contents,
    scale: float,
    up: str,
    say: Say,
    *,
    keep_largest: bool = False,
    cap: bool = False,
) -> Surface:
    """Surface in a file, in m, rotated, repaired and checked."""
    say(f"read {len(contents.triangles):,} triangles and {len(contents.points):,} points")
    points = contents.points * scale @ rotation_to_z(up).T
    surface, notes = repair(points, contents.triangles, keep_largest=keep_largest, cap=cap)
    for note in notes:
        say(note)
    check(surface)
    size = " x ".join(f"{1e3 * side:.0f}" for side in np.ptp(surface.points, axis=0))
    say(f"closed surface of {size} mm, {1e6 * volume(surface):.1f} cm3")
    return surface


def _on_top(mesh: TetMesh, say: Say) -> TetMesh:
    """The mesh, moved like a surface if the origin is not on its top."""
    shift = shift_to_origin(compact(mesh.points, boundary_facets(mesh.tets)[:, :3]))
    if not shift.any():
        return mesh
    say(f"moved by {in_mm(shift)}, so that its top is at the origin")
    unmoved = None if mesh.unmoved is None else mesh.unmoved + shift
    return replace(mesh, points=mesh.points + shift, unmoved=unmoved)


def _with_sides(mesh: TetMesh, planes: Sequence[float] = (), tolerance: float = 0.0) -> TetMesh:
    """The mesh with the facet sets `surface`, `top`, `cut` and `bottom` that it does not have."""
    visible = visible_from_above(mesh)
    sides = {"top": visible}
    if planes:
        is_cut = on_planes(planes, tolerance, *geometry(mesh, boundary_facets(mesh.tets)))
        sides = {"cut": is_cut, "top": visible & ~is_cut}
    tagged = tag_boundary(mesh, rest="bottom", **sides)
    return replace(mesh, facets={**tagged.facets, **mesh.facets})


def _with_summary(mesh: TetMesh, say: Say) -> TetMesh:
    volumes = corner_volumes(mesh.points, mesh.tets)
    numbers = np.unique(mesh.region).tolist()
    for number in numbers if len(numbers) > 1 or mesh.region_names else []:
        name, own = mesh.region_names.get(number, number), mesh.region == number
        say(f"region {name}: {own.sum():,} tetrahedra, {1e6 * volumes[own].sum():.3g} cm3")
    say(
        f"{len(mesh.tets):,} tetrahedra, {1e6 * volumes.sum():.1f} cm3, median edge "
        f"{1e3 * np.median(edge_lengths(mesh)):.1f} mm, least dihedral angle "
        f"{dihedral_angles(mesh).min():.1f} degrees"
    )
    return mesh
