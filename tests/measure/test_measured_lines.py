"""Lines of measurements of known phasors and noise: what is stated is counted over many draws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from skinwave.measure import Measurement
from skinwave.measure.alignment import align
from skinwave.measure.lines import MeasuredLines, holm, lines_of, measurable

RATE, SAMPLES = 2000.0, 1000
LINES = np.array([51.0, 140.0, 190.0, 280.0, 332.0, 381.0])  # Hz
DELAY, GAIN = 3.217e-3, 0.7
RNG = np.random.default_rng(5)
MODEL = (RNG.normal(size=(6, 4)) + 1j * RNG.normal(size=(6, 4))) * np.array(
    [0.1, 1.0, 1.5, 0.2, 0.5, 0.6]
)[:, None]
TIMES = np.arange(SAMPLES) / RATE
BIN = 1 / (0.75 * SAMPLES / RATE)
SPACED = {apart: 150 + apart * BIN * np.arange(5) for apart in (1.2, 2.0, 3.0, 5.0)}


def waveforms(phasors, frequencies=LINES, times=TIMES):
    turned = np.exp(2j * np.pi * np.multiply.outer(times, frequencies))
    return (turned @ phasors).real


def measured(rng, repetitions, sigma, phasors=None, **changes):
    truth = GAIN * np.exp(-2j * np.pi * LINES * DELAY)[:, None] * MODEL
    clean = waveforms(truth if phasors is None else phasors)
    noise = sigma * rng.normal(size=(repetitions, *clean.shape))
    given = {"quantity": "velocity", "places": np.full((clean.shape[1], 2), np.nan),
             "times": TIMES, "values": clean + noise} | changes  # fmt: skip
    return Measurement(**given)


def only(each, variance=None):
    return MeasuredLines(
        frequencies=LINES[: each.shape[1]], each=each, freedom=2.0 * (len(each) - 1),
        variance=each.var(axis=0, ddof=1) / len(each) if variance is None else variance,
        shifts=np.zeros(len(each)),
    )  # fmt: skip


def complex_noise(rng, *shape):
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def test_lines_without_noise_are_those_that_were_put_in():
    found = lines_of(measured(RNG, 2, 0.0), LINES)
    truth = GAIN * np.exp(-2j * np.pi * LINES * DELAY)[:, None] * MODEL
    assert np.abs(found.mean - truth).max() < 1e-9
    assert not found.variance.max() > 1e-18
    assert not found.shifts.any()


@pytest.mark.parametrize("repetitions", [1, 4])
def test_delay_and_gain_are_within_their_errors_as_often_as_is_said(repetitions):
    rng = np.random.default_rng(20 + repetitions)
    draws = (lines_of(measured(rng, repetitions, 0.2), LINES) for _ in range(100))
    found = [align(lines, MODEL, window=0.05) for lines in draws]
    of_delay = np.array([(a.delay - DELAY) / a.delay_error for a in found])
    of_gain = np.array([(a.gain - GAIN) / a.gain_error for a in found])
    for off in (of_delay, of_gain):  # the binomial bounds of 95 % in 100 draws at 0.1 %
        assert 87 <= np.count_nonzero(np.abs(off) < 1.96) <= 100
        assert 0.7 < off.std() < 1.3
    assert 0.8 < np.median([a.chi_square for a in found]) < 1.25


def test_phases_vary_as_much_as_their_errors_say():
    rng = np.random.default_rng(22)
    draws = [lines_of(measured(rng, 4, 0.2, MODEL), LINES) for _ in range(40)]
    off = np.array([np.angle(lines.mean / MODEL) / lines.phase_error for lines in draws])
    strong = np.abs(MODEL) > 0.2  # a phase of a weak line is not normally distributed
    assert off[:, strong].std() == pytest.approx(1, abs=0.1)


def test_a_delay_is_known_up_to_the_period_of_what_was_measured():
    delay = 10e-3
    model = MODEL[1:2]
    each = GAIN * np.exp(-2j * np.pi * 140 * delay) * model + 0.01 * complex_noise(RNG, 4, 1, 4)
    found = align(replace(only(each), frequencies=np.array([140.0])), model)
    assert found.delay == pytest.approx(delay - 1 / 140, abs=5 * found.delay_error)
    assert found.repeats == pytest.approx(1 / 140, rel=1e-6)


def test_delay_and_gain_can_be_given():
    lines = only(MODEL * np.exp(-2j * np.pi * LINES * 1e-3)[:, None] + np.zeros((2, 1, 1)))
    free = align(lines, MODEL)
    assert (free.delay, free.gain) == (pytest.approx(1e-3), pytest.approx(1.0))
    of_delay = align(lines, MODEL, delay=0.0)
    assert (of_delay.delay, of_delay.delay_error) == (0.0, 0.0)
    assert of_delay.gain < 0.9
    of_gain = align(lines, MODEL, gain=0.5)
    assert (of_gain.gain, of_gain.gain_error) == (0.5, 0.0)
    assert of_gain.delay == pytest.approx(1e-3)
    reversed_sign = align(lines, -MODEL, gain=-1.0)
    assert reversed_sign.delay == pytest.approx(1e-3)
    with pytest.raises(ValueError, match="must be a finite number"):
        align(lines, MODEL, gain=np.inf)
    with pytest.raises(ValueError, match="none of the measured lines"):
        align(lines, 0 * MODEL)


def test_without_known_noise_errors_are_from_the_misfit():
    each = GAIN * MODEL[None] + 0.01 * complex_noise(np.random.default_rng(0), 1, *MODEL.shape)
    lines = replace(only(each, np.full(MODEL.shape, np.nan)), freedom=1.0)
    found = align(lines, MODEL)
    assert found.gain_error == pytest.approx(found.misfit * GAIN * 4.3027 / 1.96 / 2**0.5, rel=0.1)
    assert 0 < found.delay_error < 1e-3
    one = replace(lines.only(np.array([0])), each=each[:, :1, :1], variance=lines.variance[:1, :1])
    assert np.isnan(align(one, MODEL[:1, :1]).gain_error)


def test_repetitions_out_of_step_are_shifted_into_it():
    rng = np.random.default_rng(3)
    late = np.array([0.0, 0.4e-3, -0.7e-3, 1.1e-3, 0.1e-3])
    truth = GAIN * MODEL
    values = np.array([waveforms(truth, times=TIMES - x) for x in late])
    found = lines_of(measured(rng, 5, 0.05, values=values + 0.05 * rng.normal(size=values.shape)),
                     LINES)  # fmt: skip
    assert np.abs(found.shifts - (late - late.mean())).max() < 2e-5
    assert np.abs(np.abs(found.mean) - np.abs(truth)).max() < 0.02
    assert found.shift_error == pytest.approx(late.std(ddof=1) / np.sqrt(5), rel=0.05)


def test_the_error_of_a_delay_includes_that_of_the_shifts():
    each = MODEL + 0.1 * complex_noise(np.random.default_rng(8), 3, 6, 4)
    shifts = np.array([-4e-3, 1e-3, 3e-3])  # s, standard deviation sqrt(13) ms
    alone, both = (align(replace(only(each), shifts=x), MODEL) for x in (0 * shifts, shifts))
    expected = np.hypot(alone.delay_error, np.sqrt(13 / 3) * 1e-3)
    assert both.delay_error == pytest.approx(expected)


def test_repetitions_in_step_are_left_as_they_are():
    rng = np.random.default_rng(4)
    moved = sum(bool(lines_of(measured(rng, 4, 0.3), LINES).shifts.any()) for _ in range(30))
    assert moved <= 1  # a thousandth of them


def test_significances_are_uniform_where_there_is_noise_alone():
    rng = np.random.default_rng(6)
    for repetitions in (2, 5):
        lines = only(complex_noise(rng, repetitions, 6, 2000))
        p = lines.p_values(lines.mean)
        assert stats.kstest(p.ravel(), "uniform").pvalue > 1e-3
        f = np.abs(lines.mean) ** 2 / lines.variance
        assert np.allclose(p, stats.f.sf(f, 2, 2 * (repetitions - 1)))


def test_the_chance_of_any_false_difference_is_as_stated():
    rng = np.random.default_rng(7)
    single, any_at_all = [], []
    for _ in range(40):
        lines = lines_of(measured(rng, 5, 0.2), LINES)
        away = lines.mean - align(lines, MODEL, window=0.05).apply(LINES, MODEL)
        p = lines.p_values(away)
        single.append(np.mean(p < 0.05))
        any_at_all.append(holm(p).min() < 0.05)
    assert 0.03 < np.mean(single) < 0.06
    assert np.mean(any_at_all) < 0.05 + 2.6 * np.sqrt(0.05 * 0.95 / 40)


def test_holms_correction_is_its_definition():
    p = np.array([0.01, 0.04, np.nan, 0.03, 0.005])
    assert np.allclose(holm(p), [0.03, 0.06, np.nan, 0.06, 0.02], equal_nan=True)
    assert holm(np.array([[0.9, 0.8]])).max() == 1.0


SPACED["low"] = np.array([3.75, 12.0, 40.0]) * BIN


def noisy(rng, frequencies, colour, repetitions, draws=200):
    noise = rng.normal(size=(repetitions, SAMPLES, draws))
    if colour == "1/f2":
        noise = noise.cumsum(axis=1)
    values = waveforms(np.full((len(frequencies), draws), 3.0), frequencies) + noise
    places = np.zeros((draws, 2))
    return Measurement(quantity="velocity", places=places, times=TIMES, values=values)


@pytest.mark.parametrize(("colour", "repetitions"), [("white", 1), ("1/f2", 1), ("1/f2", 3)])
def test_intervals_hold_the_truth_however_close_the_lines_and_steep_the_noise(colour, repetitions):
    """95 % circles, and intervals of a sum and of a difference, in 200 draws."""
    rng, inside, ratios = np.random.default_rng(repetitions), [], []
    for f in SPACED.values():
        found = lines_of(noisy(rng, f, colour, repetitions), f)
        off = found.mean - 3.0
        inside.append((np.abs(off) < found.radius(0.95)).mean(axis=1).mean())
        one = replace(found, each=found.each[:, :, :1], variance=found.variance[:, :1])
        for factors in (np.ones(len(f)), np.r_[1.0, -1.0, np.zeros(len(f) - 2)]):
            own = np.sqrt(found.variance / found.variance[:, :1])  # of each draw, over the first's
            true = np.var((factors @ (off / own)).real)
            ratios.append(one.variance_of(factors[:, None]) / true)
    assert 0.93 < np.mean(inside) < 0.98
    assert min(inside) > 0.92
    assert max(inside) < 0.985
    assert np.mean(ratios) == pytest.approx(1, abs=0.1)
    assert 0.6 < min(ratios) < max(ratios) < 1.5


def test_a_gain_that_changes_between_repetitions_is_in_the_errors():
    rng = np.random.default_rng(15)
    record = noisy(rng, SPACED[5.0], "white", 3)
    gain = 1 + 0.5 * rng.normal(size=(3, 1, 200))
    record = replace(record, values=gain * waveforms(np.full((5, 200), 3.0), SPACED[5.0])
                     + 0.1 * rng.normal(size=(3, SAMPLES, 200)))  # fmt: skip
    found = lines_of(record, SPACED[5.0])
    assert 0.91 < (np.abs(found.mean - 3.0) < found.radius(0.95)).mean() < 0.98


def spectra(repetitions, sigma, frequencies, amplitudes):
    rng = np.random.default_rng(13)
    noise = sigma * complex_noise(rng, repetitions, *amplitudes.shape)
    given = {"frequencies": frequencies, "values": amplitudes + noise}
    return Measurement(quantity="velocity", places=np.zeros((amplitudes.shape[1], 2)), **given)


def test_spectra_have_lines_in_their_bins_and_noise_beside_them():
    axis = np.arange(1.0, 501.0)
    amplitudes = np.zeros((500, 4), complex)
    amplitudes[LINES.astype(int) - 1] = MODEL
    found = lines_of(spectra(1, 0.02, axis, amplitudes), LINES)
    assert np.abs(found.mean - MODEL).max() < 0.08
    assert np.sqrt(np.median(found.variance)) == pytest.approx(0.02, rel=0.3)
    record = spectra(1, 0.02, axis, amplitudes)
    assert measurable(record, np.array([140.4, 499.6, 700.0])).tolist() == [True, True, False]
    for one, beyond in ((record, 700.0), (measured(RNG, 2, 0.1), 2500.0)):
        with pytest.raises(ValueError, match="no line at"):
            lines_of(one, np.array([beyond]))


def test_single_lines_once_have_no_known_noise():
    found = lines_of(spectra(1, 0.0, LINES, MODEL), LINES)
    assert np.isnan(found.variance).all()
    assert np.isnan(found.p_values(found.mean)).all()
    a = align(found, MODEL)
    assert (a.delay, a.gain) == (pytest.approx(0, abs=1e-12), pytest.approx(1))
