"""Meshes and surfaces in files: round trips, foreign orders and kinds, and one sound body."""

import functools
import json
import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista

import meshes
from meshes import MeshError, TetMesh
from meshes.files.cells import contents
from meshes.files.mesh_files import read_contents
from meshes.surface.repair import check
from meshes.surface.triangulation import volume
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import reduce_scene
from skinwave.scene.scene import STILL, Body, Scene

pytestmark = pytest.mark.usefixtures("read_here")
HAND = Path(__file__).parents[2] / "examples/hand/generic-hand-right.glb"
GMSH_EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]  # of gmsh's manual, 10-node tets


SLAB = meshes.block((0.040, 0.040, 0.012), 0.010, order=1)
TETRAHEDRON, HEXAHEDRON, WEDGE, PYRAMID = 10, 12, 13, 14  # in VTK
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]
TWO = [(7, (0, 1, 2, 3)), (9, (1, 2, 3, 4))]
NAMES = '$PhysicalNames\n2\n2 5 "the lid"\n3 7 "skin"\n$EndPhysicalNames'


def layered(order):
    mesh = meshes.block((0.02, 0.03, 0.01), 0.005, order=order)
    region = np.where(mesh.points[mesh.tets].mean(axis=1)[:, 2] > -0.005, 3, 0)
    return replace(mesh, region=region, facets={**mesh.facets, "no one": mesh.facets["top"][:0]})


def same(one, other):
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.tets, other.tets)
    np.testing.assert_array_equal(one.region, other.region)
    assert one.facets.keys() == other.facets.keys()
    for name, facets in one.facets.items():
        np.testing.assert_array_equal(other.facets[name], facets)
        assert other.facets[name].shape == facets.shape


def half(side):
    kept = side * SLAB.points[SLAB.tets].mean(axis=1)[:, 0] > 0
    nodes, tets = np.unique(SLAB.tets[kept], return_inverse=True)
    return SLAB.points[nodes], tets.reshape(-1, 4)


def grid_of(points, cells):
    return pyvista.UnstructuredGrid({kind: np.array(x) for kind, x in cells.items()}, points)


def boxes(nx, ny, nz, size):
    lines = [np.linspace(-0.5, 0.5, n + 1) * L for n, L in zip((nx, ny, nz), size, strict=True)]
    x, y, z = np.meshgrid(*lines, indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a = [number[i : nx + i, j : ny + j, k : nz + k] for k in (0, 1) for i, j in
         ((0, 0), (1, 0), (1, 1), (0, 1))]  # fmt: skip
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel() - size[2] / 2])
    return points, np.stack(a, axis=-1).reshape(-1, 8)


def import_body(file, h=0.008, **options):
    said = []
    return meshes.body_from_file(file, h, say=said.append, **options), said


def refused(file, **options):
    with pytest.raises(MeshError) as error:
        meshes.body_from_file(file, 0.008, **options)
    assert "\n" not in str(error.value)
    return str(error.value)


def volume_of(mesh):
    return 1e6 * meshes.corner_volumes(mesh.points, mesh.tets).sum()


def said_of(said, words):
    return [sentence for sentence in said if words in sentence]


@pytest.mark.parametrize(("suffix", "order"), [(".vtu", 1), (".vtu", 2), (".msh", 2)])
def test_a_mesh_is_read_as_it_was_written(tmp_path, suffix, order):
    mesh = layered(order)
    meshes.write(tmp_path / f"body{suffix}", mesh)
    same(mesh, meshes.read(tmp_path / f"body{suffix}"))
    assert [path.name for path in tmp_path.iterdir()] == [f"body{suffix}"]


def gmsh_file(path, points, tets, *, edges=GMSH_EDGES, triangles=(), names=""):
    place = {tuple(point): i + 1 for i, point in enumerate(points)}
    rows, elements = [list(p) for p in points], []

    def middle(a, b):
        at = tuple((np.array(points[a]) + points[b]) / 2)
        if at not in place:
            rows.append(at)
            place[at] = len(rows)
        return place[at]

    for a, b, c in triangles:
        nodes = [a + 1, b + 1, c + 1, middle(a, b), middle(b, c), middle(c, a)]
        elements.append(f"9 2 5 1 {' '.join(map(str, nodes))}")
    for region, tet in tets:
        nodes = [n + 1 for n in tet] + [middle(tet[a], tet[b]) for a, b in edges]
        elements.append(f"11 2 {region} 1 {' '.join(map(str, nodes))}")
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", *names.splitlines(), "$Nodes"]
    lines += [str(len(rows)), *(f"{i + 1} {x} {y} {z}" for i, (x, y, z) in enumerate(rows))]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    lines += [f"{i + 1} {element}" for i, element in enumerate(elements)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def in_the_middle(mesh):
    ends = mesh.points[mesh.tets[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]]]  # VTK
    np.testing.assert_allclose(mesh.points[mesh.tets[:, 4:]], ends.mean(axis=2), atol=1e-15)


def test_nodes_in_gmsh_order_are_reordered(tmp_path):
    gmsh_file(tmp_path / "a.msh", CORNERS, TWO, triangles=[(0, 1, 2)], names=NAMES)
    mesh = meshes.read(tmp_path / "a.msh")
    in_the_middle(mesh)
    assert sorted(mesh.region) == [7, 9]
    (lid,) = mesh.facets["the lid"]
    ends = mesh.points[lid[[[0, 1], [1, 2], [2, 0]]]]
    np.testing.assert_allclose(mesh.points[lid[3:]], ends.mean(axis=1))
    a, b, c = mesh.points[lid[:3]]
    assert np.cross(b - a, c - a)[2] < 0  # seen from below, which is outside


def test_mid_side_nodes_off_their_edges_are_refused(tmp_path):
    gmsh_file(tmp_path / "a.msh", CORNERS, TWO, edges=[(0, 1)] * 3 + GMSH_EDGES[3:])
    with pytest.raises(MeshError, match=r"2 of 2 tetrahedra with a mid-side node more than 25% of"):
        meshes.read(tmp_path / "a.msh")


def test_gmsh_version_4_is_read(tmp_path):
    mesh = layered(2)
    raw = meshio.Mesh(mesh.points, [("tetra10", mesh.tets)])
    meshio.write(tmp_path / "a.msh", raw, file_format="gmsh")
    read = meshes.read(tmp_path / "a.msh")
    np.testing.assert_array_equal(read.tets, mesh.tets)


@pytest.mark.parametrize(("mode", "compressor"), [("Ascii", "none"), ("Appended", "lz4")])
def test_vtu_of_every_encoding_is_read_with_field_data(tmp_path, mode, compressor):
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    grid = grid_of(SLAB.points, {TETRAHEDRON: SLAB.tets})
    grid.field_data["TimeValue"] = [0.25]
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(tmp_path / "a.vtu"))
    writer.SetInputData(grid)
    writer.SetCompressorType(["none", "zlib", "lz4"].index(compressor))
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.Write()
    mesh = meshes.read(tmp_path / "a.vtu")
    np.testing.assert_allclose(mesh.points, SLAB.points, atol=1e-8)
    np.testing.assert_array_equal(mesh.tets, SLAB.tets)


def pieces_vtu(path):
    text = []
    for points, tets in map(half, (-1, 1)):
        rows = "\n".join(" ".join(map(repr, map(float, p))) for p in points)
        text.append(
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(tets)}"><Points>'
            f'<DataArray type="Float64" NumberOfComponents="3" format="ascii">{rows}</DataArray>'
            '</Points><Cells><DataArray type="Int64" Name="connectivity" format="ascii">'
            f"{' '.join(map(str, tets.ravel()))}</DataArray>"
            '<DataArray type="Int64" Name="offsets" format="ascii">'
            f"{' '.join(str(4 * (i + 1)) for i in range(len(tets)))}</DataArray>"
            '<DataArray type="UInt8" Name="types" format="ascii">'
            f"{'10 ' * len(tets)}</DataArray></Cells></Piece>"
        )
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">'
        f"<UnstructuredGrid>{''.join(text)}</UnstructuredGrid></VTKFile>"
    )


def test_touching_pieces_of_a_file_are_merged(tmp_path):
    pieces_vtu(tmp_path / "a.vtu")
    mesh, said = import_body(tmp_path / "a.vtu")
    assert volume_of(mesh) == pytest.approx(19.2, rel=1e-6)
    assert len(mesh.points) == len(SLAB.points)
    assert said_of(said, "merged 15 nodes that coincide")


def test_blocks_are_regions_by_their_names(tmp_path):
    grids = {name: grid_of(points, {TETRAHEDRON: tets})
             for name, (points, tets) in (("skin", half(-1)), ("fat", half(1)))}  # fmt: skip
    pyvista.MultiBlock(grids).save(tmp_path / "a.vtm")
    mesh, _ = import_body(tmp_path / "a.vtm")
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    for number, name in mesh.region_names.items():
        assert 1e6 * volumes[mesh.region == number].sum() == pytest.approx(9.6), name
    assert sorted(mesh.region_names.values()) == ["fat", "skin"]


def mixed():
    """Points and cells of a box of hexahedra, wedges and pyramids: bricks split differently."""
    points, bricks = boxes(4, 4, 2, (0.040, 0.040, 0.012))
    where = points[bricks].mean(axis=1)
    left, middle = where[:, 0] < 0, where[:, 1] < 0
    cells = {HEXAHEDRON: bricks[left & middle]}
    prism = bricks[left & ~middle]
    cells[WEDGE] = np.vstack([prism[:, [0, 1, 2, 4, 5, 6]], prism[:, [0, 2, 3, 4, 6, 7]]])
    rest = bricks[~left]
    tips = len(points) + np.arange(len(rest))
    sides = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    cells[PYRAMID] = np.vstack([np.column_stack([rest[:, side], tips]) for side in sides])
    return np.vstack([points, points[rest].mean(axis=1)]), cells


def test_hexahedra_wedges_and_pyramids_are_split_conformingly(tmp_path):
    points, cells = mixed()
    grid = grid_of(points, cells)
    grid.save(tmp_path / "a.vtu")
    mesh, said = import_body(tmp_path / "a.vtu")
    by_vtk = 1e6 * grid.compute_cell_sizes()["Volume"].sum()
    assert volume_of(mesh) == pytest.approx(by_vtk, rel=1e-9)
    for kind in ("hexahedron", "wedge", "pyramid"):
        assert said_of(said, f"cells of type {kind} into"), kind
    # The boundary of conforming tetrahedra is that of the box.
    middles = mesh.points[meshes.boundary_facets(mesh.tets)].mean(axis=1)
    off = np.abs(np.abs(middles - [0, 0, -0.006]) - [0.02, 0.02, 0.006]).min(axis=1)
    assert off.max() < 1e-12


def write_groups(path, points, cells, groups, names):
    data = dict.fromkeys(("gmsh:physical", "gmsh:geometrical"), groups)
    numbers = {name: np.array(number) for name, number in names.items()}
    raw = meshio.Mesh(points, cells, cell_data=data, field_data=numbers)
    meshio.write(path, raw, file_format="gmsh22")


def test_facets_of_hexahedra_stay_in_their_sets(tmp_path):
    points, bricks = boxes(3, 2, 2, (0.030, 0.020, 0.010))
    top = bricks[np.isclose(points[bricks][:, 4:, 2].mean(axis=1), 0)][:, 4:]
    groups, names = [np.full(len(bricks), 1), np.full(len(top), 2)], {"skin": [1, 3], "top": [2, 2]}
    write_groups(tmp_path / "a.msh", points, [("hexahedron", bricks), ("quad", top)], groups, names)
    mesh = meshes.read(tmp_path / "a.msh")
    assert mesh.region_names == {1: "skin"}
    facets = mesh.points[mesh.facets["top"]]
    assert np.isclose(facets[..., 2], 0).all()
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    assert normals[:, 2].sum() / 2 == pytest.approx(0.030 * 0.020)
    assert (normals[:, 2] > 0).all()


def abaqus(parts, instances="", head="*HEADING\n"):
    text = head
    for name, body in parts:
        text += f"*Part, name={name}\n{body}*End Part\n"
    return text + f"*Assembly, name=A\n{instances}*End Assembly\n"


def nodes_and_elements(points, tets, more=""):
    rows = [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist(), 1)]
    cells = [f"{i}, {', '.join(map(str, tet))}" for i, tet in enumerate((tets + 1).tolist(), 1)]
    return "*Node\n" + "\n".join(rows) + f"\n*Element, type=C3D4{more}\n" + "\n".join(cells) + "\n"


def test_instances_are_placed_by_translation_and_rotation(tmp_path):
    part = [("BAR", nodes_and_elements(*half(-1)))]
    instances = (
        "*Instance, name=A-1, part=BAR\n*End Instance\n*Instance, name=A-2, part=BAR\n"
        "0., 0., 0.\n0., 0., 0., 0., 0., 1., 180.\n*End Instance\n"
    )
    (tmp_path / "a.inp").write_text(abaqus(part, instances))
    mesh, _ = import_body(tmp_path / "a.inp")
    assert volume_of(mesh) == pytest.approx(19.2, rel=1e-9)
    away = instances.replace("0., 0., 0.\n", "0., 0.05, 0.\n")
    (tmp_path / "a.inp").write_text(abaqus(part, away))
    assert "2 separate bodies (9.6, 9.6 cm3)" in refused(tmp_path / "a.inp")
    # A translation comes before the rotation, here about an axis away from the origin.
    moved = "0.1, 0., 0.\n0.1, 0., 0., 0.1, 0., 1., 90."
    instance = f"*Instance, name=A-1, part=BAR\n{moved}\n*End Instance\n"
    (tmp_path / "a.inp").write_text(abaqus(part, instance))
    x, y, _ = half(-1)[0].T
    read = meshes.read(tmp_path / "a.inp")
    np.testing.assert_allclose(np.ptp(read.points[:, :2], axis=0), [np.ptp(y), np.ptp(x)])
    np.testing.assert_allclose(read.points[:, 1].min(), x.min(), atol=1e-12)
    np.testing.assert_allclose(read.points[:, 0].mean(), 0.1, atol=1e-12)


def test_touching_parts_with_equal_numbers_are_merged(tmp_path):
    parts = [(name, nodes_and_elements(*half(side))) for name, side in (("SKIN", -1), ("BONE", 1))]
    instances = "".join(f"*Instance, name={n}-1, part={n}\n*End Instance\n" for n, _ in parts)
    (tmp_path / "a.inp").write_text(abaqus(parts, instances))
    mesh, _ = import_body(tmp_path / "a.inp")
    assert volume_of(mesh) == pytest.approx(19.2, rel=1e-9)
    assert sorted(mesh.region_names.values()) == ["BONE", "SKIN"]


def test_generated_sets_that_partition_the_elements_are_regions(tmp_path):
    upper = SLAB.points[SLAB.tets].mean(axis=1)[:, 2] > -0.006
    order = np.concatenate([np.flatnonzero(upper), np.flatnonzero(~upper)])
    text = nodes_and_elements(SLAB.points, SLAB.tets[order], ", elset=ALL")
    text += f"*Elset, elset=skin, generate\n1, {upper.sum()}, 1\n"
    text += f"*Elset, elset=muscle, generate\n{upper.sum() + 1}, {len(order)}\n"
    (tmp_path / "a.inp").write_text(text)
    mesh, _ = import_body(tmp_path / "a.inp")
    names = {mesh.region_names[r]: (mesh.region == r).sum() for r in np.unique(mesh.region)}
    assert names == {"SKIN": upper.sum(), "MUSCLE": (~upper).sum()}


def test_sets_continued_lines_and_included_nodes(tmp_path):
    slab = meshes.block((0.04, 0.04, 0.012), 0.012, order=2)
    upper = slab.points[slab.tets[:, :4]].mean(axis=1)[:, 2] > -0.006
    (tmp_path / "nodes.inc").write_text(
        "** in metre\n" + "".join(f"{7 * i + 9}, {x!r}, {y!r}, {z!r}\n"
                                  for i, (x, y, z) in enumerate(slab.points.tolist()))
    )  # fmt: skip
    lines = ["*Heading", "*NODE", "*Include, input=nodes.inc"]
    for title, own in (("SKIN", upper), ("muscle", ~upper)):
        lines.append(f"*element, type=c3d10, elset={title}")
        for i in np.flatnonzero(own):
            words = [str(7 * n + 9) for n in slab.tets[i]]
            lines += [f"{i + 1}, {', '.join(words[:6])},", f" {', '.join(words[6:])}"]
    lines += ["*Elset, elset=PROBE", "1, 2", "*Nset, nset=BASE, generate", "1, 9, 7"]
    (tmp_path / "a.inp").write_text("\n".join(lines) + "\n")
    mesh = meshes.read(tmp_path / "a.inp")
    assert mesh.order == 2
    assert volume_of(mesh) == pytest.approx(19.2, rel=1e-9)
    names = {name: (mesh.region == number).sum() for number, name in mesh.region_names.items()}
    assert names == {"SKIN": upper.sum(), "MUSCLE": (~upper).sum()}


def test_generated_or_missing_abaqus_data_are_refused(tmp_path):
    for text, said in [
        ("*NODE\n1, 0, 0, 0\n*NGEN\n1, 9, 1\n", "NGEN"),
        ("*INCLUDE, INPUT=gone.inc\n", "gone.inc"),
        ("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", "missing node 2"),
        ("*INSTANCE, NAME=a, PART=b\n*END INSTANCE\n", "missing part 'b'"),
        ("*NODE\n1, a, 0, 0\n", r"below \*NODE"),
    ]:
        (tmp_path / "a.inp").write_text(text)
        with pytest.raises(MeshError, match=said):
            meshes.read(tmp_path / "a.inp")


def test_overlapping_groups_give_the_smaller_as_region(tmp_path):
    upper = SLAB.points[SLAB.tets].mean(axis=1)[:, 2] > -0.006
    tets = np.vstack([SLAB.tets, SLAB.tets])
    groups = np.concatenate([np.full(len(SLAB.tets), 1), np.where(upper, 2, 3)])
    names = {"all": [1, 3], "skin": [2, 3], "fat": [3, 3]}
    write_groups(tmp_path / "a.msh", SLAB.points, [("tetra", tets)], [groups], names)
    mesh, _ = import_body(tmp_path / "a.msh")
    assert set(mesh.region_names.values()) == {"skin", "fat"}


def test_errors_of_damaged_files_name_the_damage(tmp_path):
    points = np.array(SLAB.points)
    points[3] = np.nan
    grid_of(points, {TETRAHEDRON: SLAB.tets}).save(tmp_path / "a.vtk")
    with pytest.raises(MeshError, match="1 nodes whose coordinates"):
        meshes.read(tmp_path / "a.vtk")
    meshes.write(tmp_path / "b.msh", SLAB)
    content = (tmp_path / "b.msh").read_bytes()
    (tmp_path / "b.msh").write_bytes(content[: len(content) * 3 // 4])
    with pytest.raises(MeshError, match="cut short"):
        meshes.read(tmp_path / "b.msh")
    (tmp_path / "c.stl").write_text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0")
    with pytest.raises(MeshError, match="is damaged or cut short"):
        read_contents(tmp_path / "c.stl")


def test_inverted_tetrahedra_are_reordered_and_overlapping_ones_refused(tmp_path):
    tets = np.array(SLAB.tets)
    tets[:20] = tets[:20][:, [0, 2, 1, 3]]
    grid_of(SLAB.points, {TETRAHEDRON: tets}).save(tmp_path / "a.vtu")
    mesh, said = import_body(tmp_path / "a.vtu")
    assert said_of(said, "reordered 20 inverted")
    assert volume_of(mesh) == pytest.approx(19.2, rel=1e-9)
    points = np.array(SLAB.points)
    inner = np.flatnonzero(np.abs(points - [0, 0, -0.006]).max(axis=1) < 1e-9)
    points[inner] += [0.013, 0.002, 0.001]
    grid_of(points, {TETRAHEDRON: SLAB.tets}).save(tmp_path / "b.vtu")
    assert "tetrahedra of the mesh overlap at" in refused(tmp_path / "b.vtu")


def test_the_largest_of_several_bodies_is_kept_on_request(tmp_path):
    loose = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 1e-3 + [0.03, 0, 0]
    points = np.vstack([SLAB.points, loose])
    tets = np.vstack([SLAB.tets, len(SLAB.points) + np.arange(4)[None]])
    grid_of(points, {TETRAHEDRON: tets}).save(tmp_path / "a.vtu")
    assert "--keep largest" in refused(tmp_path / "a.vtu")
    mesh, said = import_body(tmp_path / "a.vtu", keep_largest=True)
    assert len(mesh.tets) == len(SLAB.tets)
    assert said_of(said, "kept the largest of 2 bodies, 100.0 % of the volume")


def test_a_mesh_is_rotated_and_moved_below_the_device(tmp_path):
    x, y, z = SLAB.points.T
    corner = np.column_stack([x + 0.02, z + 0.012, 0.02 - y])  # y up, a corner at the origin
    meshes.write(tmp_path / "a.msh", replace(SLAB, points=corner, facets={}))
    mesh, said = import_body(tmp_path / "a.msh", up="+y")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose(low, [-0.02, -0.02, -0.012], atol=1e-3)
    np.testing.assert_allclose(high, [0.02, 0.02, 0.0], atol=1e-3)
    assert high[2] == pytest.approx(0.0, abs=1e-12)
    meshes.write(tmp_path / "b.vtu", mesh)
    again, said = import_body(tmp_path / "b.vtu")
    np.testing.assert_array_equal(again.points, mesh.points)  # where it is on its top already
    assert not said_of(said, "moved by")


def test_negative_regions_are_refused(tmp_path):
    grid = grid_of(SLAB.points, {TETRAHEDRON: SLAB.tets})
    grid.cell_data["material"] = np.where(np.arange(len(SLAB.tets)) < 96, 1, -1)
    grid.save(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match="0 or above"):
        meshes.read(tmp_path / "a.vtu")


def test_files_without_a_mesh_are_refused_in_one_sentence(tmp_path):
    for name, content in [
        ("a.vtu", b"<VTKFile>"),
        ("a.msh", b"nothing"),
        ("a.inp", b""),
        ("a.vtk", b"# vtk DataFile Version 3.0\n"),
        ("a.stl", b""),
        ("a.fbx", b""),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ]:
        (tmp_path / name).write_bytes(content)
        with pytest.raises(MeshError, match=name) as error:
            meshes.read(tmp_path / name)
        assert "\n" not in str(error.value)


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "a.vtu").write_text("mine")

    def half_written(path, *arguments, **options):
        Path(path).write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio, "write", half_written)
    with pytest.raises(OSError, match="No space left"):
        meshes.write(tmp_path / "a.vtu", layered(1))
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtu"]
    assert (tmp_path / "a.vtu").read_text() == "mine"


def open_wrist(path, rim=0.0):
    """A tube along y that is closed at one end only, whose open rim leaves its plane by `rim`."""
    n, rings = 24, 8
    angle = 2 * np.pi * np.arange(n) / n
    y = np.linspace(-0.02, 0.02, rings)
    x, z = 0.02 * np.cos(angle), 0.008 * np.sin(angle)
    points = np.vstack([np.column_stack([x, np.full(n, at), z]) for at in y])
    points[:n, 1] += rim * np.cos(2 * angle)
    number = np.arange(n * rings).reshape(rings, n)
    a, b = number[:-1], number[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    triangles = [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    tip = np.column_stack([np.roll(number[-1], -1), number[-1], np.full(n, n * rings)])
    points, every = np.vstack([points, [0, 0.02, 0]]), np.vstack([*triangles, tip])
    pyvista.PolyData(points, faces=np.insert(every, 0, 3, axis=1).ravel()).save(path)


def test_an_open_wrist_is_capped_on_request(tmp_path):
    open_wrist(tmp_path / "a.stl")
    assert "--cap" in refused(tmp_path / "a.stl")
    mesh, said = import_body(tmp_path / "a.stl", cap=True)
    area = 24 / 2 * np.sin(2 * np.pi / 24) * 0.02 * 0.008
    assert volume_of(mesh) == pytest.approx(1e6 * 0.04 * area, rel=0.02)
    assert said_of(said, "closed a hole of 24 edges, 40 mm wide")
    open_wrist(tmp_path / "b.stl", rim=0.005)
    assert "10.0 mm" in refused(tmp_path / "b.stl", cap=True)


def test_a_surface_inside_another_is_refused(tmp_path):
    skin, bone = pyvista.Sphere(radius=0.02), pyvista.Sphere(radius=0.005)
    (skin + bone).save(tmp_path / "a.stl")
    assert "--inner" in refused(tmp_path / "a.stl")
    surface = read_contents(tmp_path / "a.stl")
    kept, notes = meshes.repair(surface.points, surface.triangles, keep_largest=True)
    assert len(kept.triangles) == skin.n_cells
    assert "94.1 %" in notes[-1]


@functools.cache
def hand():
    found = read_contents(HAND)
    return found.points, found.triangles


def write_obj(path, points, triangles):
    rows = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in points]
    rows += ["f {} {} {}".format(*(triangle + 1)) for triangle in triangles]
    path.write_text("\n".join(rows) + "\n")


def write_by_vtk(path, points, triangles):
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    pyvista.PolyData(points, faces=faces).save(path)


WRITERS = {".obj": write_obj, ".stl": write_by_vtk}


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_hand_with_seams_is_repaired_from_every_format(tmp_path, suffix):
    points, triangles = hand()
    WRITERS[suffix](tmp_path / f"hand{suffix}", points, triangles)
    raw = read_contents(tmp_path / f"hand{suffix}")
    surface, _ = meshes.repair(raw.points, raw.triangles)
    check(surface)
    plain, said = meshes.repair(points, triangles)
    assert said_of(said, "along seams")
    assert volume(surface) == pytest.approx(volume(plain), rel=1e-4)
    np.testing.assert_allclose(surface.points.max(axis=0), plain.points.max(axis=0), atol=1e-6)


@pytest.mark.parametrize("suffix", [".stl", ".glb", ".vtu", ".msh"])
def test_truncated_and_garbled_files_are_refused(tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / f"body{suffix}"
    if suffix == ".glb":
        path.write_bytes(HAND.read_bytes())
    elif suffix == ".stl":
        write_by_vtk(path, *hand())
    else:
        meshes.write(path, layered(2))
    content = path.read_bytes()
    third = len(content) // 3
    garbled = content[:third] + b"\xff" * third + content[2 * third :]
    for spoilt in (content[: 2 * third], garbled, content[::-1]):
        path.write_bytes(spoilt)
        assert path.name in refused(path)
        assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_a_clipped_patch_has_its_cuts_as_facets(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points, triangles = hand()
    write_by_vtk("hand.ply", 1e3 * points, triangles)
    patch = ["--clip", "-20", "22", "-18", "16"]
    arguments = ["--unit", "mm", "--up", "-x", "--element-size", "12", "--out", "patch.vtu"]
    assert main(["mesh", "hand.ply", *arguments, *patch]) == 0
    mesh = meshes.read("patch.vtu")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose([low[0], high[0], low[1], high[1]], [-0.02, 0.022, -0.018, 0.016],
                               atol=1e-3)  # fmt: skip
    _, normal = meshes.facets.geometry(mesh, mesh.facets["cut"])
    assert np.abs(normal[:, :2]).max(axis=1).min() > 0.9
    parts = [len(mesh.facets[name]) for name in ("top", "cut", "bottom")]
    assert len(mesh.facets["surface"]) == sum(parts)


def test_the_mesh_command_keeps_a_volume_mesh(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    meshes.write("slab.msh", layered(2))
    assert main(["mesh", "slab.msh", "--quiet"]) == 0
    mesh = meshes.read("slab-mesh.vtu")
    np.testing.assert_array_equal(mesh.tets, layered(2).tets)
    np.testing.assert_array_equal(mesh.facets["top"], layered(2).facets["top"])
    assert "surface" in mesh.facets
    assert main(["mesh", "slab.msh", "--quiet"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["mesh", "slab.msh", "--quiet", "--overwrite"]) == 0


def test_options_of_the_mesh_command(tmp_path, capsys):
    x, y, z = layered(1).points.T
    points = 1e3 * np.column_stack([x + 0.02, z, -y])  # in mm, y up
    loose = np.vstack([np.zeros(3), np.eye(3)]) + [60, 0, 0]
    tets = np.vstack([layered(1).tets, len(points) + np.arange(4)[None]])
    turned = TetMesh(points=np.vstack([points, loose]), tets=tets)
    meshes.write(tmp_path / "a.vtu", turned)
    command = ["mesh", str(tmp_path / "a.vtu"), "-o", str(tmp_path / "b.vtu"), "--json"]
    assert main([*command, "--unit", "mm", "--up", "+y", "--keep", "largest", "--cap"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert any("kept the largest of 2 bodies" in said for said in summary["said"])
    mesh = meshes.read(tmp_path / "b.vtu")
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), [0.02, 0.03, 0.01], rtol=1e-9)
    assert main([*command[:-1], "--overwrite", "--quiet"]) == 2


def test_the_cache_distinguishes_facet_sets_of_a_file(tmp_path):
    block = meshes.block((0.02, 0.02, 0.01), 0.005)
    body = Body(kind="mesh", file=str(tmp_path / "body.vtu"), sides="clamped")
    scene, read = Scene(pressure=STILL, body=body, probes=((-0.004, 0.001),)), []
    for held, pushed in (("sides", "top"), ("left", "top"), ("left", "part")):
        part = block.facets["top"][block.points[block.facets["top"]][..., 0].max(axis=1) < 1e-9]
        facets = {"sides": block.facets[held], "top": {**block.facets, "part": part}[pushed]}
        meshes.write(body.file, replace(block, facets=facets))
        read.append(reduce_scene(scene, SolveOptions(h=0.005)))
    stiffness = [np.abs(prepared.poles.values[:3]).sum() for prepared in read]
    assert stiffness[0] != pytest.approx(stiffness[1], rel=1e-3)
    assert len(read[1].points) == 2 * len(read[2].points)


def test_errors_of_the_mesh_command_are_one_line(tmp_path, monkeypatch, capsys):
    for arguments, said in [
        (["open.stl"], "open along"),
        (["hand.obj", "--unit", "mm"], "probably m"),
        (["hand.obj", "--up", "up"], "up"),
        (["hand.obj", "--element-size", "nan"], "h = nan m"),
        (["hand.obj", "--clip", "10", "20", "10", "20"], "middle of the palm"),
        (["hand.obj", "--out", "hand.stl"], "ends in .vtu or .msh"),
        (["hand.obj", "--out", "no/where.vtu"], "no"),
        (["missing.stl"], "missing.stl"),
    ]:
        monkeypatch.chdir(tmp_path)
        points, triangles = hand()
        write_obj(tmp_path / "hand.obj", points, triangles)
        write_by_vtk("open.stl", points, triangles[50:])
        before = sorted(path.name for path in tmp_path.iterdir())
        assert main(["mesh", *arguments, "--quiet"]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert re.search(said, line), line
        assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_voxels_are_split_as_the_hexahedra_that_they_are(tmp_path, read_here):
    grid = pyvista.ImageData(dimensions=(3, 3, 3), spacing=(1.0, 2.0, 3.0))
    grid.cast_to_unstructured_grid().save(tmp_path / "voxels.vtu")
    mesh = meshes.read(tmp_path / "voxels.vtu", unit="in")
    assert meshes.corner_volumes(mesh.points, mesh.tets).sum() == pytest.approx(48 * 0.0254**3)


UPPER = SLAB.points[SLAB.tets].mean(axis=1)[:, 2] > -0.006
XDMF = """<?xml version="1.0"?>
<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>
<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude"><Domain>
<Grid Name="mesh" GridType="Uniform"><Topology TopologyType="Tetrahedron" NumberOfElements="{n}">
<DataItem Dimensions="{n} 4" NumberType="Int" Format="HDF">a.h5:/tets</DataItem></Topology>
<Geometry GeometryType="XYZ"><DataItem Dimensions="{p} 3" Format="HDF">a.h5:/points</DataItem>
</Geometry></Grid>
<Grid Name="cells" GridType="Uniform"><xi:include xpointer="xpointer({link}/Geometry)" />
<Topology TopologyType="Tetrahedron" NumberOfElements="{n}">
<DataItem Dimensions="{n} 4" NumberType="Int" Format="HDF">a.h5:/tets</DataItem></Topology>
<Attribute Name="cells" AttributeType="Scalar" Center="Cell">
<DataItem Dimensions="{n} 1" Format="HDF">a.h5:/tags</DataItem></Attribute></Grid>
<Grid Name="facets" GridType="Uniform"><xi:include xpointer="xpointer({link}/Geometry)" />
<Topology TopologyType="Triangle" NumberOfElements="{k}">
<DataItem Dimensions="{k} 3" NumberType="Int" Format="HDF">a.h5:/top</DataItem></Topology>
<Attribute Name="facets" AttributeType="Scalar" Center="Cell">
<DataItem Dimensions="{k} 1" Format="HDF">a.h5:/five</DataItem></Attribute></Grid>
</Domain></Xdmf>"""


@pytest.mark.parametrize("link", ["/Xdmf/Domain/Grid", "/Xdmf/Domain/Grid[@Name='mesh']"])
def test_tags_of_cells_and_facets_in_xdmf_are_regions_and_facet_sets(tmp_path, link):
    h5py, top = pytest.importorskip("h5py"), SLAB.facets["top"]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["tets"], file["points"], file["top"] = SLAB.tets, SLAB.points, top
        file["tags"] = np.where(UPPER, 1, 2)[:, None].astype(np.int32)
        file["five"] = np.full((len(top), 1), 5, np.int32)
    text = XDMF.format(n=len(SLAB.tets), p=len(SLAB.points), k=len(top), link=link)
    (tmp_path / "a.xdmf").write_text(text)
    mesh, said = import_body(tmp_path / "a.xdmf")
    np.testing.assert_array_equal(mesh.region, np.where(UPPER, 1, 2))
    assert volume_of(mesh) == pytest.approx(19.2)
    assert len(mesh.facets["group 5"]) == len(top)
    assert not said_of(said, "duplicate")
    (tmp_path / "a.h5").unlink()
    assert "'a.h5', which is missing" in refused(tmp_path / "a.xdmf")


def test_regions_are_read_under_any_name_and_others_noted(tmp_path):
    grid = grid_of(SLAB.points, {TETRAHEDRON: SLAB.tets})
    numbers = np.where(UPPER, 1.0, 2.0)
    for name, values in [
        ("stress", np.linspace(0, 1, len(numbers))), ("rank", numbers), ("signed", -numbers),
        ("ids", np.arange(len(numbers))), ("name_to_read", numbers), ("grain", 3 - numbers),
    ]:  # fmt: skip
        grid.cell_data[name] = values
    grid.save(tmp_path / "a.vtu")
    mesh, said = import_body(tmp_path / "a.vtu")
    np.testing.assert_array_equal(mesh.region, numbers)
    assert said_of(said, "regions are the numbers in the cell array name_to_read")
    assert said_of(said, "left out the cell arrays signed, grain")


def bulk_data(fields, head, tail, start=""):
    rows = [["GRID", i, "", *xyz] for i, xyz in enumerate((1e3 * SLAB.points).tolist(), 1)]
    rows += [["CTETRA", i, 1 + (not up), *nodes] for i, (up, nodes) in
             enumerate(zip(UPPER, (SLAB.tets + 1).tolist(), strict=True), 1)]  # fmt: skip
    return start + head + "".join(map(fields, rows)) + tail


def small_fields(row):
    cells = (f"{x:.4f}"[:7] if isinstance(x, float) else str(x) for x in row)
    return "".join(f"{cell:8}" for cell in cells) + "\n"


def large_fields(row):
    name, *cells = (f"{x:.8E}" if isinstance(x, float) else str(x) for x in row)
    lines = ["".join(f"{cell:>16}" for cell in cells[i : i + 4]) for i in (0, 4)]
    return f"{name + '*':8}{lines[0]}*\n*       {lines[1]}\n"


@pytest.mark.parametrize(
    ("fields", "head", "tail"),
    [
        (small_fields, "$ to be included\n", ""),
        (large_fields, "SOL 101\nCEND\nBEGIN BULK\nPSOLID,1,1\n", "CBAR,999,3,1,2\nENDDATA\n"),
        (lambda row: ",".join(map(str, row)).lower() + "\n", "begin bulk\n", "enddata\n"),
        (lambda row: "\t".join(map(str, row)) + "\n", "", "CTRIA3,998,9,1,2,3,,0.5\n"),
    ],
)
def test_nastran_is_read_in_all_fields_with_or_without_a_head(tmp_path, fields, head, tail):
    (tmp_path / "part.inc").write_text(bulk_data(fields, "", tail))
    (tmp_path / "a.bdf").write_text(f"{head}INCLUDE 'part.inc'\n")
    (tmp_path / "b.nas").write_text(bulk_data(fields, head, tail))
    for name in ("a.bdf", "b.nas"):
        mesh, _ = import_body(tmp_path / name, unit="mm")
        assert volume_of(mesh) == pytest.approx(19.2)
        np.testing.assert_array_equal(mesh.region, np.where(UPPER, 1, 2))


@pytest.mark.parametrize(("order", "base"), [(1, 0), (2, 1)])
def test_tetgen_files_of_both_orders_are_read(tmp_path, order, base):
    mesh = meshes.block((0.04, 0.04, 0.012), 0.010, order=order)
    order_of = [0, 1, 2, 3, 8, 5, 7, 9, 6, 4][: mesh.tets.shape[1]]  # some other node order
    nodes = [f"{i + base} {x} {y} {z}" for i, (x, y, z) in enumerate(mesh.points.tolist())]
    cells = [
        f"{i + base}  {' '.join(map(str, (tet + base)[order_of]))}  {7 if up else 3}"
        for i, (tet, up) in enumerate(zip(mesh.tets, UPPER, strict=True))
    ]
    (tmp_path / "a.1.node").write_text("\n".join([f"# x\n{len(nodes)}  3  0  0", *nodes]))
    head = f"{len(cells)}  {mesh.tets.shape[1]}  1"
    (tmp_path / "a.1.ele").write_text("\n".join([head, *cells, "# Generated by tetgen"]))
    read, _ = import_body(tmp_path / "a.1.ele")
    assert read.order == order
    assert volume_of(read) == pytest.approx(19.2)
    np.testing.assert_array_equal(read.region, np.where(UPPER, 7, 3))


def test_lagrange_tetrahedra_are_read(tmp_path):
    for order, mesh in ((1, SLAB), (2, meshes.quadratic(SLAB))):
        nodes = mesh.tets.shape[1]
        cells = np.insert(mesh.tets, 0, nodes, axis=1).ravel()
        kinds = np.full(len(mesh.tets), pyvista.CellType.LAGRANGE_TETRAHEDRON, np.uint8)
        pyvista.UnstructuredGrid(cells, kinds, mesh.points).save(tmp_path / "a.vtu")
        read, _ = import_body(tmp_path / "a.vtu")
        assert read.order == order
        assert volume_of(read) == pytest.approx(19.2)


@pytest.mark.parametrize("centre", ["cell", "point"])
def test_of_a_label_image_the_voxels_with_a_label_are_read(tmp_path, centre):
    image = pyvista.ImageData(dimensions=(13, 13, 7), spacing=(0.005, 0.005, 0.004))
    centres = image if centre == "point" else image.cell_centers()
    x, y, z = (centres.points - np.array(image.center)).T
    inside = (np.abs(x) < 0.021) & (np.abs(y) < 0.021) & (np.abs(z) < 0.009)
    labels = np.where(inside, np.where(x > 0, 4, 2), 0).astype(np.int16)
    (image.cell_data if centre == "cell" else image.point_data)["label"] = labels
    image.save(tmp_path / "a.vtk")
    mesh, _ = import_body(tmp_path / "a.vtk")
    assert volume_of(mesh) == pytest.approx(inside.sum() * 0.1)
    assert set(mesh.region.tolist()) == {2, 4}


def test_sound_files_that_are_not_read_name_what_is_not(tmp_path):
    image = pyvista.ImageData(dimensions=(5, 5, 5))
    image.point_data["density"] = np.linspace(0, 1, 125)
    image.save(tmp_path / "image.vtk")
    pyvista.PolyData(SLAB.points).save(tmp_path / "cloud.ply")
    lines = "".join(f"v {x} {y} {z}\n" for x, y, z in SLAB.points.tolist())
    (tmp_path / "cloud.obj").write_text(lines)
    head, nodes = "$MeshFormat\n{} 0 8\n$EndMeshFormat\n", "1 0 0 0 3 1 0 0 0\n"
    tail = "$Elements\n0\n$EndElements\n"
    (tmp_path / "two.msh").write_text(
        head.format(2.2) + f"$ParametricNodes\n1\n{nodes}$EndParametricNodes\n{tail}"
    )
    (tmp_path / "four.msh").write_text(
        head.format(4.1) + f"$Nodes\n1 1 1 1\n3 1 1 1\n1\n0 0 0 0 0 0\n$EndNodes\n{tail}"
    )
    for name, words in [
        ("image.vtk", "an image of 64 voxels, not a body"),
        ("cloud.ply", "points without triangles"),
        ("cloud.obj", "points without triangles"),
        ("two.msh", "parametric nodes"),
        ("four.msh", "parametric nodes"),
    ]:
        assert words in refused(tmp_path / name)


def test_negative_families_of_cells_are_regions_with_names():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1.0]])
    raw = meshio.Mesh(
        points, [("tetra", np.array([[0, 1, 2, 3], [0, 2, 1, 4]]))],
        cell_data={"cell_tags": [np.array([-6, -7])]},
        info={"notes": [], "names": {-6: "skin", -7: "bone"}},
    )  # fmt: skip
    found = contents(Path("a.med"), raw)
    assert (found.region.tolist(), found.names) == ([6, 7], {6: "skin", 7: "bone"})


def test_any_order_of_nodes_on_edges_becomes_that_of_vtk():
    mesh = meshes.block((1.0, 1.0, 1.0), 0.5)
    order = [0, 1, 2, 3, 6, 4, 5, 9, 7, 8]  # cyclic, so that its inverse is another one
    raw = meshio.Mesh(mesh.points, [("tetra10", mesh.tets[:, order])],
                      info={"notes": [], "names": {}})  # fmt: skip
    found = contents(Path("a.vtu"), raw)
    np.testing.assert_array_equal(found.points[found.tets], mesh.points[mesh.tets])
