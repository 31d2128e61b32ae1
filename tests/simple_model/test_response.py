"""The record that every model returns: its own arrays, checked."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import signal

from simple_model import Response, phasors, windows
from simple_model.response import LINE_BETA

TIMES = np.arange(5) / 10_000


def made(**changed):
    parts = {"times": TIMES, "probes": np.zeros((2, 2)), "values": np.ones((5, 2))}
    return Response(model="made", **(parts | changed))


def test_the_callers_arrays_stay_the_callers():
    mine = {"times": TIMES.copy(), "probes": np.zeros((2, 2)), "values": np.ones((5, 2))}
    response = made(**mine)
    for array in mine.values():
        array += 1.0  # neither frozen nor shared
    np.testing.assert_array_equal(response.times, TIMES)
    np.testing.assert_array_equal(response.displacement, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        response.displacement[0] = 2.0


@pytest.mark.parametrize(
    "changed",
    [
        {"times": TIMES[:, None]},
        {"probes": np.zeros((2, 4))},
        {"values": np.ones((2, 5))},
        {"probes": np.zeros((3, 2))},
        {"values": np.full((5, 2), np.nan)},
        {"times": TIMES**2},
        {"quantity": "mm"},
    ],
)
def test_a_response_that_cannot_be_is_refused_in_a_sentence(changed):
    with pytest.raises(ValueError, match="of a response|is unknown") as refused:
        made(**changed)
    assert "\n" not in str(refused.value)


def test_probes_may_have_a_height():
    assert made(probes=np.zeros((2, 3))).probes.shape == (2, 3)


@pytest.mark.parametrize("n", [1, 64, 1001])
def test_windows_are_scipys(n):
    for name in windows.COSINES:
        np.testing.assert_array_equal(windows.cosines(name, n), signal.get_window(name, n))
    for beta in (0.0, 3.3, LINE_BETA):
        symmetric = signal.get_window(("kaiser", beta), n, fftbins=False)
        np.testing.assert_array_equal(windows.kaiser(n, beta), symmetric)


def test_what_few_commands_need_is_not_imported_by_all():
    """Each of a study's processes and each page would wait for it."""
    code = "import fem, simple_model, sys; print(*sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"fem", "simple_model", "scipy.sparse"} <= set(said.stdout.split())
    few = {"scipy.signal", "scipy.stats", "scipy.interpolate", "scipy.optimize", "matplotlib"}
    assert not few & set(said.stdout.split())


def test_lines_of_two_samples_are_refused():
    two = made(times=TIMES[:2], values=np.ones((2, 2)))
    with pytest.raises(ValueError, match="2 samples are too few to fit lines to; record more"):
        phasors(two, (100.0,))
