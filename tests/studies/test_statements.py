"""Claims of pages about a run follow from its scene."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import MovingPressure, Response, Rhythm, Tacton, Trajectory
from skinwave.report.description import model_paragraphs, scene_rows, unresolved_lines
from skinwave.report.spectra import sensation_levels
from skinwave.results.claims import evaluate
from skinwave.results.files import line_rows
from skinwave.results.run import Run
from skinwave.scene.scene import BODIES, Body, Layer, Placement, Scene
from skinwave.sweeps.measures import result_columns

LAYERS = (Layer(thickness=1e-3, material="dermis"),)
CORNERS = ((-0.01, 0.0), (0.01, 0.0), (0.01, 0.01))
RECORDED = Trajectory(shape="recorded", times=(0, 0.1, 0.25), points=CORNERS, levels=(0, 1, 0.5))
SECOND = {"second_am_frequency": 200, "superposition": (0.25, 0.75)}


def run(body, drive="pressure_squared", **tacton):
    pressure = MovingPressure(tacton=Tacton(duration=0.5, **tacton), drive=drive)
    scene = Scene(pressure=pressure, body=body)
    times = np.arange(5000) / 1e4
    motion = 1e-6 * np.sin(2 * np.pi * 140 * times)[:, None] * np.ones(len(scene.probes))
    response = Response(model="fem", times=times, probes=scene.probe_points, values=motion)
    return Run(tacton="one", body=body.kind, scene=scene, response=response)


def test_pages_name_the_drive_law():
    for drive in ("pressure_squared", "force_corrected"):
        said = " ".join(model_paragraphs([run(BODIES["palm"], drive, am_frequency=140)]))
        assert drive.replace("_", " ") in said
        assert ("pressure squared" in said) == (drive == "pressure_squared")


@pytest.mark.parametrize(
    "tones",
    [
        {"am_frequency": 140, "second_am_frequency": 200, "superposition": (0.0, 1.0)},
        {"am_frequency": 140, "envelope_frequency": 10},
    ],
)
def test_claims_need_a_single_tone(tones):
    assert evaluate([run(BODIES["skin-slab"], **tones)]) == []
    assert evaluate([run(BODIES["skin-slab"], am_frequency=140)])


def at_the_focus(seconds, **tacton):
    """A made-up motion of 2 um at f_AM, 1 um at twice it and 3 um in the mean."""
    one = run(BODIES["skin-slab"], **tacton)
    times = np.arange(round(seconds * 1e4)) / 1e4
    angle = 2 * np.pi * tacton["am_frequency"] * times
    motion = 1e-6 * (3 + 2 * np.sin(angle) + np.cos(2 * angle))[:, None] * np.ones(5)
    response = replace(one.response, times=times, values=motion)
    pressure = replace(one.scene.pressure, tacton=Tacton(duration=seconds, **tacton))
    return replace(one, scene=replace(one.scene, pressure=pressure), response=response)


def test_unresolved_lines_are_not_reported():
    short, long = at_the_focus(0.5, am_frequency=2), at_the_focus(2.0, am_frequency=2)
    assert short.frequencies == short.lines == sensation_levels(short, 0) == {}
    assert short.unresolved == ("f_AM", "2f_AM", "3f_AM", "4f_AM", "5f_AM")
    assert list(line_rows(short)) == []
    assert "5 lines" in unresolved_lines([short])[0]
    assert evaluate([short]) == []
    assert long.unresolved == ()
    assert unresolved_lines([long]) == []
    assert long.lines["f_AM"][0] == pytest.approx(2e-6, rel=1e-3)
    assert long.lines["2f_AM"][0] == pytest.approx(1e-6, rel=1e-3)
    row = result_columns(short.scene, short.response)
    assert not [name for name in row if name.startswith(("f_AM", "2f_AM"))]


def test_lines_next_to_unresolved_ones_are_not_assessed():
    """The path of 141 Hz is too near to 140 Hz, and 282 Hz to 280."""
    near = Trajectory(shape="circle", size=0.02, speed=0.02 * np.pi * 141)
    one = at_the_focus(0.5, am_frequency=140, trajectory=near)
    assert {"f_AM", "f_d", "2f_d-f_AM", "f_d-f_AM"} <= set(one.unresolved)
    assert "5f_AM" in one.unresolved
    assert one.frequencies == {}
    assert evaluate([one]) == []
    row = result_columns(one.scene, one.response)
    assert "5f_AM_um" not in row
    assert not {"level_db", "sensation_line"} & row.keys()


def test_scene_rows_describe_the_tacton():
    pulses = Rhythm(pulses=((0.03, 0.02),), ramp=0.005)
    for tacton, row, numbers in (
        ({"am_frequency": 80, **SECOND}, "amplitude modulation", "80 200 0.25 0.75"),
        ({"trajectory": RECORDED}, "focus", "0.25"),
        ({"amplitude": 0.5, "rhythm": pulses}, "amplitude", "50 50 5"),
    ):
        said = dict(scene_rows(run(BODIES["skin-slab"], **tacton).scene))[row]
        assert set(numbers.split()) <= set(said.replace(",", "").split())


def test_scene_rows_describe_placement_and_layers():
    place = Placement(tilt_x=np.radians(10), offset=(0.0, 0.005), lift=0.002)
    body = Body(layers=LAYERS, placement=place)
    one = run(body)
    for said in (dict(scene_rows(one.scene))["body"], model_paragraphs([one])[0]):
        assert all(number in said for number in ("1 mm", "10°", "(0, 5, 2) mm"))
