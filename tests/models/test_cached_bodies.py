"""Reduced bodies: in the cache, the same again; and half of a body for probes on its plane."""

import json
from dataclasses import replace

import numpy as np
import pytest
from corpus import FREE, SHORT

import fem
from fem.linear_solver import factorise
from meshes import cache
from meshes.records import decode, encode
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.bodies import Body
from skinwave.bodies.build import build, operators
from skinwave.models import meshed, reduced, symmetry
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.models.symmetry import axes_of_probes
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.scene.file import loads
from skinwave.scene.scene import Scene

PATH = Trajectory(shape="circle", size=0.02, speed=8)
CIRCLE = Tacton(am_frequency=140, duration=0.1, trajectory=PATH)
SLAB = Body(kind="slab", width=0.06, height=0.05, depth=0.01, material="palm")
SHEET = Body(kind="sheet", width=0.08, height=0.06, material="paper", base="free", sides="clamped",
             depth=1e-4)  # fmt: skip
IN_AIR = replace(SHEET, air=True)
ON_X = ((0.0, 0.0), (0.007, 0.0), (-0.012, 0.0))


def test_a_prepared_body_comes_from_the_cache_unchanged(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    scene = loads(SHORT)
    phases = []
    options = SolveOptions(h=0.012, progress=lambda phase, _: phases.append(phase))
    first = answer(reduce_scene(scene, options), scene)
    assert "reduce" in phases
    phases.clear()
    again = answer(reduce_scene(scene, options), scene)
    assert phases == ["mesh"]
    np.testing.assert_array_equal(first.displacement, again.displacement)
    reduce_scene(scene, replace(options, h=0.008))
    assert "reduce" in phases  # another mesh is another entry


@pytest.mark.parametrize("stiffer", [0.1, 4.0])
def test_the_expansion_point_follows_the_lowest_natural_frequency(stiffer, monkeypatch):
    """Frequencies follow the speed of shear waves over the depth."""
    shear = stiffer * SLAB.solid.shear_modulus
    soft = replace(SLAB.solid, shear_modulus=shear, viscosity=SLAB.solid.viscosity * stiffer**0.5)
    body = replace(SLAB, material=soft)
    points = [meshed.expansion_point(each, build(each, 0.008)) for each in (SLAB, body)]
    assert points[1] == pytest.approx(points[0] * np.sqrt(stiffer), rel=1e-6)
    monkeypatch.setenv("SKINWAVE_CACHE", "")
    scene = Scene(pressure=MovingPressure(tacton=CIRCLE), body=body, probes=ON_X)
    found = reduce_scene(scene, SolveOptions(h=0.008)).effort.reduced_dofs
    monkeypatch.setattr(meshed, "expansion_point", lambda *_: points[0])
    assert found < reduce_scene(scene, SolveOptions(h=0.008)).effort.reduced_dofs


def test_a_body_with_many_probes_is_reduced_for_its_path():
    few = Scene(pressure=MovingPressure(tacton=CIRCLE), body=SLAB, probes=ON_X)
    places = np.random.default_rng(0).uniform(-0.015, 0.015, (60, 2))
    many = replace(few, probes=ON_X + tuple(map(tuple, places.tolist())))
    options = SolveOptions(h=0.012, tolerance=0.015)
    body = reduce_scene(many, options, own_path=True)
    assert body.effort.reduced_dofs < reduce_scene(many, options).effort.reduced_dofs / 2
    found, expected = (
        answer(b, s).values for b, s in ((body, many), (reduce_scene(few, options), few))
    )
    size = np.linalg.norm(expected, axis=0)
    assert (np.linalg.norm(found[:, :3] - expected, axis=0) < 3e-3 * size).all()
    other = replace(CIRCLE, trajectory=replace(PATH, size=0.01))
    with pytest.raises(ValueError, match="path of another focus"):
        answer(body, replace(many, pressure=MovingPressure(tacton=other)))


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
        reduce_scene(scene, SolveOptions(h=0.01, **options), symmetry=symmetry, reduction=reduction)
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
        found.append(solve_as_planned(scene, plan(scene, SolveOptions(tolerance=0.2))))
    for other in found[1:]:
        assert cache.digest(other.values) == cache.digest(found[0].values)
        assert other.effort.mesh == found[0].effort.mesh
        # Of a coarser mesh as well, whose sums differ by round-off if threads share them otherwise.
        assert other.expected_error == pytest.approx(found[0].expected_error, rel=1e-9)


def motions(monkeypatch, body, probes, h):
    scene, found = Scene(pressure=MovingPressure(tacton=CIRCLE), body=body, probes=probes), []
    for axes in (axes_of_probes, lambda probes, among: ""):
        monkeypatch.setattr(symmetry, "axes_of_probes", axes)
        made = reduced.reduce_scene(scene, SolveOptions(h=h), reduction=1e-6)
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
        monkeypatch.setattr(symmetry, "axes_of_probes", axes)
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
