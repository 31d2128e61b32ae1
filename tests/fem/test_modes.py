"""Natural frequencies of thin sheets, whose thickness is a million times as stiff as their bend."""

from importlib import import_module

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import fem
import meshes

static = import_module("fem.static")  # fem.static is its function
A5 = (0.148, 0.210)


def sheet(thickness, fixed, h=21e-3):
    mesh = meshes.sheet(*A5, thickness, h)
    fixed = dict.fromkeys(fixed, "xyz") or np.zeros(mesh.points.shape, bool)
    return fem.assemble(mesh, fem.PRESETS["paper"], fixed=fixed)


def test_modes_of_paper_clamped_at_two_edges():
    operators = sheet(1e-4, ("left", "right"))
    found, shapes = fem.modes(operators, 6)
    expected = np.sqrt(eigsh(operators.K, 6, M=operators.M, sigma=0)[0]) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    kept = shapes[operators.free]
    np.testing.assert_allclose(kept.T @ (operators.M @ kept), np.eye(6), atol=1e-6)


@pytest.mark.slow
def test_bending_frequencies_of_free_paper_scale_with_thickness():
    thin, thick = (fem.modes(sheet(thickness, ()), 10)[0] for thickness in (1e-4, 1e-3))
    assert (thin[:6] < 0.2).all()
    np.testing.assert_allclose(thin[6:], thick[6:] / 10, rtol=0.01)


def test_modes_that_do_not_converge_are_refused(monkeypatch):
    monkeypatch.setattr(static, "MOST_RESTARTS", 1)
    with pytest.raises(fem.Diverged, match="constrain it"):
        fem.modes(sheet(1e-4, ()), 8)
