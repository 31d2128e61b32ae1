"""Published measurements and the models: factors, closed forms, the command."""

from dataclasses import replace
from functools import partial
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from scipy.special import i0e

from simple_model import sensation_level
from simple_model.layers.material import Material
from simple_model.load.focus import spot_width
from skinwave.bodies import Body
from skinwave.commands.cli import main
from skinwave.system.effort import silent
from skinwave.verify import predictions, validation
from skinwave.verify.predictions import (
    BODIES,
    USUAL,
    Samples,
    decay_exponents,
    deflections,
    leading_wave,
)
from skinwave.verify.published import (
    CONTACTS,
    LENGTH,
    OPTIMUM,
    SPEED,
    WAVES,
    all_sources,
    rayleigh_wave,
)
from skinwave.verify.validation import compare_finger, compare_set

SPREAD = replace(
    OPTIMUM, frequencies=(1.0, 2.0, 3.0, 4.0, 5.0), values=(nan,) * 5, lows=(2.0,) * 5,
    highs=(4.0,) * 5,
)  # fmt: skip
COARSE = np.arange(50.0, 701.0, 50.0)  # Hz, to save time
HAND = Path(__file__).parents[2] / "examples/hand/generic-hand-right.glb"


def test_factor_is_relative_to_the_nearer_end_of_the_spread():
    rows = compare_set(SPREAD, "palm-layers", [1.0, 3.0, 8.0, nan, inf])
    assert [row.outcome for row in rows] == ["below", "within", "above", "no wave", "above"]
    assert [row.factor for row in rows[:3]] == [0.5, 1.0, 2.0]
    assert not rows[0].is_fitted
    assert compare_set(SPREAD, "palm", [1.0])[0].is_fitted


def test_values_without_spread_agree_within_the_reading_error():
    alone = replace(SPREAD, values=(3.0,) * 5, lows=(), highs=())
    rows = compare_set(alone, "palm", [3.1, 2.9, 3.2, 2.0, 6.0])
    assert [row.outcome for row in rows] == ["within", "within", "above", "below", "above"]


def test_voigt_lengths_match_the_closed_form():
    """With mu = 7.86 kPa and 5.03 Pa s the 1/e length is 7.3 mm at 200 Hz, the speed 3.22 m/s."""
    speed, length = rayleigh_wave(7.86e3, 5.03, 200.0)
    assert speed == pytest.approx(3.22, abs=0.005)
    assert length == pytest.approx(7.3e-3, abs=5e-5)
    voigt = next(each for each in WAVES if "Voigt" in each.name)
    assert voigt.values[1] == pytest.approx(length)
    assert (np.array(voigt.lows) < voigt.values).all()
    assert (np.array(voigt.highs) > voigt.values).all()


@pytest.fixture(scope="module")
def curves():
    return {name: leading_wave(body, COARSE) for name, body in BODIES.items()}


def test_wave_of_a_half_space_matches_the_closed_form(curves):
    f = np.array([100.0, 200.0, 700.0])
    expected = np.array([rayleigh_wave(25e3, 5.0, x) for x in f]).T
    assert curves["palm"].at(SPEED, f) == pytest.approx(expected[0], rel=2e-4)
    assert curves["palm"].at(LENGTH, f) == pytest.approx(expected[1], rel=2e-4)


def test_layer_on_bone_has_no_wave_at_rest():
    slab = leading_wave(BODIES["skin-slab"])
    assert np.isnan(slab.at(SPEED, np.array([0.0, 50.0]))).all()
    # 15 mm and c_s = 5 m/s: nothing propagates below a quarter of a shear wave, 83 Hz.
    assert slab.frequencies[np.isfinite(slab.speed)][0] == pytest.approx(83, abs=10)


def test_decay_exponents_match_closed_forms():
    """Statically a Gaussian spot deflects a half-space as exp(-x) I_0(x), x = r^2 / 4 s^2."""
    r = np.geomspace(0.010, 0.040, 12)
    at_rest, moving = decay_exponents(BODIES["palm"], np.array([0.01, 300.0]))
    static = i0e(r**2 / (4 * spot_width(0.200) ** 2))
    assert at_rest == pytest.approx(-np.polyfit(np.log(r), np.log(static), 1)[0], abs=1e-3)
    # Where waves outweigh the near field, they spread as r^-1/2 and lose exp(-r/L).
    wave = -0.5 * np.log(r) - r / rayleigh_wave(25e3, 5.0, 300.0)[1]
    assert moving == pytest.approx(-np.polyfit(np.log(r), wave, 1)[0], abs=0.05)


def test_all_sources_span_the_single_sources():
    both = all_sources(SPEED), all_sources(LENGTH)
    assert np.array(both[0].lows)[[0, 1, 3]].tolist() == [8.0, 3.06, 5.0]
    assert np.array(both[0].highs)[[0, 1, 3]].tolist() == [18.0, 10.0, 10.0]
    assert both[1].highs[1] == pytest.approx(0.081)
    assert both[1].frequencies == (100.0, 200.0, 300.0, 400.0)  # beyond, Potts alone


def test_each_published_set_has_a_row_for_each_body(curves):
    rows = validation.compare_sets(WAVES, curves)
    for each in WAVES:
        assert each.source
        assert set(each.fitted) <= set(BODIES)
        assert len(each.values) == len(each.frequencies)
        own = [row for row in rows if row.published.name == each.name]
        assert len(own) == len(each.bodies) * len(each.frequencies)
    fitted = {(row.published.name, row.body) for row in rows if row.is_fitted}
    assert ("Zhang: speed", "forearm") in fitted


def test_best_focus_speed_of_a_half_space_is_near_its_surface_wave():
    """Deflection of the half-space forearm at 2, 3 and 5 m/s: 0.402, 0.409, 0.309 um/Pa."""
    largest, _ = deflections(BODIES["forearm"], 0.100)
    at = {v: 1e6 * u for v, u in zip(USUAL.speeds, largest, strict=True)}
    assert [at[2.0], at[3.0], at[5.0]] == pytest.approx([0.402, 0.409, 0.309], abs=6e-4)
    assert 2.4 < predictions.peak(USUAL.speeds, largest) < 3.3
    assert np.isnan(predictions.peak(np.arange(3.0), np.array([3.0, 2.0, 1.0])))
    assert predictions.peak(np.arange(5.0), -((np.arange(5.0) - 2.3) ** 2)) == pytest.approx(2.3)


def elastic(modulus):
    """A half-space without loss, nearly incompressible."""
    material = Material(density=1000, shear_modulus=modulus, poisson=0.4999)
    return Body(kind="slab", material=material, depth=inf)


def test_a_disc_deflects_a_half_space_as_in_closed_form():
    """Mean under a uniform pressure: 16 (1 - nu^2) F / 3 pi^2 E a, and 1.3 % less for the edge."""
    area, modulus, nu = 1.8e-4, 25e3, 0.4999
    found = predictions.disc_compliance(elastic(modulus), area, [1e-3])
    young, radius = 2 * modulus * (1 + nu), np.sqrt(area / np.pi)
    expected = 16 * (1 - nu**2) / (3 * np.pi**2 * young * radius)
    assert abs(found[0]) == pytest.approx(0.987 * expected, rel=2e-3)


def test_the_frequency_of_least_impedance_is_that_of_the_shear_speed_over_the_radius():
    """Without loss, the only length is the radius and the only speed that of shear waves."""
    usual = predictions.least_impedance(elastic(10e3), 1.0e-4)
    assert 100 < usual < 600
    assert predictions.least_impedance(elastic(10e3), 4.0e-4) == pytest.approx(usual / 2, rel=0.01)
    assert predictions.least_impedance(elastic(20e3), 2.0e-4) == pytest.approx(usual, rel=0.01)


def test_the_threshold_of_a_force_is_that_of_displacement_over_compliance():
    """On and off, a force has the amplitude 2/pi at its frequency; 1.45 cm2 is 3 dB above 2.9."""
    body = BODIES["palm"]
    per_force = abs(predictions.disc_compliance(body, 1.45e-4, [200.0])[0])
    amplitude = 2 / np.pi * predictions.threshold_force(body, 1.45e-4, [200.0])[0]
    level = sensation_level(amplitude * per_force, 200.0, "large_contactor")
    assert level == pytest.approx(20 * np.log10(2**0.5), abs=1e-6)


def test_contacts_are_compared_for_each_area_and_body(monkeypatch):
    monkeypatch.setattr(predictions, "least_impedance", lambda body, area, samples: 160.0)
    rows = validation.compare_sets(CONTACTS, {})
    assert len(rows) == sum(len(each.areas) * len(each.bodies) for each in CONTACTS) == 20
    by_set = {row.published.name: row for row in rows}
    assert by_set["Lundström: thenar, 3.1 cm²"].factor == pytest.approx(2.0)
    assert by_set["Lundström: fingertip, 0.28 cm²"].factor == pytest.approx(0.8)
    assert by_set["Dalecki: threshold, 1.8 cm²"].published.values == pytest.approx([0.4e-3])
    assert not any(row.is_fitted for row in rows)


def test_finger_is_compared_at_its_own_frequencies():
    rows = compare_finger([200.0, 300.0], [0.020, 0.045])
    assert [row.frequency for row in rows] == [200.0, 300.0]
    assert rows[0].factor == pytest.approx(20 / 42)
    assert rows[1].outcome == "within"


@pytest.mark.slow
def test_motion_decays_faster_along_a_finger_at_higher_frequency():
    """Coarse: by 6.5 mm the lengths are 23, 14 and 9.8 mm at 200, 300 and 400 Hz."""
    lengths = predictions.along_finger(HAND, silent, (200.0, 300.0), h=0.009)
    assert lengths == pytest.approx([0.023, 0.014], rel=0.2)
    assert compare_finger((200.0, 300.0), lengths)[1].outcome == "below"


@pytest.mark.parametrize("words", [["--published", "--hand", "no-hand.glb"], ["--hand", "x.glb"]])
def test_command_refuses_a_missing_hand(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    assert main(["verify", "--quiet", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "validation").exists()


def test_command_writes_a_page_and_a_table(tmp_path, monkeypatch):
    """With few speeds and frequencies, to save time."""
    few = Samples(frequencies=COARSE, speeds=np.array([2.0, 5.0, 12.0]))
    monkeypatch.setattr(validation, "validate", partial(validation.validate, samples=few))
    out = tmp_path / "out"
    assert main(["verify", "--published", "-o", str(out), "--quiet"]) == 0
    page = (out / "index.html").read_text("utf-8")
    assert page.index("agree") < page.index('id="factors"') < page.index('id="waves"')
    rows = (out / "validation.csv").read_text("utf-8").splitlines()
    assert rows[0].startswith("set,site,quantity,unit,frequency_hz,body,published")
    assert sum("Potts" in row for row in rows) == 8 * 8
