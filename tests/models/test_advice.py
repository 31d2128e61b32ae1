"""Advice of refusals: every cure that a message names is taken up, and accepted."""

import itertools

import pytest

from skinwave.models import named, names
from skinwave.models.limits import Refused, check_takes, takers, takes
from skinwave.planning.plan import plan
from skinwave.scene.file import dumps, loads

TACTON = "[tacton]\nam_frequency_hz = 120\nduration_s = 0.01\n{tacton}\n"
PROBES = "[probes]\npoints_mm = [[0, 0]]\n{probes}\n"
PAPER = "{{ density_kg_m3 = 800.0, young_modulus_pa = 1e9, poisson = 0.3{losses} }}"
PRONY = ", prony = [{ modulus_pa = 1e8, time_s = 1e-3 }]"
LAW = ', law = "fractional-zener", fast_modulus_pa = 5e8, time_s = 1e-3, exponent = 0.5'
SHEET = 'kind = "sheet"\nsize_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 0.2\n'
SLAB = "size_x_mm = 30\nsize_y_mm = 30\n"
OPEN = 'mounting = { edges = ["left", "right"] }\n'
ASKED = {
    "plain": "",
    "shear": '[load]\nkind = "shear"',
    "contact": '[load]\nkind = "point_force"\nforce_n = 0.01',
    "gravity": "[load]\ngravity_m_per_s2 = 9.81",
    "support": "[load.support_motion]\namplitude_um = 1\nfrequency_hz = 100",
    "lobe": '[focus]\nprofile = "main_lobe"',
    "tilted": "[placement]\ntilt_x_deg = 5",
}
READ = {"motion": "", "velocity": 'quantity = "velocity"', "deep": "depth_mm = 0.05",
        "stress": 'quantity = "strain_zz"\ndepth_mm = 0.05'}  # fmt: skip
PATHS = {
    "rest": "",
    "recorded": 'shape = "recorded"\npoints_mm = [[0, 0], [3, 1]]\ntimes_s = [0, 0.01]',
}
COMBINED = [
    *itertools.product(ASKED, ["motion"], ["rest"]),
    *itertools.product(["plain", "shear", "lobe"], ["velocity", "deep", "stress"], ["rest"]),
    ("plain", "motion", "recorded"),
]


def sheet(losses="", more=""):
    return f"{SHEET}material = {PAPER.format(losses=losses)}\n{more}"


BODIES = {
    "half-space": f"{SLAB}thickness_mm = inf",
    "slab too thin to mesh": "thickness_mm = 0.1",
    "undamped slab": f"{SLAB}thickness_mm = 6\nmaterial = {{ density_kg_m3 = 1000.0, "
    "shear_modulus_pa = 2e4, poisson = 0.49 }",
    "palm": 'kind = "palm"\nsize_x_mm = 60\nsize_y_mm = 60',
    "finger of a thin layer": 'kind = "finger"\nsize_x_mm = 16\nsize_y_mm = 25\nthickness_mm = 13\n'
    'layers = [{ thickness_mm = 2, material = "dermis" }, '
    '{ thickness_mm = 0.1, material = "fat" }]',
    "sheet": sheet(),
    "open relaxing sheet in air": sheet(PRONY, f"air = true\n{OPEN}"),
    "sheet of a law in air": sheet(LAW, "air = true"),
    "curled, stretched sheet": sheet(more="mounting = {curl_x_mm = 0.5, tension_x_n_per_m = 20.0}"),
    "sheet with free sides on a base": sheet(PRONY, 'air = true\nsides = "free"\nbase = "clamped"'),
    "grained sheet": SHEET + 'material = "paper-grain"',
}


def scenes():
    for body, (asked, read, path) in itertools.product(BODIES, COMBINED):
        tacton, probes = TACTON.format(tacton=PATHS[path]), PROBES.format(probes=READ[read])
        text = f"{tacton}{probes}{ASKED[asked]}\n[body]\n{BODIES[body]}\n"
        try:
            yield f"{body}, {asked}, {read}, {path}", loads(text)
        except ValueError:
            continue


def refused(scene, model):
    try:
        if model == "auto":
            if not takers(scene):
                plan(scene)
        else:
            check_takes(named(model), scene)
    except Refused as error:
        return error
    return None


SCENES = dict(scenes())


@pytest.mark.parametrize("body", BODIES)
def test_every_cure_is_accepted(body):
    found = 0
    own = [(name, scene) for name, scene in SCENES.items() if name.startswith(f"{body}, ")]
    for (name, scene), model in itertools.product(own, ("auto", *names())):
        if error := refused(scene, model):
            found += 1
            assert error.cures, f"{name}: {error}"
            for cure in error.cures:
                assert cure.words in str(error)
                assert cure.model in str(error) or model in (cure.model, "auto")
                assert takes(named(cure.model), loads(dumps(cure.scene))), f"{name}: {error}"
                if model == "auto":
                    assert takers(cure.scene)
    assert found
