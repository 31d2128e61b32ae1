"""Shared, small: a block of skin and ways to measure orders."""

import os

import numpy as np
import pytest

import meshes


def order(sizes: list[float], errors: list[float]) -> float:
    """Slope of log error against log size."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


@pytest.fixture(scope="session", autouse=True)
def fresh_cache(tmp_path_factory):
    """Tests prepare bodies themselves, whatever this machine prepared before."""
    os.environ["SKINWAVE_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def distorted_cube() -> meshes.TetMesh:
    """A unit cube of ten-node tetrahedra whose inner corners are shaken."""
    straight = meshes.extrude(*[np.linspace(0, 1, 4)] * 3, order=1)
    points = straight.points.copy()
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inner] += np.random.default_rng(3).uniform(-0.08, 0.08, (inner.sum(), 3))
    return meshes.quadratic(
        meshes.TetMesh(points=points, tets=straight.tets, facets=straight.facets)
    )
