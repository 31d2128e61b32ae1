"""Trade-off of models, and the mechanisms that make lines of paper and skin."""

from dataclasses import replace

import numpy as np
import pytest
from corpus import SHORT

from simple_model import Tacton, Trajectory
from skinwave.models import named
from skinwave.models.limits import takes
from skinwave.planning.simulate import compute
from skinwave.scene.file import loads
from skinwave.scene.scene import BODIES, Body
from skinwave.studies import paper_vs_skin
from skinwave.studies.tradeoff import Candidate, candidates, tradeoff, write


@pytest.mark.slow
@pytest.mark.usefixtures("in_one_process")
def test_tradeoff_ranks_candidates_by_cost_and_error(tmp_path):
    scene = loads(SHORT)
    scene = replace(scene, body=replace(scene.body, width=0.03, height=0.03, sides="free"))
    chosen = [
        Candidate(model="point-kernel"),
        Candidate(model="fem", h=0.012),
        Candidate(model="fem", h=0.006),
        Candidate(model="fem-transient", h=0.012, dt=2e-3),
    ]
    phases = []
    finest = (1.5, 1.25)
    found = tradeoff(scene, lambda phase, _: phases.append(phase), chosen, finest=finest)
    error = {m.candidate.name: m.error for m in found.results}
    assert error["fem, h = 6.00 mm"] < error["fem, h = 12.00 mm"] < error["point-kernel"]
    assert error["fem-transient, h = 12.00 mm, dt = 2 ms"] > error["fem, h = 12.00 mm"]
    front = [(m.error, m.cold, m.warm) for m in found.front()]
    for one in ((m.error, m.cold, m.warm) for m in found.results):
        beaten = any(all(np.array(other) <= one) for other in front if other != one)
        assert beaten != (one in front)
    assert found.cheapest(1e-12) is None
    assert len(phases) == len(chosen) + 2
    write(tmp_path, scene, found)
    assert (tmp_path / "tradeoff.csv").read_text().count("\n") == 5


@pytest.mark.usefixtures("in_one_process")
def test_a_candidate_that_fails_is_named(tmp_path, monkeypatch):
    kernel, scene = compute(loads(SHORT), "point-kernel"), loads(SHORT)

    def run(scene, candidate):
        if candidate.dt:
            raise ArithmeticError("not finite")
        return kernel, 1.0, 1.0, 0

    monkeypatch.setattr("skinwave.studies.tradeoff._run", run)
    chosen = [Candidate(model="point-kernel"), Candidate(model="fem-transient", dt=1.0)]
    found = tradeoff(scene, lambda *phase: None, chosen)
    assert found.failures == {chosen[1].name: "not finite"}
    write(tmp_path, scene, found)
    assert "1 part of this result failed" in (tmp_path / "index.html").read_text()
    with pytest.raises(ValueError, match="not finite"):
        tradeoff(scene, lambda *phase: None, chosen[1:])


@pytest.mark.parametrize(
    "body",
    [
        "material = { density_kg_m3 = 1000, shear_modulus_pa = 2e4, poisson = 0.49 }",
        "kind = 'palm'",
        "kind = 'sheet'",
        "kind = 'sheet'\nmaterial = 'paper-grain'\nair = true",
    ],
)
def test_every_candidate_takes_its_scene(body):
    scene = loads(f"[tacton]\nam_frequency_hz = 140\n[body]\n{body}")
    assert [c.model for c in candidates(scene) if not takes(named(c.model), scene)] == []


def test_tradeoff_needs_a_body():
    with pytest.raises(ValueError, match="sheet or a slab"):
        tradeoff(loads("[body]\nkind = 'none'"), lambda phase, fraction: None)


def test_load_ratios_are_those_of_the_fourier_series():
    found = paper_vs_skin.load_ratios()
    expected = {
        "square of the sound's amplitude": (0.25, 0, 0),
        "contact on one side only": (0.424, 0, 0.085),
        "clipped sound, squared": (0.589, 0.2, 0),
        "square root of the command": (0.2, 0.086, 0.048),
    }
    for name, ratios in expected.items():
        assert found[name] == pytest.approx(ratios, abs=2e-3)


@pytest.mark.slow
def test_ratios_over_amplitude_separate_lines_of_sheet_and_load(tmp_path):
    bodies = {
        "paper-sheet-loose": replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06),
        "skin-slab": Body(width=0.042, height=0.042, depth=0.01, sides="clamped"),
    }
    still = [("am140", Tacton(am_frequency=140, trajectory=Trajectory()))]
    given = {"patterns": still, "bodies": bodies, "duration": 0.2, "amplitudes": (0.25, 1.0)}
    found = paper_vs_skin.paper_vs_skin(lambda phase, done: None, h=0.0075, **given)
    for body in ("loose sheet", "skin slab"):
        assert max(found.ratios[f"{body}: linear load"]) < 1e-5
        quiet, loud = found.ratios[f"{body}: squared load"]
        assert quiet == pytest.approx(loud, rel=1e-3)
    quiet, loud = found.ratios["loose sheet: squared load, stretching"]
    assert abs(loud / quiet - 1) > 0.05
    paper_vs_skin.report(found).write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"index.html", "amplitude.png", "lines.csv", "ratios.csv"}
