"""Scene files: defaults, refusals, and the round trip from text to scene and back."""

import re
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from fem import Material
from skinwave import BODIES, Body, dumps, loads, read
from skinwave.scene.paper15 import scenes, tactons

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
TACTON = "[tacton]\nduration_s = 0.05\n"
KEYS = {
    "size = 10": ("size_mm", "size_mm = 10"),
    "[tacton.rhythm]\npulses = [[1, 2]]": ("pulses_ms", "[tacton.rhythm]\npulses_ms = [[1, 2]]"),
    "[body]\n[body.material]\nyoung = 3": ("young_modulus_pa", ""),
    "[body]\nsize_mm = 10": ("[tacton]", "size_mm = 10"),
    "[body]\nkind = slab": ("", '[body]\nkind = "slab"'),
    '[body]\nkind = "sheet"\nair = True': ("", '[body]\nkind = "sheet"\nair = true'),
    "size_mm = 0,5": ("", "size_mm = 0.5"),
}
INVALID = {  # and what the error names
    "[tacton]\nshape = 'circel'": "'circle'",
    "[tacton]\nsize = 20": "'size_mm'",
    '[body]\nkind = "palm-layers"': 'preset = "palm-layers"',
    '[body]\npreset = "palm-layer"': "'palm-layer'",
    '[body]\npreset = ["palm"]': "text",
    '[body]\npreset = "palm"\nkind = "slab"': 'kind = "slab"',
    "[tactons]\nsize_mm = 20": "'tacton'",
    "[tacton]\nshape = 'circle'\nsize_mm = 61": "61 mm",
    "[tacton]\nam_frequency_hz = -80": "am_frequency = -80",
    "[tacton]\nspeed_m_per_s = nan": "speed = nan",
    "[focus]\npeak_pressure_pa = inf": "peak_pressure = inf",
    "[tacton]\nsuperposition = [0.5, 0.6]": "sum",
    "[tacton]\nsuperposition = [1]": "pair",
    "[tacton]\nduration_s = 0": "above 0",
    "[tacton]\nduration_s = 32": "32",
    "[tacton]\nsize_mm = 'big'": "size_mm = 'big'",
    "[tacton]\nsize_mm = true": "size_mm = True",
    "tacton = 3": "table",
    "[focus]\nheight_mm = 700": "700 mm",
    "[focus]\ndrive = 'squared'": "'pressure_squared'",
    "[focus]\nprofile = 'gauss'": "'gaussian'",
    "[probes]\npoints_mm = [[51, 0]]": "probe (51, 0) mm",
    "[probes]\npoints_mm = []": "points_mm",
    "[probes]\npoints_mm = [[0, nan]]": "finite",
    "[tacton]\nshape = 'circle'\nsize_mm = 60\n[body]\nsize_x_mm = 50": "30 mm",
    "[body]\nkind = 'slap'": "'slab'",
    "[body]\nmaterial = 'palms'": "'palm'",
    "[body]\nbase = 'free'\nsides = 'free'": "unconstrained",
    "[body]\nthickness_mm = -1": "thickness_mm",
    "[body]\nthickness_mm = 15000": "15 m exceeds 2 m",
    "[body.material]\ndensity_kg_m3 = 1000": "shear_modulus_pa and poisson",
    "[tacton\n": "TOML",
}
NONSENSE = (
    "[tacton]\nshape = 'xyzzy'", "[body]\nmaterial = 'q'", "[tacton]\nwwwwww = 1",
    "[zzz]\nsize_mm = 1",
)  # fmt: skip


def test_the_paper_has_fifteen_tactons():
    patterns = dict(tactons())
    assert len(patterns) == 15
    moving = [t for t in patterns.values() if t.trajectory.drawing_frequency]
    assert len(moving) == 12
    assert sum(t.am_frequency > 0 for t in moving) == 9


def test_scenes_round_trip():
    assert len(EXAMPLES) > 5
    found = [scene for name, tacton in tactons() for scene in scenes(name, tacton).values()]
    for scene in (*found, *map(read, EXAMPLES)):
        assert loads(dumps(scene)) == scene
    text = "[body.material]\ndensity_kg_m3 = 1070\nshear_modulus_pa = 25e3\npoisson = 0.49\n"
    scene = loads(text + "viscosity_pa_s = 3\n")
    own = Material(density=1070, shear_modulus=25e3, poisson=0.49, viscosity=3)
    assert scene.body.material == own
    assert loads(dumps(scene)) == scene


def test_missing_keys_take_the_value_of_the_preset():
    assert loads("").body == BODIES["skin-slab"]
    assert loads("[body]\nkind = 'sheet'").body == BODIES["paper-sheet-loose"]
    # A body, or none, never changes the load.
    assert loads("[body]\nkind = 'none'").pressure == loads("").pressure
    assert loads("").pressure.drive == "pressure_squared"


def test_default_probes_lie_on_a_narrow_body(tmp_path):
    path = tmp_path / "small-finger.toml"
    path.write_text(f'{TACTON}[body]\npreset = "fingertip"', encoding="utf-8")
    scene = read(path)
    assert scene.name == "small-finger"
    x, y = scene.probe_points.T
    assert len(x) == 5
    assert (y == 0).all()
    assert 0.003 < x.max() < scene.body.width / 2
    assert loads(dumps(scene)).probes == scene.probes
    assert loads("").probes[-1] == (0.02, 0.0)  # wide enough
    given = '[body]\npreset = "fingertip"\n[probes]\npoints_mm = [[0, 0], [20, 0]]'
    with pytest.raises(ValueError, match="outside the body"):
        loads(given)


def test_keys_have_their_units():
    scene = loads(
        "[tacton]\namplitude_percent = 50\nshape = 'circle'\nsize_mm = 20\nspeed_m_per_s = 12\n"
        "[focus]\nheight_mm = 150\n[probes]\npoints_mm = [[5, -10]]"
    )
    assert scene.tacton.amplitude == 0.5
    assert scene.tacton.trajectory.size == 0.020
    assert scene.pressure.height == 0.150
    np.testing.assert_array_equal(scene.probe_points, [[0.005, -0.010]])


def test_invalid_scenes_are_refused_in_one_sentence():
    for text, named in INVALID.items():
        with pytest.raises(ValueError, match=re.escape(named)) as error:
            loads(text)
        assert "\n" not in str(error.value)
    for text in NONSENSE:
        with pytest.raises(ValueError, match="use one of") as error:
            loads(text)
        assert "did you mean" not in str(error.value)


def test_lengths_in_millimetre_instead_of_metre_are_refused():
    for name in ("width", "height", "depth"):
        with pytest.raises(ValueError, match=f"{name} = 15 m .*{name} = 0.015"):
            Body(**{name: 15})
        assert getattr(Body(**{name: 2.0}), name) == 2
    assert Body(depth=inf).depth == inf


def test_a_preset_is_changed_by_other_keys():
    body = loads('[body]\npreset = "palm-layers"\nthickness_mm = 20\n[placement]\nlift_mm = 1').body
    known = BODIES["palm-layers"]
    assert body.layers == known.layers
    assert (body.depth, body.placement.lift) == (0.020, 0.001)
    assert loads(dumps(replace(loads(""), body=body))).body == body


@pytest.mark.parametrize("wrong", KEYS)
def test_the_key_that_a_message_names_is_accepted(wrong):
    name, right = KEYS[wrong]
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        loads(TACTON + wrong)
    assert name in str(refusal.value)
    loads(TACTON + right)


@pytest.mark.parametrize(
    "path", [r'"C:\Users\me\hand.stl"', r"C:\temp\thumb.stl", r'"meshes\new.stl"']
)
def test_a_windows_path_needs_single_quotes_or_slashes(path):
    scene = '[body]\nkind = "mesh"\nmaterial = "palm"\nfile = '
    with pytest.raises(ValueError, match="'.*/"):
        loads(scene + path)
    plain = path.strip('"')
    assert loads(f"{scene}'{plain}'").body.file == plain
    slashes = plain.replace("\\", "/")
    assert loads(f'{scene}"{slashes}"').body.file == slashes
