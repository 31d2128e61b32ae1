"""What pages state of a run follows from its scene."""

import numpy as np
import pytest

from simple_model import MovingPressure, Response, Tacton, Trajectory
from skinwave.run import Run
from skinwave.scene import BODIES, Body, Layer, Scene
from skinwave.studies.claims import evaluate
from skinwave.studies.description import modelled

LAYERS = (Layer(thickness=1e-3, material="dermis"),)
CIRCLE = Trajectory(shape="circle", size=0.02, speed=12.0)


def run(body, drive="pressure_squared", **tacton):
    pressure = MovingPressure(tacton=Tacton(duration=0.5, **tacton), drive=drive)
    scene = Scene(pressure=pressure, body=body)
    times = np.arange(5000) / 1e4
    motion = 1e-6 * np.sin(2 * np.pi * 140 * times)[:, None] * np.ones(len(scene.probes))
    response = Response(model="fem", times=times, probes=scene.probe_points, displacement=motion)
    return Run(tacton="one", body=body.kind, scene=scene, response=response)


@pytest.mark.parametrize(
    ("body", "stated", "absent"),
    [
        (BODIES["palm"], "Left out: layers.", "sheet"),
        (BODIES["skin-slab"], "Left out: layers and curvature.", "sheet"),
        (Body(layers=LAYERS), "; above it 1 mm of dermis. Left out: curvature.", "layers"),
        (BODIES["paper-sheet"], "The mesh is a thicker sheet", "curvature"),
    ],
)
def test_what_is_left_out_is_that_of_the_body(body, stated, absent):
    sentence = modelled([run(body)])[0]
    assert stated in sentence
    assert absent not in sentence


def test_a_drive_law_that_was_not_used_is_not_named():
    squared, corrected = (
        " ".join(modelled([run(BODIES["palm"], drive, am_frequency=140)]))
        for drive in ("pressure_squared", "force_corrected")
    )
    assert "pressure_squared" in squared
    assert "pressure_squared" not in corrected
    assert "force_corrected" in corrected


@pytest.mark.parametrize(
    "tones",
    [
        {"am_frequency": 140, "second_am_frequency": 200, "superposition": (0.0, 1.0)},
        {"second_am_frequency": 200, "superposition": (0.0, 1.0), "trajectory": CIRCLE},
        {"am_frequency": 140, "superposition": (0.0, 1.0)},
        {"am_frequency": 140, "envelope_frequency": 10},
    ],
)
def test_statements_on_one_tone_are_not_judged_by_others(tones):
    assert evaluate([run(BODIES["skin-slab"], **tones)]) == []
    assert evaluate([run(BODIES["skin-slab"], am_frequency=140)])
