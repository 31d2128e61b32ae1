"""Models beside a measurement: differences beyond the noise, claims of the data, the command."""

import csv
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from simple_model import ErrorPart, MovingPressure, Statement, Tacton, Trajectory
from simple_model.quantities import PRESSURE, quantity
from skinwave.commands import cli
from skinwave.measure import Measurement, comparison
from skinwave.measure import comparison_page as measured_page
from skinwave.measure.claims import FAILS, HOLDS, UNDECIDED, assess_measured, by_name
from skinwave.measure.comparison import Measured, at_measured_places, compare_measured, runs_to_draw
from skinwave.measure.lines import MeasuredLines
from skinwave.measure.misfit import NOT_DESCRIBED
from skinwave.measure.writing import write
from skinwave.planning.simulate import compute
from skinwave.report.maps import MeasuredPlaces, surfaces_figure
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField
from skinwave.scene.file import dumps
from skinwave.scene.paper15 import beside_kernels
from skinwave.scene.scene import BODIES, Body, Scene

DELAY, GAIN = 2.4e-3, 0.6
CIRCLE = Trajectory(shape="circle", size=0.02, speed=12.0)
NO_SPECTRUM = np.empty(0), np.empty((0, 2))
F_D = 12 / (np.pi * 0.02)
FREQUENCIES = {
    **{f"{n}f_AM".lstrip("1"): n * 140.0 for n in range(1, 6)},
    **{f"{n}f_d".lstrip("1"): n * F_D for n in range(1, 4)},
    **{f"{n}f_d{s}f_AM".lstrip("1"): n * F_D + (140 if s == "+" else -140)
       for n in (1, 2) for s in "+-"},
}  # fmt: skip


def scene_of(duration=0.25, body=BODIES["skin-slab"], **tacton):
    return Scene(pressure=MovingPressure(tacton=Tacton(duration=duration, **tacton)), body=body,
                 quantity="velocity")  # fmt: skip


AM = scene_of(am_frequency=140.0)
BOTH = scene_of(am_frequency=140.0, trajectory=CIRCLE)
MAPPED = replace(AM, probes=((0.0, 0.0), (0.004, 0.002), (0.02, 0.0)), quantity="displacement")


def runs_of(scene, stiffness=1.0):
    bare = beside_kernels(replace(scene, quantity="displacement"))
    soft = replace(scene.body, material=scene.body.solid.scaled(modulus=stiffness))
    of_body = compute(replace(scene, body=soft), "flat-body-harmonic")
    kernels = [Run(tacton="one", body="none", scene=s, response=compute(s, model))
               for model, s in bare.items()]  # fmt: skip
    return [*kernels, Run(tacton="one", body="skin-slab", scene=scene, response=of_body)]


@pytest.fixture(scope="module")
def models():
    return {True: runs_of(AM), False: runs_of(AM, stiffness=1.3)}


def record(run, rng, repetitions=5, sigma=1e-4, **changes):
    times = np.arange(900) / 4000
    late = CubicSpline(run.response.times, run.response.values)(times + 0.007 - DELAY)
    noise = sigma * rng.normal(size=(repetitions, *late.shape))
    given = {"quantity": run.response.quantity, "places": run.response.probes, "times": times,
             "values": GAIN * late + noise} | changes  # fmt: skip
    return Measurement(**given)


def test_a_true_model_agrees_but_for_the_stated_rate(models):
    rng = np.random.default_rng(1)
    any_at_all, delays, gains = [], [], []
    for _ in range(20):
        found = compare_measured(Measured(measurement=record(models[True][-1], rng)), models[True])
        column = found.main
        any_at_all.append(column.differs.any())
        a = column.alignment
        gains.append(abs(a.gain - GAIN) < 1.96 * a.gain_error)
        off = (a.delay - (DELAY - 0.007) + 1 / 280) % (1 / 140) - 1 / 280
        delays.append(abs(off) < 1.96 * a.delay_error)
        assert a.repeats == pytest.approx(1 / 140, rel=1e-3)
    assert np.mean(any_at_all) <= 0.05 + 2.6 * np.sqrt(0.05 * 0.95 / 20)
    assert np.mean(gains) > 0.85
    assert np.mean(delays) > 0.85


def test_a_model_three_tenths_too_stiff_is_rejected(models):
    rng = np.random.default_rng(2)
    measured = Measured(measurement=record(models[True][-1], rng, sigma=2e-5))
    found = compare_measured(measured, models[False])
    column = found.main
    assert column.differs[list(found.names).index("f_AM")].sum() >= 3
    assert column.alignment.misfit > 3 * found.noise
    assert (found.findings(column) == comparison.DIFFERS).any()
    same = compare_measured(measured, models[True])
    assert same.main.alignment.misfit < column.alignment.misfit / 3
    assert {*np.unique(same.findings(same.main))} == {comparison.AGREES, comparison.NO_LINE}


def test_errors_of_gain_and_delay_hold_the_truth_of_a_wrong_model_or_are_not_given(models):
    measured = Measured(measurement=record(models[True][-1], np.random.default_rng(2), sigma=2e-5))
    found = compare_measured(measured, models[False])
    a = found.main.alignment
    assert 0.05 < a.unexplained < 0.2
    assert abs(a.gain - GAIN) < 1.96 * a.gain_error < GAIN
    off = (a.delay - (DELAY - 0.007) + 1 / 280) % (1 / 140) - 1 / 280
    assert abs(off) < 1.96 * a.delay_error < 1 / 280
    assert "include the misfit" in measured_page.conclusion(found, found.main)
    far = compare_measured(measured, runs_of(AM, stiffness=4.0))
    assert far.main.alignment.misfit > 0.2
    assert np.isnan([far.main.alignment.gain_error, far.main.alignment.delay_error]).all()
    assert NOT_DESCRIBED[1:] in measured_page.conclusion(far, far.main)
    (*_, row) = measured_page.columns_table(far).records()
    assert not any("±" in str(cell) or "given" in str(cell) for cell in row.values())


def test_a_model_that_misfits_has_a_delay_at_which_the_record_lies_within_the_tacton():
    slow = replace(CIRCLE, speed=8.0)
    scene = scene_of(duration=0.5, am_frequency=140.0, trajectory=slow)
    true, stiff = (runs_of(scene, stiffness)[-1] for stiffness in (0.8, 1.0))
    noise = 1e-5 * np.random.default_rng(3).normal(size=(4, *true.response.values.shape))
    given = {"times": true.response.times, "values": true.response.values + noise}
    measured = Measurement(quantity="velocity", places=scene.probe_points, **given)
    found = compare_measured(Measured(measurement=measured), [stiff])
    column = found.main
    assert column.alignment.misfit > 0.2
    assert abs(column.alignment.delay) < 1e-3
    assert not any("--delay" in text for text in measured_page.remarks(found))
    far = compare_measured(Measured(measurement=measured, delay=-0.3926), [stiff])
    assert any("107 of the 500 ms" in text for text in measured_page.remarks(far))


def test_the_overlap_of_a_record_that_begins_before_the_tacton():
    rows = np.arange(500) / 1e3
    given = {"times": rows, "values": np.sin(rows)[None, :, None]}
    measured = Measurement(quantity="velocity", places=np.zeros((1, 2)), **given)
    run = SimpleNamespace(response=SimpleNamespace(times=np.arange(1000) / 1e3))
    found = [comparison.overlap(measured, run, delay) for delay in (0.4, 0.0, -0.8)]
    np.testing.assert_allclose(found, [0.099, 0.499, 0.199])


def test_differences_within_the_numerical_error_are_marked(models):
    rng = np.random.default_rng(2)
    errors = Statement(parts=(ErrorPart(name="mesh", source="elements", error=0.5),))
    rough = [
        replace(run, response=replace(
            run.response, effort=replace(run.response.effort, errors=errors)
        ))
        for run in models[False]
    ]  # fmt: skip
    found = compare_measured(Measured(measurement=record(models[True][-1], rng, sigma=2e-5)), rough)
    assert (found.findings(found.main) == comparison.NUMERICAL).any()


def test_delay_and_gain_are_those_given(models):
    rng = np.random.default_rng(3)
    asked = Measured(measurement=record(models[True][-1], rng), delay=DELAY - 0.007, gain=GAIN)
    found = compare_measured(asked, models[True])
    *kernels, body = found.columns
    assert (body.alignment.gain, body.alignment.delay) == (GAIN, DELAY - 0.007)
    assert all(k.alignment.gain != GAIN and k.alignment.gain_error != 0 for k in kernels)
    assert not body.differs.any()
    late = compare_measured(replace(asked, delay=0.0), models[True])
    assert late.main.differs.any()


def remarks_of(runs, *records):
    return [" ".join(measured_page.remarks(compare_measured(Measured(measurement=m), runs)))
            for m in records]  # fmt: skip


def test_a_wrong_sign_and_an_early_start_have_remarks(models):
    true = record(models[True][-1], np.random.default_rng(8))
    values = true.values.copy()
    values[:, :400] = 0  # of 900, of which the first 225 are left out
    said = remarks_of(models[True], true, replace(true, values=-true.values),
                   replace(true, values=values))  # fmt: skip
    assert ["sign" in text for text in said] == [False, True, False]
    assert ["not steady" in text for text in said] == [False, False, True]


def test_clipping_and_hum_on_a_line_of_the_load_have_remarks():
    runs = runs_of(scene_of(am_frequency=120.0, duration=0.5))
    clean = record(runs[-1], np.random.default_rng(8))
    top = 0.7 * np.abs(clean.values).max()
    hum = 0.3 * clean.values.std() * np.sin(2 * np.pi * 60 * clean.times)[:, None]
    said = remarks_of(runs, clean, replace(clean, values=clean.values.clip(-top, top)),
                   replace(clean, values=clean.values + hum))  # fmt: skip
    assert ["clipped" in text for text in said] == [False, True, False]
    assert ["hum of" in text for text in said] == [False, False, True]


def test_a_record_is_drawn_on_the_clock_of_the_model(models):
    run = models[True][-1]
    measured = Measured(measurement=record(run, np.random.default_rng(4), sigma=1e-7))
    found = compare_measured(measured, models[True])
    drawn = runs_to_draw(found)[-1]
    assert (drawn.body, drawn.column) == ("measured", "measured")
    times = drawn.response.times
    inside = (times > 0.05) & (times < 0.2)
    model = CubicSpline(run.response.times, run.response.values)(times[inside])
    assert np.abs(drawn.response.values[inside] - GAIN * model).max() < 1e-3 * np.abs(model).max()


def test_a_spectrum_of_lines_is_compared_and_drawn(models):
    run = models[True][-1]
    waveform = record(run, np.random.default_rng(5), sigma=1e-9)
    lines = compare_measured(Measured(measurement=waveform), models[True]).lines
    given = {"frequencies": lines.frequencies[:2], "values": lines.each[:1, :2]}
    spectra = Measurement(quantity="velocity", places=run.response.probes, **given)
    found = compare_measured(Measured(measurement=spectra), models[True])
    assert list(found.names) == ["f_AM", "2f_AM"]
    assert "3f_AM" in found.unresolved
    assert (found.findings(found.main) == comparison.UNKNOWN).all()
    assert found.main.alignment.misfit < 1e-4
    drawn = runs_to_draw(found)[-1].response
    size = np.ptp(run.response.values, axis=0)
    model = GAIN * (run.response.values - run.response.values.mean(axis=0))
    assert np.abs(drawn.values - model).max() < 2e-3 * size.max()


def claims_of(scene, amplitudes, noise, spectrum=NO_SPECTRUM, unresolved=()):
    names = [*amplitudes]
    size = np.array([amplitudes[n] for n in names])[:, None] * np.ones(2)
    scatter = noise * np.array([1, 1j, -1, -1j])[:, None, None]
    each = size + scatter + 0j
    lines = MeasuredLines(
        frequencies=np.array([FREQUENCIES[n] for n in names]), each=each, shifts=np.zeros(4),
        variance=each.var(axis=0, ddof=1) / 4, freedom=6.0,
    )  # fmt: skip
    at = replace(scene, probes=((0.0, 0.0), (0.01, 0.0)))
    named = by_name(at, {n: (n,) for n in names}, lines, unresolved, spectrum)
    return {c.claim: c.finding for c in assess_measured(named)}


def test_claims_about_harmonics_are_decided_above_the_noise():
    three = {"f_AM": 1.0, "2f_AM": 0.2, "3f_AM": 0.05}
    clear = claims_of(AM, three, 1e-3)
    assert (clear["M1"], clear["S1"]) == (HOLDS, FAILS)
    none = claims_of(AM, three | {"3f_AM": 0.0}, 1e-5)
    assert none["M1"] == FAILS
    assert {"S1", "M1", "S5"} == set(none)  # the others are not about AM alone
    assert claims_of(AM, three | {"3f_AM": 0.0}, 0.02)["M1"] == UNDECIDED
    assert claims_of(AM, three | {"2f_AM": 1e-7, "3f_AM": 1e-7}, 1e-5)["S1"] == UNDECIDED
    assert claims_of(AM, three | {"f_AM": 0.01}, 0.1)["M1"] == UNDECIDED
    assert claims_of(AM, three, np.nan)["M1"] == UNDECIDED
    of_path = claims_of(scene_of(trajectory=CIRCLE), {"f_d": 1.0, "2f_d": 0.5, "3f_d": 0.2}, 1e-3)
    assert (of_path["M2"], of_path["S2"]) == (UNDECIDED, UNDECIDED)
    f = np.arange(0, 1000.0)
    peaks = np.exp(-((f - 140.3) ** 2) / 4)[:, None] * np.ones(2)
    assert claims_of(AM, three, 1e-3, (f, peaks))["S5"] == HOLDS


def test_claims_about_both_modulations():
    plain = dict.fromkeys(FREQUENCIES, 0.02) | {"f_AM": 1.0}
    found = claims_of(BOTH, plain, 1e-4)
    assert [found[c] for c in ("S3", "S4", "M3", "M4", "M5")] == [FAILS, *[HOLDS] * 4]
    strong = claims_of(BOTH, plain | {"f_d": 1.05}, 1e-4)
    assert [strong[c] for c in ("S4", "M4", "M5")] == [FAILS] * 3
    # M5 is about the multiples of f_AM and f_d, M4 about all lines.
    paired = claims_of(BOTH, plain | {"f_d-f_AM": 1.5}, 1e-4)
    assert [paired[c] for c in ("S4", "M4", "M5")] == [FAILS, FAILS, HOLDS]
    assert claims_of(BOTH, plain | {"f_d": 0.99}, 0.02)["S4"] == UNDECIDED
    pairs = dict.fromkeys(FREQUENCIES, 0.0) | {"f_AM": 1.0}
    pairs |= dict.fromkeys(("f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM"), 0.1)
    assert claims_of(BOTH, pairs, 1e-9)["S3"] == HOLDS
    assert claims_of(BOTH, pairs, 1e-5)["S3"] == UNDECIDED


def test_places_are_those_of_the_measurement_or_as_many():
    times = np.arange(100) / 1000
    places = np.array([[0.0, 0.001], [0.004, 0.0]])
    given = {"quantity": "velocity", "times": times, "values": np.zeros((1, 100, 2))}
    moved = at_measured_places(AM, Measurement(places=places, **given))
    assert moved.probe_points == pytest.approx(places)
    unknown = Measurement(places=np.full((2, 2), np.nan), **given)
    with pytest.raises(ValueError, match="5 probes"):
        at_measured_places(AM, unknown)
    two = replace(AM, probes=((0.0, 0.0), (0.002, 0.0)))
    assert at_measured_places(two, unknown) == replace(two, quantity="displacement")
    with pytest.raises(ValueError, match="outside the body"):
        at_measured_places(AM, Measurement(places=places + 1, **given))
    with pytest.raises(ValueError, match="strain"):
        at_measured_places(AM, Measurement(places=places, **(given | {"quantity": "strain_xx"})))


@pytest.fixture
def compared(tmp_path_factory, in_one_process):
    folder = tmp_path_factory.mktemp("measured")
    body = Body(kind="slab", width=0.04, height=0.04, depth=0.008, sides="clamped")
    scene = replace(scene_of(am_frequency=140.0, body=body), quantity="displacement",
                    probes=((0.0, 0.0), (0.008, 0.0)), name="small")  # fmt: skip
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    steady = compute(replace(scene, quantity="velocity"), "flat-body-harmonic")
    run = Run(tacton="small", body="slab", scene=scene, response=steady)
    write(record(run, np.random.default_rng(7)), folder / "record.npz")
    words = ["compare", f"{folder}/scene.toml", "--measured", f"{folder}/record.npz", "--json",
             "--element-size", "10", "--out", f"{folder}/out"]  # fmt: skip
    return folder, words, cli.main(words)


@pytest.mark.slow
def test_the_command_puts_the_measurement_beside_the_models(compared, capsys):
    folder, _, code = compared
    assert code == 0
    out = folder / "out"
    rows = [*csv.DictReader((out / "measured.csv").read_text("utf-8").splitlines())]
    assert {row["model"] for row in rows} == {"point-kernel-published", "point-kernel", "slab"}
    of_am = [row for row in rows if row["line"] == "f_AM" and row["model"] == "slab"]
    assert [row["place"] for row in of_am] == ["1", "2"]
    z = float(of_am[0]["measured_velocity_mm_s"]), float(of_am[0]["model_velocity_mm_s"])
    assert z[0] == pytest.approx(z[1], rel=0.3)
    assert 0 <= float(of_am[0]["p_adjusted"]) <= 1
    page = (out / "index.html").read_text("utf-8")
    assert page.index("Comparison with the measurement") < page.index("What propagation changes")
    assert (out / "pictures" / "measured.png").stat().st_size > 10_000
    assert "M1," in (out / "measured-claims.csv").read_text("utf-8")
    kept = json.loads((out / "record.json").read_text("utf-8"))
    assert kept["command"]["options"]["measured"] == str((folder / "record.npz").resolve())


def test_lines_of_a_velocity_are_read_as_displacement():
    """2 sin and 3 cos: RMS sqrt((4 + 9) / 2) micrometre."""
    f = np.array([140.0, 280.0])
    moved = 1e-6 * np.array([[2j, 0, 1], [3, 0, 0]])
    velocity = 2j * np.pi * f[:, None] * moved
    lines = MeasuredLines(frequencies=f, each=velocity[None], variance=np.full((2, 3), np.nan),
                          freedom=2.0, shifts=np.zeros(1))  # fmt: skip

    measurement = SimpleNamespace(record=quantity("velocity"))
    made = SimpleNamespace(scene=MAPPED, measurement=measurement, lines=lines)
    found = comparison.measured_places(made)
    assert found.rms == pytest.approx(1e-6 * np.sqrt([6.5, 0, 0.5]))
    np.testing.assert_array_equal(found.places, MAPPED.probe_points)


def test_places_have_the_colour_of_the_map_and_none_on_a_pressure():
    x = np.linspace(-0.01, 0.01, 21)
    r = np.hypot(*np.meshgrid(x, x))
    body = SurfaceField(x=x, y=x, rms=1e-6 * np.exp(-r / 0.005))
    kernel = replace(body, rms=1e7 * body.rms**1.5, quantity=PRESSURE)
    rms = 2e-6 * np.array([1.0, np.exp(-np.hypot(4, 2) / 5), 0.3])
    measured = MeasuredPlaces(places=MAPPED.probe_points, rms=rms)
    figure = surfaces_figure(MAPPED, {"point-kernel": kernel, "skin-slab": body}, measured=measured)
    bare, marked = (
        next(c for c in ax.collections if hasattr(c, "get_sizes") and len(c.get_offsets()) > 1)
        for ax in figure.axes[:2]
    )
    for squares in (bare, marked):  # the third place is beyond the map
        assert squares.get_offsets().data == pytest.approx(1e3 * MAPPED.probe_points[:2])
    assert bare.get_array() is None
    image = figure.axes[1].images[0]
    assert image.colorbar.extend == "max"
    marked.update_scalarmappable()
    np.testing.assert_allclose(marked.get_facecolors(), image.cmap(image.norm(1e6 * rms[:2])))
