"""Which mechanism makes which line, on paper and on skin."""

from dataclasses import replace

import pytest

from simple_model import Tacton, Trajectory
from skinwave.scene.scene import BODIES, Body
from skinwave.studies import paper_vs_skin as study


def test_load_ratios_are_those_of_the_fourier_series():
    found = study.load_ratios()
    expected = {
        "square of the sound's amplitude": (0.25, 0, 0),
        "contact on one side only": (0.424, 0, 0.085),
        "clipped sound, squared": (0.589, 0.2, 0),
        "square root of the command": (0.2, 0.086, 0.048),
    }
    for name, ratios in expected.items():
        assert found[name] == pytest.approx(ratios, abs=2e-3)


@pytest.mark.slow
def test_ratios_over_amplitude_separate_lines_of_sheet_and_load(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "DURATION", 0.2)  # s; after half of it these bodies are steady
    monkeypatch.setattr(study, "AMPLITUDES", (0.25, 1.0))
    bodies = {
        "paper-sheet-loose": replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06),
        "skin-slab": Body(width=0.042, height=0.042, depth=0.01, sides="clamped"),
    }
    still = [("am140", Tacton(am_frequency=140, trajectory=Trajectory()))]
    found = study.paper_vs_skin(lambda phase, done: None, h=0.0075, patterns=still, bodies=bodies)
    for body in ("loose sheet", "skin slab"):
        assert max(found.ratios[f"{body}: linear load"]) < 1e-5
        quiet, loud = found.ratios[f"{body}: squared load"]
        assert quiet == pytest.approx(loud, rel=1e-3)
    quiet, loud = found.ratios["loose sheet: squared load, stretching"]
    assert abs(loud / quiet - 1) > 0.05
    study.report(found).write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"index.html", "amplitude.png", "lines.csv", "ratios.csv"}
