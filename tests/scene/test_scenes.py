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


def test_the_paper_has_fifteen_tactons():
    patterns = dict(tactons())
    assert len(patterns) == 15
    moving = [t for t in patterns.values() if t.trajectory.drawing_frequency]
    assert len(moving) == 12
    assert sum(t.am_frequency > 0 for t in moving) == 9


def test_every_preset_comes_back_from_its_file():
    for name, tacton in tactons():
        for scene in scenes(name, tacton).values():
            assert loads(dumps(scene)) == scene


def test_every_example_is_a_scene_that_comes_back():
    assert len(EXAMPLES) > 5
    for path in EXAMPLES:
        assert loads(dumps(read(path))) == read(path), path


def test_a_material_of_ones_own_comes_back():
    scene = loads(
        "[body]\nkind = 'slab'\n[body.material]\ndensity_kg_m3 = 1070\n"
        "shear_modulus_pa = 25e3\npoisson = 0.49\nviscosity_pa_s = 3\n"
    )
    assert scene.body.material == Material(
        density=1070, shear_modulus=25e3, poisson=0.49, viscosity=3
    )
    assert loads(dumps(scene)) == scene


def test_missing_keys_take_the_presets_value():
    assert loads("").body == BODIES["skin-slab"]
    assert loads("[body]\nkind = 'sheet'").body == BODIES["paper-sheet-loose"]
    # A body, or none, never changes the load.
    assert loads("[body]\nkind = 'none'").pressure == loads("").pressure
    assert loads("").pressure.drive == "pressure_squared"


def test_units_of_the_file_are_those_of_its_keys():
    scene = loads(
        "[tacton]\namplitude_percent = 50\nshape = 'circle'\nsize_mm = 20\nspeed_m_per_s = 12\n"
        "[focus]\nheight_mm = 150\n[probes]\npoints_mm = [[5, -10]]"
    )
    assert scene.tacton.amplitude == 0.5
    assert scene.tacton.trajectory.size == 0.020
    assert scene.pressure.height == 0.150
    np.testing.assert_array_equal(scene.probe_points, [[0.005, -0.010]])


WRONG = {
    "[tacton]\nshape = 'circel'": "did you mean 'circle'",
    "[tacton]\nsize = 20": "unknown key 'size'; did you mean 'size_mm'",
    '[body]\nkind = "palm-layers"': 'a preset of that name; write preset = "palm-layers" instead',
    '[body]\npreset = "palm-layer"': "'palm-layer' is unknown, use one of none,",
    '[body]\npreset = ["palm"]': "must be a text in quotes",
    '[body]\npreset = "palm"\nkind = "slab"': 'kind = "slab" and a preset of kind = "palm"',
    "[tactons]\nsize_mm = 20": "unknown key 'tactons'; did you mean 'tacton'",
    "[tacton]\nshape = 'circle'\nsize_mm = 61": "size = 61 mm is outside 0 to 60 mm",
    "[tacton]\nam_frequency_hz = -80": "am_frequency = -80",
    "[tacton]\nspeed_m_per_s = nan": "speed = nan of a path must be a finite number",
    "[focus]\npeak_pressure_pa = inf": "peak_pressure = inf of a load must be a finite number",
    "[tacton]\nsuperposition = [0.5, 0.6]": "with sum 1",
    "[tacton]\nsuperposition = [1]": "must be a pair of numbers",
    "[tacton]\nduration_s = 0": "of a Tacton must be a finite number, above 0",
    "[tacton]\nduration_s = 32": "longest Tacton; shorten it",
    "[tacton]\nsize_mm = 'big'": "size_mm = 'big' must be a number",
    "[tacton]\nsize_mm = true": "size_mm = True must be a number",
    "tacton = 3": "must be a table",
    "[focus]\nheight_mm = 700": "height = 700 mm is outside 20 to 600 mm",
    "[focus]\ndrive = 'squared'": "did you mean 'pressure_squared'",
    "[focus]\nprofile = 'gauss'": "did you mean 'gaussian'",
    "[probes]\npoints_mm = [[51, 0]]": "probe (51, 0) mm lies outside the body",
    "[probes]\npoints_mm = []": "give at least one probe",
    "[probes]\npoints_mm = [[0, nan]]": "coordinates must be finite",
    "[tacton]\nshape = 'circle'\nsize_mm = 60\n[body]\nsize_x_mm = 50": "path reaches 30 mm",
    "[body]\nkind = 'slap'": "did you mean 'slab'",
    "[body]\nmaterial = 'palms'": "did you mean 'palm'",
    "[body]\nbase = 'free'\nsides = 'free'": "unconstrained and drifts",
    "[body]\nthickness_mm = -1": "must be finite and above 0",
    "[body]\nthickness_mm = 15000": "body depth = 15 m is more than 2 m",
    "[body]\nsize_x_mm = 1e5": "body width = 100 m is more than 2 m",
    "[body.material]\ndensity_kg_m3 = 1000": "lacks shear_modulus_pa and poisson",
    "[tacton\n": "not valid TOML",
}


def test_wrong_scenes_are_refused_in_one_sentence():
    for text in WRONG:
        with pytest.raises(ValueError) as error:  # noqa: PT011 - the text is checked below
            loads(text)
        assert WRONG[text] in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["width", "height", "depth"])
def test_a_length_in_millimetre_where_metres_are_meant_is_refused(name):
    said = rf"body {name} = 15 m .*lengths are in metre here.*15 mm are {name} = 0.015"
    with pytest.raises(ValueError, match=said):
        Body(**{name: 15})
    assert getattr(Body(**{name: 2.0}), name) == 2
    assert Body(depth=inf).depth == inf


NONSENSE = {
    "[tacton]\nshape = 'xyzzy'": "shape 'xyzzy' is unknown, use one of point, line,",
    "[body]\nmaterial = 'q'": "material 'q' is unknown, use one of",
    "[tacton]\nwwwwww = 1": "[tacton] has the unknown key 'wwwwww'; it may have amplitude_percent,",
    "[zzz]\nsize_mm = 1": "has the unknown key 'zzz'; it may have",
}


def test_nothing_is_suggested_for_nonsense():
    for text in NONSENSE:
        with pytest.raises(ValueError, match=re.escape(NONSENSE[text])) as error:
            loads(text)
        assert "did you mean" not in str(error.value)


def test_a_preset_is_changed_by_other_keys():
    body = loads('[body]\npreset = "palm-layers"\nthickness_mm = 20\n[placement]\nlift_mm = 1').body
    known = BODIES["palm-layers"]
    assert body.layers == known.layers
    assert (body.depth, body.placement.lift) == (0.020, 0.001)
    assert loads(dumps(replace(loads(""), body=body))).body == body
