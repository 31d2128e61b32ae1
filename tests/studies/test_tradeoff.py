"""The trade-off of models: error beside measured cost."""

from dataclasses import replace

import numpy as np
import pytest
from corpus import SHORT

from skinwave.scene.file import loads
from skinwave.studies.tradeoff import Candidate, study, write


@pytest.mark.slow
@pytest.mark.usefixtures("in_one_process")
def test_tradeoff_ranks_candidates_by_cost_and_error(tmp_path, monkeypatch):
    monkeypatch.setattr("skinwave.studies.tradeoff.FINEST", (1.5, 1.25))
    scene = loads(SHORT)
    scene = replace(scene, body=replace(scene.body, width=0.03, height=0.03, sides="free"))
    chosen = [
        Candidate(model="point-kernel"),
        Candidate(model="fem", h=0.012),
        Candidate(model="fem", h=0.006),
        Candidate(model="fem-transient", h=0.012, dt=2e-3),
    ]
    phases = []
    found = study(scene, lambda phase, fraction: phases.append(phase), chosen)
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


def test_tradeoff_needs_a_body():
    with pytest.raises(ValueError, match="sheet or a slab"):
        study(loads("[body]\nkind = 'none'"), lambda phase, fraction: None)
