"""Layers of a slab in the interactive tool: as text, as sliders, and in the response."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model.compliance import layered
from simple_model.wavenumber_integral import point_response
from skinwave.bodies.analytic import stack
from skinwave.scene import BODIES, Body, Layer
from skinwave.scene_file import dumps
from skinwave.web import moves, waves
from skinwave.web.controls import OWN_BODY, STARTS, checked, from_query, to_query
from skinwave.web.free_bodies import covers
from skinwave.web.layer_values import (
    layers_of,
    loss_factor,
    rows,
    with_layers,
    with_own_materials,
)
from skinwave.web.scenes import scene_of
from skinwave.web.slabs import is_tabulated, lowest, tabulate, wavenumbers

SKIN = Body(
    material="muscle",
    layers=(
        Layer(thickness=0.3e-3, material="epidermis"),
        Layer(thickness=1e-3, material="dermis"),
    ),
)


@pytest.fixture
def session(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    scene = dumps(replace(scene_of(STARTS), body=SKIN))
    made = session_of(get_server(request.node.name, client_type="vue3"), scene)
    made.state.ready()
    yield made
    made.worker.close()


def test_layers_come_back_from_their_text():
    shown = rows(SKIN, "")
    assert [row["name"] for row in shown] == ["epidermis", "dermis", "muscle"]
    text = ", ".join(f"{row['thickness']}/{row['modulus']}" for row in shown)
    same = with_layers(SKIN, text)
    assert (same.layers, same.material) == (SKIN.layers, SKIN.material)
    assert same.depth == pytest.approx(SKIN.depth)
    stiff = with_layers(SKIN, "0.5/90, 1/70, 10/25")
    assert stiff.depth == pytest.approx(11.5e-3)
    epidermis = stack(stiff).materials[0]
    assert epidermis.shear_modulus == pytest.approx(90e3)
    before = stack(SKIN).materials[0]
    assert epidermis.viscosity / before.viscosity == pytest.approx(90e3 / before.shear_modulus)
    assert rows(stiff, "")[0]["modulus"] == "90"
    assert with_layers(BODIES["skin-slab"], "inf/25").depth == np.inf
    assert rows(BODIES["paper-sheet-loose"], "") == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1", "layer 1: '1' is none"),
        ("1/27, x/3", "layer 2: 'x/3' is none"),
        ("1/nan", "a shear modulus of nan kPa is outside"),
        ("inf/3, 1/3", "layer 1: a thickness of inf mm is outside"),
        ("70/3", "a thickness of 70 mm is outside 0.01 to 60 mm"),
    ],
)
def test_layers_that_are_none_are_refused(text, message):
    with pytest.raises(ValueError, match=message):
        checked("layers", text)
    with pytest.raises(ValueError, match="2 layers are given, and this body has 3"):
        with_layers(SKIN, "1/2, 3/4")
    assert layers_of("") == ()


def test_layers_are_moved_one_by_one(session):
    assert [row["thickness"] for row in session.state.body_layers] == ["0.3", "1", "13.7"]
    with session.state:
        moves.own_layer(session, 1, "modulus", "40")
    with session.state:
        moves.own_layer(session, 0, "thickness", "0,5")
    assert session.state.layers.startswith("0.5/500")
    assert session.state.body_layers[1]["modulus"] == "40"
    assert session.scene.body.layers[1].material.shear_modulus == pytest.approx(40e3)
    again, refused = from_query(to_query(session.values), own=True)
    assert (again["layers"], refused) == (session.state.layers, ())
    with session.state:
        moves.own_layer(session, 0, "thickness", "thick")
    assert "'thick/500" in session.state.errors["layers"]
    with session.state:
        moves.undo(session)
        moves.undo(session)
    assert session.state.layers == ""
    assert session.scene.body == SKIN
    with session.state:
        moves.turn(session, {"layers": "0.5/90, 1/26, 10/5"})
        moves.turn(session, {"body": "skin-slab"})
    assert (session.state.layers, session.state.problem) == ("", "")
    assert len(session.state.body_layers) == 1
    with session.state:
        moves.own_layer(session, 2, "modulus", "40")  # of the body before
        moves.turn(session, {"body": "paper-sheet-loose"})
    assert session.state.body_layers == []


def test_a_palm_has_stiffness_loss_and_thickness():
    palm = BODIES["palm"]
    (row,) = rows(palm, "")
    assert (row["name"], row["thickness"], row["modulus"], row["loss"]) == (
        "palm", "15", "25", "0.2513",
    )  # fmt: skip
    assert with_layers(palm, "15/25/0.2513") == palm
    stiff = with_layers(palm, "16/40/0.4")
    assert stiff.depth == pytest.approx(16e-3)
    assert stiff.material.shear_modulus == pytest.approx(40e3)
    assert loss_factor(stiff.material) == pytest.approx(0.4)
    assert with_own_materials(palm, "16/40/0.4") == replace(palm, depth=16e-3)
    assert with_own_materials(palm, "") is None
    assert covers(palm, with_layers(palm, "15/40/0.4"))
    for beyond in ("15/70", "15/25/0.6", "16/30"):
        assert not covers(palm, with_layers(palm, beyond))
    zener = replace(palm, material="palm-zener")
    assert loss_factor(with_layers(zener, "15/25/0.1").material) == pytest.approx(0.1)
    with pytest.raises(ValueError, match="is none that the law of this material can have"):
        with_layers(replace(palm, material="bone"), "15/4000/0.1")


SOFT = replace(BODIES["silicone-disc"], material="palm", width=0.016, height=0.016, depth=0.005)


def test_the_tissue_around_a_bone_is_moved_alone():
    finger = BODIES["fingertip"]
    (row,) = rows(finger, "")
    assert (row["name"], row["thickness"]) == ("palm", "13")
    moved = with_layers(finger, "13/40/0.4")
    assert moved.regions == finger.regions
    assert covers(finger, moved)


@pytest.mark.parametrize("soft", [SOFT, BODIES["fingertip"]], ids=["disc", "fingertip"])
def test_moved_materials_of_elements_are_those_of_their_own_reduction(soft):
    mm = f"{1e3 * soft.depth:g}"
    values = STARTS | {"body": OWN_BODY, "duration": 0.05, "size": 4.0, "x": 3.0}
    answered, said = waves.BodyResponses(), []

    def moved(layers):
        base = with_own_materials(soft, layers)
        assert base == soft
        scene = scene_of(values | {"layers": layers}, soft)
        return scene, answered(scene, lambda *each: said.append(each), False, base)

    moved(f"{mm}/30")
    assert said
    said.clear()
    scene, found = moved(f"{mm}/17/0.2")
    assert not said, "one reduction serves all"
    own = waves.BodyResponses()(scene, lambda *_: None)
    motion = own.response.displacement
    apart = np.linalg.norm(found.response.displacement - motion)
    assert apart < 0.02 * np.linalg.norm(motion - motion.mean())
    assert np.nansum((found.map.rms - own.map.rms) ** 2) < 4e-4 * np.nansum(own.map.rms**2)


def test_the_table_of_layers_is_their_wavenumber_integral():
    assert is_tabulated(SKIN)
    assert not is_tabulated(replace(SKIN, base="free"))
    table = tabulate(wavenumbers(SKIN, lowest(0.2), lambda *_: None), 0.2)
    f, r = table.frequencies[[0, 20, 56, 120]], table.distances[[0, 10, 30]]
    expected = point_response(layered(stack(SKIN)), r, 2 * np.pi * f, 4.35e-3)
    found = table.g[[0, 20, 56, 120]][:, [0, 10, 30]]
    assert np.abs(found - expected).max() < 1e-4 * np.abs(expected).max()
