"""Properties of every load, body and mesh, on examples that Hypothesis draws."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

import fem
import meshes
from simple_model import SHAPES, MovingPressure, Rhythm, Signal, Tacton, Trajectory, flat_body
from simple_model.layers.compliance import half_space, slab
from simple_model.load.focus import FOCI
from simple_model.load.rhythm import ROLES
from simple_model.load.tacton import SHARINGS
from simple_model.load.trajectory import SWEEPS
from skinwave import BODIES, Body, Scene, SkinwaveWarning, dumps, loads
from skinwave.bodies.body import KINDS
from skinwave.bodies.supports import CONDITIONS
from skinwave.models import named
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, simulate

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)
held = st.sampled_from([(b, s) for b in CONDITIONS for s in CONDITIONS if "clamped" in (b, s)])
SMALL = Body(width=0.03, height=0.03, depth=0.006, sides="clamped")
SHEET = replace(BODIES["paper-sheet-loose"], width=0.03, height=0.03)
WATCHED = ((0.0, 0.0), (0.006, 0.003))
SLOW = {"density": 1000.0, "shear_modulus": 9e3, "poisson": 0.3, "viscosity": 0.05}
REACH = 0.016  # m of a focus, beyond which it is below a thousandth


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


frequencies = st.just(0.0) | numbers(5.0, 400.0)
materials = st.builds(
    fem.Material,
    density=numbers(300, 3000),
    shear_modulus=numbers(5e3, 1e5),
    poisson=numbers(-0.3, 0.499),
    viscosity=numbers(1, 10),
    loss_factor=numbers(0, 0.3),
)
places = st.lists(st.tuples(numbers(-0.008, 0.008), numbers(-0.008, 0.008)), min_size=2, max_size=6)
sized = st.builds(
    Trajectory,
    shape=st.sampled_from(SHAPES),
    size=st.just(0.0) | numbers(0.002, 0.012),
    speed=st.just(0.0) | numbers(0.5, 6),
    sweep=st.sampled_from(SWEEPS),
    centre=st.just((0.0, 0.0)) | st.tuples(numbers(-0.002, 0.002), numbers(-0.002, 0.002)),
)


@st.composite
def recordings(draw):
    points = draw(places)
    n, step = len(points), st.just(0.0) | numbers(1e-3, 5e-3)
    steps = draw(st.lists(step, min_size=n - 1, max_size=n - 1))
    times = np.concatenate([[0.0], np.cumsum(steps) + 1e-3 * (np.arange(len(steps)) > -1)])
    levels = draw(st.just([]) | st.lists(numbers(0, 1), min_size=n, max_size=n))
    given = {"times": tuple(times.tolist()), "levels": tuple(levels), "hold": draw(st.booleans())}
    return Trajectory(shape="recorded", points=tuple(points), **given)


@st.composite
def polylines(draw):
    points, sweep = tuple(draw(places)), draw(st.sampled_from(SWEEPS))
    path = Trajectory(shape="polyline", points=points, sweep=sweep, speed=0.0)
    return replace(path, speed=draw(numbers(0, 300)) * path.length)


rhythms = st.builds(
    Rhythm,
    pulses=st.lists(
        st.tuples(numbers(2e-3, 0.02), st.just(0.0) | numbers(1e-4, 0.02)), min_size=1, max_size=3
    ).map(tuple),
    ramp=st.just(0.0) | numbers(0, 1e-3),
)
signals = st.builds(
    Signal,
    rate=numbers(50, 2000),
    samples=st.lists(numbers(0, 1), min_size=2, max_size=8).map(tuple),
    role=st.sampled_from(ROLES),
)
several = st.lists(numbers(0, 1), min_size=1, max_size=8).map(tuple)
tactons = st.builds(
    Tacton,
    amplitude=numbers(0, 1),
    am_frequency=frequencies,
    second_am_frequency=frequencies,
    superposition=numbers(0, 1).map(lambda w: (w, 1 - w)),
    envelope_frequency=st.just(0.0) | numbers(1, 20),
    duration=numbers(0.001, 0.03),
    trajectory=sized,
    foci=st.just((0.0,)) | several,
    sharing=st.sampled_from(SHARINGS),
)
every_tacton = (
    tactons
    | st.builds(replace, tactons, rhythm=st.none() | rhythms, signal=st.none() | signals)
    | st.builds(
        Tacton,
        am_frequency=frequencies,
        duration=numbers(0.001, 0.03),
        trajectory=recordings() | polylines(),
        foci=st.just((0.0,)) | several,
    )
)  # fmt: skip
pressures = st.builds(
    MovingPressure,
    tacton=tactons,
    profile=st.sampled_from(FOCI),
    drive=st.sampled_from(["force_corrected", "linear", "pressure_squared"]),
    depth_of_modulation=numbers(0, 1),
    peak_pressure=st.just(0.0) | numbers(1e-3, 1e3),
    height=numbers(0.1, 0.4),
)
papers = st.builds(
    fem.from_young, density=numbers(300, 1500), young=numbers(1e8, 1e10), poisson=numbers(0, 0.45),
    loss_factor=numbers(0.02, 0.1),
)  # fmt: skip


@st.composite
def scenes(draw):
    """Small bodies, with probes that may coincide or lie on the rim."""
    base, sides = draw(held)
    kind = draw(st.sampled_from(("none", "sheet", "slab")))
    width, height = draw(numbers(0.02, 0.04)), draw(numbers(0.02, 0.04))
    depth = draw(numbers(0.003, 0.01) if kind == "slab" else numbers(1e-4, 5e-4))
    solids = st.just("paper") | papers if kind == "sheet" else st.just("palm") | materials
    size = {"width": width, "height": height, "depth": depth}
    body = Body(kind=kind, material=draw(solids), base=base, sides=sides, **size)
    share = st.sampled_from((0.0, 0.25, -0.5, 0.5)) | numbers(-0.5, 0.5)
    points = draw(st.lists(st.tuples(share, share), min_size=1, max_size=4))
    probes = tuple((x * width, y * height) for x, y in points)
    return Scene(name=draw(st.text()), pressure=draw(pressures), body=body, probes=probes)


def small_scene(tacton, body=SMALL, **pressure):
    load = MovingPressure(tacton=tacton, **pressure)
    return Scene(pressure=load, body=body, probes=WATCHED)


def body_for(model):
    return SMALL if takes(named(model), small_scene(Tacton())) else SHEET


@pytest.mark.parametrize(
    "model", ["flat-body", "fem", "fem-harmonic", "fem-transient", "plate-modes-transient"]
)
@settings(max_examples=3)
@given(tactons, numbers(0.01, 100))
def test_every_linear_model_is_linear_in_the_pressure(model, tacton, factor):
    given = {"h": 0.01, "dt": 1e-3 if tacton.duration > 2e-3 else None, "tolerance": 0.3}
    body = body_for(model)
    once, many = (
        compute(small_scene(tacton, body, peak_pressure=p), model, **given).displacement
        for p in (10.0, 10.0 * factor)
    )
    np.testing.assert_allclose(many, factor * once, atol=1e-9 * np.abs(many).max())


def pushed_and_read(material, rng):
    mesh = meshes.block((0.03, 0.02, 0.01), 0.005)
    places = rng.uniform(-0.5, 0.5, (2, 2)) * [0.03, 0.02]
    operators = fem.assemble(mesh, material, absorbing="sides")
    return mesh, operators, fem.probe_operator(mesh, places)


@given(materials, seeds, numbers(0, 800))
def test_responses_are_reciprocal(material, rng, hertz):
    _, operators, S = pushed_and_read(material, rng)
    there = S @ fem.harmonic(operators, S[[0]].toarray()[0], hertz)[0]
    here = S @ fem.harmonic(operators, S[[1]].toarray()[0], hertz)[0]
    assert abs(there[1] - here[0]) < 1e-9 * np.sqrt(abs(there[0] * here[1]))


@settings(max_examples=6)
@given(numbers(0.06, 0.09), frequencies, st.sampled_from(("half-space", "slab")))
def test_no_wave_of_an_endless_body_arrives_before_it_can(distance, am, kind):
    solid = fem.Material(**SLOW)
    body = half_space(solid) if kind == "half-space" else slab(solid, 0.02)
    load = MovingPressure(tacton=Tacton(am_frequency=am, duration=0.05))
    times = np.arange(500) / 1e4
    x = np.abs(flat_body(body, load, [[distance, 0.0]], times).displacement[:, 0])
    arrival = (distance - REACH) / solid.pressure_speed
    assert x[times < arrival].max() < 0.01 * x.max()


@settings(max_examples=3)
@given(st.sampled_from((0.04, 0.055)), st.sampled_from((0.0, 80.0, 200.0)))
def test_no_wave_of_a_mesh_arrives_before_it_can(distance, am):
    material = fem.Material(**SLOW | {"viscosity": 1.0})
    body = Body(material=material, width=0.112, height=0.02, depth=0.01, sides="clamped")
    load = MovingPressure(tacton=Tacton(am_frequency=am, duration=0.03))
    scene = Scene(pressure=load, body=body, probes=((0, 0), (distance, 0)))
    for model in ("fem", "fem-transient"):
        x = np.abs(compute(scene, model, tolerance=0.05, h=0.005, dt=2e-4).displacement)
        times = np.arange(len(x)) / 1e4
        arrival = (distance - REACH) / material.pressure_speed
        assert x[times < arrival, 1].max() < 0.01 * x[:, 1].max()
        assert x[0].max() < 1e-6 * x.max()


@pytest.mark.parametrize("model", ["flat-body", "fem", "fem-transient"])
@settings(max_examples=4)
@given(tactons)
def test_a_later_load_does_not_change_an_earlier_motion(model, tacton):
    tacton = replace(tacton, duration=max(tacton.duration, 0.005))
    longer = replace(tacton, duration=2 * tacton.duration)
    short, long = (
        compute(small_scene(t), model, tolerance=0.3, h=0.01, dt=1e-4).displacement
        for t in (tacton, longer)
    )
    bound = 2e-3 if model == "flat-body" else 1e-9  # a transform over another period
    assert np.abs(long[: len(short)] - short).max() <= bound * np.abs(long).max()


@st.composite
def bodies(draw):
    """A shaken block, straight or bowed, in four- or ten-node tetrahedra."""
    rng, order = draw(seeds), draw(st.sampled_from((1, 2)))
    mesh = meshes.block((0.03, 0.02, 0.01), 0.006, order=order)
    return replace(mesh, points=mesh.points + rng.uniform(-3e-4, 3e-4, mesh.points.shape))


@given(bodies(), materials, seeds)
def test_a_response_moves_and_rotates_with_its_body(mesh, material, rng):
    R = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    R *= np.linalg.det(R)
    moved = replace(mesh, points=mesh.points @ R.T + rng.uniform(-1, 1, 3))
    force = rng.standard_normal(mesh.points.shape)
    u = fem.static(fem.assemble(mesh, material), force.ravel())
    turned = fem.static(fem.assemble(moved, material), (force @ R.T).ravel())
    expected = (u.reshape(-1, 3) @ R.T).ravel()
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-8 * np.abs(u).max())


@settings(max_examples=100)
@given(scenes(), st.none() | every_tacton)
def test_a_scene_comes_back_from_its_file(scene, tacton):
    if tacton:
        scene = replace(scene, body=Body(), pressure=replace(scene.pressure, tacton=tacton))
    once = loads(dumps(scene))
    assert dumps(once) == dumps(scene)
    assert loads(dumps(once)) == once
    assert once.name == scene.name
    assert once.pressure.drive == scene.pressure.drive
    np.testing.assert_allclose(once.probe_points, scene.probe_points, rtol=1e-14)
    assert once.tacton.trajectory.size == pytest.approx(scene.tacton.trajectory.size, rel=1e-14)
    if scene.body.kind != "none":
        assert once.body.width == pytest.approx(scene.body.width, rel=1e-14)


@settings(max_examples=6)
@given(scenes())
def test_planned_scenes_run(scene):
    with pytest.MonkeyPatch.context() as patch:
        coarse = {
            "sheet": lambda body: min(body.width, body.height) / 16,
            "slab": lambda body: min(6e-3, max(body.depth / 2, 1.5e-3)),
        }
        for kind, size in coarse.items():
            patch.setitem(KINDS, kind, replace(KINDS[kind], default_size=size))
        try:
            required = plan(scene, SolveOptions(tolerance=0.3))
        except ValueError:
            reject()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkinwaveWarning)  # of a sheet that deflects far, say
            found = simulate(scene, "auto", 0.3)
    assert found.model == required.model
    assert found.displacement.shape == (len(found.times), len(scene.probes))
    assert np.isfinite(found.displacement).all()
