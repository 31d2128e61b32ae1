"""Detection thresholds: the values that the literature is summed up by, and levels above them."""

import numpy as np
import pytest

from simple_model import sensation_level, threshold

FREQUENCIES = [10, 20, 40, 60, 80, 100, 140, 191, 200, 210, 250, 300, 382, 500]
LARGE = [4.0, 4.0, 3.9, 1.7, 0.97, 0.62, 0.32, 0.17, 0.16, 0.14, 0.10, 0.13, 0.19, 0.28]
SPOT = [4.0, 4.0, 4.0, 3.9, 2.2, 1.4, 0.71, 0.38, 0.35, 0.32, 0.22, 0.29, 0.42, 0.63]


@pytest.mark.parametrize(("area", "micrometre"), [("large_contactor", LARGE), ("focal_spot", SPOT)])
def test_thresholds_are_those_of_the_literature(area, micrometre):
    np.testing.assert_allclose(1e6 * threshold(FREQUENCIES, area), micrometre, rtol=0.04)


def test_it_falls_by_twelve_decibel_an_octave_to_its_least_at_250_hz():
    low, high = threshold([100, 200], "large_contactor")
    assert 20 * np.log10(low / high) == pytest.approx(12)
    f = np.arange(10, 1000)
    assert f[np.argmin(threshold(f))] == 250


def test_a_line_at_its_threshold_has_level_zero():
    assert sensation_level(threshold(140), 140) == pytest.approx(0)
    assert sensation_level(10 * threshold(140), 140) == pytest.approx(20)
    assert sensation_level(0.0, 140) == -np.inf


def test_nothing_is_said_outside_the_curve():
    assert np.isnan(threshold([5.0, 2000.0])).all()
    assert sensation_level(1e-3, 5.0) == -np.inf


def test_a_published_pressure_threshold_meets_it():
    """556.9 Pa at 200 Hz moves the palm by 0.165 um, at the threshold of a large contactor."""
    assert abs(sensation_level(0.075e-6 * 2.2, 200, "large_contactor")) < 5


def test_an_unknown_area_is_refused():
    with pytest.raises(ValueError, match="did you mean 'focal_spot'"):
        threshold(140, "spot")
