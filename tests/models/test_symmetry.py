"""Half of a body for probes on its plane of symmetry, under loads that have none."""

from dataclasses import replace

import numpy as np
import pytest

from fem.linear_solver import factorise
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.bodies import Body
from skinwave.bodies.build import build, operators
from skinwave.models import meshed, reduced
from skinwave.models.meshed import axes_of_probes
from skinwave.models.options import SolveOptions
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Scene

PATH = Trajectory(shape="circle", size=0.02, speed=8)
CIRCLE = Tacton(am_frequency=140, duration=0.1, trajectory=PATH)
SLAB = Body(kind="slab", width=0.06, height=0.05, depth=0.01, material="palm")
SHEET = Body(kind="sheet", width=0.08, height=0.06, material="paper", base="free", sides="clamped",
             depth=1e-4)  # fmt: skip
IN_AIR = replace(SHEET, air=True)
ON_X = ((0.0, 0.0), (0.007, 0.0), (-0.012, 0.0))


def motions(monkeypatch, body, probes, h):
    scene, found = Scene(pressure=MovingPressure(tacton=CIRCLE), body=body, probes=probes), []
    for axes in (axes_of_probes, lambda probes, among: ""):
        monkeypatch.setattr(meshed, "axes_of_probes", axes)
        made = reduced.prepare(scene, SolveOptions(h=h), reduction=1e-6)
        found.append(reduced.answer(made, scene))
    return found


@pytest.mark.parametrize(
    ("body", "probes", "h", "share"),
    [
        (SLAB, ON_X, 5e-3, 0.6),
        (SLAB, ((0.0, 0.0),), 5e-3, 0.4),
        (SHEET, ON_X, 4e-3, 0.6),
        (IN_AIR, ON_X, 5e-3, 0.6),
    ],
)
def test_probes_on_a_plane_need_only_the_even_part(monkeypatch, body, probes, h, share):
    part, whole = motions(monkeypatch, body, probes, h)
    assert part.effort.dofs < share * whole.effort.dofs
    error = np.abs(part.displacement - whole.displacement).max()
    assert error < 1e-4 * np.abs(whole.displacement).max()  # above the band of the reductions


def test_lines_are_solved_on_the_even_part(monkeypatch):
    scene, found = Scene(pressure=MovingPressure(tacton=CIRCLE), body=SLAB, probes=ON_X), []
    for axes in (axes_of_probes, lambda probes, among: ""):
        monkeypatch.setattr(meshed, "axes_of_probes", axes)
        found.append(compute(scene, "fem-harmonic", h=0.01))
    part, whole = found
    assert part.effort.dofs < 0.6 * whole.effort.dofs
    error = np.abs(part.displacement - whole.displacement).max()
    assert error < 1e-9 * np.abs(whole.displacement).max()
    assert part.effort.energy_imbalance < 1e-9


def test_half_of_a_coarse_disc_is_factorised():
    disc = Body(kind="disc", width=0.03, height=0.03, depth=0.01, material="ecoflex")
    K = operators(build(disc, 0.0106, "y")).K
    b = np.ones(K.shape[0])
    np.testing.assert_allclose(K @ factorise(K).solve(b), b, atol=1e-6)
