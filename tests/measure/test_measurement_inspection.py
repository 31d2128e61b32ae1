"""Inspection of measurements of known content: lines, noise, hum, clipping, and what is missing."""

import json

import numpy as np
import pytest
import read_results

from skinwave.commands.cli import main
from skinwave.measure import Measurement
from skinwave.measure.inspection import clip_count, hum_of, inspect
from skinwave.measure.inspection_page import text
from skinwave.measure.line_search import SpectralLine, find_lines
from skinwave.measure.writing import write

RATE = 2000.0
T = np.arange(2000) / RATE


def coloured(rng, shape, power):
    runs, count, places = shape
    f = np.fft.rfftfreq(4 * count)
    f[0] = f[1]
    white = np.fft.rfft(rng.normal(size=(runs, 4 * count, places)), axis=1)
    return np.fft.irfft(white * (f ** (-power / 2))[None, :, None], axis=1)[:, :count]


def test_noise_alone_rarely_has_lines():
    """At 20 % in 50 files 10, and at most 19 by the binomial distribution at 0.3 %."""
    rng = np.random.default_rng(2)
    noise = (coloured(rng, (2, 512, 2), 2) for _ in range(50))
    assert 1 <= sum(len(find_lines(x, RATE, alarm=0.2).lines) > 0 for x in noise) <= 19


def test_lines_lie_within_their_errors():
    rng = np.random.default_rng(4)
    deviations, floors = [], []
    for _ in range(40):
        f = np.array([60.0, 140.0, 143.0]) + rng.uniform(-0.5, 0.5, 3)
        a = np.array([0.5, 2.0, 0.06])
        phases = rng.uniform(0, 2 * np.pi, 3)
        x = (a * np.cos(2 * np.pi * f * T[:, None] + phases)).sum(axis=1)
        x = x[None, :, None] + 0.1 * rng.normal(size=(1, len(T), 1))
        found = find_lines(x, RATE)
        assert len(found.lines) == 3
        deviations.append([(line.frequency - g) / line.error for line, g in zip(
            found.lines, f, strict=True)])  # fmt: skip
        floors.append(np.median(found.floor))
        assert [line.amplitudes[0] for line in found.lines] == pytest.approx(a, abs=0.02)
    # 120 deviations: their mean square is 1 +- 0.13.
    assert 0.6 < np.mean(np.square(deviations)) < 1.4
    assert np.sqrt(np.mean(floors)) == pytest.approx(0.1 * np.sqrt(2 / RATE), rel=0.03)


def test_the_error_of_one_line_is_the_published_bound():
    """Of amplitude A over T in noise of density S, sqrt(3 S / (pi^2 A^2 T^3)); places add up."""
    rng = np.random.default_rng(5)
    x = np.cos(2 * np.pi * 141.3 * T)[None, :, None] * np.array([1.0, 0.5])
    x = x + 0.2 * rng.normal(size=(2, len(T), 2))
    (line,) = find_lines(x, RATE).lines
    density, duration = 0.2**2 * 2 / RATE, len(T) / RATE
    bound = np.sqrt(3 * density / (np.pi**2 * 2 * (1 + 0.25) * duration**3))
    assert line.error == pytest.approx(bound, rel=0.1)
    assert line.amplitudes == pytest.approx([1, 0.5], abs=0.02)
    assert line.false_alarm < 1e-20


def test_weak_lines_beside_strong_ones_are_not_side_lobes():
    rng = np.random.default_rng(6)
    f, a = np.array([100.4, 110.7, 333.3]), np.array([1.0, 3e-4, 1e-4])
    x = (a * np.cos(2 * np.pi * f * T[:, None])).sum(axis=1) + 1e-5 * rng.normal(size=len(T))
    found = find_lines(x[None, :, None], RATE).lines
    assert [line.frequency for line in found] == pytest.approx(f, abs=2e-2)
    assert [line.amplitudes[0] for line in found] == pytest.approx(a, rel=0.01)


def from_rest(seconds, decay, noise=0.0):
    """Two lines at 130 and 260 Hz, and a free vibration of as much that starts them from rest."""
    t = np.arange(round(1e4 * seconds)) / 1e4
    own = np.cos(2 * np.pi * 118 * t) + 0.3 * np.sin(2 * np.pi * 61 * t)
    x = np.cos(2 * np.pi * 130 * t) + 0.1 * np.cos(2 * np.pi * 260 * t + 1)
    x += noise * np.random.default_rng(0).normal(size=t.shape) - own * np.exp(-t / decay)
    return Measurement(quantity="velocity", times=t, places=[[0, 0]], values=x[None, :, None])


def says_unsteady(found):
    return any("not steady" in sentence for sentence in found.missing)


@pytest.mark.parametrize(("seconds", "decay"), [(0.1, 0.005), (0.5, 0.02)])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_lines_of_a_motion_from_rest_are_within_their_errors(seconds, decay, noise):
    found = inspect(from_rest(seconds, decay, noise))
    for true in (130, 260):
        line = min(found.lines, key=lambda line: abs(line.frequency - true))
        assert abs(line.frequency - true) < 2 * line.error < 20
    assert not says_unsteady(found)


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_a_transient_that_outlasts_the_first_quarter_is_reported(noise):
    for seconds in (0.1, 0.15, 0.2, 0.3, 0.4):
        assert says_unsteady(inspect(from_rest(seconds, 0.1, noise)))


def test_steady_records_are_rarely_called_unsteady():
    rng, noted = np.random.default_rng(3), 0
    for _ in range(60):
        t = np.arange(rng.integers(150, 1000)) / 4e3
        f = (np.arange(3) + 2) * rng.uniform(5.4, 8) / t[-1]
        x = np.cos(2 * np.pi * f * t[:, None] + rng.uniform(0, 6, 3)) @ [1.0, 0.3, 0.1]
        x = x[:, None] * [1.0, 0.2] + 0.02 * rng.normal(size=(2, len(t), 2))
        noted += says_unsteady(inspect(Measurement(
            quantity="velocity", times=t, places=np.zeros((2, 2)), values=x)))  # fmt: skip
    assert noted <= 4  # the binomial bound of 1 % in 60 draws at 0.3 %


def test_round_off_has_no_lines():
    t = np.arange(1000) / 1e4
    x = np.cos(2 * np.pi * 130 * t)
    rounded = np.array([float(f"{value:.9g}") for value in x])
    (line,) = find_lines(rounded[None, :, None], 1e4).lines
    assert line.frequency == pytest.approx(130, abs=1e-3)
    assert 0 < line.error < 0.1
    coarse = np.array([float(f"{value:.6g}") for value in 2e-3 * x])  # many lines, 120 dB weaker
    found = max(find_lines(coarse[None, :, None], 1e4).lines, key=lambda line: line.amplitudes)
    assert found.frequency == pytest.approx(130, abs=1e-4)
    still = 1e-6 + 1e-22 * np.random.default_rng(0).integers(-2, 3, 1000)
    still += 1e-21 * np.cos(2 * np.pi * 111 * t)
    assert not find_lines(still[None, :, None], 1e4).lines


def test_mains_hum_is_resolved_from_lines_of_the_load():
    for frequencies, driven, expected in (
        ((49.98, 99.96, 140), (), {0: "mains 50 Hz", 1: "mains 2 x 50 Hz"}),
        ((59.99, 120.5, 179.97), (), {0: "mains 60 Hz", 2: "mains 3 x 60 Hz"}),
        ((200.0, 400.0, 600.0), (), {}),  # multiples of 50 Hz, and of a load's 200 Hz
        ((49.98, 100.6, 250.3), (), {0: "mains 50 Hz"}),  # no multiples of 49.98 Hz
        ((60.0, 120.0), (0,), {}),  # multiples of the drive's
    ):
        lines = [SpectralLine(frequency=f, error=2e-3, amplitudes=np.ones(1), false_alarm=0.0)
                 for f in frequencies]  # fmt: skip
        assert hum_of(lines, 1.0, driven) == expected


def test_clipping_is_not_rounding():
    sine = np.sin(2 * np.pi * 7.3 * T)
    for cut in (0.5, 0.9, 0.97):
        assert clip_count(np.clip(sine, -cut, cut)) == (np.abs(sine) >= cut).sum()
        coarse = np.round(np.clip(sine, -cut, cut) * 500)
        assert clip_count(coarse) == (np.abs(coarse) == coarse.max()).sum()
    assert clip_count(np.minimum(sine, 0.8)) == (sine >= 0.8).sum()
    for steps in (2, 3, 20, 1000):
        assert clip_count(np.round(sine * steps)) == 0
    noise = np.random.default_rng(7).normal(size=5000)
    assert clip_count(noise) == clip_count(np.round(100 * noise)) == clip_count(np.ones(50)) == 0


def scan(**changes):
    rng = np.random.default_rng(8)
    x = 2e-3 * np.sin(2 * np.pi * 140 * T) + 3e-4 * np.sin(2 * np.pi * 49.97 * T)
    x = x + 5e-4 * np.sin(2 * np.pi * 191.3 * T)
    noise = rng.normal(size=(2, len(T), 4)) * np.array([1e-4, 1e-4, 2e-4, 0])
    values = (x[:, None] * np.array([1, 0.3, 0.5, 0]))[None] + noise
    values[:, :, 2] = np.clip(values[:, :, 2], -7e-4, 7e-4)
    given = {"quantity": "velocity", "times": T, "values": values, "name": "scan",
             "places": [[0, 0], [0.01, 0], [0, 0.01], [0.01, 0.01]],
             "drive": np.sin(2 * np.pi * 140 * T)} | changes  # fmt: skip
    return Measurement(**given)


def test_what_a_scan_has():
    found = inspect(scan())
    what = {round(line.frequency): origin for line, origin in zip(
        found.lines, found.origins, strict=True)}  # fmt: skip
    assert what[140] == "drive"
    assert what[191] == ""
    assert what[50] == "mains 50 Hz"
    assert found.noise[:2] == pytest.approx(1e-4 * np.sqrt(2 / RATE), rel=0.1)
    assert list(found.kept) == [0, 1, 2]
    assert list(found.constant) == [3]
    assert (found.clipped.sum(axis=0) > 100).tolist() == [False, False, True, False]
    assert found.missing == ()
    bare = inspect(scan(drive=[], values=scan().values[:1], places=np.full((4, 2), np.nan)))
    assert len(bare.missing) == 3


def test_lines_of_spectra():
    rng = np.random.default_rng(9)
    f = np.arange(400) + 1.0
    values = rng.normal(size=(3, 400, 1)) + 1j * rng.normal(size=(3, 400, 1))
    values[:, 139] += 20
    given = {"frequencies": f, "places": [[0, 0]], "values": values * 1e-9}
    measured = Measurement(quantity="displacement", **given)
    (line,) = inspect(measured).lines
    assert line.frequency == 140
    assert line.amplitudes[0] == pytest.approx(20e-9, rel=0.1)
    assert inspect(measured).noise[0] == pytest.approx(np.sqrt(2) * 1e-9, rel=0.1)
    one = {"frequencies": [1.0], "places": [[0, 0]], "values": [[[1j]]]}
    assert inspect(Measurement(quantity="velocity", **one)).lines == ()


def test_short_and_extreme_measurements_are_inspected():
    for count, scale in ((1, 1e150), (2, 1.0), (33, 0.0), (64, 1e-150)):
        values = scale * np.random.default_rng(1).normal(size=(1, count, 2))
        given = {"times": T[:count], "places": np.full((2, 2), np.nan), "values": values}
        measured = Measurement(quantity="velocity", **given)
        assert "velocity" in text(inspect(measured)).lower()


def test_the_command_prints_and_writes(tmp_path, capsys):
    path, out = tmp_path / "scan.npz", tmp_path / "out"
    write(scan(), path)
    assert main(["fit", "--inspect", str(path), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (line,) = (line for line in told["lines"] if abs(line["frequency_hz"] - 140) < 1)
    assert line["what"] == "drive"
    assert {p.name for p in out.iterdir()} == {
        "index.html", "measured.png", "measurement.npz", "measurement.csv", "found-lines.csv",
        "record.json",
    }  # fmt: skip
    rows = read_results.rows(out / "found-lines.csv")
    assert float(rows[0]["frequency_hz"]) == pytest.approx(49.97, abs=0.05)
    assert main(["fit", "--inspect", str(out / "measurement.csv"), "--quiet"]) == 0
