"""Damping and relaxing stiffness as combinations of K and M."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
from fem.boundary import Support
from fem.load_and_probe import facet_points

PALM = fem.PRESETS["palm"]
LOSSY = replace(PALM, loss_factor=0.2)


def block(material):
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    below = np.linspace(0, 2e7, len(facet_points(mesh, "bottom")))
    rest = Support(facets=mesh.facets["bottom"], stiffness=below, absorbed=0 * below)
    given = {"fixed": {}, "absorbing": "sides", "support": rest}
    halves = replace(mesh, region=np.arange(len(mesh.tets)) % 2)
    alike = fem.assemble(halves, {0: material, 1: material}, **given)
    return mesh, fem.assemble(mesh, material, **given), alike


def same(one, other):
    return abs(one - other).max() < 1e-10 * abs(other).max()


@pytest.mark.parametrize("material", [LOSSY, fem.PRESETS["palm-zener"]])
def test_combinations_equal_matrices_assembled_part_by_part(material):
    material = replace(material, poisson=0.45)
    _, one, parts = block(material)
    assert one.laws
    assert one.laws.damping.rest.nnz
    for name in "KCMR":
        assert same(getattr(one, name), getattr(parts, name))
    assert [b.time for b in one.branches] == [b.time for b in parts.branches]
    assert all(same(a.K, b.K) for a, b in zip(one.branches, parts.branches, strict=True))


@pytest.mark.parametrize("material", [PALM, LOSSY])
def test_moments_by_combinations_equal_those_by_products(material):
    mesh, ops, _ = block(material)
    S = fem.probe_operator(mesh, [[0.0, 0.0], [0.004, 0.001]])
    F = fem.load_operator(mesh) @ np.random.default_rng(0).random((len(facet_points(mesh)), 3))
    found, plain = (
        fem.reduce(each, S, 500.0, 1e-3, loads=F) for each in (ops, replace(ops, laws=None))
    )
    assert found.moments == plain.moments
    one, other = (
        fem.transfer(model, model.basis.T @ F, [10.0, 250.0, 500.0]) for model in (found, plain)
    )
    np.testing.assert_allclose(one, other, atol=1e-8 * np.abs(other).max())
    assert not np.delete(found.basis, ops.free, axis=0).any()
    basis, projected = found.basis[ops.free], found.operators
    pairs = [(getattr(ops, name), getattr(projected, name)) for name in "KCMR"]
    pairs += [(a.K, b.K) for a, b in zip(ops.branches, projected.branches, strict=True)]
    for full, small in pairs:
        np.testing.assert_allclose(basis.T @ (full @ basis), small, atol=1e-9 * np.abs(small).max())
