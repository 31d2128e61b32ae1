"""Shared, small: a cache of their own, and a body that no element fits well."""

import os

import pytest

import meshes
from skinwave.verify import elements


@pytest.fixture(scope="session", autouse=True)
def fresh_cache(tmp_path_factory):
    """Tests prepare bodies themselves, whatever this machine prepared before."""
    os.environ["SKINWAVE_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def distorted_cube() -> meshes.TetMesh:
    """A unit cube of ten-node tetrahedra whose inner corners are shaken."""
    return elements.distorted_cube()
