"""Surfaces: their measures, repair, crossings and winding, and what no mesher is given."""

from itertools import combinations
from unittest.mock import Mock

import numpy as np
import pytest

import meshes
from meshes import MeshError, Surface
from meshes.surface import alignment
from meshes.surface.repair import check, repair
from meshes.surface.self_intersection import self_intersections
from meshes.surface.triangulation import volume
from meshes.surface.winding import check_inside, winding_number
from meshes.volume import tetrahedralise as tetra


def cube(side=0.02, at=(0, 0, 0)):
    box = meshes.block((side, side, side), side, order=1)
    surface, _ = repair(box.points, meshes.boundary_facets(box.tets))
    return Surface(points=surface.points + at, triangles=surface.triangles)


def sphere(radius=0.01, n=12):
    lines = [np.linspace(-1, 1, n)] * 3
    box = meshes.extrude(*lines, order=1)
    surface, _ = repair(box.points, meshes.boundary_facets(box.tets))
    along = np.tan(surface.points * np.pi / 4)
    points = radius * along / np.linalg.norm(along, axis=1, keepdims=True)
    return Surface(points=points, triangles=surface.triangles)


def together(*surfaces):
    first = np.cumsum([0, *(len(s.points) for s in surfaces)])
    triangles = [s.triangles + n for s, n in zip(surfaces, first, strict=False)]
    return Surface(points=np.vstack([s.points for s in surfaces]), triangles=np.vstack(triangles))


def open_sphere():
    whole = sphere()
    low = whole.points[whole.triangles].mean(axis=1)[:, 2] < 0.008
    return Surface(points=whole.points, triangles=whole.triangles[low])


def pinched():
    pair = together(cube(), cube(at=(0.02, 0.02, 0.02)))
    return repair(pair.points, pair.triangles)[0]


def mixed():
    whole = sphere()
    triangles = np.array(whole.triangles)
    triangles[::3] = triangles[::3, ::-1]
    return Surface(points=whole.points, triangles=triangles)


def soup():
    whole = sphere()
    points = whole.points[whole.triangles].reshape(-1, 3)
    return Surface(points=points, triangles=np.arange(len(points)).reshape(-1, 3))


def doubled():
    whole = sphere()
    return Surface(points=whole.points, triangles=np.vstack([whole.triangles, whole.triangles[:5]]))


def degenerate():
    whole = sphere()
    a, b, _ = whole.triangles[0]
    return Surface(points=whole.points, triangles=np.vstack([whole.triangles, [[a, b, b]]]))


def changed(array, place, value):
    """A sphere with one coordinate or number changed, not made yet."""
    parts = {"points": np.array(SPHERE.points), "triangles": np.array(SPHERE.triangles)}
    parts[array][place] = value
    return lambda: Surface(**parts)


SPHERE = sphere()
FEW = SPHERE.points[:3]
REFUSED = {
    "open at one side": (open_sphere, "open along"),
    "one triangle": (lambda: Surface(points=FEW, triangles=[[0, 1, 2]]), "open along 3 of its 3"),
    "crossing itself": (lambda: together(cube(), cube(at=(0.011, 0.007, 0.003))), "2 separate"),
    "triangles twice": (doubled, "more than two triangles"),
    "mixed orientation": (mixed, "opposite directions"),
    "seen from inside": (
        lambda: Surface(points=SPHERE.points, triangles=SPHERE.triangles[:, ::-1]), "encloses -"),
    "touching at a point": (pinched, "touch at 1 single"),
    "no number": (changed("points", (7, 1), np.nan), "first point 7"),
    "no triangles": (lambda: Surface(points=FEW, triangles=np.zeros((0, 3), int)), "n > 0"),
    "number too large": (changed("triangles", (3, 0), 10**6), "from 0 to 1000000"),
    "numbers with fractions": (lambda: Surface(points=FEW, triangles=[[0, 1, 1.5]]), "whole"),
}  # fmt: skip


@pytest.fixture
def no_mesher(monkeypatch, tmp_path):

    monkeypatch.setattr(tetra, "_run", Mock(side_effect=AssertionError("the mesher was started")))
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


def test_invalid_surfaces_do_not_reach_the_mesher(no_mesher):
    for make, said in REFUSED.values():
        with pytest.raises(MeshError, match=said) as error:
            meshes.tetrahedralise(make(), 3e-3)
        assert "\n" not in str(error.value)


def test_invalid_options_do_not_reach_the_mesher(no_mesher):
    for options, said in [
        ({"h": 1.0}, "h = 1.0 m"),
        ({"h": float("nan")}, "h = nan m"),
        ({"h": 1.2e-4}, "1,000,000"),
        ({"timeout": float("inf")}, "timeout = inf s"),
        ({"sizing": lambda points: points}, "shape"),
        ({"sizing": lambda points: points[:, 0]}, "least size = -"),
    ]:
        with pytest.raises(MeshError, match=said):
            meshes.tetrahedralise(cube(), **({"h": 5e-3} | options))


def test_a_sheet_is_too_thin_for_the_mesher(no_mesher):
    sheet = meshes.sheet(0.1, 0.1, 1e-4, 0.05, order=1)
    surface, _ = repair(sheet.points, meshes.boundary_facets(sheet.tets))
    with pytest.raises(MeshError, match="mm thick"):
        meshes.tetrahedralise(surface, 5e-3)


def test_common_defects_are_repaired():
    for make in (soup, doubled, degenerate, mixed):
        surface, said = repair(make().points, make().triangles)
        check(surface)
        assert len(said) == 1
        assert volume(surface) == pytest.approx(volume(SPHERE))
        assert len(surface.triangles) == len(SPHERE.triangles)


@pytest.mark.parametrize("gap", [1e-7, 1e-6, 1e-5, 5e-5])
def test_seams_are_welded_or_told_from_holes(gap):
    points, triangles = SPHERE.points, SPHERE.triangles
    left = points[triangles].mean(axis=1)[:, 0] < 0
    apart = np.vstack([points, points + [gap, 0, 0]])
    halves = np.vstack([triangles[left], triangles[~left] + len(points)])
    if gap < 2e-5:
        surface, said = repair(apart, halves)
        check(surface)
        assert volume(surface) == pytest.approx(volume(SPHERE), rel=2 * gap / 0.01)
        assert f"up to {1e6 * gap:.2g} um wide" in said[0]
        return
    with pytest.raises(MeshError, match="a seam about 50 um wide") as error:
        repair(apart, halves)
    assert "--cap" not in str(error.value)
    with pytest.raises(MeshError, match="--cap"):
        repair(points, triangles[left])


def test_sound_surfaces_do_not_cross_themselves():
    for surface in (SPHERE, cube()):
        assert not len(self_intersections(surface))
        far = Surface(points=surface.points + 1e3, triangles=surface.triangles)
        assert not len(self_intersections(far))


def test_crossings_agree_with_testing_every_pair():
    rng = np.random.default_rng(3)
    points = rng.uniform(size=(60, 1, 3)) + rng.uniform(-0.2, 0.2, size=(60, 3, 3))
    soup = Surface(points=points.reshape(-1, 3), triangles=np.arange(180).reshape(-1, 3))

    def pierces(p, q):
        """Whether a side of p meets q, by solving for where."""
        for j in range(3):
            a, b = p[j], p[(j + 1) % 3]
            s, u, v = np.linalg.solve(np.column_stack([b - a, q[0] - q[1], q[0] - q[2]]), q[0] - a)
            if 0 <= s <= 1 and u >= 0 and v >= 0 and u + v <= 1:
                return True
        return False

    expected = [(i, j) for i, j in combinations(range(60), 2)
                if pierces(points[i], points[j]) or pierces(points[j], points[i])]  # fmt: skip
    assert len(expected) > 10
    assert [tuple(pair) for pair in self_intersections(soup).tolist()] == expected


def test_a_point_pulled_through_the_body_is_detected():
    points = np.array(SPHERE.points)
    top = int(points[:, 2].argmax())
    points[top] *= [1, 1, -1.5]
    with pytest.raises(MeshError, match=r"intersects itself at \d+ pairs of triangles, first near"):
        check(Surface(points=points, triangles=SPHERE.triangles))


def test_blocks_are_centred_despite_round_off():
    for sides in [(0.048, 0.032, 0.01), (0.04, 0.04, 0.012), (0.03, 0.02, 0.01)]:
        block = meshes.block(sides, 0.008, order=1)
        surface, _ = repair(block.points, meshes.boundary_facets(block.tets))
        x, y, radius = alignment.widest_circle(surface)
        assert [x, y] == pytest.approx([0, 0], abs=0.01 * sides[0])
        assert radius == pytest.approx(min(sides[:2]) / 2, rel=0.02)


def test_rotations_take_each_axis_to_z():
    for up in alignment.ROTATIONS:
        axis = np.zeros((3, 3))
        axis[0, "xyz".index(up[1])] = 1 if up[0] == "+" else -1
        assert (alignment.rotation_to_z(up) @ axis[0]).tolist() == [0, 0, 1]
        assert np.linalg.det(alignment.ROTATIONS[up]) == 1


def box(sides, at=(0.0, 0.0, 0.0), h=np.inf):
    made = meshes.block(sides, min(h, *sides), order=1)
    surface, _ = repair(made.points, meshes.boundary_facets(made.tets))
    return Surface(points=surface.points + at, triangles=surface.triangles)


OUTER = box((0.020, 0.016, 0.012))
BONE = box((0.008, 0.006, 0.005), (0.0, 0.0, -0.004))


def test_a_winding_number_is_1_inside_and_0_outside():
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.012, 0.012, (500, 3)) - [0, 0, 0.006]
    low, high = OUTER.points.min(axis=0), OUTER.points.max(axis=0)
    inside = ((points > low) & (points < high)).all(axis=1)
    np.testing.assert_allclose(winding_number(OUTER, points), inside, atol=1e-12)
    assert 50 < inside.sum() < 450


def test_surfaces_that_are_not_inside_are_refused():
    for inner, said in [
        ({"a": box((0.008,) * 3, (0.009, 0, -2e-3))}, "the body and a cross"),
        ({"a": box((0.008,) * 3, (0.05, 0, -2e-3))}, "a lies outside"),
        ({"a": BONE, "b": box((0.009, 0.003, 0.003), (0, 0, -5e-3))}, "a and b cross"),
    ]:
        with pytest.raises(MeshError, match=said):
            check_inside(OUTER, inner)
        check_inside(OUTER, {"a": BONE, "marrow": box((2e-3,) * 3, (0, 0, -5e-3))})


def test_a_bone_is_cut_with_its_body():
    whole, cuts = alignment.cut_to_box(BONE, (-1, 1, -1, 1))
    assert whole is BONE
    assert not cuts
    part, cuts = alignment.cut_to_box(BONE, (-0.002, 1, -1, 1))
    assert cuts == 1
    assert volume(part) == pytest.approx(0.006 * 0.006 * 0.005, rel=1e-6)
    assert alignment.cut_to_box(BONE, (0.005, 1, -1, 1))[0] is None
