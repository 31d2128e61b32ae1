"""Meshes and surfaces in files: exact round trips, foreign orders, seams, and what is refused."""

import functools
import json
import re
import struct
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import meshes
from meshes import MeshError, TetMesh
from meshes.shapes.palm import Palm, level_set
from meshes.surface import alignment
from meshes.surface.repair import check
from meshes.surface.triangulation import Surface, volume
from skinwave.commands.cli import main
from skinwave.models.prepared import prepare
from skinwave.scene.scene import Body

GMSH_EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]  # of gmsh's manual, 10-node tets


def layered(order):
    """A block of two regions with the facet sets of its sides, one of them empty."""
    mesh = meshes.block((0.02, 0.03, 0.01), 0.005, order=order)
    region = np.where(mesh.points[mesh.tets].mean(axis=1)[:, 2] > -0.005, 3, 0)
    return replace(mesh, region=region, facets={**mesh.facets, "no one": mesh.facets["top"][:0]})


def curved_ball():
    mesh = meshes.block((2.0, 2.0, 2.0), 0.5)
    along = np.tan((mesh.points + [0, 0, 1]) * np.pi / 4)
    size = np.abs(along).max(axis=1, keepdims=True)
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return TetMesh(points=along * (1 + 0.2 * (size / length - 1)), tets=mesh.tets)


def same(one, other):
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.tets, other.tets)
    np.testing.assert_array_equal(one.region, other.region)
    assert one.facets.keys() == other.facets.keys()
    for name, facets in one.facets.items():
        np.testing.assert_array_equal(other.facets[name], facets)
        assert other.facets[name].shape == facets.shape


# Round trips


@pytest.mark.parametrize("suffix", [".vtu", ".msh"])
@pytest.mark.parametrize("order", [1, 2])
def test_a_mesh_is_read_as_it_was_written(tmp_path, suffix, order):
    mesh = layered(order)
    meshes.write(tmp_path / f"body{suffix}", mesh)
    same(mesh, meshes.read(tmp_path / f"body{suffix}"))
    assert [path.name for path in tmp_path.iterdir()] == [f"body{suffix}"]


@pytest.mark.parametrize("suffix", [".vtu", ".msh"])
def test_curved_elements_are_read_as_they_were_written(tmp_path, suffix):
    for mesh in (curved_ball(), meshes.builtin("palm")):
        meshes.write(tmp_path / f"body{suffix}", mesh)
        same(mesh, meshes.read(tmp_path / f"body{suffix}"))


def test_fields_are_beside_the_mesh_for_other_programs(tmp_path):
    import pyvista

    mesh = layered(2)
    motion = np.random.default_rng(0).normal(size=(len(mesh.points), 3))
    stress = np.arange(float(len(mesh.tets)))
    meshes.write(tmp_path / "a.vtu", mesh, motion=motion, stress=stress)
    seen = pyvista.read(tmp_path / "a.vtu")
    np.testing.assert_array_equal(seen.point_data["motion"], motion)
    np.testing.assert_array_equal(seen.cell_data["stress"][: len(mesh.tets)], stress)
    np.testing.assert_array_equal(seen.cell_data["region"][: len(mesh.tets)], mesh.region)
    top = seen.extract_cells(seen.cell_data["facets:top"] == 1)
    assert set(top.points[:, 2]) == {0.0}
    same(mesh, meshes.read(tmp_path / "a.vtu"))


def write_grid(path, mesh):
    import pyvista

    cells = np.column_stack([np.full(len(mesh.tets), 10), mesh.tets]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(mesh.tets), 24), np.array(mesh.points))
    grid.cell_data["material"] = mesh.region.astype(np.int32)
    grid.save(path)


def test_what_pyvista_writes_is_read(tmp_path):
    mesh = layered(2)
    for name in ("a.vtu", "b.vtk"):
        write_grid(tmp_path / name, mesh)
        read = meshes.read(tmp_path / name)
        np.testing.assert_array_equal(read.tets, mesh.tets)
        np.testing.assert_array_equal(read.points, mesh.points)
        np.testing.assert_array_equal(read.region, mesh.region)
        assert read.points.dtype.isnative
        assert read.region.dtype == np.int64


def test_units_are_taken_to_metre(tmp_path):
    mesh = layered(1)
    meshes.write(tmp_path / "a.vtu", replace(mesh, points=mesh.points * 1e3))
    np.testing.assert_allclose(meshes.read(tmp_path / "a.vtu", unit="mm").points, mesh.points)


# Order of nodes


def gmsh_file(path, points, tets, *, edges=GMSH_EDGES, triangles=(), names=""):
    """A mesh of 10-node tetrahedra in version 2.2, written by hand."""
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


CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]
TWO = [(7, (0, 1, 2, 3)), (9, (1, 2, 3, 4))]
NAMES = '$PhysicalNames\n2\n2 5 "the lid"\n3 7 "skin"\n$EndPhysicalNames'


def in_the_middle(mesh):
    ends = mesh.points[mesh.tets[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]]]  # VTK
    np.testing.assert_allclose(mesh.points[mesh.tets[:, 4:]], ends.mean(axis=2), atol=1e-15)


def test_nodes_of_gmsh_are_taken_to_our_order(tmp_path):
    gmsh_file(tmp_path / "a.msh", CORNERS, TWO, triangles=[(0, 1, 2)], names=NAMES)
    mesh = meshes.read(tmp_path / "a.msh")
    in_the_middle(mesh)
    assert sorted(mesh.region) == [7, 9]
    (lid,) = mesh.facets["the lid"]
    ends = mesh.points[lid[[[0, 1], [1, 2], [2, 0]]]]
    np.testing.assert_allclose(mesh.points[lid[3:]], ends.mean(axis=1))
    a, b, c = mesh.points[lid[:3]]
    assert np.cross(b - a, c - a)[2] < 0  # seen from below, which is outside


def test_what_is_written_for_gmsh_has_its_order(tmp_path):
    meshes.write(tmp_path / "a.msh", layered(2))
    content = (tmp_path / "a.msh").read_bytes()
    assert content.startswith(b"$MeshFormat\n2.2 1 8\n")
    n = len(layered(2).points)
    start = content.index(b"$Nodes\n") + len(b"$Nodes\n") + len(f"{n}\n")
    record = np.dtype([("number", "i4"), ("at", "f8", 3)])
    points = np.frombuffer(content, record, n, start)["at"]
    start = content.index(b"$Elements\n")
    start = content.index(b"\n", start + len(b"$Elements\n")) + 1
    kind, count, tags = np.frombuffer(content, "i4", 3, start)
    assert (kind, tags) == (11, 2)
    tets = np.frombuffer(content, "i4", 13 * count, start + 12).reshape(-1, 13)[:, 3:] - 1
    for node, (a, b) in enumerate(GMSH_EDGES, start=4):
        halfway = (points[tets[:, a]] + points[tets[:, b]]) / 2
        np.testing.assert_allclose(points[tets[:, node]], halfway, atol=1e-15)


def test_an_order_that_is_not_its_formats_is_told_by_where_nodes_are(tmp_path):
    vtk = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    for edges in (vtk, vtk[::-1], [vtk[i] for i in (3, 5, 0, 1, 4, 2)]):
        gmsh_file(tmp_path / "a.msh", CORNERS, TWO, edges=edges)
        in_the_middle(meshes.read(tmp_path / "a.msh"))


def test_nodes_beside_their_edges_are_refused(tmp_path):
    gmsh_file(tmp_path / "a.msh", CORNERS, TWO, edges=[(0, 1)] * 3 + GMSH_EDGES[3:])
    with pytest.raises(MeshError, match=r"2 of 2 tetrahedra with a node further than 25% of an"):
        meshes.read(tmp_path / "a.msh")


ABAQUS = """*HEADING
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 0, 1, 0
4, 0, 0, 1
5, 1, 1, 1
9, 8, 8, 8
*ELEMENT, TYPE=C3D4, ELSET=SKIN
1, 1, 2, 3, 4
*ELEMENT, TYPE=C3D4, ELSET=BONE
2, 2, 3, 4, 5
"""


def test_element_sets_of_abaqus_are_regions(tmp_path):
    (tmp_path / "a.inp").write_text(ABAQUS)
    mesh = meshes.read(tmp_path / "a.inp")
    assert mesh.region.tolist() == [1, 2]
    assert len(mesh.points) == 5  # the one that nothing uses is gone
    assert meshes.corner_volumes(mesh.points, mesh.tets).sum() == pytest.approx(0.5)


# What is refused


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.vtu", b"", "is damaged or cut short; save it again"),
        ("a.vtu", b"<VTKFile>", "is damaged or cut short"),
        ("a.msh", b"nothing", "cut short or no mesh of gmsh"),
        ("a.msh", b"$MeshFormat\n9.9 0 8\n$EndMeshFormat\n", "cut short or no mesh of gmsh"),
        ("a.inp", b"*NODE\n1, a, b\n", "cannot be read"),
        ("a.inp", b"", "holds no triangles and no solid"),
        ("a.vtk", b"# vtk DataFile Version 3.0\n", "damaged|holds no triangles"),
        ("a.xyz", b"", "of no kind that is read here; give one of .vtu"),
        ("a.msh", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n"
         b"$EndNodes\n$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n",
         "is a surface without solid elements; read it"),
    ],
)  # fmt: skip
def test_no_mesh_file_is_refused_in_one_sentence(tmp_path, capfd, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=said) as error:
        meshes.read(tmp_path / name)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")
    with pytest.raises(MeshError, match="no file that is there"):
        meshes.read(tmp_path / f"not-{name}".replace("xyz", "vtu"))


def test_version_4_of_another_program_is_read_or_refused_but_never_wrong(tmp_path):
    import meshio

    mesh = layered(2)
    raw = meshio.Mesh(mesh.points, [("tetra10", mesh.tets)])
    meshio.write(tmp_path / "a.msh", raw, file_format="gmsh")
    read = meshes.read(tmp_path / "a.msh")
    np.testing.assert_array_equal(read.tets, mesh.tets)
    meshio.write(tmp_path / "b.msh", raw, file_format="gmsh", binary=False)
    try:
        in_the_middle(meshes.read(tmp_path / "b.msh"))
    except MeshError as error:
        assert "msh22" in str(error)  # noqa: PT017 - either outcome is right


@pytest.mark.parametrize(
    ("name", "fields", "said"),
    [
        ("a.stl", {}, "choose one of the kinds .msh, .vtu"),
        ("a.vtu", {"region": [1]}, "a field cannot be called 'region'"),
        ("a.vtu", {"facets:top": [1]}, "cannot be called"),
        ("a.vtu", {"u": [1, 2]}, r"field 'u' has shape \(2,\); give one value for each of"),
        ("a.vtu", {"u": 1.0}, r"shape \(\)"),
    ],
)
def test_nothing_is_left_of_what_cannot_be_written(tmp_path, name, fields, said):
    with pytest.raises(MeshError, match=said):
        meshes.write(tmp_path / name, layered(1), **fields)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    import meshio

    (tmp_path / "a.vtu").write_text("mine")

    def half_written(path, *arguments, **options):
        with open(path, "w") as file:
            file.write("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio, "write", half_written)
    with pytest.raises(OSError, match="No space left"):
        meshes.write(tmp_path / "a.vtu", layered(1))
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtu"]
    assert (tmp_path / "a.vtu").read_text() == "mine"


def test_only_readers_and_writers_know_meshio():
    folder = meshes.__path__[0]
    found = subprocess.run(
        ["grep", "-rl", "--include=*.py", "import meshio", folder], capture_output=True, text=True
    )
    assert set(found.stdout.split()) == {
        f"{folder}/files/{name}.py" for name in ("abaqus", "mesh_files", "reader_child")
    }


# Surfaces in files


@functools.cache
def hand():
    """A low-polygon hand in metre: fingers along -x, palm towards +y, far from the origin."""
    import pyvista

    grid = pyvista.ImageData(
        dimensions=(28, 45, 14), spacing=(5e-3,) * 3, origin=(-0.0623, -0.0633, -0.0433)
    )
    points = np.asarray(grid.points, np.float64)
    inside = level_set(Palm(), points)
    fingers = [(x, 0.03, 1.15 * x, 0.05 + y) for x, y in
               ((-0.033, 0.055), (-0.011, 0.07), (0.011, 0.08), (0.033, 0.07))]  # fmt: skip
    for x, y, x_tip, y_tip in [*fingers, (0.028, -0.03, 0.052, 0.025)]:
        root, tip = np.array([x, y, -0.01]), np.array([x_tip, y_tip, -0.008])
        along = np.clip((points - root) @ (tip - root) / ((tip - root) @ (tip - root)), 0, 1)
        away = np.linalg.norm(points - root - along[:, None] * (tip - root), axis=1) - 0.009
        blend = np.maximum(0.006 - np.abs(inside - away), 0)
        inside = np.minimum(inside, away) - blend**2 / 0.024
    contour = grid.contour([0.0], scalars=inside, method="flying_edges")
    x, y, z = np.asarray(contour.points, np.float64).T
    triangles = np.asarray(contour.faces).reshape(-1, 4)[:, 1:]
    return np.column_stack([-y + 1.2, z + 0.4, -x - 3.0]), triangles


def with_seams(points, triangles):
    """Each half of the hand with points of its own, as where textures meet."""
    upper = points[triangles].mean(axis=1)[:, 2] > -3.0
    return np.vstack([points, points]), triangles + len(points) * upper[:, None]


def write_obj(path, points, triangles):
    rows = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in points]
    rows += ["f {} {} {}".format(*(triangle + 1)) for triangle in triangles]
    path.write_text("\n".join(rows) + "\n")


def write_glb(path, points, triangles):
    """Binary glTF of two primitives below a node that moves them."""
    half = len(triangles) // 2
    blobs, views, accessors, primitives = b"", [], [], []
    for part in (triangles[:half], triangles[half:]):
        used, numbers = np.unique(part, return_inverse=True)
        positions = (points[used] - [1, 0, 0]).astype("<f4")
        arrays = (positions, numbers.astype("<u4").reshape(-1))
        kinds = ((5126, "VEC3"), (5125, "SCALAR"))
        for array, (component, kind) in zip(arrays, kinds, strict=True):
            views.append({"buffer": 0, "byteOffset": len(blobs), "byteLength": array.nbytes})
            accessor = {"bufferView": len(views) - 1, "componentType": component, "type": kind,
                        "count": len(array)}  # fmt: skip
            if kind == "VEC3":
                low, high = positions.min(axis=0), positions.max(axis=0)
                accessor |= {"min": low.tolist(), "max": high.tolist()}
            accessors.append(accessor)
            blobs += array.tobytes()
        last = len(accessors)
        primitives.append({"attributes": {"POSITION": last - 2}, "indices": last - 1})
    head = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 0, 0]}],
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blobs)}],
    }
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(blobs)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, total)
        + struct.pack("<I4s", len(text), b"JSON") + text
        + struct.pack("<I4s", len(blobs), b"BIN\0") + blobs
    )  # fmt: skip


def write_by_vtk(path, points, triangles):
    import pyvista

    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    pyvista.PolyData(points, faces=faces).save(path)


WRITERS = {".obj": write_obj, ".glb": write_glb, ".stl": write_by_vtk, ".ply": write_by_vtk,
           ".vtp": write_by_vtk}  # fmt: skip


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_hand_with_seams_is_the_same_from_every_kind_of_file(tmp_path, suffix):
    points, triangles = with_seams(*hand())
    WRITERS[suffix](tmp_path / f"hand{suffix}", points, triangles)
    raw = meshes.read_surface(tmp_path / f"hand{suffix}", up="+y")
    surface, _ = meshes.repaired(raw.points, raw.triangles)
    check(surface)
    x, y, z = points.T
    plain, _ = meshes.repaired(np.column_stack([x, -z, y]), triangles)
    assert volume(surface) == pytest.approx(volume(plain), rel=1e-4)
    np.testing.assert_allclose(surface.points.max(axis=0), plain.points.max(axis=0), atol=1e-6)


@pytest.mark.parametrize("up", alignment.TURNS)
def test_up_is_a_turn_that_takes_the_axis_to_z(up):
    axis = np.zeros((3, 3))
    axis[0, "xyz".index(up[1])] = 1 if up[0] == "+" else -1
    turned = alignment.turned(Surface(points=axis, triangles=[[0, 1, 2]]), up)
    assert turned.points[0].tolist() == [0, 0, 1]
    assert np.linalg.det(alignment.TURNS[up]) == 1


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.stl", b"", "damaged|holds no triangles"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "damaged|holds no triangles"),
        ("a.obj", b"v 0 0 0\n", "holds no triangles and no solid"),
        ("a.glb", b"glTF....", "damaged|holds no triangles"),
        ("a.vtp", b"<VTKFile>", "damaged|holds no triangles"),
        ("a.fbx", b"", "of no kind that is read here; give one of .vtu"),
    ],
)
def test_no_surface_file_is_refused_in_one_sentence(tmp_path, capfd, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=said) as error:
        meshes.read_surface(tmp_path / name)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def damaged(content, seed):
    """A file cut short, or with a few bytes changed at its beginning or anywhere."""
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:
        return content[: rng.integers(len(content))]
    changed = bytearray(content)
    for place in rng.integers(len(content) if seed % 3 == 1 else min(len(content), 1500), size=4):
        changed[place] = rng.integers(256)
    return bytes(changed)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [*WRITERS, ".vtu", ".msh", ".inp", ".vtk"])
def test_a_damaged_file_takes_nobody_with_it(tmp_path, capfd, suffix):
    path = tmp_path / f"body{suffix}"
    if suffix in WRITERS:
        points, triangles = hand()
        WRITERS[suffix](path, points, triangles[:400])
    elif suffix == ".inp":
        path.write_text(ABAQUS)
    elif suffix == ".vtk":
        write_grid(path, layered(2))
    else:
        meshes.write(path, layered(2))
    content, read = path.read_bytes(), meshes.read_surface if suffix in WRITERS else meshes.read
    for seed in range(3):
        path.write_bytes(damaged(content, seed))
        try:
            read(path)
        except MeshError as error:
            assert "\n" not in str(error)  # noqa: PT017 - a damaged coordinate is still a number
    assert capfd.readouterr() == ("", "")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


# skinwave mesh


def test_a_hand_with_seams_is_meshed_with_unit_and_up_only(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    points, triangles = with_seams(*hand())
    write_glb(tmp_path / "hand.glb", points, triangles)
    assert main(["mesh", "hand.glb", "--unit", "m", "--up", "+y", "--h", "12", "--json"]) == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert any("along seams" in sentence for sentence in summary["said"])
    mesh = meshes.read("hand-mesh.vtu")
    assert meshes.dihedral_angles(mesh).min() > 5
    assert {"surface", "top", "bottom"} == set(mesh.facets)
    assert {name: len(f) for name, f in mesh.facets.items()} == summary["facets"]
    # The middle of the palm, not that of the whole hand, is the origin.
    top = mesh.points[np.unique(mesh.facets["top"])]
    near = top[np.linalg.norm(top[:, :2], axis=1) < 0.012]
    assert np.abs(near[:, 2]).max() < 0.003
    true, _ = meshes.repaired(*hand())
    x_wrist, x_tip = true.points[:, 0].max(), true.points[:, 0].min()
    assert 0.03 < mesh.points[:, 0].max() < 0.07 < 0.1 < -mesh.points[:, 0].min()
    assert np.ptp(mesh.points[:, 0]) == pytest.approx(x_wrist - x_tip, abs=0.002)
    assert {path.name for path in tmp_path.iterdir()} == {"hand.glb", "hand-mesh.vtu"}


def test_a_patch_is_cut_with_its_cuts_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    points, triangles = hand()
    write_by_vtk("hand.ply", 1e3 * points, triangles)
    patch = ["--clip", "-30", "35", "-32", "28"]
    arguments = ["--unit", "mm", "--up", "+y", "--h", "10", "--out", "patch.vtu"]
    assert main(["mesh", "hand.ply", *arguments, *patch]) == 0
    assert "cut at 4 planes" in capsys.readouterr().out
    mesh = meshes.read("patch.vtu")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose([low[0], high[0], low[1], high[1]], [-0.03, 0.035, -0.032, 0.028],
                               atol=1e-3)  # fmt: skip
    centroid, normal = meshes.facets.geometry(mesh, mesh.facets["cut"])
    assert np.abs(normal[:, :2]).max(axis=1).min() > 0.9
    assert {"top", "cut", "bottom", "surface"} == set(mesh.facets)
    assert len(mesh.facets["surface"]) == sum(
        len(mesh.facets[name]) for name in ("top", "cut", "bottom")
    )
    assert (centroid[:, 0] > 0.034).any()
    assert (centroid[:, 1] < -0.031).any()


def test_a_mesh_is_taken_as_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    meshes.write("slab.msh", layered(2))
    assert main(["mesh", "slab.msh", "--quiet"]) == 0
    mesh = meshes.read("slab-mesh.vtu")
    np.testing.assert_array_equal(mesh.tets, layered(2).tets)
    np.testing.assert_array_equal(mesh.facets["top"], layered(2).facets["top"])
    assert "surface" in mesh.facets
    assert main(["mesh", "slab.msh", "--quiet"]) == 2
    assert "exists and is kept; pass --overwrite" in capsys.readouterr().err
    assert main(["mesh", "slab.msh", "--quiet", "--overwrite"]) == 0


def test_options_of_the_command_reach_the_reader(tmp_path, capsys):
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
    assert "which may be mm (--unit mm" in capsys.readouterr().err


def test_what_is_prepared_is_kept_for_the_facets_that_a_file_names(tmp_path):
    block = meshes.block((0.02, 0.02, 0.01), 0.005)
    body = Body(kind="mesh", file=str(tmp_path / "body.vtu"), sides="clamped")
    read = []
    for held, pushed in (("sides", "top"), ("left", "top"), ("left", "part")):
        part = block.facets["top"][block.points[block.facets["top"]][..., 0].max(axis=1) < 1e-9]
        facets = {"sides": block.facets[held], "top": {**block.facets, "part": part}[pushed]}
        meshes.write(body.file, replace(block, facets=facets))
        read.append(prepare(body, np.array([(-0.004, 0.001)]), h=0.005))
    stiffness = [np.abs(prepared.body.poles.values[:3]).sum() for prepared in read]
    assert stiffness[0] != pytest.approx(stiffness[1], rel=1e-3)
    assert len(read[1].body.points) == 2 * len(read[2].body.points)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["open.stl"], "open along .* edges, first near (.*) mm; close those in a plane"),
        (["hand.obj", "--unit", "mm"], "0.2.* mm from corner to corner .* which may be m"),
        (["hand.obj", "--unit", "feet"], "unit 'feet' is unknown; use one of m, cm, mm, um, in"),
        (["hand.obj", "--up", "up"], "up = 'up' is no axis; use one of"),
        (["hand.obj", "--h", "0"], "h = 0.0 m must be from"),
        (["hand.obj", "--h", "nan"], "h = nan m"),
        (["hand.obj", "--clip", "10", "20", "10", "20"], "must have the middle of the palm"),
        (["hand.obj", "--out", "hand.stl"], "ends in .vtu or .msh"),
        (["hand.obj", "--out", "no/where.vtu"], "no is no folder"),
        (["hand.obj", "--timeout", "0"], "timeout = 0.0 s"),
        (["missing.stl"], "missing.stl is no file that is there"),
        (["hand.step"], "of no kind that is read here"),
    ],
)
def test_what_cannot_be_meshed_ends_in_one_line(tmp_path, monkeypatch, capsys, arguments, said):
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


def test_reading_and_meshing_are_imported_only_when_used():
    code = (
        "import sys, meshes, skinwave.commands.cli; meshes.builtin('slab')\n"
        "assert not {'pyvista', 'vtkmodules', 'meshio', 'pytetwild'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
