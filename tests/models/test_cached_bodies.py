"""Reduced bodies in the cache: the same again, and never those of another body."""

import json
from dataclasses import replace

import numpy as np
import pytest
from corpus import FREE, SHORT

import fem
from meshes import cache
from meshes.records import decode, encode
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, prepare
from skinwave.planning.plan import plan
from skinwave.planning.simulate import solve
from skinwave.scene.file import loads


def test_a_prepared_body_comes_from_the_cache_unchanged(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    scene = loads(SHORT)
    phases = []
    options = SolveOptions(h=0.012, progress=lambda phase, _: phases.append(phase))
    first = answer(prepare(scene, options), scene)
    assert "reduce" in phases
    phases.clear()
    again = answer(prepare(scene, options), scene)
    assert phases == ["mesh"]
    np.testing.assert_array_equal(first.displacement, again.displacement)
    prepare(scene, replace(options, h=0.008))
    assert "reduce" in phases  # another mesh is another entry


def test_records_are_read_back_exactly_and_only_from_our_own_types():
    branch, arrays = fem.MaxwellBranch(K=np.eye(2) / 3, time=0.1), {}
    record = {"branches": (branch, None), ("a", 1): [2.5 - 1j, True, np.float64(0.1)]}
    structure = json.loads(json.dumps(encode(record, arrays)))
    again = decode(structure, arrays)
    np.testing.assert_array_equal(again["branches"][0].K, branch.K)
    assert again["branches"][0].time == 0.1
    assert again["a", 1] == [2.5 - 1j, True, 0.1]
    with pytest.raises(ValueError, match="subprocess"):
        decode({"record": "subprocess:Popen", "items": []}, {})
    with pytest.raises(TypeError):
        encode(print, {})


def test_the_key_of_a_body_holds_solver_options_and_shapes(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    scene = loads(SHORT)

    def made(symmetry="", reduction=None, **options):
        before = len(list(tmp_path.glob("*.npz")))
        prepare(scene, SolveOptions(h=0.01, **options), symmetry=symmetry, reduction=reduction)
        return len(list(tmp_path.glob("*.npz"))) > before

    assert made()
    assert not made(solver=fem.available()[0])  # what auto is
    assert made(solver="superlu") == (fem.available()[0] != "superlu")
    assert made(reduction=5e-3)
    assert made(symmetry="x")
    assert not made()
    x = np.arange(6.0)
    assert len({cache.key(a) for a in (x, x.reshape(2, 3), x.view(np.int64))}) == 3


def test_a_plan_is_the_same_again_with_and_without_a_cache(monkeypatch, tmp_path):
    scene, found = FREE, []
    for folder in ("one", "one", ""):
        monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / folder) if folder else "")
        found.append(solve(scene, plan(scene, SolveOptions(tolerance=0.2))))
    for other in found[1:]:
        assert cache.digest(other.values) == cache.digest(found[0].values)
        assert other.effort.mesh == found[0].effort.mesh
        assert other.expected_error == found[0].expected_error
