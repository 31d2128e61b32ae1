"""Models that take the same random scene agree within the errors that they state."""

import math

import pytest

from bench.agreement import Outcome, Pair, outcome, table

SEED = 4711
# Of the first hundred: slabs and sheets of each kind of support and quantity that take seconds.
NUMBERS = 2, 6, 14, 17, 19, 25, 30, 46, 63, 65, 76, 92, 97
# The slow checks, every line or step a solution of its own, are left to `bench.agreement`.
MODELS = (
    "flat-body", "flat-body-harmonic", "fem", "plate-modes", "plate-modes-transient",
    "plate-modes-nonlinear", "fem-nonlinear",
)  # fmt: skip


@pytest.mark.parametrize("number", NUMBERS)
def test_models_agree_within_their_stated_errors(number):
    found = outcome(number, table(number, SEED), MODELS, slowest=math.inf)
    assert not found.faults
    assert not found.disagreements, found.scene


def test_a_difference_above_the_stated_errors_is_reported():
    """A difference of 3 % between responses with a stated error of 1 % each."""
    found = Outcome(0, {})
    found.pairs = [Pair(("a", "b"), 0.03, 0.02), Pair(("a", "c"), 0.02, 0.02)]
    assert [pair.models for pair in found.disagreements] == [("a", "b")]
