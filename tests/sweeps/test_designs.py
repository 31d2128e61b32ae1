"""Designs: which values meet in which run, and samples of uncertain numbers."""

from math import log, pi, sqrt

import numpy as np
import pytest
from scipy import stats

from skinwave.scene import distributions
from skinwave.scene.distributions import Distribution, parse_distribution, uniform, within_factor
from skinwave.scene.file import read
from skinwave.scene.variation import cases, combinations, parse, saltelli_shares
from skinwave.sweeps.sampling import one_at_a_time, samples, sobol_indices

SHARES = np.array([1e-6, 0.05, 0.3, 0.5, 0.77, 0.95, 1 - 1e-6])


def varied(*texts):
    return [parse(text) for text in texts]


def bounds(shape, low, high):
    return Distribution(shape=shape, measure="bounds", width=(low, high))


def numbers(count, low, high):
    return [uniform(f"x{k}", low, high) for k in range(count)]


def quantiles(spreads, shares):
    return np.transpose([each.at(column) for each, column in zip(spreads, shares.T, strict=True)])


def test_a_factorial_is_every_value_with_every_other_and_zip_first_with_first():
    met = combinations(varied("tacton.speed_m_per_s=1:12:12", "body.thickness_mm=10,15"))
    assert len(met) == 24
    assert met[0] == {"tacton.speed_m_per_s": 1.0, "body.thickness_mm": 10}
    assert met[-1] == {"tacton.speed_m_per_s": 12.0, "body.thickness_mm": 15}
    met = combinations(varied("tacton.size_mm=5:15:3", "body.thickness_mm=9,10,11"), "zip")
    assert [tuple(each.values()) for each in met] == [(5, 9), (10, 10), (15, 11)]
    with pytest.raises(ValueError, match="3, 2"):
        combinations(varied("tacton.size_mm=5:15:3", "body.thickness_mm=9,10"), "zip")


def test_a_latin_hypercube_meets_every_stratum_once_and_is_the_same_again():
    asked = varied("tacton.speed_m_per_s=2:12", "body.material=palm,forearm")
    met = combinations(asked, "lhs", 20)
    speeds = np.array([each["tacton.speed_m_per_s"] for each in met])
    np.testing.assert_array_equal(np.sort(((speeds - 2) / 0.5).astype(int)), np.arange(20))
    assert sorted(each["body.material"] for each in met) == 10 * ["forearm"] + 10 * ["palm"]
    assert met == combinations(asked, "lhs", 20) != combinations(asked, "lhs", 20, seed=1)
    found = samples(numbers(2, 0, 1), 50, seed=3)
    assert (np.sort((50 * found).astype(int), axis=0) == np.arange(50)[:, None]).all()


def test_any_key_of_a_scene_can_be_varied(scene):
    texts = (
        "body.material.viscosity_pa_s=2,4", "probes.points_mm=[[0, 0]],[[1, 0], [2, 0]]",
        "tacton.sweep=one_way",
    )  # fmt: skip
    found = cases(scene, combinations(varied(*texts)))
    assert [case.scene.body.solid.viscosity for case in found] == [2, 2, 4, 4]
    assert found[0].scene.body.solid.shear_modulus == read(scene).body.solid.shear_modulus
    assert [len(case.scene.probes) for case in found] == [1, 2, 1, 2]
    bodies = cases(scene, combinations(varied("body=skin-slab,palm,none")))
    assert [case.scene.body.kind for case in bodies] == ["slab", "palm", "none"]
    same = cases(scene, combinations(varied("body.thickness_mm=10,10.0,15")))
    assert len({case.name() for case in same}) == 2


def test_the_spreads_of_presets_can_be_varied(scene):
    texts = ("body.material.modulus_scale=factor(1,3)", "body.material.loss_scale=0.5:2")
    met = combinations(varied(*texts), "sobol", 4)
    plain = read(scene).body.solid
    for case, each in zip(cases(scene, met), met, strict=True):
        modulus, loss = each.values()
        assert case.scene.body.solid == plain.scaled(modulus=modulus, loss=loss)
        assert case.keys["body.material.modulus_scale"] == modulus
    for wrong in ("body.layers.3.material.loss_scale=1,2", "body.material.loss_scale=0,-1"):
        with pytest.raises(ValueError, match="loss_scale"):
            cases(scene, combinations(varied(wrong)))


def test_distributions_of_a_sweep():
    for text, value, given in (
        ("normal(25e3, 0.3)", 25e3, Distribution(shape="normal", width=(0.3,))),
        ("factor(50,2)", 50, within_factor(2)),
        ("triangular(10,12,20)", 12, bounds("triangular", 10, 20)),
    ):
        assert parse_distribution("x", text) == distributions.Spread(
            key="x", value=value, distribution=given
        )
    assert parse_distribution("x", "palm") is None
    with pytest.raises(ValueError, match="2 numbers"):
        parse_distribution("x", "uniform(1)")
    asked = varied("focus.peak_pressure_pa=factor(50,2)", "tacton.size_mm=10:20")
    met = combinations(asked, "sobol", 4)
    sizes = [run["tacton.size_mm"] for run in met]
    assert len(met) == 4 * (2 + 2)
    assert sizes[:4] == sizes[8:12]
    assert all(10 <= size <= 20 for size in sizes)
    for wrong in (("sobol", 5), ("factorial", None)):
        with pytest.raises(ValueError, match="power of two|--design lhs"):
            combinations(asked, *wrong)


@pytest.mark.parametrize(
    ("given", "value", "frozen"),
    [
        (Distribution(width=(0.3,)), 7.0, stats.lognorm(sqrt(log(1.09)), scale=7)),
        (within_factor(2.0), 50.0, stats.lognorm(log(2) / stats.norm.ppf(0.95), scale=50)),
        (Distribution(shape="normal", width=(0.3,)), -4.0, stats.norm(-4, 1.2)),
        (Distribution(shape="normal", measure="standard_error", width=(2.0,)), 0.0,
         stats.norm(0, 2)),
        (bounds("uniform", 1, 5), 2.0, stats.uniform(1, 4)),
        (bounds("triangular", 1, 5), 2.0, stats.triang(0.25, 1, 4)),
    ],
)  # fmt: skip
def test_quantiles_are_those_of_scipy(given, value, frozen):
    assert given.quantile(value, SHARES) == pytest.approx(frozen.ppf(SHARES), rel=1e-9)


def test_indices_of_the_ishigami_function():
    """Ishigami and Homma (1990); closed form in Saltelli et al., Global Sensitivity Analysis."""
    a, b = 7.0, 0.1
    x = quantiles(numbers(3, -pi, pi), saltelli_shares(3, 4096))
    y = np.sin(x[:, 0]) * (1 + b * x[:, 2] ** 4) + a * np.sin(x[:, 1]) ** 2
    found = sobol_indices(y, 3)
    first, second = (1 + b * pi**4 / 5) ** 2 / 2, a**2 / 8
    both = b**2 * pi**8 * (1 / 18 - 1 / 50)
    variance = first + second + both
    assert found.first * variance == pytest.approx([first, second, 0], abs=0.02 * variance)
    expected = [first + both, second, both]
    assert found.total * variance == pytest.approx(expected, abs=0.02 * variance)
    away = np.abs(found.first - np.array([first, second, 0]) / variance)
    assert (away < 2 * found.first_error).all()
    assert (found.first_error < 0.05).all()


def test_indices_and_tornadoes_of_a_sum():
    weights, spreads = np.array([1.0, 2.0, 0.0]), numbers(3, 0, 1)
    x = quantiles(spreads, saltelli_shares(3, 256))
    assert sobol_indices(1e3 + x @ weights, 3).first == pytest.approx([0.2, 0.8, 0], abs=0.03)
    assert sobol_indices(0 * x[:, 0], 3).total == pytest.approx([0, 0, 0])
    with pytest.raises(ValueError, match="matrices"):
        sobol_indices(x[:-1, 0], 3)
    y = one_at_a_time(spreads) @ weights
    assert y[0] == pytest.approx(1.5)
    assert y[2::2] - y[1::2] == pytest.approx(0.9 * weights)


def test_indices_of_an_output_that_hardly_varies_are_finite():
    x = quantiles(numbers(2, 0, 1), saltelli_shares(2, 8))
    mixed = np.where(np.arange(len(x)) < 16, 1.0, x[:, 0])  # varies in the mixed matrices alone
    for y in (np.full(len(x), 0.1), np.full(len(x), 1e6) + 1e-10 * x[:, 0], mixed):
        found = sobol_indices(y, 2)
        for each in (found.first, found.total, found.first_error, found.total_error):
            np.testing.assert_array_equal(each, 0)
