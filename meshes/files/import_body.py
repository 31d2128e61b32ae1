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
from meshes.surface.alignment import aligned, clipped, cut_to, off_origin, on_planes, turned, turns
from meshes.surface.repair import check, in_mm, repaired
from meshes.surface.triangulation import Surface, compact, volume
from meshes.surface.winding import check_inside
from meshes.tetmesh import MeshError, TetMesh, boundary_facets, corner_volumes
from meshes.volume.quality import dihedral_angles, edge_lengths, one_body
from meshes.volume.tetrahedralise import EPSILON, REST, check_size, graded, tetrahedralise

FINE_RADIUS, GROWTH, COARSEST = 30e-3, 1.25, 2.0  # m about the palm's middle; elements; of h
SMALLEST, LARGEST = 5e-3, 1.0  # m: diagonal of what can be a hand, or part of one
TYPICAL = 0.1  # m

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
    """Tetrahedra of the body in a file, placed under the device, with its boundary named.

    A surface is repaired where that takes no guess, turned so that `up` is +z, moved so that the
    middle of its palm is the origin and its top there is z = 0, cut to `clip` and filled with
    tetrahedra of h that grow beyond 30 mm from the middle. A mesh is checked like a surface and
    turned; it is moved only if the origin is not on top of it.

    Parameters
    ----------
    path : file of a surface or mesh, of one of `FORMATS`
    h : float, metre, edge length aimed at in the middle of the palm
    unit : of the coordinates in the file: m, cm, mm, um or in
    up : axis of the file that points to the device: +x, -x, ... -z
    inner : files of closed surfaces inside it, such as bones, each of which becomes a region by the
        name of its file
    clip : least and greatest x, least and greatest y, metre from the middle of the palm
    keep_largest : keep only the largest of several separate pieces
    cap : close holes of a surface whose edges lie in a plane, such as an open wrist
    timeout : float, second, of the mesher
    say, progress : get a sentence on each thing that was found or done; the phase, and 0

    Returns
    -------
    TetMesh with the facet sets `surface`, `top` (seen from above), `cut` (the planes of the clip)
        and `bottom`, or those of the file; and its regions, or `tissue` and one for each inner
        surface

    Raises a MeshError if the file cannot be read or repaired, is of a size that no hand has, or the
    mesher fails.
    """
    progress(f"reading {Path(path).name}", 0.0)
    scale, found = scale_of(unit), read_contents(path)
    for note in found.notes:
        say(note)
    _check_plausible(path, found, unit)
    if len(found.tets):
        if clip is not None or inner:
            raise MeshError(
                f"{path} is a mesh already, which is neither clipped nor filled; save its surface"
            )
        say(f"read {len(found.tets):,} tetrahedra of {found.tets.shape[1]} nodes")
        mesh = mesh_of(replace(found, points=found.points @ turns(up).T), scale)
        mesh = one_body(mesh, keep_largest=keep_largest, say=say)
        return _described(_with_sides(_on_top(mesh, say)), say)
    surface = _sound(found, scale, up=up, keep_largest=keep_largest, cap=cap, say=say)
    bones = _inner_surfaces(inner, surface, unit=unit, up=up, say=say)
    surface, shift = aligned(surface)
    bones = {name: replace(bone, points=bone.points + shift) for name, bone in bones.items()}
    say(f"moved by {in_mm(shift)}, the palm's middle to the origin")
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
            f"{twice[-1]} would be a second region '{Path(twice[-1]).stem}'; rename the file"
        )
    found: dict[str, Surface] = {}
    for path in paths:
        try:
            inside, scale = read_contents(path), scale_of(unit)
            if len(inside.tets):
                raise MeshError(f"{path} is a mesh; give a closed surface")
            found[Path(path).stem] = _sound(
                inside, scale, up=up, keep_largest=False, cap=False, say=say
            )
        except MeshError as error:
            raise MeshError(f"{path}: {str(error).removeprefix(f'{path} ')}") from None
    if found:
        check_inside(outer, found)
    return found


def _check_plausible(path: PathLike, found: Contents, unit: str) -> None:
    """Check that a body is as large as a hand, or part of one, in the unit of its file."""
    used = found.points[np.unique(found.tets if len(found.tets) else found.triangles)]
    size = float(np.linalg.norm(np.ptp(used, axis=0)))
    if SMALLEST < size * scale_of(unit) < LARGEST:
        return
    likely = min(UNITS, key=lambda name: abs(np.log(max(size, 1e-300) * UNITS[name] / TYPICAL)))
    raise MeshError(
        f"{path} is {1e3 * size * scale_of(unit):.3g} mm from corner to corner with its unit taken "
        f"as {unit}, and must be from {1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm; give its unit, "
        f'which may be {likely} (--unit {likely}; in a scene, unit = "{likely}" of [body])'
    )


def _sound(
    found: Contents, scale: float, *, up: str, keep_largest: bool, cap: bool, say: Say
) -> Surface:
    """Surface in a file, metre, repaired and checked."""
    say(f"read {len(found.triangles):,} triangles and {len(found.points):,} points")
    points = turned(Surface(points=found.points * scale, triangles=found.triangles), up).points
    surface, said = repaired(points, found.triangles, keep_largest=keep_largest, cap=cap)
    for sentence in said:
        say(sentence)
    check(surface)
    size = " x ".join(f"{1e3 * side:.0f}" for side in np.ptp(surface.points, axis=0))
    say(f"closed surface of {size} mm, {1e6 * volume(surface):.1f} cm3")
    return surface


def _on_top(mesh: TetMesh, say: Say) -> TetMesh:
    """The mesh, moved like a surface if the origin is not on top of it."""
    boundary = compact(mesh.points, boundary_facets(mesh.tets)[:, :3])
    shift = off_origin(boundary)
    if not shift.any():
        return mesh
    say(f"moved by {in_mm(shift)}, its top to the origin")
    unmoved = None if mesh.unmoved is None else mesh.unmoved + shift
    return replace(mesh, points=mesh.points + shift, unmoved=unmoved)


def _with_sides(mesh: TetMesh, planes: Sequence[float] = (), tolerance: float = 0.0) -> TetMesh:
    """The mesh with `surface`, `top`, `cut` and `bottom`, of which it keeps what it has."""
    seen = visible_from_above(mesh)
    sides = {"top": seen}
    if planes:
        is_cut = on_planes(planes, tolerance)(*geometry(mesh, boundary_facets(mesh.tets)))
        sides = {"cut": is_cut, "top": seen & ~is_cut}
    made = tag_boundary(mesh, rest="bottom", **sides)
    return replace(mesh, facets={**made.facets, **mesh.facets})


def _described(mesh: TetMesh, say: Say) -> TetMesh:
    volumes = corner_volumes(mesh.points, mesh.tets)
    numbers = np.unique(mesh.region).tolist()
    for number in numbers if len(numbers) > 1 or mesh.region_names else []:
        name, own = mesh.region_names.get(number, number), mesh.region == number
        say(f"region {name}: {own.sum():,} tetrahedra, {1e6 * volumes[own].sum():.3g} cm3")
    say(
        f"{len(mesh.tets):,} tetrahedra, {1e6 * volumes.sum():.1f} cm3, edges of "
        f"{1e3 * np.median(edge_lengths(mesh)):.1f} mm, dihedral angles from "
        f"{dihedral_angles(mesh).min():.1f} degrees"
    )
    return mesh
