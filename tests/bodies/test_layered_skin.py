"""Presets of layered skin: the speeds that docs/scenes.md states, and the ranges of the fit."""

import pytest

from bench.layered_skin import RANGES, values_of
from skinwave.bodies import BODIES
from skinwave.verify.predictions import leading_wave
from skinwave.verify.published import OPTIMUM, wave_sets


@pytest.mark.parametrize(
    ("preset", "speeds", "lengths"),
    [("palm-layers", (8.5, 5.1), (40, 30)), ("forearm-layers", (3.5, 3.2), (21, 7.8))],
)
def test_waves_of_layers_are_as_fast_as_the_manual_says(preset, speeds, lengths):
    wave = leading_wave(BODIES[preset], [100.0, 200.0])
    assert wave.speed == pytest.approx(speeds, rel=0.03)
    assert 1e3 * wave.length == pytest.approx(lengths, rel=0.03)


@pytest.mark.parametrize("preset", RANGES)
def test_each_fitted_number_is_within_its_range(preset):
    found = values_of(BODIES[preset], RANGES[preset])
    for name, each in RANGES[preset].items():
        assert each.low <= found[name] <= each.high or found[name] == pytest.approx(each.low)
        assert each.source


def test_palm_layers_predict_the_optimum_of_a_focus_and_are_fitted_to_waves_of_hands():
    fitted = {each.name for each in wave_sets() if "palm-layers" in each.built}
    assert {name.partition(":")[0] for name in fitted} == {"Potts", "Manfredi", "SkinSource"}
    assert "palm-layers" in OPTIMUM.bodies
    assert "palm-layers" not in OPTIMUM.built
