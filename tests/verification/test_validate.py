"""Published measurements beside the models: factors, closed forms, files of measurements."""

import json
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from scipy.io import savemat
from scipy.special import i0e

from simple_model.load.focus import spot_width
from skinwave.commands.cli import main
from skinwave.measure import skinsource
from skinwave.verify import finger, zigzag
from skinwave.verify.compared import ABOVE, BELOW, NONE, WITHIN, compared, csv_row, tallies
from skinwave.verify.focus_speed import sweep, top
from skinwave.verify.modulation import harmonics
from skinwave.verify.published import (
    LENGTH,
    OPTIMUM,
    SKINSOURCE,
    SPEED,
    all_sources,
    rayleigh_wave,
    voigt_lengths,
    wave_sets,
)
from skinwave.verify.published_waves import BODIES, compare_waves, decay_exponents, leading_wave

SPREAD = replace(
    OPTIMUM, frequencies=(1.0, 2.0, 3.0, 4.0, 5.0), values=(nan,) * 5, lows=(2.0,) * 5,
    highs=(4.0,) * 5,
)  # fmt: skip


def test_a_factor_is_to_the_nearer_end_of_the_spread():
    rows = compared(SPREAD, "palm-layers", [1.0, 3.0, 8.0, nan, inf])
    assert [row.outcome for row in rows] == [BELOW, WITHIN, ABOVE, NONE, ABOVE]
    assert [row.factor for row in rows[:3]] == [0.5, 1.0, 2.0]
    assert rows[0].words == "below the published spread, by a factor of 2.0"
    assert rows[4].words == "above the published spread, without bound"
    assert not rows[0].is_built
    (tally,) = tallies(rows[:4])
    assert tally.words == (
        "within the published spread at 1 of 4; below at 1 by a factor of 2.0; above at 1 by a "
        "factor of 2.0; no wave at 1"
    )


def test_without_a_spread_agreement_is_as_near_as_a_curve_is_read():
    alone = replace(SPREAD, values=(3.0,) * 5, lows=(), highs=())
    rows = compared(alone, "palm", [3.1, 2.9, 3.2, 2.0, 6.0])
    assert [row.outcome for row in rows] == [WITHIN, WITHIN, ABOVE, BELOW, ABOVE]
    assert rows[4].words == (
        "above the published value, of which no spread is published, by a factor of 2.0; the "
        "preset was made from it"
    )
    cells = csv_row(rows[3])
    assert cells[6:10] == ["3", "", "", "2"]
    assert cells[12] == "yes"


def test_voigt_lengths_are_those_of_the_closed_form_and_within_their_spread():
    """With mu = 7.86 kPa and 5.03 Pa s the 1/e length is 7.3 mm at 200 Hz, the speed 3.22 m/s."""
    speed, length = rayleigh_wave(7.86e3, 5.03, 200.0)
    assert speed == pytest.approx(3.22, abs=0.005)
    assert length == pytest.approx(7.3e-3, abs=5e-5)
    found = voigt_lengths()
    assert found.values[1] == pytest.approx(length)
    assert (np.array(found.lows) < found.values).all()
    assert (np.array(found.highs) > found.values).all()


COARSE = np.arange(50.0, 701.0, 50.0)  # Hz, so as to be quick


@pytest.fixture(scope="module")
def curves():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("skinwave.verify.published_waves.GRID", COARSE)
        return {name: leading_wave(body) for name, body in BODIES.items()}


def test_the_wave_of_a_half_space_is_that_of_the_closed_form(curves):
    f = np.array([100.0, 200.0, 700.0])
    expected = np.array([rayleigh_wave(25e3, 5.0, x) for x in f]).T
    assert curves["palm"].at(SPEED, f) == pytest.approx(expected[0], rel=2e-4)
    assert curves["palm"].at(LENGTH, f) == pytest.approx(expected[1], rel=2e-4)


def test_a_layer_on_bone_has_no_wave_at_rest():
    slab = leading_wave(BODIES["skin-slab"])
    assert np.isnan(slab.at(SPEED, np.array([0.0, 50.0]))).all()
    # 15 mm and c_s = 5 m/s: nothing propagates below a quarter of a shear wave, 83 Hz.
    assert slab.frequencies[np.isfinite(slab.speed)][0] == pytest.approx(83, abs=10)


def test_an_exponent_at_rest_is_that_of_the_closed_form_and_grows_with_loss():
    """Statically a Gaussian spot deflects a half-space as exp(-x) I_0(x), x = r^2 / 4 s^2."""
    r = np.geomspace(0.010, 0.040, 12)
    at_rest, moving = decay_exponents(BODIES["palm"], np.array([0.01, 300.0]))
    static = i0e(r**2 / (4 * spot_width(0.200) ** 2))
    assert at_rest == pytest.approx(-np.polyfit(np.log(r), np.log(static), 1)[0], abs=1e-3)
    # Where waves outweigh the near field, they spread as r^-1/2 and lose exp(-r/L).
    wave = -0.5 * np.log(r) - r / rayleigh_wave(25e3, 5.0, 300.0)[1]
    assert moving == pytest.approx(-np.polyfit(np.log(r), wave, 1)[0], abs=0.05)


def test_all_sources_span_each_of_them():
    both = all_sources(SPEED), all_sources(LENGTH)
    assert np.array(both[0].lows)[[0, 1, 3]].tolist() == [8.0, 3.06, 5.0]
    assert np.array(both[0].highs)[[0, 1, 3]].tolist() == [18.0, 10.0, 10.0]
    assert both[1].highs[1] == pytest.approx(0.081)
    assert both[1].lows[1] < 7.3e-3
    assert both[1].frequencies == (100.0, 200.0, 300.0, 400.0)  # beyond, Potts alone


def test_each_published_set_has_a_source_and_bodies_that_are_there(curves):
    rows = compare_waves(curves)
    for each in wave_sets():
        assert each.source
        assert each.how
        assert set(each.built) <= set(BODIES)
        own = [row for row in rows if row.published is each or row.published.name == each.name]
        assert len(own) == len(each.bodies) * len(each.frequencies)
    built = {(row.published.name, row.body) for row in rows if row.is_built}
    assert ("Zhang: speed", "forearm") in built


def test_the_optimum_of_a_half_space_is_near_its_surface_wave():
    """Deflection of the half-space forearm at 2, 3 and 5 m/s: 0.402, 0.409, 0.309 um/Pa."""
    found = sweep(BODIES["forearm"], 0.100)
    at = {v: 1e6 * u for v, u in zip(found.speeds, found.largest, strict=True)}
    assert [at[2.0], at[3.0], at[5.0]] == pytest.approx([0.402, 0.409, 0.309], abs=6e-4)
    assert 2.4 < found.optimum < 3.3
    assert top(np.array([1.0, 2.0, 3.0]), np.array([3.0, 2.0, 1.0])) != found.optimum
    assert np.isnan(top(np.array([1.0, 2.0, 3.0]), np.array([3.0, 2.0, 1.0])))
    assert top(np.arange(5.0), -((np.arange(5.0) - 2.3) ** 2)) == pytest.approx(2.3)


def test_harmonics_of_the_load_are_those_of_the_drive_law():
    found = {(h.wave, h.drive): h for h in harmonics()}
    squared = found["sine", "pressure_squared"]
    assert squared.load == pytest.approx([1, 0.25, 0], abs=1e-6)
    # At 140 Hz the compliance of this half-space at 2f is 0.63 of that at f.
    assert squared.motion[1] == pytest.approx(0.63 * 0.25, abs=2e-3)
    assert squared.agrees
    assert not found["sine", "force_corrected"].agrees
    square = found["square", "pressure_squared"]
    assert square.load == pytest.approx([1, 0, 1 / 3], abs=2e-3)
    assert square.agrees


def test_the_zigzag_goes_along_and_back_at_its_speeds():
    for speed in zigzag.SPEEDS:
        drawn = zigzag.path(speed)
        t, points = np.array(drawn.times), np.array(drawn.points)
        velocity = np.diff(points, axis=0) / np.diff(t)[:, None]
        assert np.abs(velocity[:, 0]) == pytest.approx(speed)
        assert np.abs(velocity[:, 1]) == pytest.approx(2.5)
        assert np.ptp(points[:, 0]) == pytest.approx(0.170)
        assert np.abs(points[:, 1]).max() == pytest.approx(0.010)
        assert t[-1] == pytest.approx(2 * 0.170 / speed)


def recording(path, places, rms):
    """A file of the published set: y (N, M, 2), references, sampling rate and places in mm."""
    t = np.arange(400) / 5000
    wave = np.sqrt(2) * np.sin(2 * np.pi * 125 * t)
    y = np.repeat((rms[:, None] * wave)[:, :, None], 2, axis=2)
    reference = np.repeat(np.sin(2 * np.pi * 62.5 * t)[None, :, None], len(rms), axis=0)
    savemat(path, {"y": y, "r": np.repeat(reference, 2, axis=2), "fs": 5000.0, "xy": places})


def test_what_a_recording_of_the_zigzag_does_not_say_is_added_by_another_command(tmp_path):
    y = np.random.default_rng(0).normal(size=(4, 50, 2))
    hint = "`skinwave measured .*scan.mat --out DIR` takes such options"
    for lacks, given in (("--rate", {"xy": np.eye(4)[:, :2]}), ("--places", {"fs": 5000.0})):
        savemat(tmp_path / "scan.mat", {"y": y, "r": np.ones(50), **given})
        with pytest.raises(ValueError, match=f"{lacks}.*{hint}"):
            zigzag.measured(tmp_path / "scan.mat", 4.0)


def test_a_recording_of_the_zigzag_is_seen_along_the_hand(tmp_path):
    along = np.linspace(-70, 70, 15)
    places = np.stack([0.2 * along, along], axis=1)
    rms = np.linspace(1e-3, 2e-3, 15)
    recording(tmp_path / "scan.mat", places, rms)
    found = zigzag.measured(tmp_path / "scan.mat", 4.0)
    assert found.rms == pytest.approx(rms, rel=1e-3)
    assert 1e3 * found.places == pytest.approx(along * np.sqrt(1.04), rel=1e-6)
    assert found.middle == pytest.approx(1.5e-3, rel=1e-3)
    assert np.isfinite(zigzag.binned(found)).sum() >= 13


def skinsource_files(folder, monkeypatch, length):
    """Four people whose motion falls to 1/e in `length` from sensor 19, and their drawing."""
    impulses = folder / "data/impulse-responses"
    impulses.mkdir(parents=True)
    monkeypatch.setattr(skinsource, "_is_intact", lambda *_: True)
    pixels = [[0.0, 1000.0 + k] for k in range(72)]
    for step, sensor in enumerate(finger.SENSORS):
        pixels[sensor - 1] = [5.0 * (step % 2), 40.0 * step]
    (folder / "data/visualization.json").write_text(json.dumps({"outputLocations": pixels}))
    for model in finger.PEOPLE:
        scale = skinsource.HAND_LENGTHS[model - 1] / skinsource.DRAWN_HAND
        values = np.zeros((522, 72, 3), np.float32)
        for step, sensor in enumerate(finger.SENSORS):
            values[0, sensor - 1, 2] = np.exp(-40.0 * step * scale / (length * model))
        (impulses / f"model-{model}-location-08.f32").write_bytes(values.tobytes("F"))
    return impulses


def test_lengths_are_found_again_in_files_of_skinsource(tmp_path, monkeypatch):
    people = finger.of_skinsource(skinsource_files(tmp_path, monkeypatch, 0.020))
    assert [person.lengths[0] for person in people] == pytest.approx(
        [0.02, 0.04, 0.06, 0.08], rel=1e-3
    )
    published = finger.from_files(people)
    assert published.between(2) == pytest.approx((0.02, 0.08), rel=1e-3)
    hand = finger.Decay(
        name="hand", frequencies=np.array([200.0, 300.0]), distances=np.array([0.0, 0.05, 0.1]),
        amplitudes=np.exp(-np.outer([1 / 0.020, 1 / 0.045], [0.0, 0.05, 0.1])),
    )  # fmt: skip
    rows = finger.compare_hand(hand, SKINSOURCE)
    assert [row.frequency for row in rows] == [200.0, 300.0]
    assert rows[0].factor == pytest.approx(20 / 42)
    assert rows[1].outcome == WITHIN


@pytest.mark.slow
def test_a_hand_loses_more_along_its_finger_at_a_higher_frequency(monkeypatch):
    """Coarse: by 6.5 mm the lengths are 23, 14 and 9.8 mm at 200, 300 and 400 Hz."""
    monkeypatch.setattr(finger, "SIZE", 0.009)
    found = finger.of_hand(finger.EXAMPLE, lambda phase, fraction: None, (200.0, 300.0))
    assert found.dofs > 10_000
    assert found.lengths == pytest.approx([0.023, 0.014], rel=0.2)
    assert found.amplitudes.max(axis=1).tolist() == [1.0, 1.0]
    assert finger.compare_hand(found)[1].outcome == BELOW


@pytest.mark.parametrize(
    ("asked", "said"),
    [(["--zigzag", "scan.mat", "fast"], "no speed in m/s"),
     (["--zigzag", "scan.mat", "3"], "none of the drawn speeds"),
     (["--zigzag", "scan.mat", "4"], "scan.mat"),
     (["--skinsource", "nowhere"], "none of model-1-location-08.f32"),
     (["--hand", "no-hand.glb"], "is not there")],
)  # fmt: skip
def test_command_refuses_in_one_sentence(tmp_path, monkeypatch, capsys, asked, said):
    monkeypatch.chdir(tmp_path)
    assert main(["validate", "--quiet", *asked]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert not (tmp_path / "validation").exists()


def test_command_writes_a_page_beside_a_users_own_files(tmp_path, monkeypatch, capsys):
    """With few speeds and frequencies, so as to be quick."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("skinwave.verify.focus_speed.SPEEDS", np.array([2.0, 5.0, 12.0]))
    monkeypatch.setattr("skinwave.verify.published_waves.GRID", COARSE)
    monkeypatch.setattr("skinwave.verify.zigzag.SPEEDS", (4.0, 11.0))
    monkeypatch.setattr("skinwave.verify.zigzag.BODIES_SHOWN", ("palm",))
    along = np.linspace(-70, 70, 15)
    recording(tmp_path / "scan.mat", np.stack([along, 0 * along], axis=1), np.full(15, 1e-3))
    impulses = skinsource_files(tmp_path, monkeypatch, 0.020)
    asked = ["--zigzag", "scan.mat", "4", "--skinsource", str(impulses), "-o", "out", "--json"]
    assert main(["validate", *asked]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["sentences"][0].startswith("Of ")
    assert any("predicted over measured" in sentence for sentence in said["sentences"])
    page = (tmp_path / "out/index.html").read_text("utf-8")
    assert page.index("agree") < page.index('id="factors"') < page.index('id="waves"')
    for name in ("waves", "focus-speed", "zigzag", "finger", "factors"):
        assert f'id="{name}"' in page
    assert "from its files" in page
    rows = (tmp_path / "out/validation.csv").read_text("utf-8").splitlines()
    assert rows[0].startswith("set,site,quantity,unit,frequency_hz,body,published")
    assert sum("Potts" in row for row in rows) == 8 * 8
    assert any(row.startswith('"AM radiation force, sine"') for row in rows)
