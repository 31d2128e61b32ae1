"""Every line by its name: named from the load's own spectrum, and all else listed by its kind."""

import numpy as np
import pytest
from circling import circle
from hypothesis import given, settings
from hypothesis import strategies as st

import simple_model
from simple_model import MovingPressure, Rhythm, Tacton, line_table, named_lines, point_kernel
from simple_model.line_table import FREE, OF_LOAD, UNNAMED, UNRESOLVED
from simple_model.load.line_names import SYMBOLS, line_frequency, line_name, line_names, symbols
from simple_model.response import SETTLE, fit_lines
from skinwave import Body, Scene
from skinwave.planning.simulate import compute

TIMES = np.arange(6000) / 6000
PLACES = [[0.0, 0.0], [0.006, 0.0], [0.012, 0.002]]
tones = st.just(0.0) | st.floats(20.0, 400.0)
loads = st.builds(
    MovingPressure,
    tacton=st.builds(
        Tacton,
        am_frequency=tones,
        second_am_frequency=tones,
        superposition=st.sampled_from(simple_model.SUPERPOSITIONS),
        envelope_frequency=st.just(0.0) | st.floats(5.0, 60.0),
        trajectory=st.just(simple_model.Trajectory()) | st.builds(circle, st.floats(30.0, 300.0)),
        rhythm=st.none() | st.none()
        | st.builds(lambda on, gap: Rhythm(pulses=((on, gap),), ramp=0.3 * on),
                    st.floats(0.02, 0.1), st.floats(0.01, 0.1)),
    ),
    drive=st.sampled_from(["force_corrected", "linear", "pressure_squared"]),
)  # fmt: skip


def answered(drive="linear", places=PLACES, times=TIMES, **tacton):
    load = MovingPressure(tacton=Tacton(**tacton), drive=drive)
    return load, point_kernel(load, places, times)


def test_an_envelope_under_the_squared_law():
    """50/4 (1 + M E)^2 Pa: 12.5 at f_AM +- f_e; 50/16 [1 - cos 2a][1 - cos 2b] of its square."""
    load, response = answered("pressure_squared", am_frequency=140, envelope_frequency=7)
    found = {name: a[0] for name, a in line_table(load, response).amplitudes.items()}
    assert found == pytest.approx(
        {"2f_e": 3.125, "f_AM-f_e": 12.5, "f_AM+f_e": 12.5, "2f_AM-2f_e": 1.5625, "2f_AM": 3.125,
         "2f_AM+2f_e": 1.5625}, rel=1e-6,
    )  # fmt: skip


def test_the_squared_law_has_pairs_about_multiples_of_f_d_at_twice_f_am():
    """(1 + M)^2 / 4 = 3/8 + M / 2 - cos(2a) / 8: n f_d +- 2 f_AM are 1/6 of n f_d."""
    load, response = answered("pressure_squared", am_frequency=140, trajectory=circle(190.986))
    found = line_table(load, response).amplitudes
    for n in ("", "2", "3"):
        for sign in "-+":
            both = found[f"{n}f_d{sign}2f_AM"][1] / found[f"{n}f_d"][1]
            assert both == pytest.approx(1 / 6, rel=1e-6)
    assert found["f_d+2f_AM"][2] > found["2f_AM"][2] / 2


def test_names_give_the_frequencies_of_lines():
    tacton = Tacton(
        am_frequency=140, second_am_frequency=217, superposition=(0.5, 0.5), envelope_frequency=7,
        trajectory=circle(190.986), rhythm=Rhythm(pulses=((0.05, 0.03),)),
    )  # fmt: skip
    rng = np.random.default_rng(0)
    for orders in rng.integers(-3, 4, (50, len(SYMBOLS))):
        orders[4] = 0  # there is no signal
        if orders.any():
            frequency = abs(float(orders @ symbols(tacton)))
            name = line_name(orders.tolist(), symbols(tacton))
            assert line_frequency(tacton, name) == pytest.approx(frequency, abs=1e-9)
            assert line_name((-orders).tolist(), symbols(tacton)) == name
    assert line_frequency(Tacton(am_frequency=140), "f_d-f_AM") is None
    with pytest.raises(ValueError, match="'f_x'"):
        line_frequency(tacton, "f_x")


def test_coinciding_lines_are_listed_once_by_the_simplest_name():
    load, response = answered("pressure_squared", am_frequency=140, trajectory=circle(70.0))
    names = named_lines(load)
    assert len(set(np.round(list(names.values()), 3))) == len(names)
    assert {"f_d", "f_AM"} <= names.keys()
    assert "2f_d" not in names
    table = line_table(load, response)
    assert "f_AM" in table.frequencies
    assert "2f_d" not in table.frequencies


def test_a_rhythm_and_a_signal_have_side_lines():
    pulses = Rhythm(pulses=((0.05, 0.03),))
    load, response = answered(am_frequency=140, rhythm=pulses)
    found = line_table(load, response).amplitudes
    assert found["f_AM"][0] == pytest.approx(50 * 5 / 8, rel=0.01)
    side = 50 * np.sin(5 / 8 * np.pi) / np.pi
    assert found["f_AM-f_r"][0] == pytest.approx(side, rel=0.01)
    assert found["f_AM+f_r"][0] == pytest.approx(side, rel=0.01)
    samples = tuple(np.sin(2 * np.pi * np.arange(12) / 12).tolist())
    wave = simple_model.Signal(rate=1200, samples=samples)
    load, response = answered(am_frequency=30, signal=wave)
    found = line_table(load, response).amplitudes
    assert max(found, key=lambda name: found[name][0]) in ("f_AM-f_s", "f_s-f_AM", "f_AM+f_s")
    assert set(named_lines(load, 0.1)) == {"f_s-f_AM", "f_AM+f_s"}


@settings(max_examples=10)
@given(loads)
def test_the_line_table_matches_the_spectrum(load):
    response = point_kernel(load, PLACES, TIMES)
    table = line_table(load, response)
    listed = [(f, table.amplitudes[name]) for name, f in table.frequencies.items()]
    listed += [(peak.frequency, peak.amplitudes) for peak in table.unnamed]
    kept = response.displacement[round(SETTLE * len(TIMES)) :]
    moving = kept - kept.mean(axis=0)
    if np.abs(moving).max() < 1e-6:
        assert not [f for f, a in listed if a.max() > 1e-6]
        return
    assert not [peak for peak in table.unnamed if peak.kind == FREE]
    f, made = np.fft.rfftfreq(len(TIMES), TIMES[1]), line_names(load)
    strongest = made.strengths.max()
    for p in range(len(PLACES)):
        window = np.blackman(len(TIMES))
        x = response.displacement[:, p]
        bins = 2 * np.abs(np.fft.rfft((x - kept[:, p].mean()) * window)) / window.sum()
        bins[:4] = 0
        top = int(np.argmax(bins))
        if bins[top] < 1e-6:
            continue
        # Lines within a lobe of the window are one peak of the spectrum.
        if (made.strengths[np.abs(made.frequencies - f[top]) < 5] > 0.02 * strongest).sum() > 1:
            continue
        nearest, amplitude = min(((f, a[p]) for f, a in listed), key=lambda x: abs(x[0] - f[top]))
        away = abs(nearest - f[top])
        assert away < 1
        # Between two bins a Blackman window shows a line by up to 12 % less.
        assert amplitude * (1 - 0.48 * away**2) == pytest.approx(bins[top], rel=0.05)
        assert max(a[p] for _, a in listed) < 1.15 * bins[top]
    left = fit_lines(response, [f for f, _ in listed])[1][round(SETTLE * len(TIMES)) :]
    if load.tacton.rhythm is None and not table.unresolved:
        assert (left**2).mean() < 1e-3 * (moving**2).mean()


def struck(frequency=87.0, decay=6.0, strength=0.3, quantity="displacement"):
    load = MovingPressure(tacton=Tacton(am_frequency=140))
    free = strength * np.exp(-decay * TIMES) * np.sin(2 * np.pi * frequency * TIMES)
    x = 1e-6 * (np.sin(2 * np.pi * 140 * TIMES) + 0.25 * np.cos(2 * np.pi * 280 * TIMES) + free)
    response = simple_model.Response(
        model="fem", times=TIMES, probes=np.zeros((1, 2)), values=x[:, None], quantity=quantity
    )
    return load, response


def test_a_free_vibration_differs_from_a_line_of_the_load():
    table = line_table(*struck())
    assert [peak.kind for peak in table.unnamed] == [FREE]
    assert table.unnamed[0].frequency == pytest.approx(87, abs=0.2)
    assert set(table.frequencies) == {"f_AM", "2f_AM"}
    assert table.amplitudes["f_AM"][0] == pytest.approx(1e-6, rel=0.01)
    assert line_table(*struck(strength=3e-3)).unnamed == ()  # below -40 dB


def test_lines_of_a_chirp_are_no_free_vibration():
    t = np.arange(500) / 2000
    chirp = simple_model.Signal(
        rate=2000, samples=tuple(np.sin(2 * np.pi * (20 * t + 960 * t**2)).tolist())
    )
    scene = Scene(pressure=MovingPressure(tacton=Tacton(duration=0.25, signal=chirp)), body=Body())
    for model in ("flat-body", "flat-body-harmonic"):
        table = line_table(scene.pressure, compute(scene, model))
        assert {peak.kind for peak in table.unnamed} == {OF_LOAD}


def test_lines_of_a_rhythm_are_named_by_it():
    rhythm = Rhythm(pulses=((0.1, 0.05), (0.04, 0.11)), ramp=0.02)
    tacton = Tacton(am_frequency=60, duration=0.42, rhythm=rhythm)
    scene = Scene(pressure=MovingPressure(tacton=tacton), body=Body())
    table = line_table(scene.pressure, compute(scene, "flat-body-harmonic"))
    assert {"f_AM", "f_AM-f_r", "f_AM+f_r", "2f_AM"} <= table.frequencies.keys()
    assert {peak.kind for peak in table.unnamed} <= {OF_LOAD}


def test_a_steady_peak_that_is_not_in_the_load_is_unnamed():
    table = line_table(*struck(decay=0.0))
    assert [peak.kind for peak in table.unnamed] == [UNNAMED]
    assert table.unnamed[0].amplitudes[0] == pytest.approx(0.3e-6, rel=0.02)


def test_lines_that_are_not_resolved_are_listed_together():
    load, response = answered(am_frequency=140, second_am_frequency=140.6, superposition=(0.5, 0.5))
    table = line_table(load, response)
    assert table.frequencies == {}
    assert set(table.unresolved) == {"f_AM", "f_AM2"}
    assert [peak.kind for peak in table.unnamed] == [UNRESOLVED]
    assert table.unnamed[0].frequency == pytest.approx(140, abs=1)
