"""One chain of assumptions for every kind of body."""

from dataclasses import replace

import corpus
import numpy as np
import pytest

import fem
import simple_model
import skinwave
from simple_model import Tacton
from skinwave.bodies.flattened import flatten
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Body, Layer, Placement
from skinwave.studies.assumptions import without
from skinwave.studies.outward import Outward, outward
from skinwave.studies.relax import hierarchy_of

PATH = simple_model.Trajectory(shape="circle", size=0.006, speed=3.0)
LOAD = simple_model.MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05, trajectory=PATH))
LAYERS = (Layer(thickness=0.001, material="dermis"),)
SMALL = {"width": 0.024, "height": 0.024, "depth": 0.004}
DEEP = (("deep", "fat"),)
H = 6e-3
BODY = {
    "sheet": Body(  # of elements, because it is tilted
        kind="sheet",
        material="paper",
        width=0.03,
        height=0.03,
        depth=5e-4,
        sides="clamped",
        base="free",
        placement=Placement(tilt_x=0.1),
    ),
    "layered slab": Body(**SMALL, sides="clamped", layers=LAYERS),
    "half-space": Body(width=0.02, height=0.02, depth=np.inf, material="forearm"),
    "disc": Body(kind="disc", **SMALL, sides="free", base="elastic", base_stiffness=1e7),
    "layered palm": Body(kind="palm", width=0.03, height=0.03, depth=0.008, layers=LAYERS),
    "finger": BODIES["fingertip"],
    "mesh": Body(kind="mesh", file="block.vtu", regions=DEEP),
}


def scene_of(body):
    return skinwave.Scene(pressure=LOAD, body=body, probes=((0.0, 0.0), (0.005, 0.0)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a block of 24 x 24 x 8 mm, whose lower half is another region."""
    folder = tmp_path_factory.mktemp("bodies")
    corpus.write_block(folder / "block.vtu")
    return folder


@pytest.mark.usefixtures("in_one_process")
@pytest.mark.parametrize("kind", BODY)
def test_waves_are_a_step_of_every_body(kind, folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr("skinwave.studies.assumptions.can_be_alone", lambda *step: False)
    found = hierarchy_of(scene_of(BODY[kind]), lambda phase, done: None, h=H)
    assert found.failures == {}
    effects = {effect.name: effect for effect in found.effects()}
    assert 0.02 < effects["no propagation"].waveform < 2
    # A solid has one model under all loads, so that its error is no effect of a load.
    solids = [step for step in found.steps if step.body.is_solid]
    models = {step.body: step.model for step in solids}
    assert [step.model for step in solids] == [models[step.body] for step in solids]


@pytest.mark.usefixtures("in_one_process")
def test_steps_are_those_of_separate_runs():
    scene = scene_of(BODY["disc"])
    found = hierarchy_of(scene, lambda phase, done: None, h=H)
    for step in found.steps[3:]:
        changed, model = without(scene, step.dropped, h=H)
        assert (step.model, step.body) == (model, changed.body)
        alone = compute(changed, model, h=H)
        size = np.abs(alone.values).max()
        np.testing.assert_allclose(step.response.values, alone.values, atol=2e-3 * size)
        assert len(step.response.probes) == len(scene.probes)
    assert [step.body.base for step in found.steps[-2:]] == ["clamped", "elastic"]
    assert found.steps[-1].body == scene.body


def test_the_flat_body_has_the_strata_under_the_focus(folder, monkeypatch):
    monkeypatch.chdir(folder)
    at, bone = np.zeros((1, 2)), flatten(BODY["finger"], np.zeros((1, 2)), 2e-3)
    assert (bone.kind, bone.base, bone.sides, bone.layers) == ("slab", "clamped", "absorbing", ())
    assert bone.depth == pytest.approx(6e-3, rel=0.03)  # of tissue over the bone
    two = flatten(BODY["mesh"], np.array([[1e-3, 2e-3], [0.2, 0.0]]), H)
    assert two.depth == pytest.approx(8e-3)
    assert [start for start, _ in two.strata] == pytest.approx([0, 4e-3])
    assert two.solid == fem.PRESETS["fat"]
    assert two.width == 0.4  # all places are on it
    layered = flatten(replace(BODY["mesh"], layers=LAYERS), at, H)
    assert [start for start, _ in layered.strata] == pytest.approx([0, 1e-3, 4e-3])
    palm = BODY["layered palm"]
    assert flatten(palm, at, H).strata == palm.strata
    assert flatten(BODY["half-space"], at, H) == BODY["half-space"]
    with pytest.raises(ValueError, match="not above the body"):
        flatten(BODY["mesh"], np.array([[0.05, 0.0]]), H)


def test_the_reach_lies_between_two_probes():
    distances = np.array([0, 5e-3, 1e-2])
    line = Outward(probes=np.zeros((3, 2)), towards="+x", distances=distances)
    assert line.reach(np.array([6.0, 1.0, -3.0])).metre == pytest.approx(6.25e-3)
    assert line.reach(np.array([6.0, 1.0, 2.0])).beyond
    assert line.reach(np.array([-1.0, 1.0, 2.0])) is None


def test_probes_of_the_reach_stay_on_the_body():
    scene = scene_of(BODY["layered palm"])
    line = outward(scene, scene.body, H)
    assert line.towards == "+x"
    places = line.probes
    np.testing.assert_allclose(places[:, 0], 3e-3 + line.distances, atol=1e-12)
    assert 0.011 < places[-1, 0] < 0.014
    assert not places[:, 1].any()
    edge = replace(LOAD, tacton=replace(LOAD.tacton, trajectory=replace(PATH, size=0.028)))
    assert outward(replace(scene, pressure=edge), scene.body, H) is None
