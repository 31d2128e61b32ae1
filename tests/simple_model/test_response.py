"""The record that every model returns: its own arrays, checked."""

import numpy as np
import pytest
from scipy import signal

import simple_model
from simple_model import MovingPressure, Response, Tacton, lines, point_kernel, spectra
from skinwave.results.run import ASSESSED

TIMES = np.arange(5) / 10_000
SECOND = np.arange(10_000) / 10_000
PROBES = [[0.0, 0.0], [0.005, 0.0], [0.010, 0.0], [0.015, 0.0], [0.020, 0.0]]


def make(**changed):
    parts = {"times": TIMES, "probes": np.zeros((2, 2)), "values": np.ones((5, 2))}
    return Response(model="made", **(parts | changed))


def test_a_response_copies_its_arrays():
    mine = {"times": TIMES.copy(), "probes": np.zeros((2, 2)), "values": np.ones((5, 2))}
    response = make(**mine)
    for array in mine.values():
        array += 1.0  # neither frozen nor shared
    np.testing.assert_array_equal(response.times, TIMES)
    np.testing.assert_array_equal(response.displacement, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        response.displacement[0] = 2.0


def test_invalid_responses_and_lines_are_refused():
    for changed in (
        {"times": TIMES[:, None]}, {"probes": np.zeros((2, 4))}, {"values": np.ones((2, 5))},
        {"values": np.full((5, 2), np.nan)}, {"times": TIMES**2}, {"quantity": "mm"},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="of a response|is unknown"):
            make(**changed)
    two = make(times=TIMES[:2], values=np.ones((2, 2)))
    for ask, said in (
        (lambda: simple_model.phasors(two, (100.0,)), "2 samples"),
        (lambda: lines(sampled(SECOND), [5000.0]), "half the sampling rate"),
        (lambda: point_kernel(MovingPressure(tacton=Tacton()), [1.0, 2.0], SECOND), "shape"),
    ):
        with pytest.raises(ValueError, match=said):
            ask()


def test_windows_match_scipy():
    n = 1001
    for name in spectra.COSINES:
        np.testing.assert_array_equal(spectra.cosines(name, n), signal.get_window(name, n))


def kernel(am=0.0, size=0.0, speed=0.0, drive="linear", probes=PROBES):
    path = simple_model.Trajectory(shape="circle", size=size, speed=speed)
    tacton = Tacton(am_frequency=am, trajectory=path)
    load = MovingPressure(tacton=tacton, profile="main_lobe", drive=drive, peak_pressure=1.0)
    return load, point_kernel(load, probes, SECOND)


def sampled(x):
    x = np.atleast_2d(x).T if np.ndim(x) == 1 else x
    return Response(model="made", times=SECOND, probes=np.zeros((x.shape[1], 2)), values=x)


def test_a_line_between_bins_is_read_exactly():
    x = 3.0 * np.sin(2 * np.pi * 190.98593 * SECOND + 0.3) + 1e-5 * np.cos(2 * np.pi * 140 * SECOND)
    amplitude = lines(sampled(x), [190.98593, 140.0])[:, 0]
    np.testing.assert_allclose(amplitude, [3.0, 1e-5], rtol=1e-9)


def test_lines_closer_than_the_resolution_share_one_amplitude():
    x = np.sin(2 * np.pi * 100 * SECOND)
    np.testing.assert_allclose(lines(sampled(x), [100.0, 100.2])[:, 0], 1.0, atol=1e-6)


def test_the_spectrum_shows_amplitudes():
    f, amplitude = simple_model.spectrum(sampled(2.0 + 0.7 * np.sin(2 * np.pi * 140 * SECOND)))
    assert amplitude[np.argmin(abs(f - 140)), 0] == pytest.approx(0.7, rel=1e-9)
    assert amplitude[0, 0] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize(
    ("size", "speed", "probe", "expected"),
    [
        # Fourier amplitudes of sinc^2(D/D0), D0 = 11.6 mm, along the circle, probe on the path.
        (0.010, 6, 0.005, [0.375, 0.468, 0.135, 0.020]),
        (0.030, 18, 0.015, [0.125, 0.213, 0.189, 0.153]),
    ],
)
def test_lines_of_stm_are_those_of_the_kernel(size, speed, probe, expected):
    _, response = kernel(size=size, speed=speed, probes=[[probe, 0.0]])
    f_d = 190.98593171027443
    found = lines(response, np.arange(4) * f_d)[:, 0]
    np.testing.assert_allclose(found, expected, atol=6e-4)


@pytest.mark.parametrize(("am", "size", "speed"), [(80.0, 0.030, 18), (140.0, 0.010, 6)])
def test_am_and_stm_have_pairs_and_nothing_at_multiples_of_f_d(am, size, speed):
    load, response = kernel(am=am, size=size, speed=speed)
    found = simple_model.line_table(load, response, candidates=ASSESSED).amplitudes
    strongest = found["f_AM"].max()
    assert max(found[n].max() for n in ("f_d", "2f_d", "3f_d")) < 1e-6 * strongest  # -120 dB
    for pair in ("f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM"):
        assert found[pair].max() > 0.1 * strongest
        # S >= 0: no pair can be higher than f_AM, at any probe.
        assert (found[pair] <= found["f_AM"] * (1 + 1e-9)).all()
