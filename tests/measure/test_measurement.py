"""Record of a measurement."""

import numpy as np
import pytest

from skinwave.measure import Measurement

PLACES = np.array([[0.0, 0.0], [0.01, 0.0]])


def waveforms(**changes):
    t = np.arange(50) / 1000
    values = np.sin(2 * np.pi * 100 * t)[None, :, None] * np.array([1.0, 2.0])
    given = {"quantity": "velocity", "places": PLACES, "times": t, "values": values} | changes
    return Measurement(**given)


def test_waveforms_and_spectra_are_told_apart():
    measured = waveforms()
    assert not measured.is_spectrum
    assert measured.rate == pytest.approx(1000)
    assert measured.mean.shape == (50, 2)
    spectra = waveforms(times=[], frequencies=[100.0, 200.0], values=np.ones((3, 2, 2)) * 1j)
    assert spectra.is_spectrum
    assert np.isnan(spectra.rate)
    assert spectra.mean[1, 0] == 1j


def test_arrays_are_copies_that_cannot_be_written_to():
    values = np.zeros((1, 50, 2))
    measured = waveforms(values=values)
    values[:] = 1
    assert not measured.values.any()
    with pytest.raises(ValueError, match="read-only"):
        measured.values[:] = 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"quantity": "pressure"}, "not measured on a body"),
        ({"quantity": "speed"}, "speed"),
        ({"frequencies": [1.0]}, "either times or frequencies"),
        ({"places": [[0.0, 0.0, 0.0]]}, r"shape \(1, 3\); give \(p, 2\)"),
        ({"values": np.zeros((50, 2))}, r"shape \(50, 2\)"),
        ({"values": np.full((1, 50, 2), np.nan)}, "must be finite"),
        ({"drive": np.zeros(3)}, "has 3 values"),
        ({"times": np.r_[np.arange(49), 60] / 1000}, "equal steps"),
        ({"times": np.arange(50)[::-1] / 1000}, "must rise"),
    ],
)
def test_what_cannot_be_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        waveforms(**changes)
