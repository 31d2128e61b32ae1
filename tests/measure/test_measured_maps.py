"""Measured places on the maps of a comparison."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import MovingPressure, Tacton
from simple_model.quantities import PRESSURE, quantity
from skinwave.measure.comparison import measured_places
from skinwave.measure.lines import MeasuredLines
from skinwave.report.maps import MeasuredPlaces, surfaces_figure
from skinwave.results.surface import SurfaceField
from skinwave.scene.scene import BODIES, Scene

SCENE = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=BODIES["skin-slab"],
    probes=((0.0, 0.0), (0.004, 0.002), (0.02, 0.0)),
)  # fmt: skip


def test_lines_of_a_velocity_are_read_as_displacement():
    """2 sin and 3 cos: RMS sqrt((4 + 9) / 2) micrometre."""
    f = np.array([140.0, 280.0])
    moved = 1e-6 * np.array([[2j, 0, 1], [3, 0, 0]])
    velocity = 2j * np.pi * f[:, None] * moved
    lines = MeasuredLines(frequencies=f, each=velocity[None], variance=np.full((2, 3), np.nan),
                          freedom=2.0, shifts=np.zeros(1))  # fmt: skip

    class Comparison:
        scene, measurement = SCENE, type("M", (), {"record": quantity("velocity")})

    Comparison.lines = lines
    found = measured_places(Comparison)
    assert found.rms == pytest.approx(1e-6 * np.sqrt([6.5, 0, 0.5]))
    np.testing.assert_array_equal(found.places, SCENE.probe_points)


def test_places_have_the_colour_of_the_map_and_none_on_a_pressure():
    x = np.linspace(-0.01, 0.01, 21)
    r = np.hypot(*np.meshgrid(x, x))
    body = SurfaceField(x=x, y=x, rms=1e-6 * np.exp(-r / 0.005))
    kernel = replace(body, rms=1e7 * body.rms**1.5, quantity=PRESSURE)
    rms = 2e-6 * np.array([1.0, np.exp(-np.hypot(4, 2) / 5), 0.3])
    measured = MeasuredPlaces(places=SCENE.probe_points, rms=rms)
    figure = surfaces_figure(SCENE, {"point-kernel": kernel, "skin-slab": body}, measured=measured)
    bare, marked = (
        next(c for c in ax.collections if hasattr(c, "get_sizes") and len(c.get_offsets()) > 1)
        for ax in figure.axes[:2]
    )
    for squares in (bare, marked):  # the third place is beyond the map
        assert squares.get_offsets().data == pytest.approx(1e3 * SCENE.probe_points[:2])
    assert bare.get_array() is None
    image = figure.axes[1].images[0]
    assert image.colorbar.extend == "max"
    marked.update_scalarmappable()
    np.testing.assert_allclose(marked.get_facecolors(), image.cmap(image.norm(1e6 * rms[:2])))
