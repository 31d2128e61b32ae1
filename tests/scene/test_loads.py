"""Loads beside pressure: shear tractions, forces of a small contact, gravity, moving supports."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

import fem
import skinwave
from fem.load_and_probe import facet_normals, pressure_operator, traction_operator
from meshes import block
from simple_model import Material, MovingPressure, Stack, Tacton, Trajectory
from simple_model.layers.flat_quantities import traction_field
from simple_model.layers.wavenumber_integral import point_integrals
from simple_model.load.spectrum import pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT
from simple_model.response import fit_lines
from skinwave import Body, Load, Scene, SupportMotion, dumps, loads
from skinwave.bodies.build import build, operators
from skinwave.measure import Measurement
from skinwave.measure.fit import fit
from skinwave.measure.predicted import line_predictor, target_of, waveform_predictor
from skinwave.models import parametric
from skinwave.models.meshed import load_in_steps, surface_load
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.patterns.conversion import write_pattern
from skinwave.patterns.pattern import Options
from skinwave.planning.extent import symmetry
from skinwave.planning.plan import plan
from skinwave.planning.refinement import about_its_rest
from skinwave.planning.simulate import compute
from skinwave.results.run import SUPPORT, Run
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import with_values

SOLID = Material(density=1000, shear_modulus=2e4, poisson=0.3, viscosity=6.0)
SMALL = """
[body]
size_x_mm = 44
size_y_mm = 44
thickness_mm = 10
sides = "clamped"
[body.material]
density_kg_m3 = 1000
shear_modulus_pa = 2e4
poisson = 0.0
viscosity_pa_s = 20
[probes]
points_mm = [[5, 2], [9, 0], [-6, 3]]
"""
TONE = '[tacton]\nam_frequency_hz = 200\nduration_s = 0.03\n[focus]\ndrive = "linear"\n'
AROUND = TONE.replace("[focus]", 'shape = "circle"\nsize_mm = 10\nspeed_m_per_s = 2\n[focus]')
SHEAR = '[load]\nkind = "shear"\ndirection = [1, 1]\n'
FORCE = '[load]\nkind = "point_force"\nforce_n = 0.02\nwidth_mm = 5\n'
IMPULSE = "[tacton]\nduration_s = 0.03\nrhythm = { pulses_ms = [[2, 28]], ramp_ms = 1 }\n"
CIRCLE = Trajectory(shape="circle", size=0.01, speed=2.0)
SQUARE = Trajectory(shape="square", size=0.01, speed=2.0)
H = 3e-3
MODULUS = "body.material.shear_modulus_pa"
RHO, MU, VISCOSITY, DEPTH = 1000.0, 2e4, 20.0, 12e-3
COLUMN_SOLID = fem.Material(density=RHO, shear_modulus=MU, poisson=0.0, viscosity=VISCOSITY)
COLUMN = Body(material=COLUMN_SOLID, width=6e-3, height=6e-3, depth=DEPTH, sides="free")
UP = SupportMotion(amplitude=5e-6, frequency=140.0)
REST = """
[tacton]
duration_s = 0.1
am_frequency_hz = 60
[focus]
peak_pressure_pa = 0
[probes]
points_mm = [[0, 0], [2, 1]]
"""
SHAKEN = "[load]\nsupport_motion = { amplitude_um = 5, frequency_hz = 140 }\n"
STILL = '[body]\nsides = "free"\n'
ADRIFT = '[body]\nbase="free"\nsides={left="free", right="free", front="free", back="absorbing"}'


def far(found, expected):
    """Largest relative error (p,) of waveforms."""
    return np.linalg.norm(found - expected, axis=0) / np.linalg.norm(expected, axis=0)


def test_a_shear_traction_on_a_half_space_is_that_of_cerruti():
    """u_z = F (1 - 2 nu) x / 4 pi mu r^2 (Johnson, Contact Mechanics, eq. 3.75), F within r."""
    half, w = Stack(materials=(SOLID,), thicknesses=(np.inf,)), 3e-3
    places = np.array([[5e-3, 2e-3], [-4e-3, 6e-3], [12e-3, 0.0]])
    r, force = np.hypot(*places.T), 2 * pi * w**2

    def at(direction):
        field = traction_field(DISPLACEMENT, half, direction)
        integrals = point_integrals(field, r, [0.01 + 0j], w)[:, 0]
        return np.einsum("mcp,cp->p", field.weights(places), integrals).real

    within = (1 - np.exp(-(r**2) / 2 / w**2)) / r**2
    closed = force * (1 - 2 * 0.3) / (4 * pi * 2e4) * places[:, 0] * within
    np.testing.assert_allclose(at((1.0, 0.0, 0.0)), closed, rtol=1e-4)
    both = 0.6 * at((1.0, 0.0, 0.0)) + 0.8 * at((0.0, 0.0, -1.0))
    np.testing.assert_allclose(at((0.6, 0.0, -0.8)), both, rtol=1e-9)


def test_the_unit_tangent_follows_the_focus():
    phase = np.array([0.1, 0.3, 0.85])
    angle = 2 * pi * phase
    around = np.column_stack([-np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(CIRCLE.tangent_at_phase(phase), around, atol=1e-9)
    corners = SQUARE.tangent_at_phase(phase)
    np.testing.assert_allclose(corners, [[-1, 0], [0, -1], [0, 1]], atol=1e-9)
    line = Trajectory(shape="line", size=0.02, speed=1.0)
    np.testing.assert_allclose(line.tangent_at_phase([0.2, 0.7]), [[1, 0], [-1, 0]], atol=1e-9)


@pytest.mark.parametrize("path", [CIRCLE, SQUARE], ids=["circle", "square"])
def test_spectral_lines_along_a_path_give_the_load_in_time(path):
    tacton = Tacton(am_frequency=90.0, trajectory=path)
    load = MovingPressure(tacton=tacton, heading="x", drive="linear")
    points = np.array([[5e-3, 1e-3, 0], [-4e-3, -3e-3, 0], [0.0, 5e-3, 0]])
    t = np.linspace(0, 0.05, 701)
    f, a = pressure_lines(load, points, 1e-6)
    direct = load(points, t)
    # A direction that jumps at corners has lines 1/n: those beyond the 250th hold some 5 %.
    assert far(synthesise(f, a, t), direct).max() < (1e-5 if path is CIRCLE else 0.07)
    y = replace(load, heading="y")(points, t)
    np.testing.assert_allclose(direct**2 + y**2, replace(load, heading="")(points, t) ** 2)


def test_tractions_have_the_force_of_their_direction():
    mesh = block((0.02, 0.03, 0.01), 5e-3)
    normals = facet_normals(mesh)
    tilted = np.broadcast_to([0.6, 0.0, -0.8], normals.shape)
    force = (traction_operator(mesh, tilted) @ np.full(len(normals), 7.0)).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), 7 * 0.02 * 0.03 * tilted[0], atol=1e-15)
    inwards = traction_operator(mesh, -normals) - pressure_operator(mesh)
    assert abs(inwards).max() < 1e-18


def test_on_a_slope_shear_is_tangential_and_a_force_keeps_its_size():
    a = 0.5
    normal = np.array([[np.sin(a), 0.0, np.cos(a)]])
    (shear,) = Load(kind="shear").tractions(normal)[:, 0]
    np.testing.assert_allclose(shear, np.cos(a) ** 2 * np.array([np.cos(a), 0, -np.sin(a)]))
    both = Load(kind="shear", direction="path").tractions(normal)[:, 0]
    np.testing.assert_allclose(both, [shear, [0, np.cos(a), 0]])
    (force,) = Load(kind="point_force", force=1.0).tractions(normal)[:, 0]
    np.testing.assert_allclose(force, [0, 0, -np.cos(a)])
    (pushed,) = Load().tractions(normal)[:, 0]
    np.testing.assert_allclose(pushed, -(np.cos(a) ** 2) * normal[0])


def test_elements_under_tractions_meet_the_wavenumber_integral():
    solid, width = replace(SOLID, poisson=0.0), 6e-3
    body = Body(material=solid, width=0.05, height=0.05, depth=0.01, sides="clamped")
    each = (
        Load(kind="shear", direction=(1.0, 0.5)),
        Load(kind="point_force", force=1.0, direction=(0.6, 0.0, -0.8)),
    )
    made, places = build(body, H), np.array([[8e-3, 2e-3], [-4e-3, -5e-3]])
    operators_of = [surface_load(made, load) for load in each]
    spot = np.exp(-(operators_of[0][1][:, :2] ** 2).sum(axis=1) / 2 / width**2)
    u = fem.static(operators(made), np.column_stack([P @ spot for P, _ in operators_of]))
    layer = Stack(materials=(solid,), thicknesses=(0.01,))
    for load, found in zip(each, (fem.probe_operator(made.mesh, places) @ u).T, strict=True):
        (direction,) = load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0]
        field = traction_field(DISPLACEMENT, layer, direction)
        integrals = point_integrals(field, np.hypot(*places.T), [1e-3 + 0j], width)[:, 0]
        exact = np.einsum("mcp,cp->p", field.weights(places), integrals).real
        assert np.abs(found - exact).max() < 0.01 * np.abs(exact).max()


@pytest.mark.parametrize(
    "text",
    [
        AROUND + '[load]\nkind = "shear"\ndirection = "path"\n',
        IMPULSE + FORCE + "direction = [0.3, 0, -1]\n",
    ],
    ids=["along a circle", "impulse"],
)
def test_models_agree_on_shear_and_contact_loads(text):
    scene = loads(text + SMALL)
    flat = compute(scene, "flat-body").values
    assert far(compute(scene, "fem", tolerance=0.02, h=H).values, flat).max() < 0.05
    if scene.load.direction != "path":
        return
    made = build(scene.body, H)
    P, points = surface_load(made, scene.load)
    assert P.shape[1] == 2 * len(points)
    q = load_in_steps(scene.loads, points, np.arange(200) / 1e4, 5e-5)(0.0123)
    x, y = np.split(q, 2)
    np.testing.assert_allclose(np.hypot(x, y), abs(scene.pressure(points, 0.0123)))


def test_steady_states_agree_on_a_shear_traction():
    scene = loads(TONE + SHEAR + SMALL)
    flat = compute(scene, "flat-body-harmonic").values
    assert far(compute(scene, "fem-harmonic", h=H).values, flat).max() < 0.05


def column(base, stiffness=0.0):
    solid = replace(SOLID, poisson=0.0)
    return Body(
        material=solid, width=0.01, height=0.01, depth=0.012, base=base, sides="free",
        base_stiffness=stiffness,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("body", "model", "soft"),
    [
        (column("clamped"), "fem", 0.0),
        (column("clamped"), "fem-transient", 0.0),
        (column("elastic", 2e6), "fem-harmonic", 1000 * 0.012 / 2e6),
    ],
)
def test_a_column_sags_under_its_own_weight(body, model, soft):
    """u = rho g H^2 / 2 E, and rho g H / k of springs below; the moving load comes on top."""
    scene = loads("[tacton]\nam_frequency_hz = 150\nduration_s = 0.01\n[probes]\npoints_mm=[[0,0]]")
    still = replace(scene, body=body)
    heavy = replace(still, load=Load(gravity=9.81))
    u, moved = (compute(each, model, h=6e-3).values for each in (heavy, still))
    sag = 9.81 * (1000 * 0.012**2 / (2 * 4e4) + soft)
    np.testing.assert_allclose(u - moved, sag, rtol=1e-6)
    both = [compute(replace(x, quantity="velocity"), model, h=6e-3).values for x in (heavy, still)]
    np.testing.assert_allclose(*both, atol=1e-12)


def test_probes_read_the_stress_of_weight():
    """sigma_zz = -rho g d at a depth d, beside that of the load."""
    scene = loads('[probes]\npoints_mm = [[0, 0]]\ndepth_mm = 6\nquantity = "stress_zz"\n[focus]\n'
                  "peak_pressure_pa = 0\n[tacton]\nduration_s = 0.01")  # fmt: skip
    heavy = replace(scene, body=column("clamped"), load=Load(gravity=9.81))
    found = compute(heavy, "fem", h=3e-3).values
    np.testing.assert_allclose(found, -1000 * 9.81 * 6e-3, rtol=0.03)


@pytest.mark.parametrize("load", ['kind = "shear"\ndirection = [1, 2]', 'direction = "path"\n'
                                  'kind = "shear"', "gravity_m_per_s2 = 9.81"])  # fmt: skip
def test_scenes_of_loads_round_trip(load):
    scene = loads(f'[tacton]\nshape = "circle"\nsize_mm = 10\nspeed_m_per_s = 4\n[load]\n{load}')
    assert loads(dumps(scene)) == scene
    assert not scene.load.is_plain
    if scene.load.direction != "path":
        still = replace(scene.tacton, trajectory=Trajectory())
        at_rest = replace(scene, pressure=replace(scene.pressure, tacton=still))
        assert symmetry(at_rest) == ("xy" if scene.load.gravity else "")
    assert loads(dumps(replace(scene, load=Load()))).load.is_plain


def test_a_force_has_no_device():
    scene = loads(IMPULSE + FORCE + SMALL)
    assert loads(dumps(scene)) == scene
    assert "[focus]" not in dumps(scene)
    assert scene.pressure.peak_pressure * 2 * pi * 5e-3**2 == pytest.approx(0.02)
    assert not [each for each in spreads_of(scene) if each.part == "device"]
    found = plan(scene, SolveOptions(tolerance=0.1))
    assert found.model.startswith("flat-body")


def test_invalid_loads_are_refused():
    for text, said in [
        ('kind = "sheer"', "did you mean 'shear'"),
        ("force_n = 1", "a load of kind 'pressure' does not take force"),
        ('kind = "shear"\ndirection = [1, 0, 0]', "must be 2 finite numbers"),
        ('kind = "shear"\ndirection = "path"', "rests or jumps from point to point"),
        ('kind = "point_force"', "force = 0.0 of a load"),
        ('kind = "point_force"\nforce_n = 1\nwidth_mm = 0.01', "is outside 0.2 to 20 mm"),
        ('kind = "point_force"\nforce_n = 1\nwidth_mm = 0', "width_mm = 0 must"),
        ('kind = "point_force"\nforce_n = 1\ndirection = [0, 0, 0]', "must be 3 finite numbers"),
        ('kind = "point_force"\nforce_n = 1\n[focus]\nheight_mm = 300', "focus"),
        ("gravity_m_per_s2 = 99", "gravity = 99"),
        ('gravity_m_per_s2 = 9.8\n[body]\nbase = "free"', "falls under gravity; clamp"),
    ]:
        with pytest.raises(ValueError, match=said):
            loads(f"[load]\n{text}")


@pytest.mark.parametrize(
    ("model", "scene", "said"),
    [
        ("point-kernel", TONE + '[load]\nkind = "shear"\n', "not a shear traction along"),
        ("flat-body", TONE + "[load]\ngravity_m_per_s2 = 9\n", "pressure and gravity of 9 m/s2"),
        ("flat-body", TONE + '[probes]\nquantity = "strain_zz"\n[load]\nkind = "shear"\n',
         "does not compute strain zz under a shear traction along .*use --model fem"),
    ],
)  # fmt: skip
def test_models_refuse_unsupported_loads(model, scene, said):
    with pytest.raises(ValueError, match=said):
        compute(loads(scene), model)


SHEAR = '[load]\nkind = "shear"\ndirection = [1, 0]\n'


def test_pressure_only_functions_refuse_other_loads():
    scene = loads(SHEAR + SMALL)
    heavy = replace(scene, load=Load(gravity=9.81))
    with pytest.raises(ValueError, match="focus alone, not pressure and gravity"):
        target_of(heavy, "flat-body", DISPLACEMENT, scene.probe_points)
    assert target_of(heavy, "fem", DISPLACEMENT, scene.probe_points).linear == ("gain",)
    with pytest.raises(ValueError, match="a pattern of a device needs"):
        write_pattern(scene, ".csv", Options())
    with pytest.raises(ValueError, match="needs a load normal to it"):
        loads(SHEAR + "[body]\npreset = 'paper-sheet-loose'")
    pressed = replace(scene, load=Load())
    reduced = reduce_scene(pressed, SolveOptions(h=6e-3))
    assert np.isfinite(answer(reduced, pressed).values).all()
    with pytest.raises(ValueError, match="is reduced for"):
        answer(reduced, scene)
    shaken = "[load.support_motion]\nfrequency_hz = 100\namplitude_um = 1\n"
    for own, said in ((heavy, "gravity"), (loads(SMALL + shaken), "density")):
        with pytest.raises(ValueError, match=said):
            skinwave.prepare(own, {MODULUS: (1.5e4, 3e4)})


def test_gravity_does_not_hide_the_error_of_a_mesh():
    scene = loads(SMALL)
    heavy = replace(scene, load=Load(gravity=9.81))
    without, under = (skinwave.simulate(s, "fem", h=5e-3) for s in (scene, heavy))
    assert np.abs(under.values).max() > 3 * np.abs(without.values).max()
    assert under.expected_error == pytest.approx(without.expected_error, rel=0.2)


@pytest.mark.parametrize("load", [FORCE, '[load]\nkind = "shear"\ndirection = "path"\n'])
def test_materials_can_be_varied_under_any_moving_load(load):
    start = IMPULSE if load == FORCE else AROUND
    scene = loads((start.partition("[focus]")[0] if load == FORCE else start) + SMALL + load)
    free = skinwave.prepare(scene, {MODULUS: (1.5e4, 3e4)}, h=6e-3)
    values = {MODULUS: 2.6e4}
    own = with_values(scene, values)
    reduced = reduce_scene(own, SolveOptions(h=6e-3))
    found, expected = parametric.answer(free, values).values, answer(reduced, own).values
    assert far(found, expected).max() < 0.01


def test_a_fit_recovers_the_modulus_and_the_force_of_a_contact():
    scene = loads(IMPULSE.replace("0.03", "0.06") + SMALL.replace("44", "24") + FORCE)
    hidden = with_values(scene, {MODULUS: 2.4e4, "load.force_n": 0.03})
    found = compute(hidden, "fem")
    places, values = scene.probe_points, found.values[None]
    measured = Measurement(quantity="displacement", places=places, times=found.times, values=values)
    vary = [f"{MODULUS}=12000:40000", "load.force_n=0.005:0.1"]
    fitted = fit(scene, measured, vary, model="fem", starts=2)
    assert fitted.target.reduced is not None, "no factorisation for each modulus"
    assert fitted.values[MODULUS] == pytest.approx(2.4e4, rel=0.01)
    assert fitted.values["load.force_n"] == pytest.approx(0.03, rel=0.01)


def test_predictions_of_layers_under_tractions_are_those_of_the_model():
    text = AROUND.replace("0.03", "0.2") + SMALL.replace("poisson = 0.0", "poisson = 0.49") + SHEAR
    scene = loads(text)
    target = target_of(scene, "flat-body", DISPLACEMENT, scene.probe_points)
    expected, _ = fit_lines(compute(scene, "flat-body-harmonic"), np.array([200.0]))
    found = line_predictor(target, np.array([200.0]))({})
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-3 * np.abs(expected).max())
    rest = compute(scene, "flat-body")
    assert far(waveform_predictor(target, rest.times)({}), rest.values).max() < 1e-3


def shaken(body=COLUMN, motion=UP, **changes):
    return replace(loads(REST), body=body, load=Load(support_motion=motion), **changes)


def wavenumber(frequency):
    """Of waves along a column without Poisson's effect, whose modulus is 2 (mu + i w eta)."""
    w = 2 * np.pi * frequency
    return w * np.sqrt(RHO / (2 * (MU + 1j * w * VISCOSITY)))


def closed(times, motion, z=0.0):
    """u = a cos k z / cos k H at a depth z below the free end, upwards."""
    k = wavenumber(motion.frequency)
    a = motion.line * np.cos(k * z) / np.cos(k * DEPTH)
    return np.real(a * np.exp(2j * np.pi * motion.frequency * times))


@pytest.mark.parametrize(
    ("model", "motion"),
    [
        ("fem", UP),
        ("fem-harmonic", replace(UP, frequency=60.0, direction=(0.0, 0.0, -3.0))),
        ("fem-harmonic", replace(UP, frequency=400.0)),
    ],
)
def test_a_shaken_layer_moves_as_in_closed_form(model, motion):
    """140 Hz is beside its first resonance, at c / 4 H = 132 Hz."""
    found = compute(shaken(motion=motion), model, h=3e-3)
    late = found.times > 0.06  # when the start has faded
    # Probes read motion into the body.
    expected = -np.sign(motion.direction[2]) * closed(found.times[late], motion)
    error = np.abs(found.values[late] - expected[:, None]).max() / np.abs(expected).max()
    assert error < 3e-3
    assert abs(np.abs(expected).max() / UP.amplitude - 1) > 0.15  # no rigid motion


def test_layers_on_shaken_springs_and_sideways_motion_of_slow_bodies():
    """Springs below a rigid mass: a / (1 - (w / w_0)^2), w_0^2 = k / rho H."""
    stiff = replace(COLUMN_SOLID, shear_modulus=2e8, viscosity=0.0)
    springs = replace(COLUMN, material=stiff, base="elastic", base_stiffness=5e6)
    found = compute(shaken(springs), "fem-harmonic", h=6e-3)
    gain = 1 / (1 - (2 * np.pi * 140) ** 2 * RHO * DEPTH / 5e6)
    np.testing.assert_allclose(np.abs(found.values).max() / UP.amplitude, abs(gain), rtol=2e-3)
    aside = SupportMotion(amplitude=1e-4, frequency=1.0, direction=(1.0, 0.0, 0.0))
    slow = shaken(replace(COLUMN, width=0.02, height=0.02), aside, quantity="displacement_x")
    found = compute(slow, "fem", h=6e-3)
    along = 1e-4 * np.sin(2 * np.pi * found.times)  # all of the body moves along
    np.testing.assert_allclose(found.values, np.stack([along, along], axis=1), atol=2e-6)


def test_a_shaken_layer_starts_from_rest():
    """u = u_c + w, of the modes sin (n + 1/2) pi (z / H) of w, which start with its -u_c' (0)."""
    found = compute(shaken(), "fem", h=4e-3)
    n = np.arange(40)[:, None]
    wn = (n + 0.5) * np.pi / DEPTH * np.sqrt(2 * MU / RHO)  # modulus 2 mu, loss w eta / mu
    rate = wn**2 * VISCOSITY / MU
    top = (-1.0) ** n * 2 / ((n + 0.5) * np.pi)  # participation, times the mode at the free end
    w, t = 2 * np.pi * UP.frequency, found.times
    steady = -UP.acceleration / (wn**2 - w**2 + 1j * w * rate)
    poles = -rate / 2 + np.array([1, -1]) * np.sqrt(rate**2 / 4 - wn**2 + 0j)
    left = np.stack([-steady.real, -UP.speed - (1j * w * steady).real])[..., 0]  # of q, q' at 0
    free = np.linalg.solve(np.stack([np.ones_like(poles), poles], axis=1), left.T[..., None])
    q = (steady * np.exp(1j * w * t)).real
    q += np.einsum("nk,nkt->nt", free[..., 0], np.exp(poles[..., None] * t)).real
    expected = UP.amplitude * np.sin(w * t) + (top * q).sum(axis=0)
    assert np.abs(expected[:6]).max() < 0.02 * UP.amplitude  # waves take 1.9 ms to the free end
    error = np.abs(found.values + expected[:, None]).max() / np.abs(expected).max()
    assert error < 2e-3


def test_support_motion_adds_to_the_load_and_has_rates():
    both = shaken()
    pressed = replace(both, pressure=replace(both.pressure, peak_pressure=50.0))
    alone = replace(pressed, load=Load())
    u, moved, still = (compute(each, "fem", h=6e-3).values for each in (pressed, both, alone))
    np.testing.assert_allclose(u, moved + still, atol=1e-4 * np.abs(u).max())
    rate = compute(replace(both, quantity="velocity"), "fem", h=6e-3).values
    slope = (moved[2:] - moved[:-2]) / 2e-4
    np.testing.assert_allclose(rate[1:-1], slope, atol=1e-2 * np.abs(rate).max())


def test_another_tone_reuses_the_reduction(monkeypatch, tmp_path):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    another = replace(UP, frequency=90.0, amplitude=1e-6)
    at_rest = Scene(pressure=MovingPressure(tacton=Tacton()), body=COLUMN, probes=((0.0, 0.0),))
    first, louder, along = (
        reduce_scene(replace(at_rest, load=load), SolveOptions(h=6e-3))
        for load in (Load(support_motion=UP), Load(support_motion=another), Load())
    )
    assert "factorise and reduce" not in louder.effort.seconds
    assert louder.load.support_motion.frequency == 90.0
    np.testing.assert_array_equal(first.inertia, louder.inertia)
    assert "factorise and reduce" in along.effort.seconds
    assert not along.translation.any()


def test_scenes_with_support_motion_round_trip_and_are_planned():
    scene = loads(REST + SHAKEN + STILL)
    assert loads(dumps(scene)) == scene
    assert scene.load.support_motion == UP
    assert "support_motion" not in dumps(replace(scene, load=Load()))
    found = plan(shaken(), SolveOptions(tolerance=0.2))
    assert (found.model, found.highest, found.symmetry) == ("fem", 140.0, "")


def test_invalid_support_motions_are_refused():
    for text, said in [
        ("[load]\nsupport_motion = { amplitude_um = 5 }", "needs frequency_hz"),
        (SHAKEN.replace("140", "4000"), "frequency_hz = 4000"),
        (SHAKEN.replace("140", "140, direction = [0, 0]"), "must be 3 finite numbers, not all 0"),
        (SHAKEN, 'use sides = "clamped"'),
        (SHAKEN + '[body]\nbase = "absorbing"\nsides = "clamped"', 'use base = "clamped"'),
        (SHAKEN + '[body]\npreset = "paper-sheet"', "needs a solid, not a body of kind 'sheet'"),
        (SHAKEN + '[body]\nkind = "none"', "needs a solid, not a body of kind 'none'"),
        (SHAKEN + ADRIFT, "unconstrained"),
    ]:
        with pytest.raises(ValueError, match=said):
            loads(text)


@pytest.mark.parametrize("model", ["flat-body", "fem-transient", "point-kernel"])
def test_models_without_support_motion_refuse_it(model):
    scene = loads(REST + SHAKEN + STILL)
    with pytest.raises(ValueError, match=f"^{model} .*support"):
        compute(scene, model)
    with pytest.raises(ValueError, match="support_motion"):
        skinwave.field(scene, [0.0])


def test_lines_of_a_shaken_body_are_those_of_pressure_and_support():
    scene = loads(REST.replace("peak_pressure_pa = 0", "peak_pressure_pa = 50"))
    scene = replace(scene, body=COLUMN, pressure=with_tones(scene.pressure, 140.0, 0.05))
    still = compute(scene, "fem-harmonic", h=3e-3)
    motion = replace(UP, frequency=67.0)
    moved = replace(scene, load=Load(support_motion=motion))
    both = compute(moved, "fem-harmonic", h=3e-3)
    shaken_too = Run(tacton="", body="slab", scene=moved, response=both)
    alone = Run(tacton="", body="slab", scene=scene, response=still)
    np.testing.assert_allclose(shaken_too.lines["f_AM"], alone.lines["f_AM"], rtol=1e-3)
    top = abs(1 / np.cos(wavenumber(67.0) * DEPTH)) * motion.amplitude
    assert shaken_too.frequencies[SUPPORT] == 67.0
    np.testing.assert_allclose(shaken_too.lines[SUPPORT], top, rtol=5e-3)
    assert not shaken_too.unnamed
    assert SUPPORT not in alone.lines


def with_tones(pressure, am_frequency, duration):
    tacton = replace(pressure.tacton, am_frequency=am_frequency, duration=duration)
    return replace(pressure, tacton=tacton)


def test_gravity_alone_has_the_error_of_its_deflection():
    scene = loads(
        "[tacton]\nduration_s = 0.02\namplitude_percent = 0\n[body]\nsize_x_mm = 30\n"
        "size_y_mm = 30\nthickness_mm = 8\nsides = 'clamped'\n[load]\ngravity_m_per_s2 = 9.81\n"
        "[probes]\npoints_mm = [[0, 0]]"
    )
    response = skinwave.simulate(scene, "fem", 0.3, h=6e-3)
    assert 0 < response.expected_error < 0.2
    wave = np.sin(2 * np.pi * np.arange(40) / 40)[:, None]  # its mean is 0
    round_off, moving = (1e-6 * (1 + size * wave) for size in (1e-9, 1e-2))
    np.testing.assert_array_equal(about_its_rest(scene, round_off), round_off)
    np.testing.assert_allclose(about_its_rest(scene, moving), 1e-8 * wave, rtol=0, atol=1e-20)
