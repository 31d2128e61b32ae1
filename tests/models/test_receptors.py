"""Quantities that probes read, at the surface and below it, by every model that has them."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import read_results
from half_space import boussinesq

from fem.coat import Coat
from simple_model import MovingPressure, Tacton
from simple_model.layers.material import PRESETS
from simple_model.layers.tensors import energy_root, largest_shear, von_mises
from simple_model.load.focus import spot_width
from skinwave.bodies.parts import Layer
from skinwave.commands.cli import main
from skinwave.models.meshed import probe_rows
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import BODIES, Body, Scene
from skinwave.studies.album import open_album
from skinwave.sweeps.measures import result_columns

SCENE = """
name = "below"
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[body]
size_x_mm = 32
size_y_mm = 32
thickness_mm = 6
[body.material]
density_kg_m3 = 1000
shear_modulus_pa = 25e3
poisson = 0.4999
viscosity_pa_s = 5.0
prony = [{ modulus_pa = 10e3, time_s = 0.5e-3 }]
[probes]
points_mm = [[0, 0], [4, 1]]
"""
MODELS = ("fem", "fem-harmonic")


def scene(quantity="displacement", depth="0"):
    return loads(f'{SCENE}depth_mm = {depth}\nquantity = "{quantity}"\n')


def tensor(field, depth, model):
    each = [compute(scene(f"{field}_{c}", depth), model).values
            for c in ("xx", "yy", "zz", "xy", "xz", "yz")]  # fmt: skip
    return np.stack(each, axis=-1)


def test_keys_of_a_scene_are_read_and_written():
    assert loads(SCENE).reading.is_plain
    assert scene("strain_zz", '"meissner"').depths == (0.7e-3, 0.7e-3)
    assert scene("strain_zz", '["surface", 2]').depths == (0.0, 2e-3)
    for asked in (scene("stress_xz", "[0.7, 2]"), scene("velocity"), scene(depth='"pacini"')):
        assert loads(dumps(asked)) == asked
    assert "depth_mm = 2.0" in dumps(scene(depth='"pacini"'))


def test_unknown_quantities_and_depths_are_refused():
    for quantity, depth, part in (
        ("strain_zy", "0", "strain_zy"), ("velocity", "[1]", "depth_mm"),
        ("velocity", "-1", "depth_mm = -1"), ("strain_zz", "6", "depth_mm = 6 of a probe"),
        ("strain_zz", '"pacinian"', "depth_mm 'pacinian' is unknown.*pacini"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=part):
            scene(quantity, depth)


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_a_half_space_at_rest_is_boussinesqs(poisson):
    """The mean of the steady state: stress below a focus, times its mean pressure."""
    body = Body(depth=np.inf, material=replace(PRESETS["palm"], poisson=poisson))
    load, places = MovingPressure(tacton=Tacton(duration=0.01)), ((0, 0), (3e-3, 0), (0, 6e-3))
    own = Scene(pressure=load, body=body, probes=places)
    for depth in (0.0, 0.7, 5.0):
        found = {}
        for c in ("xx", "yy", "zz", "xz", "yz"):
            read = replace(own, depth=1e-3 * depth, quantity=f"stress_{c}")
            found[c] = compute(read, "flat-body-harmonic").values[0]
        size = own.pressure(np.zeros((1, 2)), 0.0)[0]
        width = spot_width(own.pressure.height)
        for p, r in enumerate((0.0, 3e-3, 6e-3)):
            rr, tt, down, rz = boussinesq(poisson, r, 1e-3 * depth, width)
            exact = (rr, tt, down, rz, 0.0) if p < 2 else (tt, rr, down, 0.0, rz)
            got = [values[p] / size for values in found.values()]
            np.testing.assert_allclose(got, exact, rtol=0, atol=1e-4)


def test_finite_elements_and_wavenumber_integrals_read_the_same_strain():
    text = SCENE.replace("[[0, 0], [4, 1]]", "[[0, 0], [4, 1], [4, 1]]").replace("= 6", "= 8")
    asked = loads(f'{text}depth_mm = [2, 2, 0.7]\nquantity = "strain_zz"\n')
    exact = compute(asked, "flat-body").values
    found = compute(asked, "fem", h=3.3e-3).values
    misfit = np.linalg.norm(found - exact, axis=0) / np.linalg.norm(exact, axis=0)
    assert misfit.max() < 0.06


def test_reduced_harmonic_and_transient_models_read_the_same():
    small = replace(scene("energy_density", "[1, 2]"), probes=((0.0, 0.0), (3e-3, 2e-3)))
    small = replace(small, body=replace(small.body, width=0.02, height=0.02, sides="clamped"))
    reduced, steady = (compute(small, model, tolerance=0.02, h=6e-3).values for model in MODELS)
    late = slice(350, None)
    assert np.linalg.norm((steady - reduced)[late]) < 0.01 * np.linalg.norm(steady[late])
    tacton = replace(small.tacton, duration=0.01)
    short = replace(small, pressure=replace(small.pressure, tacton=tacton))
    stepped = compute(short, "fem-transient", tolerance=0.02, h=6e-3, dt=5e-5).values
    first = reduced[: len(stepped)]
    assert np.linalg.norm(stepped - first) < 0.02 * np.linalg.norm(first)


def test_quantities_that_are_not_linear_are_computed_in_time():
    e, solid = tensor("strain", "[0.7, 2]", "flat-body-harmonic"), scene().body.solid
    stress = tensor("stress", "[0.7, 2]", "flat-body-harmonic")
    expected = {
        "largest_shear_strain": largest_shear(e),
        "energy_density": ((e @ energy_root(solid).T) ** 2).sum(axis=-1),
        "von_mises_stress": von_mises(stress),
    }
    for quantity, values in expected.items():
        computed = compute(scene(quantity, "[0.7, 2]"), "flat-body-harmonic").values
        np.testing.assert_allclose(computed, values, rtol=1e-6)
        assert (computed > 0).all()


def test_a_layer_has_its_own_strain_and_the_traction_of_its_neighbour():
    layered = SCENE + '\n[[body.layers]]\nthickness_mm = 1\nmaterial = "epidermis"\n'
    head, probes = layered.split("[probes]\n")
    points, layers = probes.split("\n\n")

    def read(quantity, depth):
        text = f'{head}\n{layers}\n[probes]\n{points}\ndepth_mm = {depth}\nquantity = "{quantity}"'
        return compute(loads(text), "flat-body-harmonic").values[:, 1]

    above, below = (read("stress_zz", [z, z]) for z in (1 - 1e-6, 1 + 1e-6))
    np.testing.assert_allclose(above, below, rtol=1e-4)
    stiff, soft = (read("strain_xz", [z, z]) for z in (1 - 1e-6, 1 + 1e-6))
    assert 0.04 < np.abs(stiff).max() / np.abs(soft).max() < 0.08  # 25 to 35 kPa over 500 kPa


def test_layers_of_skin_and_own_materials_are_skin_and_silicone_is_not():
    slab = Body()
    assert slab.is_skin
    dermis = Layer(thickness=1e-3, material="dermis")
    assert replace(slab, material="ecoflex", layers=(dermis,)).is_skin
    assert replace(slab, material=replace(PRESETS["palm"], viscosity=3.0)).is_skin
    for body in (BODIES["silicone-disc"], replace(slab, material=PRESETS["ecoflex"])):
        assert body.is_solid
        assert not body.is_skin
    assert not BODIES["paper-sheet-loose"].is_solid


def test_a_run_is_written_and_read_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("below.toml").write_text(dumps(scene("strain_zz", "[0.7, 2]")))
    words = ["run", "below.toml", "--model", "flat-body", "--quiet", "--out", "out"]
    assert main(words) == 0
    rows = read_results.rows("out/lines.csv")
    assert {row["probe_depth_mm"] for row in rows} == {"0.7", "2"}
    assert all(float(row["strain_zz_um_m"]) > 0 for row in rows)
    assert not any(row["displacement_um"] or row["pressure_pa"] for row in rows)
    arrays = read_results.arrays("out/responses.npz")
    assert set(arrays) == {"t", "probes", "strain_zz", "flat-body"}
    (run,) = open_album(Path("out")).runs
    assert run.response.quantity == "strain_zz"
    np.testing.assert_array_equal(run.response.values, arrays["strain_zz"])
    assert not run.is_skin
    assert not run.is_motion
    with pytest.raises(ValueError, match="strain_zz"):
        run.response.displacement  # noqa: B018
    assert main(["report", "out", "--quiet"]) == 0
    assert "dB re threshold" not in Path("out/report/index.html").read_text()
    assert main(["relax", "below.toml", "--quiet", "--out", "other"]) == 2


def test_sweeps_have_columns_of_the_quantity():
    asked = scene("von_mises_stress", "[0.7, 2]")
    row = result_columns(asked, compute(asked, "flat-body-harmonic"))
    assert min(row["peak_von_mises_stress_pa"]) > 0
    assert "peak_um" not in row
    assert "level_db" not in row


def test_strain_in_a_coat_is_refused():
    build = SimpleNamespace(coat=Coat(materials=(scene().body.solid,), thicknesses=(0.3e-3,)))
    reading = scene("strain_zz", "[0.1, 2]").reading
    with pytest.raises(ValueError, match="0.1 mm.*0.3 mm"):
        probe_rows(scene().body, build, np.zeros((2, 2)), reading)
