"""Palms whose thickness is free: one mesh stretched over the range, one reduced body for all."""

from dataclasses import replace

import numpy as np
import pytest
from flat_palms import FLAT, grid, measures, rounded_slab
from test_parametric import full_lines, scene_of

import meshes
import skinwave
from fem.affine_model import line_errors
from meshes import MeshError, jacobian_ratios, mapped_palm, stretched_palm
from meshes.shapes.palm import level_set
from skinwave.bodies.build import build
from skinwave.models import free_bodies, parametric
from skinwave.models.free_bodies import affine_operators, build_at, geometry_shares
from skinwave.models.free_keys import free_keys, with_values
from skinwave.models.reduced import answer as own_answer
from skinwave.models.reduced import prepare as own_body
from skinwave.scene.scene import BODIES, Layer, Relief

PALM, KEY, COAT = BODIES["palm"], "body.thickness_mm", "body.layers.0.thickness_mm"
H = 12e-3
COATED = replace(PALM, layers=(Layer(thickness=0.27e-3, material="epidermis"),))


def stretched(palm, thickest, cell=5e-3):
    x, y, z = grid(thickest, cell)
    mesh = mapped_palm(palm, x, y, z * (palm.thickness / thickest.thickness))
    return stretched_palm(mesh, palm, thickest)


def test_a_stretched_palm_has_the_volume_and_area_of_its_thickness():
    of = stretched(FLAT, replace(FLAT, thickness=0.020))
    for thickness in (0.015, 0.0162, 0.0185, 0.020):
        found, expected = measures(of(thickness)), rounded_slab(replace(FLAT, thickness=thickness))
        assert found == pytest.approx(expected, rel=2e-3)


def test_nodes_of_a_stretched_palm_are_on_the_surface_of_each_thickness():
    palm = PALM.palm
    of = stretched(palm, replace(palm, thickness=0.020))
    for thickness in (0.0155, 0.0172, 0.0195):
        mesh = of(thickness)
        outer = np.unique(meshes.boundary_facets(mesh.tets))
        off = np.abs(level_set(replace(palm, thickness=thickness), mesh.points[outer]))
        assert off.max() < 2e-6
        assert jacobian_ratios(mesh.points, mesh.tets).min() > 0.3
    assert np.array_equal(of(palm.thickness).points, mesh.unmoved)


def test_a_palm_is_not_stretched_to_what_it_does_not_reach():
    mesh = mapped_palm(FLAT, *grid(FLAT, 5e-3))
    with pytest.raises(MeshError, match="narrower range"):
        stretched_palm(mesh, FLAT, replace(FLAT, thickness=0.4))
    thin = replace(PALM, relief=replace(PALM.relief, edge_radius=1e-3))
    with pytest.raises(ValueError, match="give all lengths of .body.relief."):
        parametric._range(thin, free_keys(thin, {KEY: (5.0, 60.0)}), 5e-3)
    given = {name: value for name, value in vars(thin.palm).items() if name in vars(thin.relief)}
    thin = replace(thin, relief=Relief(**given))
    free = free_keys(thin, {KEY: (5.0, 60.0)})
    with pytest.raises(ValueError, match="narrow"):
        parametric._range(thin, free, 5e-3)


def error_between(monkeypatch, count):
    """Largest error of the stiffness of a palm's tissue between so many geometries, over its
    largest entry.
    """

    def stiffness(at):
        return affine_operators(bodies.body(at), build_at(bodies, at)).of("stiffness")[0]

    monkeypatch.setattr(free_bodies, "SMOOTH", count)
    keys = free_keys(PALM, {KEY: (14.0, 20.0)})
    bodies = parametric._range(PALM, keys, H)
    assert len(bodies.geometries) == count
    known = [stiffness(each) for each in bodies.geometries]
    found = []
    for value in (15.1, 17.3):
        at = [keys[0].share(value)]
        shares = geometry_shares(bodies, bodies.body(at))
        assert shares.sum() == pytest.approx(1)
        K = stiffness(at)
        between = sum(s * each for s, each in zip(shares, known, strict=True))
        found.append(abs(between - K).max() / abs(K).max())
    return max(found)


@pytest.mark.slow
def test_matrices_between_thicknesses_converge_geometrically(monkeypatch):
    by_count = [error_between(monkeypatch, count) for count in (5, 7, 9)]
    assert by_count[1] < by_count[0] / 5
    assert by_count[2] < by_count[1] / 5
    assert by_count[1] < 1e-4, "more would act against the bulk modulus"


def assert_lines_are_those_of_the_full_body(scene, prepared, values, discretise=None):
    body = with_values(scene.body, prepared.keys, values)
    frequencies, found = parametric.lines(prepared, values)
    strong = np.argsort(-np.linalg.norm(found, axis=1))[:2]
    made = build(body, H, "", discretise)
    expected = full_lines(scene, body, frequencies[strong], made=made)
    assert line_errors(found[strong], expected).max() < 0.01


@pytest.mark.slow
def test_lines_of_a_thickness_are_those_of_the_full_body():
    scene = scene_of(PALM)
    prepared = skinwave.prepare(scene, {KEY: (14.0, 18.0)}, 0.02, h=H)
    for thickness in (14.0, 17.6):
        moved = prepared.bodies.moved
        assert_lines_are_those_of_the_full_body(scene, prepared, {KEY: thickness}, moved)
    waveforms = parametric.answer(prepared, {KEY: thickness})
    body = with_values(PALM, prepared.keys, {KEY: thickness})
    own = own_body(body, scene.probe_points, h=H, discretise=moved)
    expected = own_answer(own, scene).displacement
    assert np.abs(waveforms.displacement - expected).max() < 0.02 * np.abs(expected).max()


@pytest.mark.slow
def test_the_thickness_of_a_coat_is_free():
    scene = scene_of(COATED)
    prepared = skinwave.prepare(scene, {COAT: (0.15, 0.4)}, 0.02, h=H)
    for thickness in (0.15, 0.37):
        assert_lines_are_those_of_the_full_body(scene, prepared, {COAT: thickness})


def test_thicknesses_that_elements_do_not_follow_are_refused():
    layered = replace(PALM, layers=(Layer(thickness=5e-3, material="fat"),))
    with pytest.raises(ValueError, match="thinner than half"):
        skinwave.prepare(scene_of(layered), {KEY: (14.0, 16.0)})
    with pytest.raises(ValueError, match="2 thicknesses of a palm are free, the limit is 1"):
        free_keys(COATED, {KEY: (14.0, 16.0), COAT: (0.2, 0.3)})
