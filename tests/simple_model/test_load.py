"""The commanded signal, its paths and period, the focal spot, drive laws, the load, thresholds."""

import numpy as np
import pytest
from circling import circle

import simple_model
import skinwave
from simple_model import MovingPressure, Tacton, Trajectory, focal_spot, pattern_period, threshold
from skinwave.planning.simulate import compute

BOTH = {"second_am_frequency": 101.0, "superposition": (0.5, 0.5)}
PULSES = simple_model.Rhythm(pulses=((0.05, 0.03),))
PATHS = [Trajectory(shape="circle", size=0.02), Trajectory(shape="point")]
SHARED = simple_model.joined(PATHS, 185.0)
D_MM = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 25])
SHORT = Tacton(am_frequency=140, duration=0.003)
SKIN = skinwave.Body(width=0.04, height=0.04, depth=0.01)
FREQUENCIES = [10, 20, 40, 60, 80, 100, 140, 191, 200, 210, 250, 300, 382, 500]
LARGE = [4.0, 4.0, 3.9, 1.7, 0.97, 0.62, 0.32, 0.17, 0.16, 0.14, 0.10, 0.13, 0.19, 0.28]
SPOT = [4.0, 4.0, 4.0, 3.9, 2.2, 1.4, 0.71, 0.38, 0.35, 0.32, 0.22, 0.29, 0.42, 0.63]


def test_the_circles_of_the_paper_are_drawn_at_191_hz():
    for size, speed in ((0.010, 6), (0.030, 18)):
        path = Trajectory(shape="circle", size=size, speed=speed)
        assert path.drawing_frequency == pytest.approx(190.986, abs=5e-4)


def test_the_focus_keeps_its_speed_and_comes_back():
    path = Trajectory(shape="triangle", size=0.03, speed=5.0)
    period = 1 / path.drawing_frequency
    t = np.linspace(0, period, 36001)
    steps = np.linalg.norm(np.diff(path.position(t), axis=0), axis=1)
    assert steps.sum() == pytest.approx(path.length, rel=1e-6)
    assert np.median(steps) / np.diff(t)[0] == pytest.approx(5.0, rel=1e-6)
    np.testing.assert_allclose(path.position(0.0), path.position(period), atol=1e-12)


def test_equation_one_with_everything_on():
    t = np.linspace(0, 0.01, 4001)
    tacton = Tacton(
        amplitude=0.5, am_frequency=80, second_am_frequency=140,
        superposition=(0.25, 0.75), envelope_frequency=3,
    )  # fmt: skip
    mixed = 0.25 * np.sin(2 * np.pi * 80 * t) + 0.75 * np.sin(2 * np.pi * 140 * t)
    expected = 0.5 * np.sin(2 * np.pi * 40e3 * t) * mixed * np.sin(2 * np.pi * 3 * t)
    np.testing.assert_allclose(simple_model.commanded_signal(tacton, t), expected, atol=1e-15)


def test_values_out_of_range_are_refused():
    for build in (
        lambda: Tacton(amplitude=1.2),
        lambda: Tacton(am_frequency=float("nan")),
        lambda: Tacton(superposition=(1.5, -0.5)),
        lambda: Tacton(duration=32),
        lambda: Trajectory(size=0.061),
        lambda: simple_model.relative_intensity(0.7),
    ):
        with pytest.raises(ValueError, match="outside|sum 1"):
            build()


@pytest.mark.parametrize(
    ("tacton", "expected"),
    [
        ({"am_frequency": 140}, 1 / 140),
        ({"am_frequency": 140, "superposition": (0.0, 1.0)}, 1.0),  # not heard: nothing varies
        ({"am_frequency": 140, "trajectory": circle(200)}, 1 / 20),
        ({"trajectory": SHARED, "foci": simple_model.even_phases(2)}, 1 / 185),
        ({"am_frequency": 140, "rhythm": PULSES}, 0.4),
        (
            {"am_frequency": 140, "signal": simple_model.Signal(rate=100, samples=(0.0, 1.0, 0.5))},
            0.15,
        ),
        ({}, 1.0),
    ],
)
def test_a_pattern_period_is_the_shortest_after_which_all_repeats(tacton, expected):
    made = Tacton(**tacton)
    found = pattern_period(made)
    assert found == pytest.approx(expected, rel=1e-9)
    if found < 0.99 * made.duration:
        load, t = MovingPressure(tacton=made), np.linspace(0, 0.2, 333) + 1.7e-5
        again = load([[0.006, 0.002]], t + found)
        np.testing.assert_allclose(load([[0.006, 0.002]], t), again, atol=1e-6)


def test_incommensurate_frequencies_nearly_return_after_their_slowest_beat():
    found = pattern_period(Tacton(am_frequency=140, trajectory=circle(190.98593171027443)))
    assert found == pytest.approx(11 / 140, rel=1e-3)
    assert found * 190.98593171027443 == pytest.approx(15, abs=0.01)
    beating = {"am_frequency": 100, "superposition": (0.5, 0.5), "second_am_frequency": 100.7313}
    # 10 ms brings both back within 1 % and would not show the beat.
    assert pattern_period(Tacton(**beating, duration=5)) == pytest.approx(1 / 0.7313, rel=0.01)
    # The Tacton ends before the beat does.
    assert pattern_period(Tacton(am_frequency=100, **BOTH, duration=0.3)) > 0.297


def on_axis(mm):
    return np.column_stack([mm / 1e3, np.zeros(len(mm))])


def array_intensity(points, height):
    places = np.column_stack([points, np.full(len(points), height)])
    p = simple_model.array_field(places, (0, 0, height))
    return np.abs(p) ** 2


def test_the_main_lobe_matches_the_array():
    from_array = array_intensity(on_axis(D_MM), 0.2)
    np.testing.assert_allclose(focal_spot(on_axis(D_MM)), from_array / from_array[0], atol=0.006)


def test_the_array_makes_the_published_table():
    # Amplitude along an array axis at 200 mm, 16 x 16 pistons of 4.5 mm radius, pitch 10.3 mm.
    table = [1, .988, .952, .893, .815, .720, .613, .498, .381, .265, .155, .034, .156, .209,
             .196, .135, .070]  # fmt: skip
    p = np.sqrt(array_intensity(on_axis(D_MM), 0.2))
    np.testing.assert_allclose(p / p[0], table, atol=0.001)


def test_far_from_the_array_all_pressures_add():
    (found,) = np.abs(simple_model.array_field([[0.0, 0.0, 20.0]], (0, 0, 20.0)))
    lost = 10 ** (-1.32 * 20 / 20)  # dB/m, ISO 9613-1
    assert found == pytest.approx(256 * 3.4 / 20 * lost, rel=1e-3)


@pytest.mark.parametrize(("height", "half_width"), [(0.1, 3.2), (0.3, 7.3)])
def test_every_spot_has_the_half_width_of_the_array(height, half_width):
    for focus in ("main_lobe", "gaussian", "array"):
        at_half = focal_spot(on_axis(np.array([half_width])), height, focus)
        assert at_half == pytest.approx(0.5, abs=0.03), focus


@pytest.mark.parametrize(("height", "half_depth"), [(0.1, 0.014), (0.2, 0.037)])
def test_the_pressure_above_and_below_the_focus_is_that_of_the_array(height, half_depth):
    points = np.zeros((13, 3))
    points[:, 2] = np.linspace(-1.5, 1.5, 13) * half_depth
    from_array = np.abs(simple_model.array_field(points + [0, 0, height], (0, 0, height))) ** 2
    both = (from_array + from_array[::-1]) / 2 / from_array[6]
    pressure = MovingPressure(tacton=Tacton(), height=height)(points, 0.0).ravel()
    np.testing.assert_allclose(pressure / pressure[6], both, atol=0.07)


def test_the_gaussian_carries_the_force_of_the_array():
    x = np.linspace(-0.02, 0.02, 161)
    points = np.stack(np.meshgrid(x, x), axis=-1)
    inside = np.hypot(*points.T).T <= 0.02
    force = {f: (focal_spot(points, 0.2, f) * inside).sum() for f in ("array", "gaussian")}
    assert force["gaussian"] == pytest.approx(force["array"], rel=0.02)


def test_relative_intensity_is_the_force_of_the_array_on_a_disc():
    radius, angle = (np.arange(30) + 0.5) / 30 * 0.01, np.arange(48) / 48 * 2 * np.pi
    disc = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1)

    def force(height):
        intensity = array_intensity(disc.reshape(-1, 2), height).reshape(30, 48)
        return (intensity.mean(axis=1) * radius).sum()

    for height in (0.03, 0.12, 0.27, 0.6):
        assert simple_model.relative_intensity(height) == pytest.approx(
            force(height) / force(0.2), abs=0.01
        )


def amplitudes(drive, amplitude=1.0, depth=1.0):
    """Mean and amplitudes at f, 2f, 3f of the load at the focus, AM at f."""
    tacton = Tacton(amplitude=amplitude, am_frequency=100)
    load = MovingPressure(tacton=tacton, drive=drive, peak_pressure=1.0,
                          depth_of_modulation=depth)  # fmt: skip
    bins = np.abs(np.fft.rfft(load.gain(np.arange(400) / 40000))) / 400
    return bins[:4] * [1, 2, 2, 2]


def test_drive_laws_have_the_lines_of_their_formulas():
    np.testing.assert_allclose(amplitudes("linear"), [0, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(amplitudes("force_corrected"), [0.5, 0.5, 0, 0], atol=1e-12)
    half = amplitudes("force_corrected", depth=0.5)  # (1 + M / 2) / 1.5
    np.testing.assert_allclose(half, [2 / 3, 1 / 3, 0, 0], atol=1e-12)
    np.testing.assert_allclose(amplitudes("pressure_squared"), [0.375, 0.5, 0.125, 0], atol=1e-12)


class Louder(MovingPressure):
    def __call__(self, points, t):
        return 2 * super().__call__(points, t)


def test_only_models_that_evaluate_the_load_accept_its_subclasses():
    scene = skinwave.Scene(pressure=Louder(tacton=SHORT), body=SKIN)
    for model in ("auto", "flat-body"):
        with pytest.raises(ValueError, match="Louder"):
            skinwave.simulate(scene, model)
    plain, louder = (
        compute(skinwave.Scene(pressure=load(tacton=SHORT), body=SKIN), "fem-transient", h=0.01)
        for load in (MovingPressure, Louder)
    )
    np.testing.assert_allclose(louder.displacement, 2 * plain.displacement, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("area", "micrometre"), [("large_contactor", LARGE), ("focal_spot", SPOT)])
def test_thresholds_are_those_of_the_literature(area, micrometre):
    np.testing.assert_allclose(1e6 * threshold(FREQUENCIES, area), micrometre, rtol=0.04)


def test_a_line_at_its_threshold_has_level_zero():
    assert simple_model.sensation_level(threshold(140), 140) == pytest.approx(0)
    assert simple_model.sensation_level(10 * threshold(140), 140) == pytest.approx(20)
    assert simple_model.sensation_level(0.0, 140) == -np.inf
    # Full AM at 200 Hz up to 4.4 Pa has a line of 2.2 Pa there.
    assert simple_model.sensation_level(2.2, 200, unit="Pa") == pytest.approx(0)
    assert simple_model.sensation_level(1.1, 200, unit="Pa") == pytest.approx(-6.02, abs=0.01)
