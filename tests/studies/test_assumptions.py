"""The published model's assumptions, dropped one by one."""

import re
from dataclasses import replace

import numpy as np
import pytest
import read_results

import fem
import simple_model
import skinwave
from simple_model import PronyTerm, Tacton
from skinwave.commands.cli import main
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps
from skinwave.scene.scene import BODIES, Body, Layer
from skinwave.studies import assumptions, relax
from skinwave.studies.assumptions import as_relaxing, can_be_alone, device_path, droppable, without
from skinwave.studies.relax import Hierarchy, HierarchyStep, hierarchy_of, line_changes

PATH = simple_model.Trajectory(shape="circle", size=0.02, speed=12.0)
LOAD = simple_model.MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, trajectory=PATH))
SKIN = skinwave.Scene(pressure=LOAD, body=Body(width=0.04, height=0.04), probes=((0.01, 0.0),))
PAPER = replace(SKIN, body=replace(BODIES["paper-sheet-loose"], width=0.05, height=0.05))


def test_assumptions_of_slab_and_sheet():
    assert droppable(SKIN) == (
        "linear drive", "sinc^2 profile", "no propagation", "little loss", "one material",
        "main lobe only", "continuous path", "flat",
    )  # fmt: skip
    assert assumptions.side_step(SKIN) == (
        "linear drive", "sinc^2 profile", "no propagation", "little loss", "viscous loss",
    )  # fmt: skip
    assert assumptions.side_step(PAPER) == ()
    assert droppable(PAPER) == (
        "linear drive", "sinc^2 profile", "no propagation", "little loss", "laterally-infinite",
        "vacuum", "baffle", "main lobe only", "continuous path", "small deflection",
    )  # fmt: skip
    with pytest.raises(ValueError, match="assumption"):
        droppable(replace(SKIN, body=BODIES["none"]))
    # a body without room for a palm stays flat, and for layers that have no room of one material
    body = replace(SKIN.body, depth=0.004)
    assert not {"flat", "one material"} & {*droppable(replace(SKIN, body=body))}
    clamped = replace(SKIN.body, sides="clamped", base="elastic", base_stiffness=1e7)
    assert {"laterally-infinite", "rigid base"} < {*droppable(replace(SKIN, body=clamped))}
    layers = (Layer(thickness=0.001, material="dermis"), Layer(thickness=0.002, material="fat"))
    assert "one material" in droppable(replace(SKIN, body=replace(body, layers=layers)))


@pytest.mark.parametrize("own", [SKIN, PAPER])
def test_each_step_of_load_and_propagation_changes_one_thing(own):
    names = droppable(own)
    k = names.index("no propagation")
    before, kernel = without(own, names[:k])
    after, waves = without(own, names[: k + 1])
    assert (kernel, waves) == ("point-kernel", "flat-body")
    assert before.pressure == after.pressure == own.pressure
    assert before == replace(after, body=BODIES["none"])
    assert own.body.kind == "sheet" or after.body.sides == "absorbing"
    loads = [without(own, names[:k])[0].pressure for k in range(3)]
    assert loads[1] == replace(loads[0], drive="pressure_squared")
    assert loads[2] == replace(loads[1], profile="gaussian")
    # With and without propagation the load is the same, whatever else is dropped.
    for name in names:
        kept = [n for n in names if n != name]
        still = [n for n in kept if n != "no propagation"]
        assert without(own, kept)[0].pressure == without(own, still)[0].pressure


def test_an_infinite_body_of_elements_has_absorbing_sides():
    thin = replace(SKIN, body=replace(SKIN.body, depth=0.004, sides="clamped"))
    names = droppable(thin)
    for name, sides in (("laterally-infinite", "absorbing"), ("flat", "clamped")):
        assert without(thin, [n for n in names if n != name])[0].body.sides == sides
    assert can_be_alone("laterally-infinite", names, thin)
    absorbing = replace(thin, body=replace(thin.body, sides="absorbing"))
    assert "laterally-infinite" not in droppable(absorbing)
    other = replace(thin, body=replace(thin.body, base="free"))  # nothing else holds it
    assert not can_be_alone("laterally-infinite", droppable(other), other)
    palm = replace(thin, body=replace(BODIES["palm"], width=0.04, height=0.04))
    assert can_be_alone("laterally-infinite", droppable(palm), palm)
    assert can_be_alone("little loss", names, thin)
    assert not can_be_alone("little loss", droppable(palm), palm)
    assert not can_be_alone("laterally-infinite", droppable(SKIN), SKIN)  # a palm ends
    assert not can_be_alone("laterally-infinite", droppable(PAPER), PAPER)


def test_first_and_last_models_of_the_hierarchy():
    scene, model = without(SKIN, ())
    assert (scene.body.kind, model) == ("none", "point-kernel-published")
    assert scene.pressure == simple_model.published_load(SKIN.pressure)
    scene, model = without(SKIN, droppable(SKIN))
    assert model == "fem"
    assert scene.body.kind == "palm"
    assert (scene.pressure.drive, scene.pressure.profile) == ("pressure_squared", "array")
    assert scene.tacton.trajectory.hold
    assert len(scene.body.layers) == 1
    sheet, model = without(PAPER, droppable(PAPER))
    assert model == "plate-modes-nonlinear"
    assert sheet.body == replace(PAPER.body, air="free")


def test_a_device_rests_on_equally_spaced_points():
    most = device_path(PATH, assumptions.DEVICE_RATES[1])
    assert len(most.points) - 1 == round(assumptions.DEVICE_RATES[1] / PATH.drawing_frequency)
    path = device_path(PATH, points=5)
    assert path.hold
    assert path.drawing_frequency == pytest.approx(PATH.drawing_frequency)
    corners = np.array(path.points)
    sides = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    np.testing.assert_allclose(sides, 0.02 * np.sin(np.pi / 5), rtol=1e-9)
    np.testing.assert_allclose(np.diff(path.times), 1 / PATH.drawing_frequency / 5, rtol=1e-9)
    late = path.position(0.99 * path.times[1] * np.ones(1))
    np.testing.assert_allclose(late[0], corners[0], atol=1e-12)
    scene, model = without(SKIN, ("no propagation", "continuous path"), path=path)
    assert (scene.tacton.trajectory, model) == (path, "fem")


@pytest.mark.parametrize("device", [{"update_rate": 30e3}, {"update_rate": 20e3, "points": 106}])
def test_impossible_devices_are_refused(device):
    for call in (
        lambda: device_path(PATH, **device),
        lambda: hierarchy_of(SKIN, lambda phase, done: pytest.fail("computed"), **device),
    ):
        with pytest.raises(ValueError, match="must be"):
            call()


def test_damping_laws_agree_at_the_fitted_frequency():
    for name, hz in (("palm", 140.0), ("forearm", 140.0), ("forearm", 600.0)):
        w = 2 * np.pi * hz
        viscous = fem.PRESETS[name]
        relaxing = as_relaxing(viscous, w)
        assert relaxing.viscosity == 0
        assert relaxing.shear_modulus >= 0.499 * viscous.shear_modulus
        assert relaxing.complex_modulus(w) == pytest.approx(viscous.complex_modulus(w), rel=1e-12)
        assert relaxing.complex_modulus(3 * w).imag < 0.9 * viscous.complex_modulus(3 * w).imag
        back = assumptions.as_viscous(relaxing, w)
        assert (back.prony, back.viscosity) == ((), pytest.approx(viscous.viscosity))
        assert back.shear_modulus == pytest.approx(viscous.shear_modulus)


@pytest.mark.parametrize("material", ["palm", "palm-zener"])
def test_little_loss_is_a_tenth_at_the_same_stiffness(material):
    own = replace(SKIN, body=replace(SKIN.body, material=material))
    w = 2 * np.pi * assumptions.strongest_line(own)
    little, all_of_it = (
        without(own, ("no propagation", *dropped))[0].body.solid.complex_modulus(w)
        for dropped in ((), ("little loss",))
    )
    assert little.real == pytest.approx(all_of_it.real, rel=1e-9)
    assert little.imag == pytest.approx(0.1 * all_of_it.imag, rel=1e-9)
    assert all_of_it == pytest.approx(own.body.solid.complex_modulus(w), rel=1e-9)


@pytest.mark.parametrize("law", [as_relaxing, assumptions.as_viscous])
def test_a_change_of_damping_law_keeps_hysteresis(law):
    both = simple_model.Material(
        density=1000, shear_modulus=25e3, poisson=0.49, loss_factor=0.2,
        **({"viscosity": 5.0} if law is as_relaxing else
           {"prony": (PronyTerm(modulus=1e4, time=5e-4), PronyTerm(modulus=5e3, time=2e-3))}),
    )  # fmt: skip
    w = 2 * np.pi * 140
    assert law(both, w).complex_modulus(w) == pytest.approx(both.complex_modulus(w), rel=1e-9)


def test_the_damping_law_is_one_step():
    names = ("sinc^2 profile", "no propagation", "little loss")
    before, _ = without(SKIN, names)
    after, model = without(SKIN, (*names, "viscous loss"))
    assert model == "flat-body"
    assert before.body.solid == SKIN.body.solid
    line = 2 * np.pi * assumptions.strongest_line(SKIN)
    laws = [scene.body.solid.complex_modulus(line) for scene in (before, after)]
    assert laws[1] == pytest.approx(laws[0], rel=1e-9)
    # A body that relaxes keeps its own law at the end, and has its viscous twin before.
    own = replace(SKIN, body=replace(SKIN.body, material="palm-zener"))
    assert "viscous loss" in droppable(own)
    assert assumptions.side_step(own) == ()
    before, _ = without(own, ("no propagation", "little loss"))
    after, _ = without(own, ("no propagation", "little loss", "viscous loss"))
    assert before.body.solid.fast_modulus == 0 < before.body.solid.viscosity
    assert after.body.solid == own.body.solid


@pytest.mark.slow
@pytest.mark.usefixtures("in_one_process")
def test_relax_writes_effects_and_costs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = replace(SKIN, body=Body(width=0.032, height=0.032, depth=0.004))  # too thin for layers
    names = tuple(n for n in droppable(scene) if n not in ("flat", "one material"))
    monkeypatch.setattr(assumptions, "droppable", lambda scene: names)
    (tmp_path / "scene.toml").write_text(dumps(scene))
    assert main(["relax", "scene.toml", "--element-size", "9", "--quiet"]) == 0
    coarse = "elements of 9 mm are too coarse for the focal spot"
    assert coarse in capsys.readouterr().err
    out = tmp_path / "scene-relaxed"
    effects = {row["assumption"]: row for row in read_results.rows(out / "effects.csv")}
    sizes = [float(row["waveform_percent"]) for row in effects.values()]
    assert sizes == sorted(sizes, reverse=True)
    assert set(effects) == {
        "linear drive", "sinc^2 profile", "no propagation", "little loss", "viscous loss",
        "main lobe only", "continuous path",
    }  # fmt: skip
    # with a mean in the load its lines at multiples of f_d come from nothing
    drawn = re.search(r"(?<![2-9])f_d ([+-][\d.]+)", effects["linear drive"]["lines_db"])
    assert float(drawn[1]) > 40
    size = {name: float(row["waveform_percent"]) for name, row in effects.items()}
    assert size["continuous path"] < 10 < size["no propagation"]
    # One is a side step, and the array's field has a profile of its own.
    told = {name for name, row in effects.items() if row["alone_percent"]}
    assert told == set(effects) - {"viscous loss", "sinc^2 profile"}
    without, path = (effects[name] for name in ("no propagation", "continuous path"))
    assert without["reach_with_mm"] != without["reach_without_mm"]
    assert path["reach_with_mm"] == path["reach_without_mm"]
    assert all(float(row["seconds"]) > 0 for row in read_results.rows(out / "steps.csv"))
    with np.load(tmp_path / "scene-relaxed/responses.npz") as kept:
        assert {"t", "probes", "as published", "main lobe only"} <= set(kept.files)
    # In so short a Tacton 2 f_AM is not resolved from 3 f_d - 2 f_AM.
    assert {row["line"] for row in read_results.rows(out / "relax.csv")} >= {"f_AM", "2f_d", "f_d"}
    assert coarse in read_results.page(out / "index.html")


def test_a_step_after_a_failed_one_has_no_effect():
    times = np.arange(4.0)
    given = {"times": times, "probes": np.zeros((1, 2)), "values": times[:, None]}
    told = simple_model.Response(model="fem", **given)
    steps = tuple(
        HierarchyStep(name=name, dropped=tuple(name), model="fem", response=response)
        for name, response in (("", told), ("a", None), ("ab", told), ("abc", told))
    )
    found = Hierarchy(scene=SKIN, steps=steps, side_steps=(), leave_one_out=())
    assert [(a.name, b.name) for a, b in found.pairs()] == [("ab", "abc")]


def pretend(monkeypatch, names, step):
    """Other assumptions, and other scenes and models without them."""
    monkeypatch.setattr(assumptions, "droppable", lambda scene: names)
    monkeypatch.setattr(assumptions, "side_step", lambda scene: ())
    monkeypatch.setattr(
        assumptions, "without", lambda scene, dropped, **device: step(scene, dropped)
    )
    monkeypatch.setattr(relax, "all_warnings", lambda *scene, h: ())


def test_a_failed_step_leaves_the_others(monkeypatch):
    thin = replace(SKIN, body=replace(SKIN.body, depth=0.001))
    steps = {False: (thin, "flat-body"), True: (SKIN, "no such model")}
    names = ("linear drive", "one material")
    pretend(monkeypatch, names, lambda scene, dropped: steps[bool(dropped)])
    found = hierarchy_of(SKIN, lambda phase, done: None)
    assert found.steps[0].response is not None
    assert all("no such model" in step.error for step in found.steps[1:])
    assert found.effects() == []


@pytest.mark.usefixtures("in_one_process")
def test_a_failed_step_comes_before_the_ranking(tmp_path, monkeypatch, capsys):
    def step(scene, dropped):
        if dropped == ("linear drive", "sinc^2 profile"):
            raise ValueError("flat-body needs a slab")
        return scene, "point-kernel" if dropped else "point-kernel-published"

    pretend(monkeypatch, ("linear drive", "sinc^2 profile", "main lobe only"), step)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(dumps(SKIN))
    assert main(["relax", "scene.toml"]) == 1
    first, second, *_ = capsys.readouterr().out.splitlines()
    failed = "1 part of this result failed: sinc^2 profile (flat-body needs a slab)."
    unknown = "Not compared, because steps failed: 'sinc^2 profile', 'main lobe only'."
    assert (first, second) == (failed, unknown)
    page = re.sub("<[^>]+>", "", read_results.page(tmp_path / "scene-relaxed/index.html"))
    assert page.index("1 part of this result failed") < page.index("Of the others, ")


@pytest.mark.usefixtures("in_one_process")
def test_a_shared_body_is_reduced_once(monkeypatch):
    small = replace(SKIN, body=Body(width=0.03, height=0.03, depth=0.004))
    names = ("linear drive", "sinc^2 profile")
    pretend(monkeypatch, names, lambda scene, dropped: (small, "fem"))
    found = hierarchy_of(SKIN, lambda phase, done: None, h=4e-3).steps
    first, *others = [step.response.effort.seconds for step in found]
    reduction = {"assemble", "factorise and reduce"}
    assert reduction <= set(first)
    for step, own in zip(found[1:], others, strict=True):
        assert not reduction & set(own)
        assert step.seconds > first["factorise and reduce"]
        assert (step.response.values == found[0].response.values).all()


def test_changes_of_lines_in_decibel():
    times = np.arange(1000) / 10_000
    loud = np.sin(2 * np.pi * 140 * times)[:, None]
    first = skinwave.simulate(replace(SKIN, body=BODIES["none"]), "point-kernel")
    before, after = (replace(first, values=a * loud, quantity="displacement") for a in (1.0, 2.0))
    changes = line_changes(SKIN, before, after)
    assert changes["f_AM"] == pytest.approx(6.02, abs=0.01)


def test_the_level_of_the_published_kernel_ignores_gaps():
    rhythm = simple_model.Rhythm(pulses=((0.04, 0.02), (0.016, 0.044)), ramp=0.008)
    plain = Tacton(am_frequency=150, duration=0.16)
    levels = []
    for tacton in (replace(plain, rhythm=rhythm), plain):
        pressure = simple_model.MovingPressure(tacton=tacton)
        scene = skinwave.Scene(pressure=pressure, body=Body(), probes=((0.0, 0.0),))
        response = compute(scene, "point-kernel-published")
        levels.append(relax.levels_at_probes(scene, response).max())
    assert levels[0] == pytest.approx(levels[1], abs=0.01)
