"""Equation 2 of the paper, and how spectral lines are read off any response."""

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Response,
    Tacton,
    Trajectory,
    line_table,
    lines,
    point_kernel,
    spectrum,
)
from skinwave.results.run import ASSESSED

TIMES = np.arange(10_000) / 10_000
PROBES = [[0.0, 0.0], [0.005, 0.0], [0.010, 0.0], [0.015, 0.0], [0.020, 0.0]]


def kernel(am=0.0, size=0.0, speed=0.0, drive="linear", probes=PROBES):
    tacton = Tacton(am_frequency=am, trajectory=Trajectory(shape="circle", size=size, speed=speed))
    load = MovingPressure(tacton=tacton, profile="main_lobe", drive=drive, peak_pressure=1.0)
    return load, point_kernel(load, probes, TIMES)


def sampled(x):
    x = np.atleast_2d(x).T if np.ndim(x) == 1 else x
    return Response(model="made", times=TIMES, probes=np.zeros((x.shape[1], 2)), values=x)


def test_a_line_between_bins_is_read_exactly():
    x = 3.0 * np.sin(2 * np.pi * 190.98593 * TIMES + 0.3) + 1e-5 * np.cos(2 * np.pi * 140 * TIMES)
    amplitude = lines(sampled(x), [190.98593, 140.0])[:, 0]
    np.testing.assert_allclose(amplitude, [3.0, 1e-5], rtol=1e-9)


def test_a_strong_line_left_out_does_not_leak():
    x = np.sin(2 * np.pi * 190.98593 * TIMES)
    assert lines(sampled(x), [140.0, 210.0]).max() < 1e-6


def test_lines_closer_than_the_resolution_share_one_amplitude():
    x = np.sin(2 * np.pi * 100 * TIMES)
    np.testing.assert_allclose(lines(sampled(x), [100.0, 100.2])[:, 0], 1.0, atol=1e-6)


def test_lines_beyond_nyquist_are_refused():
    with pytest.raises(ValueError, match="half the sampling rate"):
        lines(sampled(TIMES), [5000.0])


@pytest.mark.parametrize("window", ["hann", "blackmanharris"])
def test_the_spectrum_shows_amplitudes(window):
    f, amplitude = spectrum(sampled(2.0 + 0.7 * np.sin(2 * np.pi * 140 * TIMES)), window)
    assert amplitude[np.argmin(abs(f - 140)), 0] == pytest.approx(0.7, rel=1e-9)
    assert amplitude[0, 0] == pytest.approx(2.0, rel=1e-9)


def test_am_alone_has_a_single_line():
    load, response = kernel(am=140)
    found = line_table(load, response, candidates=ASSESSED).amplitudes
    assert found["f_AM"][0] == pytest.approx(1.0)
    assert max(found[f"{n}f_AM"].max() for n in (2, 3, 4, 5)) < 1e-12


@pytest.mark.parametrize(
    ("size", "speed", "probe", "expected"),
    [
        # Fourier amplitudes of sinc^2(D/D0), D0 = 11.6 mm, along the circle, probe on the path.
        (0.010, 6, 0.005, [0.375, 0.468, 0.135, 0.020]),
        (0.030, 18, 0.015, [0.125, 0.213, 0.189, 0.153]),
    ],
)
def test_stm_alone_has_the_kernels_own_lines(size, speed, probe, expected):
    _, response = kernel(size=size, speed=speed, probes=[[probe, 0.0]])
    f_d = 190.98593171027443
    found = lines(response, np.arange(4) * f_d)[:, 0]
    np.testing.assert_allclose(found, expected, atol=6e-4)


@pytest.mark.parametrize(("am", "size", "speed"), [(80.0, 0.030, 18), (140.0, 0.010, 6)])
def test_am_and_stm_have_pairs_and_nothing_at_multiples_of_f_d(am, size, speed):
    load, response = kernel(am=am, size=size, speed=speed)
    found = line_table(load, response, candidates=ASSESSED).amplitudes
    strongest = found["f_AM"].max()
    assert max(found[n].max() for n in ("f_d", "2f_d", "3f_d")) < 1e-6 * strongest  # -120 dB
    for pair in ("f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM"):
        assert found[pair].max() > 0.1 * strongest
        # S >= 0: no pair can be higher than f_AM, at any probe.
        assert (found[pair] <= found["f_AM"] * (1 + 1e-9)).all()


def test_probes_need_two_coordinates():
    load = MovingPressure(tacton=Tacton())
    with pytest.raises(ValueError, match=r"give \(p, 2\)"):
        point_kernel(load, [1.0, 2.0], TIMES)
