"""Meshes of other programs: everything in them is read or named, and they are one sound body."""

import json
from dataclasses import replace

import numpy as np
import pytest

import meshes
from meshes import MeshError
from meshes.surface.alignment import widest_place
from meshes.volume.quality import element_volumes

SLAB = meshes.block((0.040, 0.040, 0.012), 0.010, order=1)
TETRAHEDRON, HEXAHEDRON, WEDGE, PYRAMID = 10, 12, 13, 14  # in VTK


def half(side):
    """Points and tetrahedra of the slab on one side (-1, 1) of x = 0."""
    kept = side * SLAB.points[SLAB.tets].mean(axis=1)[:, 0] > 0
    nodes, tets = np.unique(SLAB.tets[kept], return_inverse=True)
    return SLAB.points[nodes], tets.reshape(-1, 4)


def grid_of(points, cells):
    """An unstructured grid of cells, by VTK's number of their type."""
    import pyvista

    return pyvista.UnstructuredGrid(
        {kind: np.array(nodes) for kind, nodes in cells.items()}, points
    )


def boxes(nx, ny, nz, size):
    """Nodes of a box of bricks below z = 0, and the eight of each brick."""
    lines = [
        np.linspace(-0.5, 0.5, n + 1) * side for n, side in zip((nx, ny, nz), size, strict=True)
    ]
    x, y, z = np.meshgrid(*lines, indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a = [number[i : nx + i, j : ny + j, k : nz + k] for k in (0, 1) for i, j in
         ((0, 0), (1, 0), (1, 1), (0, 1))]  # fmt: skip
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel() - size[2] / 2])
    return points, np.stack(a, axis=-1).reshape(-1, 8)


def made(file, h=0.008, **options):
    """The body of a file, and what is said of it."""
    said = []
    return meshes.body_from_file(file, h, say=said.append, **options), said


def refused(file, **options):
    """The sentence with which a file is refused."""
    with pytest.raises(MeshError) as error:
        meshes.body_from_file(file, 0.008, **options)
    assert "\n" not in str(error.value)
    return str(error.value)


def volume(mesh):
    return 1e6 * element_volumes(mesh.points, mesh.tets).sum()


def said_of(said, words):
    return [sentence for sentence in said if words in sentence]


# Everything in a file


@pytest.mark.parametrize(
    ("mode", "compressor"), [("Ascii", "none"), ("Binary", "zlib"), ("Appended", "lz4")]
)
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
    """A file of two pieces, written by hand."""
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


def test_pieces_of_a_file_are_one_body_where_they_touch(tmp_path):
    pieces_vtu(tmp_path / "a.vtu")
    mesh, said = made(tmp_path / "a.vtu")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-6)
    assert len(mesh.points) == len(SLAB.points)
    assert said_of(said, "merged 15 nodes that coincide")


def test_blocks_are_regions_by_their_names(tmp_path):
    import pyvista

    grids = {name: grid_of(points, {TETRAHEDRON: tets})
             for name, (points, tets) in (("skin", half(-1)), ("fat", half(1)))}  # fmt: skip
    pyvista.MultiBlock(grids).save(tmp_path / "a.vtm")
    mesh, _ = made(tmp_path / "a.vtm")
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    for number, name in mesh.region_names.items():
        assert 1e6 * volumes[mesh.region == number].sum() == pytest.approx(9.6), name
    assert sorted(mesh.region_names.values()) == ["fat", "skin"]


def mixed():
    """A box of hexahedra, wedges and pyramids, every node turned a little within its cell's face
    planes, as columns of bricks that are split differently.
    """
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
    mesh, said = made(tmp_path / "a.vtu")
    by_vtk = 1e6 * grid.compute_cell_sizes()["Volume"].sum()
    assert volume(mesh) == pytest.approx(by_vtk, rel=1e-9)
    for kind in ("hexahedron", "wedge", "pyramid"):
        assert said_of(said, f"cells of type {kind} into"), kind
    # The boundary of conforming tetrahedra is that of the box.
    middles = mesh.points[meshes.boundary_facets(mesh.tets)].mean(axis=1)
    off = np.abs(np.abs(middles - [0, 0, -0.006]) - [0.02, 0.02, 0.006]).min(axis=1)
    assert off.max() < 1e-12


def test_facets_of_hexahedra_stay_in_their_sets(tmp_path):
    import meshio

    points, bricks = boxes(3, 2, 2, (0.030, 0.020, 0.010))
    top = bricks[np.isclose(points[bricks][:, 4:, 2].mean(axis=1), 0)][:, 4:]
    raw = meshio.Mesh(
        points, [("hexahedron", bricks), ("quad", top)],
        cell_data={"gmsh:physical": [np.full(len(bricks), 1), np.full(len(top), 2)],
                   "gmsh:geometrical": [np.full(len(bricks), 1), np.full(len(top), 2)]},
        field_data={"skin": np.array([1, 3]), "top": np.array([2, 2])},
    )  # fmt: skip
    meshio.write(tmp_path / "a.msh", raw, file_format="gmsh22")
    mesh = meshes.read(tmp_path / "a.msh")
    assert mesh.region_names == {1: "skin"}
    facets = mesh.points[mesh.facets["top"]]
    assert np.isclose(facets[..., 2], 0).all()
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    assert normals[:, 2].sum() / 2 == pytest.approx(0.030 * 0.020)
    assert (normals[:, 2] > 0).all()


def test_cells_that_are_not_split_are_named(tmp_path):
    import meshio

    points, bricks = boxes(1, 1, 1, (0.02, 0.02, 0.01))
    middles = [(bricks[0, a] + 0, bricks[0, b] + 0) for a, b in
               ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
                (2, 6), (3, 7))]  # fmt: skip
    every = np.vstack([points, [(points[a] + points[b]) / 2 for a, b in middles]])
    nodes = np.append(bricks[0], 8 + np.arange(12))[None]
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(every, [("hexahedron20", nodes)]))
    assert "1 of type hexahedron20" in refused(tmp_path / "a.vtu")


# Abaqus


def abaqus(parts, instances="", head="*HEADING\n"):
    """An input file of parts (name, lines after *PART) and instances."""
    text = head
    for name, body in parts:
        text += f"*Part, name={name}\n{body}*End Part\n"
    return text + f"*Assembly, name=A\n{instances}*End Assembly\n"


def nodes_and_elements(points, tets, more="", first=1):
    rows = [f"{i + first}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist())]
    cells = [
        f"{i + 1}, " + ", ".join(map(str, tet)) for i, tet in enumerate((tets + first).tolist())
    ]
    return "*Node\n" + "\n".join(rows) + f"\n*Element, type=C3D4{more}\n" + "\n".join(cells) + "\n"


def test_instances_are_placed_by_translation_and_rotation(tmp_path):
    part = [("BAR", nodes_and_elements(*half(-1)))]
    instances = (
        "*Instance, name=A-1, part=BAR\n*End Instance\n*Instance, name=A-2, part=BAR\n"
        "0., 0., 0.\n0., 0., 0., 0., 0., 1., 180.\n*End Instance\n"
    )
    (tmp_path / "a.inp").write_text(abaqus(part, instances))
    mesh, said = made(tmp_path / "a.inp")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
    assert said_of(said, "read 2 parts or instances")
    away = instances.replace("0., 0., 0.\n", "0., 0.05, 0.\n")
    (tmp_path / "a.inp").write_text(abaqus(part, away))
    assert "2 separate bodies (9.6, 9.6 cm3)" in refused(tmp_path / "a.inp")
    # A translation comes before the rotation, here about an axis away from the origin.
    moved = "0.1, 0., 0.\n0.1, 0., 0., 0.1, 0., 1., 90."
    (tmp_path / "a.inp").write_text(
        abaqus(part, f"*Instance, name=A-1, part=BAR\n{moved}\n*End Instance\n")
    )
    x, y, _ = half(-1)[0].T
    read = meshes.read(tmp_path / "a.inp")
    np.testing.assert_allclose(np.ptp(read.points[:, :2], axis=0), [np.ptp(y), np.ptp(x)])
    np.testing.assert_allclose(read.points[:, 1].min(), x.min(), atol=1e-12)
    np.testing.assert_allclose(read.points[:, 0].mean(), 0.1, atol=1e-12)


def test_parts_that_are_numbered_alike_are_two_bodies_or_one_where_they_touch(tmp_path):
    parts = [(name, nodes_and_elements(*half(side))) for name, side in (("SKIN", -1), ("BONE", 1))]
    instances = "".join(
        f"*Instance, name={name}-1, part={name}\n*End Instance\n" for name, _ in parts
    )
    (tmp_path / "a.inp").write_text(abaqus(parts, instances))
    mesh, _ = made(tmp_path / "a.inp")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
    assert sorted(mesh.region_names.values()) == ["BONE", "SKIN"]


def test_instances_may_have_nodes_and_elements_of_their_own(tmp_path):
    instances = "".join(
        f"*Instance, name=P-{side}, part=P\n{nodes_and_elements(*half(side))}*End Instance\n"
        for side in (-1, 1)
    )
    (tmp_path / "a.inp").write_text(abaqus([("P", "")], instances))
    mesh, said = made(tmp_path / "a.inp")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
    assert said_of(said, "merged 15 nodes")


def test_generated_sets_that_have_each_element_once_are_regions(tmp_path):
    upper = SLAB.points[SLAB.tets].mean(axis=1)[:, 2] > -0.006
    order = np.concatenate([np.flatnonzero(upper), np.flatnonzero(~upper)])
    text = nodes_and_elements(SLAB.points, SLAB.tets[order], ", elset=ALL")
    text += f"*Elset, elset=skin, generate\n1, {upper.sum()}, 1\n"
    text += f"*Elset, elset=muscle, generate\n{upper.sum() + 1}, {len(order)}\n"
    (tmp_path / "a.inp").write_text(text)
    mesh, said = made(tmp_path / "a.inp")
    names = {mesh.region_names[r]: (mesh.region == r).sum() for r in np.unique(mesh.region)}
    assert names == {"SKIN": upper.sum(), "MUSCLE": (~upper).sum()}
    assert said_of(said, "element sets that are not taken as regions: ALL")


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
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
    names = {name: (mesh.region == number).sum() for number, name in mesh.region_names.items()}
    assert names == {"SKIN": upper.sum(), "MUSCLE": (~upper).sum()} or sum(names.values()) == len(
        mesh.tets
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("*NODE\n1, 0, 0, 0\n*NGEN\n1, 9, 1\n", r"has \*NGEN, which places or makes"),
        ("*NODE, SYSTEM=C\n1, 1, 90, 0\n", r"has \*NODE, which places or makes"),
        ("*INCLUDE, INPUT=gone.inc\n", "includes 'gone.inc', which cannot be found"),
        ("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", "no node 2 of its element 1"),
        ("*INSTANCE, NAME=a, PART=b\n*END INSTANCE\n", "instance of the part 'b'"),
        ("*NODE\n1, a, 0, 0\n", r"a line below \*NODE is not of whole numbers"),
    ],
)
def test_what_abaqus_makes_by_a_rule_is_refused(tmp_path, text, said):
    (tmp_path / "a.inp").write_text(text)
    with pytest.raises(MeshError, match=said):
        meshes.read(tmp_path / "a.inp")


# One sound body


def test_tetrahedra_that_are_listed_twice_are_taken_once(tmp_path):
    tets = np.vstack([SLAB.tets, SLAB.tets[10:15][:, [1, 2, 0, 3]]])
    grid_of(SLAB.points, {TETRAHEDRON: tets}).save(tmp_path / "a.vtu")
    mesh, said = made(tmp_path / "a.vtu")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
    assert said_of(said, "left out 5 tetrahedra that are listed twice")


def test_the_smaller_of_two_groups_is_the_region(tmp_path):
    import meshio

    upper = SLAB.points[SLAB.tets].mean(axis=1)[:, 2] > -0.006
    tets = np.vstack([SLAB.tets, SLAB.tets])
    groups = np.concatenate([np.full(len(SLAB.tets), 1), np.where(upper, 2, 3)])
    raw = meshio.Mesh(
        SLAB.points, [("tetra", tets)],
        cell_data={"gmsh:physical": [groups], "gmsh:geometrical": [groups]},
        field_data={"all": np.array([1, 3]), "skin": np.array([2, 3]), "fat": np.array([3, 3])},
    )  # fmt: skip
    meshio.write(tmp_path / "a.msh", raw, file_format="gmsh22")
    mesh, said = made(tmp_path / "a.msh")
    assert set(mesh.region_names.values()) == {"skin", "fat"}
    assert said_of(said, "the smaller of their groups is taken as their region")


def test_voxels_are_split_as_hexahedra(tmp_path):
    points, bricks = boxes(4, 4, 2, (0.040, 0.040, 0.012))
    grid_of(points, {11: bricks[:, [0, 1, 3, 2, 4, 5, 7, 6]]}).save(tmp_path / "a.vtu")
    assert volume(meshes.read(tmp_path / "a.vtu")) == pytest.approx(19.2, rel=1e-9)


def test_damaged_files_are_refused_by_what_is_wrong(tmp_path):
    points = np.array(SLAB.points)
    points[3] = np.nan
    grid_of(points, {TETRAHEDRON: SLAB.tets}).save(tmp_path / "a.vtk")
    with pytest.raises(MeshError, match="1 nodes whose coordinates are no numbers"):
        meshes.read(tmp_path / "a.vtk")
    meshes.write(tmp_path / "b.msh", SLAB)
    content = (tmp_path / "b.msh").read_bytes()
    (tmp_path / "b.msh").write_bytes(content[: len(content) * 3 // 4])
    with pytest.raises(MeshError, match="cut short or no mesh of gmsh"):
        meshes.read(tmp_path / "b.msh")
    (tmp_path / "c.stl").write_text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0")
    with pytest.raises(MeshError, match="is damaged or cut short"):
        meshes.read_surface(tmp_path / "c.stl")


def test_inverted_tetrahedra_are_turned_and_overlapping_ones_refused(tmp_path):
    tets = np.array(SLAB.tets)
    tets[:20] = tets[:20][:, [0, 2, 1, 3]]
    grid_of(SLAB.points, {TETRAHEDRON: tets}).save(tmp_path / "a.vtu")
    mesh, said = made(tmp_path / "a.vtu")
    assert said_of(said, "turned round 20 of 192")
    assert volume(mesh) == pytest.approx(19.2, rel=1e-9)
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
    said = refused(tmp_path / "a.vtu")
    assert "2 separate bodies (19.2, 0.000167 cm3)" in said
    assert "--keep largest" in said
    mesh, said = made(tmp_path / "a.vtu", keep_largest=True)
    assert len(mesh.tets) == len(SLAB.tets)
    assert said_of(said, "kept the largest of 2 bodies, 100.0 % of the volume")


def test_units_that_no_hand_has_are_asked_for(tmp_path):
    meshes.write(tmp_path / "a.msh", replace(SLAB, points=1e3 * SLAB.points))
    said = refused(tmp_path / "a.msh")
    assert "which may be mm (--unit mm" in said
    mesh, _ = made(tmp_path / "a.msh", unit="mm")
    np.testing.assert_allclose(mesh.points, SLAB.points, atol=1e-15)


def test_a_mesh_is_turned_and_brought_below_the_device(tmp_path):
    x, y, z = SLAB.points.T
    corner = np.column_stack([x + 0.02, z + 0.012, 0.02 - y])  # y up, a corner at the origin
    meshes.write(tmp_path / "a.msh", replace(SLAB, points=corner, facets={}))
    mesh, said = made(tmp_path / "a.msh", up="+y")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose(low, [-0.02, -0.02, -0.012], atol=1e-3)
    np.testing.assert_allclose(high, [0.02, 0.02, 0.0], atol=1e-3)
    assert high[2] == pytest.approx(0.0, abs=1e-12)
    assert said_of(said, "its top to the origin")
    meshes.write(tmp_path / "b.vtu", mesh)
    again, said = made(tmp_path / "b.vtu")
    np.testing.assert_array_equal(again.points, mesh.points)  # where it is on its top already
    assert not said_of(said, "moved by")


# Surfaces


def open_wrist(path, rim=0.0):
    """A tube along y that is closed at one end only, whose open rim leaves its plane by `rim`."""
    import pyvista

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
    said = refused(tmp_path / "a.stl")
    assert "open along 24 of its" in said
    assert "--cap" in said
    mesh, said = made(tmp_path / "a.stl", cap=True)
    area = 24 / 2 * np.sin(2 * np.pi / 24) * 0.02 * 0.008
    assert volume(mesh) == pytest.approx(1e6 * 0.04 * area, rel=0.02)
    assert said_of(said, "closed a hole of 24 edges, 40 mm wide and 0.0 mm out of a plane")
    open_wrist(tmp_path / "b.stl", rim=0.005)
    said = refused(tmp_path / "b.stl", cap=True)
    assert "10.0 mm out of a plane and cannot be capped" in said


def test_a_bone_in_the_file_of_its_skin_is_named_with_both_cures(tmp_path):
    import pyvista

    skin, bone = pyvista.Sphere(radius=0.02), pyvista.Sphere(radius=0.005)
    (skin + bone).save(tmp_path / "a.stl")
    said = refused(tmp_path / "a.stl")
    assert "2 separate pieces" in said
    assert "--inner" in said
    surface = meshes.read_surface(tmp_path / "a.stl")
    kept, notes = meshes.repaired(surface.points, surface.triangles, keep_largest=True)
    assert len(kept.triangles) == skin.n_cells
    assert notes[-1] == "kept the largest of 2 pieces, 94.1 % of the area"


def test_compressed_gltf_is_named(tmp_path):
    head = {"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}
    (tmp_path / "a.gltf").write_text(json.dumps(head))
    assert "KHR_draco_mesh_compression" in refused(tmp_path / "a.gltf")


def test_volumes_of_curved_elements_are_those_of_their_edges():
    ball = meshes.block((2.0, 2.0, 2.0), 0.5)
    along = np.tan((ball.points + [0, 0, 1]) * np.pi / 4)
    size = np.linalg.norm(along, axis=1, keepdims=True)
    points = along * np.abs(along).max(axis=1, keepdims=True) / np.maximum(size, 1e-9)
    curved = element_volumes(points, ball.tets).sum()
    assert curved == pytest.approx(4 / 3 * np.pi, rel=3e-3)
    straight = meshes.corner_volumes(points, ball.tets).sum()
    assert abs(curved / straight - 1) > 0.02


@pytest.mark.parametrize("sides", [(0.048, 0.032, 0.01), (0.04, 0.04, 0.012), (0.03, 0.02, 0.01)])
def test_bodies_are_centred_whatever_the_rounding_at_their_sides(sides):
    block = meshes.block(sides, 0.008, order=1)
    surface, _ = meshes.repaired(block.points, meshes.boundary_facets(block.tets))
    x, y, radius = widest_place(surface)
    assert [x, y] == pytest.approx([0, 0], abs=0.01 * sides[0])
    assert radius == pytest.approx(min(sides[:2]) / 2, rel=0.02)


def test_negative_regions_are_refused_and_not_taken_as_positive(tmp_path):
    grid = grid_of(SLAB.points, {TETRAHEDRON: SLAB.tets})
    grid.cell_data["material"] = np.where(np.arange(len(SLAB.tets)) < 96, 1, -1)
    grid.save(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match="0 or above"):
        meshes.read(tmp_path / "a.vtu")
