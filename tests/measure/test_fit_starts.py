"""Searches of fits from bad starts, measurements with their sign turned, and lines left out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skinwave.measure import Measurement
from skinwave.measure.findings import cautions
from skinwave.measure.fit import fit
from skinwave.measure.fit_page import left_out_table
from skinwave.measure.observed import NOT_PREDICTED, Data, load_lines
from skinwave.measure.parameters import parse
from skinwave.measure.predicted import predicted_lines, target
from skinwave.measure.search import Problem, best_placed, descended, refine, search, solve
from skinwave.scene.file import loads
from skinwave.system.effort import silent

MODULUS = "body.material.shear_modulus_pa"
VARY = (f"{MODULUS}=8000:80000", "gain=0.2:5", "delay_ms=-5:5")
TRUE = {MODULUS: 26e3, "gain": 1.3, "delay_ms": -1.6}
LINES = np.array([51.0, 140.0, 191.0, 331.0, 471.0])
PLACES = np.array([5.0, 20.0, 35.0]) / 1e3


def plane_waves(values):
    """Shear waves (f, 2 p) from the origin that lose a factor of e in 20 mm, as two real parts."""
    speed = np.sqrt(values[MODULUS] / 1000)
    away = PLACES / speed + values["delay_ms"] / 1e3
    a = np.exp(-2j * np.pi * LINES[:, None] * away - PLACES / 20e-3)
    return values["gain"] * np.hstack([a.real, a.imag])


def problem(true=TRUE, sign=1.0, vary=VARY, lines=slice(None)):
    rng = np.random.default_rng(0)
    noise = 0.02 * rng.standard_normal(plane_waves(true).shape)
    data = Data(
        kind="lines", words="", axis=LINES[lines], unit="Hz", labels=("",) * 2 * len(PLACES),
        values=sign * (plane_waves(true) + noise)[lines], error=np.full(noise.shape, 0.02)[lines],
        is_known=True, predict=lambda values: plane_waves(TRUE | values)[lines],
    )  # fmt: skip
    return Problem(parameters=parse(vary), data=data, linear=("gain",))


@pytest.mark.parametrize("modulus", [8.5e3, 70e3])
def test_a_search_leaves_the_minimum_of_a_delay_a_period_off(modulus):
    """Of a start with the wrong delay; the local search from it ends elsewhere."""
    asked = problem()
    u = asked.parameters.place({MODULUS: modulus, "gain": 1.0, "delay_ms": 3.6})
    wrong = refine(asked, u)
    assert wrong.converged
    assert wrong.cost > 100 * asked.data.values.size
    found = asked.parameters.values(descended(asked, wrong).ended)
    assert found[MODULUS] == pytest.approx(TRUE[MODULUS], rel=0.02)
    assert found["delay_ms"] == pytest.approx(TRUE["delay_ms"], abs=0.05)


def test_every_start_reaches_the_least_minimum():
    asked, rng = problem(), np.random.default_rng(1)
    starts = [rng.random((1, 3)) for _ in range(25)]
    local = [refine(asked, best_placed(asked, each)) for each in starts]
    least = min(start.cost for start in local)
    assert sum(start.cost > 2 * least for start in local) >= 1
    found = search(asked, starts, silent)
    assert max(start.cost for start in found) == pytest.approx(least, rel=1e-3)
    begun = [start.begun for start in found]
    assert np.array(begun) == pytest.approx(np.array([start.begun for start in local]))


@pytest.mark.parametrize(("sign", "vary"), [(1, VARY), (-1, VARY)])
def test_a_turned_sign_is_noticed(sign, vary):
    true = TRUE if "delay_ms=-5:5" in vary else TRUE | {"delay_ms": 0.0}
    found = solve(problem(true, sign, vary), 2, 0, silent)
    assert found.may_be_turned == (sign < 0)


def test_a_negative_gain_is_a_turned_sign():
    vary = (VARY[0], "gain=-5:5", VARY[2])
    for sign in (1, -1):
        found = solve(problem(TRUE | {"delay_ms": 0.1}, sign, vary), 2, 0, silent)
        assert found.may_be_turned == (found.problem.parameters.values(found.u)["gain"] < 0)
        assert found.may_be_turned == (sign < 0)


SCENE = """
[tacton]
am_frequency_hz = 140
duration_s = 0.2
shape = "point"
[body]
kind = "slab"
thickness_mm = 15
[probes]
points_mm = [[4, 0], [10, 0]]
"""


@pytest.fixture(scope="module")
def lines():
    """Scene, target of the wavenumber integral, and a measurement of its lines."""
    scene = loads(SCENE)
    given = {"quantity": "velocity", "places": scene.probe_points}
    f = np.array([140.0, 280.0])
    aim = target(scene, "flat-body", Measurement(
        **given, frequencies=f, values=np.ones((1, 2, 2))
    ).record, scene.probe_points)  # fmt: skip
    rng = np.random.default_rng(0)
    a = predicted_lines(aim, f)({MODULUS: 30e3})
    noise = rng.standard_normal((2, 4, *a.shape)) * 0.01 * np.abs(a).max()
    return scene, aim, Measurement(**given, frequencies=f, values=a + noise[0] + 1j * noise[1])


def test_a_fit_hints_at_a_turned_sign(lines):
    scene, _, measured = lines
    vary = [f"{MODULUS}=10000:70000", "gain=0.2:5"]
    turned = replace(measured, values=-measured.values)
    for each, is_turned in ((measured, False), (turned, True)):
        said = [text for text in cautions(fit(scene, each, vary, starts=1)) if "sign" in text]
        assert bool(said) == is_turned
    assert said[0].startswith("with its sign turned the measurement fits flat-body as well")
    assert "another delay" not in said[0]


def test_lines_that_a_reduced_body_does_not_have_are_told(lines):
    scene, aim, measured = lines
    every = load_lines(measured, aim)
    assert every.left_out == ()
    small = replace(aim, reduced=SimpleNamespace(frequencies=every.found.frequencies[:1]))
    (left,) = load_lines(measured, small).left_out
    power = (np.abs(every.found.mean) ** 2 - 2 * every.error**2).sum(axis=1)
    assert (left.frequency, left.why) == (280.0, NOT_PREDICTED)
    assert left.share == pytest.approx(power[1] / power.sum())
    found = fit(scene, measured, ["gain=0.2:5"], starts=1)
    solution = found.solution
    data = replace(solution.problem.data, left_out=(left, replace(left, share=np.nan)))
    asked = replace(solution.problem, data=data)
    found = replace(found, solution=replace(solution, problem=asked))
    (said,) = (text for text in cautions(found) if "not fitted" in text)
    assert left.name in said
    assert f"{100 * left.share:.2g} %" in said
    rows = left_out_table(found).rows
    assert [row[0] for row in rows] == [left.name] * 2
    assert np.isnan(rows[1][2])


def test_a_line_of_noise_that_is_left_out_has_no_share(lines):
    _, aim, measured = lines
    rng = np.random.default_rng(1)
    values = measured.values.copy()
    size = 0.1 * np.abs(values[:, 0]).max()
    values[:, 1] = size * (rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2)))
    small = replace(aim, reduced=SimpleNamespace(frequencies=np.array([140.0])))
    (left,) = load_lines(replace(measured, values=values), small).left_out
    assert left.share == 0.0
