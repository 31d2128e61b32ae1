"""Which sheet was measured: candidates, their claims, the table, and what it tells."""

import json
import tomllib
from html import unescape
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from simple_model import DRIVES, Response
from simple_model.plates.modes import plate_modes
from skinwave.commands.cli import main
from skinwave.inference import (
    assess,
    design,
    drive_laws,
    knowledge,
    large_deflection,
    stretched_table,
    table,
)
from skinwave.inference.conclusions import conclusions, readings, together
from skinwave.inference.deflection import bound_table, shares_within
from skinwave.inference.knowledge import Share, holds, pattern, region, told, variance_share
from skinwave.inference.nearest_sheets import left_out, sheets
from skinwave.inference.page import drawings, page, reading_table
from skinwave.inference.scenes import scene_of, scene_text
from skinwave.inference.stretched_words import stretched_sentences
from skinwave.models.plate_modes import plate_of
from skinwave.models.stretching import unstretched_lines
from skinwave.scene.file import loads
from skinwave.scene.paper15 import tactons
from skinwave.sweeps import dataset

SMALL = {
    "size": "square", "side_mm": 70.0, "support": "clamped", "tension_x_n_per_m": 10.0,
    "tension_y_n_per_m": 30.0, "grammage_g_m2": 80.0, "young_x_gpa": 6.0, "young_ratio": 0.5,
    "loss_factor": 0.04, "off_middle": 0.2, "start_mm": 1.0, "beside_mm": 2.0,
    "quantity": "displacement", "drive": "compressed", "depth_of_modulation": 0.9,
    "height_mm": 200.0,
}  # fmt: skip


LAWS = DRIVES | drive_laws.LAWS


def harmonics(law, depth, count=4):
    """Amplitudes of the harmonics 0.. of the pressure under M = sin."""
    M = np.sin(2 * np.pi * np.arange(4096) / 4096)
    found = np.abs(np.fft.rfft(LAWS[law](1.0, M, depth))) / 4096
    return found[:count] * np.where(np.arange(count), 2, 1)


def planted(count=400, seed=0):
    """Rows in which the drive law decides M1, and the level of the rival rises with the loss."""
    rng = np.random.default_rng(seed)
    rows = []
    for k, candidate in enumerate(design.hypercube(count, seed)):
        rival = 200 * candidate["loss_factor"] + rng.normal()
        by_path = [rival - 9, rival - 5, rival]
        rows.append({
            "key": f"{k:024x}", "index": k, "version": "0", "stage": table.HYPERCUBE,
            "status": "done", "error": None, "seconds": 1.0, **candidate,
            "first_mode_hz": 30.0, "mean_over_thickness": 2 * rng.random(),
            "vibration_over_thickness": rng.random(), "sag_over_thickness": 40 * rng.random() ** 3,
            "multiple_tacton": "am140-stm30", "second_harmonic_db": -20.0,
            "M1_holds": int(candidate["drive"] in ("clipped", "compressed")), "M1_value": -40.0,
            "M2_holds": 1, "M2_value": 0.0, "M3_holds": int(rng.random() < 0.5), "M3_value": -30.0,
            "M4_holds": int(rival < 0), "M4_value": rival, "M5_holds": int(rival < -19),
            "M5_value": rival - 1, "multiple_db": [rival - 1] * 4 + [rival - 9],
            "multiple_by_path_db": [rival - 9, rival - 5, rival - 1], "rival_of_mean_db": rival - 2,
            "rival_db": [rival, rival - 1, rival - 2, rival - 3, rival - 8],
            "rival_by_path_db": by_path, "rival_line": "f_d", "rival_tacton": "am80-stm30",
            "tactons_highest": 3, "tactons_much_lower": 0,
        })  # fmt: skip
    return rows


def test_a_hypercube_meets_all_values_evenly_and_again():
    first = design.hypercube(50, 3)
    assert first == design.hypercube(50, 3) != design.hypercube(50, 4)
    for parameter in design.PARAMETERS:
        values = [candidate[parameter.key] for candidate in first]
        if parameter.bounds is None:
            counts = [values.count(value) for value in parameter.values]
            assert min(counts) >= 50 // len(counts)
        else:
            low, high = parameter.bounds
            inside = np.sort((np.array(values) - low) / (high - low) * 50).astype(int)
            np.testing.assert_array_equal(inside, np.arange(50))  # one in each of 50 parts


def test_the_sheet_of_a_candidate_is_its_own():
    plate = design.plate(SMALL)
    d = 0.080 / 780
    assert design.thickness(SMALL) == pytest.approx(d)
    assert plate.d11 == pytest.approx(6e9 * d**3 / 12 / (1 - 0.3 * 0.15))
    assert plate.d22 == pytest.approx(plate.d11 / 2)
    assert plate.d12 == pytest.approx(0.15 * plate.d11)
    assert plate.d66 == pytest.approx(np.sqrt(18) * 1e9 / (2 + 2 * np.sqrt(0.045)) * d**3 / 12)
    assert (plate.tension_x, plate.tension_y) == (10.0, 30.0)
    assert design.middle(SMALL) == pytest.approx((-0.2 * 0.005, 0.0))
    hung = design.plate(SMALL | {"size": "A5", "support": "two_clips"})
    assert (hung.size_x, hung.size_y, hung.tension_x, hung.left) == (0.21, 0.148, 0.0, "free")
    np.testing.assert_allclose(hung.clips, [(-0.1, 0.069), (0.1, 0.069)])
    assert len(design.plate(SMALL | {"support": "corners"}).clips) == 4
    strip = design.plate(SMALL | {"support": "two_edges"})
    assert (strip.left, strip.right, strip.back, strip.tension_y) == ("clamped",) * 2 + ("free", 0)


def test_only_devices_that_clip_or_compress_have_a_third_harmonic():
    plain, clipped = harmonics("pressure_squared", 0.8), harmonics("clipped", 0.8)
    assert plain[2] / plain[1] == pytest.approx(0.2)
    assert plain[3] < 1e-12 < 0.01 * clipped[3]
    # Not clipped at half the depth: modulated once.
    np.testing.assert_allclose(harmonics("clipped", 0.5), harmonics("pressure_squared", 1.0))
    assert harmonics("compressed", 0.8)[3] > 1e-3 * harmonics("compressed", 0.8)[1]
    x = LAWS["pressure_squared"](1.0, np.linspace(-1, 1, 9), 0.7)
    squeezed = LAWS["compressed"](1.0, np.linspace(-1, 1, 9), 0.7)
    np.testing.assert_allclose(squeezed, 1.25 * x / (1 + 0.25 * x))


def test_claims_of_a_candidate_follow_from_its_lines():
    modes = plate_modes(design.plate(SMALL), 200.0)
    lines = dict(assess.responses(SMALL, modes, assess.modal_forces(SMALL, modes)))
    assert [*lines] == [name for name, _ in tactons()]

    def at(tacton, frequency):
        f, u = lines[tacton]
        return np.abs(u[np.abs(f - frequency) < 1e-3]).sum(axis=0)

    f_d = 6 / (np.pi * 0.010)
    runs = {name: assess.as_run(SMALL, name, *each) for name, each in lines.items()}
    run = runs["am140-stm10"]
    for name, frequency in (("f_AM", 140), ("f_d", f_d), ("2f_AM", 280), ("f_d-f_AM", f_d - 140)):
        np.testing.assert_allclose(run.lines[name], at("am140-stm10", frequency), rtol=1e-6)
    found = assess._claims([*runs.values()])
    third = [20 * np.log10(at(f"am{f}", 3 * f) / at(f"am{f}", f)).max() for f in (80, 140, 210)]
    second = [20 * np.log10(at(f"am{f}", 2 * f) / at(f"am{f}", f)).max() for f in (80, 140, 210)]
    assert found["M1_value"] == pytest.approx(min(third + second), abs=1e-4)
    assert found["second_harmonic_db"] == pytest.approx(min(second), abs=1e-4)
    assert found["M2_holds"] == 1
    rivals = assess._rivals([*runs.values()])
    level = found["M4_value"]
    assert level == pytest.approx(max(rivals["rival_db"]))
    assert level == pytest.approx(max(rivals["rival_by_path_db"]))
    assert found["M4_holds"] == int(level < 0)
    # M5 is about 2 f_AM, 3 f_AM, ..., f_d, 2 f_d, ... alone; those of this sheet up to 1250 Hz.
    by_frequency = {}
    for name, tacton in tactons():
        if tacton.am_frequency and tacton.trajectory.drawing_frequency:
            own, d = tacton.am_frequency, tacton.trajectory.drawing_frequency
            several = [k * own for k in range(2, 16)] + [k * d for k in range(1, 7)]
            by_frequency[name] = max((at(name, f) / at(name, own)).max()
                                     for f in several if f < 1250)  # fmt: skip
    strongest = 20 * np.log10(max(by_frequency.values()))
    assert found["M5_value"] == pytest.approx(strongest, abs=1e-4)
    assert max(rivals["multiple_db"]) == pytest.approx(strongest, abs=1e-4)
    assert max(rivals["multiple_by_path_db"]) == pytest.approx(strongest, abs=1e-4)
    assert found["M5_holds"] == int(-60 <= strongest < -20)
    assert min(rivals["rival_db"]) <= rivals["rival_of_mean_db"] <= level
    worst = runs[rivals["rival_tacton"]]
    ratio = worst.lines[rivals["rival_line"]] / worst.lines["f_AM"]
    assert 20 * np.log10(ratio.max()) == pytest.approx(level)
    # As velocity, each line goes with its frequency.
    moving = SMALL | {"quantity": "velocity"}
    fast = assess.as_run(moving, "am140-stm10", *lines["am140-stm10"])
    gained = fast.lines["2f_AM"] / fast.lines["f_AM"] / (run.lines["2f_AM"] / run.lines["f_AM"])
    np.testing.assert_allclose(gained, 2.0, rtol=1e-6)
    # A device that takes the root first has no 2 f_AM, and M1 does not hold.
    corrected = SMALL | {"drive": "force_corrected"}
    forces = assess.modal_forces(corrected, modes)
    modulated = {n: assess.as_run(corrected, n, *each)
                 for n, each in assess.responses(corrected, modes, forces)}  # fmt: skip
    assert assess._claims([*modulated.values()])["M1_holds"] == 0


def without_physics(candidate, release):
    """A row as of a candidate that was computed."""
    row = planted(1)[0] | {"key": design.name(candidate, release), **candidate}
    return row | {"M4_value": 100 * candidate["loss_factor"], "error": None}


def test_tables_go_on_and_the_page_follows_from_the_table(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(table, "row", without_physics)
    monkeypatch.setattr(table, "BATCH", 1)
    monkeypatch.setattr("skinwave.inference.page.png", lambda figure: b"drawn")
    out = tmp_path / "which"
    typed = ["infer", "--scheduler", "threads", "--quiet", "--seed", "2", "-o", str(out)]
    assert main([*typed, "--samples", "3"]) == 0
    rows = dataset.read(out)
    assert [row["stage"] for row in rows] == [table.HYPERCUBE] * 3
    html = (out / "index.html").read_text()
    for paragraph in conclusions(rows):
        assert paragraph in unescape(html)
    assert page(rows, drawings(rows)) == html
    parts = sorted((out / "rows").iterdir())
    times = [part.stat().st_mtime_ns for part in parts[1:]]
    parts[0].unlink()  # as if it had been killed before
    assert main([*typed, "--samples", "3", "--search", "1", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["done"], summary["there_before"], summary["missing"]) == (1, 2, 0)
    again = dataset.read(out)
    strip = [{k: v for k, v in row.items() if k != "seconds"} for row in (*rows, *again[:3])]
    assert strip[:3] == strip[3:]
    assert [row["stage"] for row in again[3:]] == [table.SEARCH]
    assert [part.stat().st_mtime_ns for part in parts[1:]] == times
    assert (out / "sheet-1.toml").read_text() == scene_text(sheets(again)[0])
    (out / "index.html").write_text("mine")
    assert main([*typed, "--samples", "3"]) == 2
    assert "was added or changed" in capsys.readouterr().err
    assert main([*typed[:-1], str(tmp_path), "--samples", "3"]) == 2
    assert "is none of skinwave infer" in capsys.readouterr().err
    assert main([*typed, "--samples", "1"]) == 2
    assert "--samples = 1 is below 2" in capsys.readouterr().err


def test_figures_are_drawn():
    drawn = drawings(planted(60))
    assert [each.name for each in drawn] == ["shares", "rivals", "decides", "regions"]
    for each in drawn:
        pixels = np.asarray(Image.open(BytesIO(each.image)).convert("L"))
        assert 0.005 < (pixels < 128).mean() < 0.5


def test_a_candidate_that_fails_is_a_row(monkeypatch):
    monkeypatch.setattr("skinwave.inference.page.png", lambda figure: b"drawn")

    def refuse(*_):
        raise ValueError("no\nmodes")

    monkeypatch.setattr(assess, "plate_modes", refuse)
    row = assess.row(SMALL, "0")
    assert (row["status"], row["error"], row["key"]) == ("failed", "no modes",
                                                         design.name(SMALL, "0"))  # fmt: skip
    rows = [*planted(40), {key: row.get(key) for key in table.COLUMNS} | {"stage": "hypercube"}]
    assert "1 of 41 candidates have no response: no modes" in page(rows, drawings(rows))
    with pytest.raises(ValueError, match="compute some first"):
        conclusions(rows[-1:])


def test_intervals_are_those_of_clopper_and_pearson():
    # None of n: (0, 1 - (alpha/2)^(1/n)).
    low, high = Share(held=0, of=2000).interval
    assert (low, high) == (0.0, pytest.approx(1 - 0.025 ** (1 / 2000), rel=1e-6))
    low, high = Share(held=7, of=20).interval
    assert (low, high) == pytest.approx((0.1539, 0.5922), abs=5e-5)


def test_the_parameter_that_decides_is_found():
    rows = planted()
    best = told(rows, holds(rows, "M1").astype(int))[0]
    assert best.parameter.key == "drive"
    assert best.fraction == pytest.approx(1.0, abs=0.03)
    chance = told(rows, holds(rows, "M3").astype(int))
    assert chance[0].bits < 0.02
    found = region(rows, holds(rows, "M1"))
    assert found.conditions[0].startswith("drive law")
    assert found.share.value == 1.0
    both = {t.parameter.key: t.bits for t in told(rows, pattern(rows))}
    assert max(both, key=both.__getitem__) == "drive"


def test_variance_shares_are_sobol_indices():
    rows = planted(2000)
    by_key = {p.key: p for p in design.PARAMETERS}
    a, b = (
        np.array([(row[key] - p.bounds[0]) / np.ptp(p.bounds) for row in rows])
        for key, p in ((key, by_key[key]) for key in ("loss_factor", "height_mm"))
    )
    levels = 3 * a + b  # indices 0.9 and 0.1, of which five bins see 24/25
    assert variance_share(rows, levels, by_key["loss_factor"]) == pytest.approx(0.864, abs=0.01)
    # The two are correlated by chance, by 1/sqrt(2000).
    assert variance_share(rows, levels, by_key["height_mm"]) == pytest.approx(0.096, abs=0.02)
    assert variance_share(rows, levels, by_key["grammage_g_m2"]) < 0.005


def test_the_paragraph_says_what_the_table_holds():
    rows = planted()
    said = " ".join(conclusions(rows))
    held = holds(rows, "M1").sum()
    assert f"Of 400 candidates none show all five claims (below {100 * 0.0092:.2g} %)" in said
    assert f"M1 in {100 * held / 400:.0f} %" in said
    assert "M1 is decided by the drive law" in said
    assert "M2 always holds. " in said
    assert "M5 never holds." in said
    four = np.logical_and.reduce([holds(rows, f"M{k}") for k in range(1, 5)])
    lower = [sum(four & (np.array([r["M5_value"] for r in rows]) < bar)) for bar in (-10, -6)]
    counts = [count or "none" for count in lower]
    assert f"of all candidates {counts[0]} with 10 dB and {counts[1]} with 6 dB would" in said
    also = [row["M5_value"] for row in rows if row["M3_holds"]]
    assert f"or f_d is at {np.median(also):+.1f} dB in the median" in said
    assert "M3 and M5 in 0 % (0 to" in said
    assert "f_d most often (100 %), on the path of 30 mm in 100 %" in said
    assert "goes most with the loss factor" in said
    assert "To know one thing more, the drive law" in said
    shown = [dict(row) for row in rows]
    for row in shown[:4]:
        row |= {f"M{k}_holds": 1 for k in range(1, 6)} | {"M4_value": -25.0, "M5_value": -45.0}
    assert "Of 400 candidates 4 show all five claims, 1 % (0.27 to 2.5 %)." in conclusions(shown)[0]
    assert together(shown)[-1][1].held == 4
    best = sheets(shown)
    assert len({(row["size"], row["support"]) for row in best}) == 3
    assert best[0]["M4_value"] == -25.0


def test_claims_may_be_read_less_strictly():
    rows = planted()
    found, level = dict(readings(rows)), np.array([row["M4_value"] for row in rows])
    np.testing.assert_allclose(found["all lines, at all five points, on all paths"], level)
    at_any = found["all lines, at any one of the points, on all paths"]
    np.testing.assert_allclose(at_any, level - 8)
    np.testing.assert_allclose(found["all lines, in the root mean square over the points"],
                               level - 2)  # fmt: skip
    there = np.array([row["M3_holds"] for row in rows], bool)
    alone = "multiples of f_AM and f_d alone, where M3 holds, at all five points, on all paths"
    np.testing.assert_allclose(found[alone][there], level[there] - 1)
    assert np.isinf(found[alone][~there]).all()
    header, table = reading_table(rows)
    assert header[1:] == ["highest", "6 dB above", "10 dB above", "20 dB above"]
    assert table[0][1].startswith(f"{100 * (level < 0).mean():.2g} %")


def test_a_search_stays_within_bounds_and_near_the_best():
    rows = planted(60)
    best = table.nearest(rows)
    order = [
        (
            r["sag_over_thickness"] >= 10,
            -sum(r[f"M{k}_holds"] for k in (1, 2, 3)),
            max(r["M4_value"], r["M5_value"] + 20),
        )
        for r in best
    ]
    assert order == sorted(order)
    made = table.offspring(rows, 100, 1)
    assert made == table.offspring(rows, 100, 1)
    near = best[: table.PARENTS]
    for parameter in design.PARAMETERS:
        values = [candidate[parameter.key] for candidate in made]
        kept = np.mean([value in [row[parameter.key] for row in near] for value in values])
        assert kept > 1 - 2 * table.CHANGED
        if parameter.bounds is None:
            assert set(values) <= set(parameter.values)
        else:
            assert parameter.bounds[0] <= min(values) <= max(values) <= parameter.bounds[1]


@pytest.mark.parametrize("support", design.SUPPORTS)
def test_scenes_of_candidates_say_how_the_sheet_is_held(support, monkeypatch):
    for name, law in LAWS.items():
        monkeypatch.setitem(DRIVES, name, law)
    text = scene_text(SMALL | {"support": support})
    written = tomllib.loads(text)
    body, plate = written["body"], design.plate(SMALL | {"support": support})
    mounting = body["mounting"]
    held = {edge for edge in ("left", "right", "front", "back") if getattr(plate, edge) != "free"}
    assert set(mounting["edges"]) == held
    assert (mounting["tension_x_n_per_m"], mounting["tension_y_n_per_m"]) == (
        plate.tension_x, plate.tension_y
    )  # fmt: skip
    clips = np.array(mounting.get("clips_mm", [])).reshape(-1, 2) / 1e3
    np.testing.assert_allclose(clips, np.array(plate.clips).reshape(-1, 2))
    assert body["thickness_mm"] * 780e-3 == pytest.approx(0.080)
    assert body["material"]["young_y_pa"] == 3e9
    assert written["focus"]["drive"] == drive_laws.COMPRESSED.name
    # The model of that name has the same plate of it.
    found = plate_of(loads(text).body)
    for name, value in vars(plate).items():
        if name == "clip_radius" and not plate.clips:
            continue
        own = getattr(found, name)
        assert own == (value if isinstance(value, str) else pytest.approx(np.array(value)))
    assert knowledge.value_words("two_clips") == "hung from two clips"


def test_shares_are_told_within_bounds_of_the_deflection_too():
    rows = planted()
    sags = np.array([row["sag_over_thickness"] for row in rows])
    m1 = holds(rows, "M1")
    for bound in (10.0, 2.0, 0.5):
        found = shares_within(rows, bound)["M1"]
        assert (found.held, found.of) == (m1[sags < bound].sum(), (sags < bound).sum())
        assert 0 < found.of < 400
    header, lines = bound_table(rows)
    assert header[1:] == ["any", "below 10 thicknesses", "below 2 thicknesses",
                          "below half a thickness"]  # fmt: skip
    assert lines[0][1:] == ["400", *(f"{(sags < bound).sum()}" for bound in (10, 2, 0.5))]
    said = conclusions(rows)[-1]
    assert f"below 2 thicknesses in {100 * (sags < 2).mean():.0f} %" in said
    assert f"{sags.max():.1f} thicknesses at the most" in said
    of = m1[sags < 2].mean()
    assert f"Of the {(sags < 2).sum()} below 2 thicknesses none show all five; M1 in " in said
    assert f"M1 in {100 * of:.0f} % (" in said.partition("below 2 thicknesses none")[2]


def test_a_sheet_that_sags_absurdly_is_none_of_the_nearest():
    rows = planted(60)
    for row in rows[:5]:  # which show all
        row |= {f"M{k}_holds": 1 for k in range(1, 6)} | {"M4_value": -25.0, "M5_value": -45.0}
        row["sag_over_thickness"] = 900.0
    assert all(row["sag_over_thickness"] < 10 for row in sheets(rows))
    assert table.nearest(rows)[0]["sag_over_thickness"] < 10
    sagging = sum(row["sag_over_thickness"] >= 10 for row in rows)
    assert f"are not among them: {sagging} of 60" in left_out(rows)


def test_the_sag_is_the_largest_static_deflection_of_the_sheet():
    """A pressure that rests on the middle: the sum over modes of their static deflection there."""
    centred = SMALL | {"off_middle": 0.0, "start_mm": 0.0, "beside_mm": 0.0}
    modes = plate_modes(design.plate(centred), 200.0)
    forces = assess.modal_forces(centred, modes)
    own = {"am80": forces["am80"]}
    f, force = own["am80"]
    middle = float((modes.at([[0.0, 0.0]])[0] * force[f == 0].real / modes.squared).sum())
    assert assess.sag(modes, own) == pytest.approx(middle, rel=1e-6)
    assert assess.sag(modes, forces) > middle  # of the focus that is not modulated


def test_elements_without_stretching_have_the_lines_of_the_plate():
    name, tacton = next((n, t) for n, t in tactons() if n == "am140-stm20")
    modes = plate_modes(design.plate(SMALL), 200.0)
    of_plate = dict(assess.responses(SMALL, modes, assess.modal_forces(SMALL, modes)))[name]
    f, u = unstretched_lines(scene_of(SMALL, tacton), h=0.07 / 16)
    for frequency in (0.0, 190.986, 330.986):  # at 140 Hz it resonates
        own, other = (amplitude[np.abs(each - frequency) < 1e-2].sum(axis=0)
                      for each, amplitude in ((f, u), of_plate))  # fmt: skip
        np.testing.assert_allclose(np.abs(own), np.abs(other), rtol=0.1)


def stretched(row, tacton):
    """A row as of a sheet at large deflection, where M4 holds and M1 is as it was."""
    found = {"sheet": row["key"], "tacton": tacton, "status": "done", "seconds": 1.0,
             "linear_over_thickness": 3.0, "large_over_thickness": 1.5}  # fmt: skip
    for claim in large_deflection.claims_of(tacton):
        linear = {"M1": -40.0, "M4": 3.0, "M5": -4.0}[claim]
        found |= {f"{claim}_linear": linear, f"{claim}_large": linear - 7}
        found |= {f"{claim}_linear_holds": int(claim == "M1"),
                  f"{claim}_large_holds": int(claim != "M5")}  # fmt: skip
    return found


def test_the_nearest_sheets_are_computed_at_large_deflection_and_go_on(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(table, "row", without_physics)
    monkeypatch.setattr("skinwave.inference.page.png", lambda figure: b"drawn")
    monkeypatch.setattr(stretched_table, "stretched_row", stretched)
    out = tmp_path / "which"
    typed = ["infer", "--scheduler", "threads", "--seed", "2", "-o", str(out), "--samples", "40"]
    asked = [*typed, "--large-deflection", "2", "--json"]
    whole, computed = stretched_table.engine.run_all, []

    def stops(work, items, scheduler, count, done):
        """As Ctrl-C after three."""
        if len(items[0]) != 2:
            return whole(work, items, scheduler, count, done)
        for k, item in enumerate(items[:3]):
            computed.append(item)
            done(k, work(item))
        raise KeyboardInterrupt

    monkeypatch.setattr(stretched_table.engine, "run_all", stops)
    assert main(asked) == 1
    monkeypatch.setattr(stretched_table.engine, "run_all", whole)
    assert "of large deflection are missing; the same command goes on" in capsys.readouterr().err
    rows = dataset.read(out)
    assert len(stretched_table.read(out, rows)) == 3 == len(computed)
    parts = sorted((out / "large-deflection" / "rows").iterdir())
    times = [part.stat().st_mtime_ns for part in parts]
    assert main(asked) == 0
    assert [part.stat().st_mtime_ns for part in parts] == times
    found = stretched_table.read(out, rows)
    two = large_deflection.stretched_sheets(rows, 2)
    assert {(r["sheet"], r["tacton"]) for r in found} == {
        (sheet["key"], tacton)
        for sheet in two
        for tacton in large_deflection.deciding(sheet, found)
    }
    assert len(found) == 24  # since M4 no longer fails where it did
    for sheet in two:
        assert sheet["support"] in ("clamped", "simply")
        assert sheet["size"] != "A3"
        assert sheet["sag_over_thickness"] < 10
    said = conclusions(rows, found)
    assert "M1 holds in 2 of 2 (2 if it does not stretch), M4 holds in 2 of 2 (0 if" in said[-1]
    assert "M5 holds in 0 of 2 (0 if it does not stretch): M4 changes." in said[-1]
    assert "by up to 1.5 thicknesses at the points" in said[-1]
    assert "levels move by up to 7.0 dB" in said[-1]
    html = unescape((out / "index.html").read_text())
    assert all(paragraph in html for paragraph in said)
    assert "+3.0 dB, fails" in html
    assert "-4.0 dB, holds" in html
    assert main([*typed, "--large-deflection", "-1"]) == 2
    assert "--large-deflection = -1 is below 0" in capsys.readouterr().err


def test_a_claim_that_holds_is_decided_by_all_its_tactons():
    row = planted(1)[0] | {"M4_holds": 0, "M5_holds": 0}
    alone = ["am80", "am140", "am210"]
    assert set(large_deflection.deciding(row)) == {*alone, "am80-stm30", "am140-stm30"}
    assert large_deflection.claims_of("am80-stm30") == ["M4", "M5"]
    assert large_deflection.claims_of("am140") == ["M1"]
    assert large_deflection.claims_of("stm30") == []
    assert len(large_deflection.deciding(row | {"M4_holds": 1})) == 12


def test_a_claim_that_no_longer_fails_where_it_did_is_open_until_all_are_computed():
    row = planted(1)[0] | {"M4_holds": 0, "M5_holds": 0}
    first = [stretched(row, tacton) for tacton in large_deflection.deciding(row)]
    assert [large_deflection.verdict(first, claim) for claim in ("M1", "M4", "M5")] == [
        True, None, False
    ]  # fmt: skip
    assert large_deflection.verdict(first, "M4", "linear") is False
    said = stretched_sentences([row], first)
    assert "M4 holds in 0 or up to 1 of 1 (0 if it does not stretch)" in said
    assert "no claim changes" in said
    every = large_deflection.deciding(row, first)
    assert len(every) == 12
    more = [stretched(row, tacton) for tacton in every]
    assert large_deflection.verdict(more, "M4") is True
    assert large_deflection.deciding(row, more) == every
    more[-1]["M4_large_holds"] = 0
    assert large_deflection.verdict(more, "M4") is False


def test_sheets_that_elements_do_not_stretch_say_why():
    row = dict(planted(1)[0])
    refused = {"corners": "clips", "two_edges": "in a frame", "clamped": "fem-nonlinear takes 160"}
    for support, why in refused.items():
        own = {"support": support, "size": "A3", "tension_x_n_per_m": 0, "tension_y_n_per_m": 0}
        assert why in large_deflection.refusal(row | own)
    assert not large_deflection.refusal(row | {"support": "simply", "size": "A6"})
    assert "--large-deflection 3" in stretched_sentences([row], [])


def test_a_sheet_at_large_deflection_is_read_as_it_was_measured(monkeypatch):
    """A pair of lines that an element model would give: M1's levels, in displacement and
    velocity.
    """

    def lines(scene):
        return np.array([0.0, 80.0, 160.0, 240.0]), np.outer([3e-5, 1e-5, 1e-6, 1e-8], np.ones(5))

    def response(scene, model, dt):
        times = np.arange(10000) / 10000
        f, u = lines(scene)
        return Response(model=model, times=times, probes=scene.probe_points,
                        values=np.cos(2 * np.pi * np.outer(times, f)) @ u)  # fmt: skip

    monkeypatch.setattr(large_deflection, "unstretched_lines", lines)
    monkeypatch.setattr(large_deflection, "compute", response)
    row = planted(1)[0] | SMALL
    for read, factor in (("displacement", 1), ("velocity", 3)):
        found = large_deflection.stretched_row(row | {"quantity": read}, "am80")
        assert found["status"] == "done", found
        for how in ("linear", "large"):
            assert found[f"M1_{how}"] == pytest.approx(-60 + 20 * np.log10(factor), abs=0.01)
        assert found["M1_large_holds"] == int(read == "velocity")
        assert found["large_over_thickness"] == pytest.approx(3e-5 * 780 / 0.080, rel=1e-6)
