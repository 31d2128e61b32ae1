"""Natural frequencies of thin sheets, whose thickness is a million times as stiff as their bend."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import fem
import meshes

static = import_module("fem.static")  # fem.static is its function
A5 = (0.148, 0.210)
MOST_SOLUTIONS = 3000  # in which modes are found, or are not


@pytest.fixture
def counted(monkeypatch):
    """Solutions are counted, and end by an error where they would not end."""
    solved = []
    factorise = static.factorise

    def counting(A, **options):
        factor = factorise(A, **options)

        def solve(b):
            solved.append(1)
            assert len(solved) < MOST_SOLUTIONS
            return factor.solve(b)

        return replace(factor, solve=solve)

    monkeypatch.setattr(static, "factorise", counting)
    return solved


def sheet(thickness, fixed, h=14e-3):
    mesh = meshes.sheet(*A5, thickness, h)
    fixed = dict.fromkeys(fixed, "xyz") or np.zeros(mesh.points.shape, bool)
    return fem.assemble(mesh, fem.PRESETS["paper"], fixed=fixed)


def test_modes_of_a_sheet_of_paper_held_at_two_edges(counted):
    operators = sheet(1e-4, ("left", "right"))
    assert len(operators.free) > 6000
    found, shapes = fem.modes(operators, 6)
    expected = np.sqrt(eigsh(operators.K, 6, M=operators.M, sigma=0)[0]) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    kept = shapes[operators.free]
    np.testing.assert_allclose(kept.T @ (operators.M @ kept), np.eye(6), atol=1e-6)
    assert len(counted) < 200


@pytest.mark.slow
def test_a_sheet_of_paper_that_floats_bends_a_tenth_as_fast_as_one_ten_times_as_thick(counted):
    thin, thick = (fem.modes(sheet(thickness, (), 21e-3), 10)[0] for thickness in (1e-4, 1e-3))
    assert (thin[:6] < 0.2).all()
    np.testing.assert_allclose(thin[6:], thick[6:] / 10, rtol=0.01)


def test_modes_that_do_not_converge_are_refused(monkeypatch):
    monkeypatch.setattr(static, "MOST_RESTARTS", 1)
    with pytest.raises(
        fem.Diverged, match="8 lowest modes did not converge in 1 restarts.*constrain it"
    ):
        fem.modes(sheet(1e-4, ()), 8)
