"""Sheets at large deflection by von Karman's plate in its modes, as a model of scenes."""

import numpy as np

from skinwave.planning.simulate import compute
from skinwave.results.comparison import compare
from skinwave.scene.file import loads

NAME = "plate-modes-nonlinear"
SHEET = """
[tacton]
am_frequency_hz = 140
duration_s = 0.02
shape = "circle"
size_mm = 8
speed_m_per_s = 5
[focus]
peak_pressure_pa = PRESSURE
[body]
kind = "sheet"
material = "paper"
size_x_mm = 30
size_y_mm = 30
thickness_mm = 0.1
[body.mounting]
edges = ["left", "right"]
[probes]
points_mm = [[0, 0], [4, 0]]
"""


def scene(pressure, quantity="displacement", air=True):
    text = SHEET.replace("PRESSURE", str(pressure)).replace(
        "[probes]", f"[probes]\nquantity = '{quantity}'"
    )
    return loads(
        text.replace("thickness_mm = 0.1", "thickness_mm = 0.1\nair = true") if air else text
    )


def test_a_sheet_that_hardly_bends_moves_linearly():
    weak = scene(0.01, "acceleration")
    found, linear = (compute(weak, name).values for name in (NAME, "plate-modes-transient"))
    assert np.abs(found - linear).max() < 1e-5 * np.abs(linear).max()


def test_a_sheet_that_bends_far_stretches():
    """Beside elements, within what both state: at 0.7 thicknesses the linear motion is more than
    twice as large.
    """
    strong = scene(20, air=False)
    found, elements, linear = (
        compute(strong, name) for name in (NAME, "fem-nonlinear", "plate-modes-transient")
    )
    stated = found.expected_error + elements.expected_error
    assert compare(elements, found).relative_l2.max() < stated < 0.08
    assert compare(elements, linear).relative_l2.max() > 10 * stated
