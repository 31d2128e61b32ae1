"""The main job, end to end: Tactons of the paper on a paper sheet and on a palm."""

import csv
import json
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import pytest
import read_results
from in_browser import needs_browser

from skinwave.commands.cli import main
from skinwave.report.renderer import renderer
from skinwave.results.claims import CLAIMS
from skinwave.scene import paper15

pytestmark = pytest.mark.slow
PUBLISHED = "point-kernel-published"
# Of the paper's 15 one or two of each kind: claims compare paths, and tones with paths.
CHOSEN = ("stm10", "stm20", "am140", "am80-stm10", "am140-stm20")
FIGURES = len(CHOSEN) + 2 + renderer().is_available  # dots, maps, and surfaces in 3-D


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("main") / "paper-15"
    every = dict(paper15.tactons())
    assert len(every) == 15
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as said:
        patch.setattr(paper15, "tactons", lambda: [(name, every[name]) for name in CHOSEN])
        assert main(["compare", "--out", str(folder), "--json"]) == 0
    return folder, json.loads(said.getvalue())


@pytest.fixture(scope="module")
def claims(job):
    rows = csv.DictReader((job[0] / "claims.csv").read_text().splitlines())
    return {
        (row["model"] if row["body"] == "none" else row["body"], row["claim"]): row for row in rows
    }


def test_all_runs_are_there(job):
    folder, summary = job
    assert summary["runs"] == summary["planned"] == 4 * len(CHOSEN)
    assert len(list(folder.glob("*/*/scene.toml"))) == 4 * len(CHOSEN)
    assert len(list((folder / "pictures").glob("*.png"))) == FIGURES
    responses = read_results.arrays(folder / "responses.npz")
    assert responses["am140/palm/fem"].shape == (10_000, 5)
    assert responses["am140/paper-sheet/plate-modes-nonlinear"].shape == (10_000, 5)


def test_every_response_is_within_the_tolerance_and_the_memory_is_bounded(job):
    folder, summary = job
    assert summary["warnings"] == []
    for body in ("paper-sheet", "palm"):
        for record in folder.glob(f"*/{body}/record.json"):
            assert 0 < json.loads(record.read_text())["expected_error"] <= 0.05
    assert summary["peak_memory_gib"] <= 6


def test_claims_about_the_simulation_hold_in_the_published_kernel(claims):
    published = {claim: row for (column, claim), row in claims.items() if column == PUBLISHED}
    assert set(CLAIMS) == set(published)
    for claim in ("S1", "S2", "S3", "S4", "S5"):
        assert published[claim]["holds"] == "True", published[claim]
    assert float(published["S3"]["value"]) < -120
    # What the measurement had and the model lacks.
    for claim in ("M1", "M3", "M5"):  # M5 is about lines that are not there
        assert published[claim]["holds"] == "False"


def test_the_load_determines_which_lines_are_present(claims):
    for claim in ("S1", "S2", "S3", "S5", "M1", "M2", "M3"):
        of_both = [claims[column, claim]["holds"] for column in ("point-kernel", "palm")]
        assert of_both[0] == of_both[1], claim
    assert claims["point-kernel", "M3"]["holds"] == "True"
    assert claims["point-kernel", "M1"]["holds"] == "False"  # a square has no third harmonic


def test_a_stretching_sheet_adds_harmonics(claims):
    assert claims["paper-sheet", "M1"]["holds"] == "True"


def test_the_second_harmonic_on_a_palm(job):
    """AM 140 on a palm: 2 f / f is a quarter in the load, and no body adds 3 f."""
    rows = csv.DictReader((job[0] / "am140/palm/lines.csv").read_text().splitlines())
    centre = {r["line"]: float(r["displacement_um"]) for r in rows if r["probe_x_mm"] == "0"}
    assert 0.05 < centre["2f_AM"] / centre["f_AM"] < 0.25
    assert centre["3f_AM"] < 1e-6 * centre["f_AM"]


def test_waves_spread_further_than_the_point_kernel(job):
    responses = read_results.arrays(job[0] / "responses.npz")

    def level(body, model):
        motion = responses[f"am140/{body}/{model}"][2500:].std(axis=0)
        return 20 * np.log10(motion[2:] / motion[0])  # 10 mm and beyond

    kernel = level("none", "point-kernel")
    assert (level("palm", "fem") > kernel + 10).all()


def test_the_drawing_frequency_is_weak_at_the_centre_of_a_circle(job):
    rows = csv.DictReader((job[0] / "stm20/palm/lines.csv").read_text().splitlines())
    drawn = {r["probe_x_mm"]: float(r["displacement_um"]) for r in rows if r["line"] == "f_d"}
    assert drawn["0"] < 0.2 * drawn["10"]  # a palm is not symmetric


def test_the_page_stands_alone(job):
    page = (job[0] / "index.html").read_text()
    assert page.count("data:image/") == FIGURES
    for outside in ('src="http', 'href="http', "url(http", "<script"):
        assert outside not in page
    assert "contradicts M4" in page
    first = page.split("<h2")[0]
    assert first.count("<img") == FIGURES - len(CHOSEN) - 1
    assert first.count("<table") == 1
    assert 'class="verdict"' in first.split("<table")[0]


@needs_browser
def test_the_page_has_at_most_four_screens(job, browser):
    tab = browser.new_page(viewport={"width": 1200, "height": 800})
    tab.goto(f"file://{job[0] / 'index.html'}")
    assert tab.evaluate("document.documentElement.scrollHeight") <= 4 * 800
    chosen = tab.locator(".choice > div:visible")
    assert chosen.inner_text().startswith("am140-stm20")
    tab.click("label:text-is('am140')")
    assert chosen.inner_text().startswith("am140:")
    tab.click("nav >> text=Effort")
    assert tab.locator("#errors-and-effort table").first.is_visible()
    tab.close()
