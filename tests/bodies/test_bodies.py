"""Layers, placement and sides of bodies."""

import csv
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import read_results

import fem
import meshes
import skinwave
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.load.focus import along_axis, spot_width
from skinwave import compare
from skinwave.bodies.build import build
from skinwave.commands.cli import main
from skinwave.models.meshed import surface_load
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Body, Layer, Placement, Relief

pytestmark = pytest.mark.usefixtures("read_here")
HAND = Path(__file__).parents[2] / "examples/hand/generic-hand-right.glb"
PATH = Trajectory(shape="circle", size=0.02, speed=12.0)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.25, trajectory=PATH))
SKIN = skinwave.Scene(pressure=LOAD, body=Body(width=0.06, height=0.06))
CLAMPED = Body(width=0.06, height=0.06, sides="clamped")  # an eighth of the cost of `SKIN`'s
STILL = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.25))
THREE = ((0.0, 0.0), (0.01, 0.0), (0.02, 0.0))  # probes: in the middle, on the path, beyond it


def answered(body):
    probes = ((0.0, 0.0), (0.01, 0.0))
    return compute(replace(SKIN, body=body, probes=probes), "fem", h=0.006).displacement


def test_two_layers_of_one_material_are_one():
    layers = (Layer(thickness=0.004, material="palm"), Layer(thickness=0.002, material="palm"))
    one, three = CLAMPED, replace(CLAMPED, layers=layers)
    assert len(three.strata) == 1
    np.testing.assert_allclose(answered(three), answered(one), rtol=0, atol=1e-20)
    # and on a mesh that has the planes, with a material given to each region
    mesh = build(replace(one, layers=(Layer(thickness=0.004, material="fat"),)), 0.006).mesh
    assert set(mesh.region) == {0, 1}
    palm = fem.PRESETS["palm"]
    apart, alike = (fem.assemble(mesh, m, fixed="bottom") for m in ({0: palm, 1: palm}, palm))
    for name in ("K", "C", "M"):
        a, b = getattr(apart, name), getattr(alike, name)
        assert abs(a - b).max() <= 1e-12 * abs(b).max()


def test_a_layer_ends_on_a_plane_of_the_mesh():
    body = replace(CLAMPED, layers=(Layer(thickness=0.0012, material="fat"),))
    made = build(body, 0.006)
    depth = -made.mesh.points[made.mesh.tets[:, :4], 2]
    assert depth[made.mesh.region == 0].max() == pytest.approx(0.0012)
    assert depth[made.mesh.region == 1].min() == pytest.approx(0.0012)
    assert made.material == {0: fem.PRESETS["fat"], 1: fem.PRESETS["palm"]}
    soft, plain = answered(body), answered(CLAMPED)
    assert 1.03 < np.ptp(soft[:, 1]) / np.ptp(plain[:, 1]) < 1.3


@pytest.mark.parametrize("degrees", [0.0, 40.0])
def test_the_force_on_a_tilted_body_falls_with_the_cosine(degrees):
    """cos^2 of the incidence on a focal spot that is longer by 1/cos."""
    made = build(replace(SKIN.body, placement=Placement(tilt_y=np.radians(degrees))), 0.006)
    P, points = surface_load(made)
    # above or below the plane the focus is weaker; that is not asked here
    flat = LOAD.spot(points[:, :2], np.zeros(2))
    normal = made.mesh.points[made.mesh.facets["top"][0, :3]]
    normal = np.cross(normal[1] - normal[0], normal[2] - normal[0])
    normal /= np.linalg.norm(normal)
    force = -(P @ flat).reshape(-1, 3).sum(axis=0) @ normal
    whole = 2 * np.pi * spot_width(0.2) ** 2
    assert force == pytest.approx(whole * np.cos(np.radians(degrees)), rel=0.01)
    assert normal[0] == pytest.approx(np.sin(np.radians(degrees)))


def test_the_motion_of_a_lifted_body_follows_the_axial_pressure():
    raised = replace(CLAMPED, placement=Placement(lift=0.02))
    ratio = np.abs(answered(raised)).max() / np.abs(answered(CLAMPED)).max()
    assert ratio == pytest.approx(float(along_axis(0.02)), rel=0.02)


def test_a_body_of_half_the_size_moves_alike():
    scene = skinwave.Scene(pressure=STILL, body=Body(), probes=((0.0, 0.0), (0.015, 0.0)))
    sizes = (replace(scene, body=Body(width=side, height=side)) for side in (0.1, 0.05))
    whole, half = (
        answer(reduce_scene(each, SolveOptions(h=0.004), symmetry="xy"), scene) for each in sizes
    )
    assert compare(whole, half).relative_l2.max() < 0.05
    early = whole.times < 0.03  # before a wave of 5 m/s is back from 50 mm further out
    first = half.displacement[early] - whole.displacement[early]
    assert np.linalg.norm(first) < 0.02 * np.linalg.norm(whole.displacement[early])
    assert compare(compute(scene, "flat-body"), whole).relative_l2.max() < 0.05


def test_a_probe_beside_a_crease_reads_along_the_mean_normal():
    flat = meshes.block((0.04, 0.04, 0.01), 0.005)
    bent = flat.points + np.outer(-0.3 * np.abs(flat.points[:, 0]), [0, 0, 1])
    sideways = np.tile([1.0, 0.0, 0.0], len(bent))
    beside = [[-1e-5, 0.001], [1e-5, 0.001], [0.015, 0.001]]
    roof = replace(flat, points=bent)
    own, mean = (fem.probe_operator(roof, beside, patch=s) @ sideways for s in (0.0, 3e-3))
    slope = np.sin(np.arctan(0.3))
    np.testing.assert_allclose(own, [slope, -slope, -slope], rtol=1e-9)
    np.testing.assert_allclose(mean[:2], 0, atol=0.02 * slope)
    assert mean[2] == pytest.approx(-slope, rel=1e-3)
    for mesh in (flat, roof):
        level = [[0.012, 0.004]]  # a plane's own normal, however small the patch
        same = fem.probe_operator(mesh, level, patch=1e-5) - fem.probe_operator(mesh, level)
        assert abs(same).max() < 1e-12


@pytest.fixture
def block_file(tmp_path):
    block = meshes.block((0.05, 0.05, 0.01), 0.005)
    top, bottom, sides = (block.facets[name] for name in ("top", "clamped", "absorbing"))
    named = replace(block, facets={"top": top, "bottom": bottom, "sides": sides})
    meshes.write(tmp_path / "block.vtu", named)
    return tmp_path / "block.vtu"


def hand_in(file):
    return Body(kind="mesh", file=str(file), sides="clamped")


def test_a_mesh_in_a_file_is_a_body_of_a_scene(block_file, tmp_path):
    scene = replace(SKIN, body=replace(hand_in("block.vtu"), base="absorbing"))
    (tmp_path / "scene.toml").write_text(dumps(scene))
    read = skinwave.read(tmp_path / "scene.toml")
    assert read.body.file == str(block_file)  # named from where the scene file is
    made = build(read.body)
    assert made.fixed == {"sides": "xyz"}
    assert len(made.absorbing) == len(made.mesh.facets["bottom"])
    assert np.allclose(made.mesh.points[made.mesh.facets["bottom"], 2], -0.01)
    required = plan(read, SolveOptions(tolerance=0.02))
    assert required.model == "fem"
    assert np.isinf(required.error)
    assert "only one mesh: not known" in required.warnings[0]


@pytest.fixture
def dome(tmp_path):
    block = meshes.block((0.04, 0.04, 0.01), 0.005, order=1)
    points = block.points.copy()
    points[:, 2] *= 1 - 40 * np.abs(points[:, 0])
    return replace(block, points=points, facets={})


def built(folder, mesh):
    meshes.write(folder / "body.vtu", mesh)
    return build(hand_in(folder / "body.vtu"), 0.005).mesh


def test_a_mesh_in_a_file_keeps_its_own_bottom(dome, tmp_path):
    own = meshes.tag_boundary(
        dome, bottom=lambda at, normals: (at[:, 0] < -0.0101) & (normals[:, 2] < 0.5)
    )
    count = len(own.facets["bottom"])
    top = meshes.tag_boundary(own, top=lambda at, normals: (normals[:, 2] > 0.9) & (at[:, 0] > 0))
    for mesh in (own, top):
        assert len(built(tmp_path, mesh).facets["bottom"]) == count


def test_springs_and_dashpots_of_a_support_have_their_total_stiffness():
    block = meshes.block((0.02, 0.03, 0.01), 0.005)
    facets, soft = block.facets["clamped"], replace(fem.PRESETS["palm"], viscosity=0.0)
    x = fem.facet_points(block, facets)[:, 0]
    rest = fem.Support(facets=facets, stiffness=2e7 * (1 + 50 * x), absorbed=(x > 0).astype(float))
    held = fem.assemble(block, soft, fixed={}, support=rest)
    loose = fem.assemble(block, soft, fixed={})
    impedance = soft.density * soft.shear_speed * np.array([1, 1, 11**0.5])
    for axis in range(3):
        moved = np.zeros_like(block.points)
        moved[:, axis] = 1.0
        u = moved.ravel()
        assert u @ (loose.K @ u) < 1e-9 * 2e7
        assert u @ (held.K @ u) == pytest.approx(2e7 * 6e-4, rel=1e-9)
        assert u @ (held.R @ u) == pytest.approx(impedance[axis] * 3e-4, rel=1e-6)
    assert abs(held.C - held.R).max() < 1e-12 * abs(held.R).max()  # springs lose nothing


def test_a_support_keeps_the_balance_of_energy():
    block = meshes.block((0.02, 0.02, 0.01), 0.005)
    facets = block.facets["clamped"]
    many = np.ones(len(fem.facet_points(block, facets)))
    rest = fem.Support(facets=facets, stiffness=1e7 * many, absorbed=many)
    ops = fem.assemble(block, fem.PRESETS["palm"], fixed={}, support=rest)
    push = fem.pressure_operator(block).sum(axis=1)
    force = lambda t: push * 100 * np.sin(2 * np.pi * 200 * t)  # noqa: E731
    states = islice(fem.transient(ops, force, 1e-4), 40)
    *_, (state, spent) = fem.with_energy_balance(ops, states, force)
    assert fem.imbalance(spent, fem.mechanical_energy(ops, state)) < 1e-9
    assert spent.radiated > 0.01 * spent.work


def test_layers_of_a_body_from_a_file_lie_below_its_top(block_file):
    body = replace(hand_in(block_file), layers=(Layer(thickness=0.005, material="fat"),))
    made = build(body, 0.005)
    depth = -made.mesh.points[made.mesh.tets[:, :4], 2].mean(axis=1)
    assert (made.mesh.region == (depth > 0.005)).all()
    with pytest.raises(ValueError, match="thinner than half an element"):
        build(replace(body, layers=(Layer(thickness=0.001, material="fat"),)), 0.005)


@pytest.mark.slow
def test_a_flat_palm_moves_like_a_slab(monkeypatch):
    size = {"width": 0.07, "height": 0.07, "depth": 0.01, "material": "forearm"}
    flat = Relief(
        cup_depth=0, thenar_height=0, hypothenar_height=0, pad_height=0, corner_radius=0.002,
        edge_radius=0.001,
    )  # fmt: skip
    scene = replace(SKIN, body=Body(kind="palm", relief=flat, **size), probes=THREE)
    palm = compute(scene, "fem", h=0.0045)

    def with_ends(body, h, symmetry, *discretise):
        made = build(body, h, symmetry, *discretise)
        at_end = 0.999 * body.height / 2  # not the plane of symmetry, which has the same normal
        mesh = meshes.tag_boundary(made.mesh, ends=lambda at, _: np.abs(at[:, 1]) > at_end)
        return replace(made, mesh=mesh, absorbing=mesh.facets["ends"])

    monkeypatch.setattr("skinwave.models.meshed.build_body", with_ends)
    slab = compute(replace(scene, body=Body(kind="slab", sides="free", **size)), "fem", h=0.003)
    assert compare(slab, palm).relative_l2.max() < 0.02


def test_invalid_bodies_are_refused():
    for text, message in [
        ("kind = 'mesh'", "needs a file"),
        ("kind = 'slab'\nfile = 'hand.stl'", "is for kind"),
        ("kind = 'slab'\nrelief = {cup_depth_mm = 3}", "is for kind"),
        ("kind = 'palm'\nrelief = {cup_depth_mm = -3}", "cup_depth"),
        ("kind = 'palm'\nrelief = {cup_deep_mm = 3}", "cup_depth_mm"),
    ]:
        with pytest.raises(ValueError, match=message):
            loads(f"[body]\n{text}")


@pytest.mark.slow
def test_a_public_hand_goes_from_its_file_to_a_comparison_in_one_command(
    in_one_process, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    short = MovingPressure(tacton=replace(STILL.tacton, duration=0.05))
    (tmp_path / "scene.toml").write_text(dumps(replace(SKIN, pressure=short, probes=THREE[:2])))
    ask = ["compare", "scene.toml", "--body", str(HAND), "--up", "-x", "--element-size", "16"]
    assert main([*ask, "--out", "both", "--quiet"]) == 0
    page = read_results.page(tmp_path / "both/index.html")
    assert "from generic-hand-right.glb" in page
    assert "thicker sheet" not in page
    assert "elements of 16 mm" in page  # of the map, too
    assert "--up -x --element-size 16" in page
    rows = list(csv.DictReader((tmp_path / "both/lines.csv").read_text().splitlines()))
    at_am = (row for row in rows if (row["line"], row["body"]) == ("f_AM", "mesh"))
    assert 0.1 < max(float(row["displacement_um"]) for row in at_am) < 10
    assert {path.name for path in tmp_path.iterdir()} == {"scene.toml", "both"}
