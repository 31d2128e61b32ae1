"""Numbers as pages print them."""

import numpy as np
import pytest

from skinwave.system.numbers import decibel, significant


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (9.996, "10.0"), (999.6, "1,000"), (31415.9, "31,400"), (-3.14159, "-3.14"),
     (0.012345, "0.0123"), (1.26e-5, "1.26e-05"), (2.5e7, "2.5e+07"), (np.nan, "-")],
)  # fmt: skip
def test_a_number_has_three_significant_digits(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(-288.6, "< -120"), (-np.inf, "< -120"), (-119.96, "-120.0"), (3.36, "+3.4"), (-0.01, "+0.0"),
     (np.nan, "-"), (np.inf, "-")],
)  # fmt: skip
def test_a_level_that_is_round_off_is_told_as_a_bound(value, text):
    assert decibel(value, signed=True) == text
