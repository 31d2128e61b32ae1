"""Bodies of several materials: regions of a file, and a fingertip with a bone inside."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
import skinwave
from fem.affine_model import line_errors
from fem.geometry import jacobians, shape_nodes
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.bodies import BODIES, Body, Layer, Phalanx
from skinwave.bodies.build import build
from skinwave.models import parametric
from skinwave.models.free_keys import values_at
from skinwave.models.free_keys import with_values as with_free_values
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import components, reduce_scene
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Scene

pytestmark = pytest.mark.usefixtures("read_here")
FINGER = BODIES["fingertip"]
SHAPE = meshes.Fingertip(
    breadth=0.016, length=0.025, thickness=0.013, bone_breadth=0.007, bone_thickness=0.004,
    cover=0.006, tip=0.004,
)  # fmt: skip
SOFT, BONE = fem.PRESETS["palm"], fem.PRESETS["bone"]
SCENE = '[body]\nkind = "mesh"\nfile = "finger.vtu"\n'
TISSUE, IN_BONE = "body.material.shear_modulus_pa", "body.regions.bone.shear_modulus_pa"
DENSITY = "body.regions.bone.density_kg_m3"


@pytest.fixture(scope="module")
def finger():
    return meshes.fingertip_mesh(SHAPE, 4e-3)


@pytest.fixture
def body(finger, tmp_path):
    meshes.write(tmp_path / "finger.vtu", finger)
    regions = (("bone", "bone"),)
    file = str(tmp_path / "finger.vtu")
    return Body(kind="mesh", file=file, base="free", sides="clamped", regions=regions)


@pytest.mark.parametrize("suffix", [".vtu", ".msh"])
def test_regions_keep_their_numbers_and_names_in_files(finger, tmp_path, suffix):
    named = replace(finger, region=finger.region + 4, region_names={4: "soft tissue", 5: "bone"})
    meshes.write(tmp_path / f"a{suffix}", named)
    found = meshes.read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(found.region, named.region)
    assert found.region_names == named.region_names


def test_a_scene_has_regions_by_name_with_presets_or_tables():
    text = SCENE + '[body.regions]\nbone = "bone"\n3 = "fat"\n[body.regions.nail]\n'
    text += "density_kg_m3 = 1300\nshear_modulus_pa = 1e9\npoisson = 0.3\n"
    scene = loads(text)
    nail = fem.Material(density=1300, shear_modulus=1e9, poisson=0.3)
    assert scene.body.regions == (("bone", "bone"), ("3", "fat"), ("nail", nail))
    assert loads(dumps(scene)) == scene
    with pytest.raises(ValueError, match="material 'bones' is unknown"):
        loads(SCENE + '[body.regions]\nbone = "bones"\n')
    with pytest.raises(ValueError, match='regions is for kind = "mesh" or "finger", not "palm"'):
        loads('[body]\nkind = "palm"\n[body.regions]\nbone = "bone"\n')
    with pytest.raises(ValueError, match="has two materials"):
        replace(scene.body, regions=(("a", "fat"), ("a", "bone")))
    with pytest.raises(ValueError, match="orthotropic"):
        replace(scene.body, regions=(("a", "paper-grain"),))


def test_elements_have_the_material_of_their_region_and_the_rest_that_of_the_body(body, finger):
    made = build(body, 4e-3)
    used = [made.material[r] for r in made.mesh.region.tolist()]
    assert used == [BONE if r else SOFT for r in finger.region.tolist()]
    layered = replace(body, layers=(Layer(thickness=3e-3, material="fat"),))
    made = build(layered, 4e-3)
    used = [made.material[r] for r in made.mesh.region.tolist()]
    assert [solid is BONE for solid in used] == (finger.region == 1).tolist()
    assert {solid for solid in used if solid is not BONE} == {SOFT, fem.PRESETS["fat"]}


def test_errors_of_missing_regions_list_those_of_the_file(body, finger):
    volume = 1e6 * meshes.corner_volumes(finger.points, finger.tets)
    shown = f"{volume[finger.region == 0].sum():.3g} cm3"
    with pytest.raises(ValueError, match=f"'bones'.*{shown}"):
        build(replace(body, regions=(("bones", "bone"),)), 4e-3)
    with pytest.raises(ValueError, match=shown):
        build(replace(body, regions=()), 4e-3)
    both = (("tissue", "fat"), ("bone", "bone"))
    with pytest.raises(ValueError, match="material"):
        build(replace(body, regions=both), 4e-3)
    build(replace(body, regions=both, material="fat"), 4e-3)


def test_materials_of_tissue_and_bone_can_be_varied(body):
    tacton = Tacton(trajectory=Trajectory(shape="circle", size=0.006, speed=3.0))
    probes = ((0.0, 0.0), (3e-3, 2e-3))
    scene = Scene(pressure=MovingPressure(tacton=tacton), body=body, probes=probes)
    ranges = {TISSUE: (15e3, 40e3), IN_BONE: (1e6, 1e9), DENSITY: (1200.0, 2000.0)}
    free = skinwave.prepare(scene, ranges, h=4e-3)
    largest = []
    for shares in np.random.default_rng(1).random((2, 3)):
        values = values_at(free.keys, shares)
        changed = with_free_values(body, free.keys, values)
        assert dict(changed.regions)["bone"].density == values[DENSITY]
        frequencies, found = parametric.lines(free, values)
        own = components(
            reduce_scene(replace(scene, body=changed), SolveOptions(h=4e-3)), scene.pressure
        )
        expected = own.lines[[np.argmin(np.abs(own.frequencies - f)) for f in frequencies]]
        assert line_errors(found, expected).max() < 0.01
        largest.append(np.abs(found).max())
    assert largest[0] != pytest.approx(largest[1], rel=0.05)


def test_a_fingertip_has_the_volumes_of_its_ellipsoids():
    mesh = meshes.fingertip_mesh(SHAPE, 1.5e-3)
    volumes = jacobians(shape_nodes(mesh), 5, 0)[2].sum(axis=1)
    for region, (x, y, z), bar in ((1, (7, 4, 4), 2e-3), (0, (16, 8, 13), 2e-4)):
        exact = np.pi * x * z * (17 / 4 + y / 6) * 1e-9
        own = volumes[mesh.region == 1].sum() if region else volumes.sum()
        assert own == pytest.approx(exact, rel=bar)
    assert meshes.dihedral_angles(mesh).min() > 15
    assert meshes.jacobian_ratios(mesh.points, mesh.tets).min() > 0.3
    assert mesh.points[:, 2].max() == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(np.abs(mesh.points).max(axis=0), [8e-3, 12.5e-3, 13e-3])


def test_a_bone_outside_a_finger_is_refused():
    for changes, message in [
        ({"depth": 0.009}, "is not inside a fingertip of 16 x 9 mm"),
        ({"bone": Phalanx(cover=0.0)}, "cover = 0.0 m of a fingertip must be finite and above 0"),
        ({"height": 0.008}, "not longer than its round end"),
    ]:
        with pytest.raises(ValueError, match=message):
            replace(FINGER, **changes)


def test_linear_models_of_a_finger_agree():
    text = '[tacton]\nam_frequency_hz = 100\nduration_s = 0.05\n[body]\nkind = "finger"\n'
    scene = loads(text + "[probes]\npoints_mm = [[0, 0], [0, 6]]\n")
    reduced, steady, stepped = (
        compute(scene, model, h=6e-3, dt=2e-4).displacement[400:]  # after the start
        for model in ("fem", "fem-harmonic", "fem-transient")
    )
    assert np.linalg.norm(reduced - steady) < 2e-3 * np.linalg.norm(steady)
    assert np.linalg.norm(stepped - steady) < 2e-2 * np.linalg.norm(steady)
