"""Modulus laws, their Prony series, and laws, profiles and paths of a user's own."""

import cmath
from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
import simple_model
import skinwave
from meshes import cache
from simple_model import FractionalZener, Material, MovingPressure, PronyTerm, Tacton, tabulated
from simple_model.layers.compliance import slab
from simple_model.layers.flat_body import steady_lines
from simple_model.layers.material import PRESETS
from simple_model.load.sampling import highest_line
from simple_model.load.spectrum import load_lines
from skinwave.bodies.analytic import compliance
from skinwave.models.laws import relaxing
from skinwave.planning import left_out
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads, read
from skinwave.scene.scene import Body, Scene
from skinwave.scene.variation import cases

ECOFLEX = PRESETS["ecoflex"]
LAW = FractionalZener(shear_modulus=20e3, fast_modulus=60e3, exponent=0.6, time=0.5e-3)
ZENER = simple_model.of_law(density=1000.0, poisson=0.45, law=LAW)
COMPLEX = 2 * np.pi * np.array([0.0, 3.0, 140.0, 140.0 - 20j, -60.0, 900.0 - 5j, -30j])
HERTZ = np.geomspace(5.0, 1500.0, 26)
PROBES = ((0.0, 0.0), (0.006, 0.0))
BODY = "[body.material]\ndensity_kg_m3 = 1070\npoisson = 0.4999\n"
HEADER = "frequency_hz,storage_pa,loss_pa\n"
PLACES = np.array([[0.0, 0.0], [0.005, 0.0]])
CIRCLE = simple_model.Trajectory(shape="circle", size=0.01, speed=1.0)
TWO = fem.Material(
    density=1000.0, shear_modulus=20e3, poisson=0.45,
    prony=(PronyTerm(modulus=8e3, time=0.4e-3), PronyTerm(modulus=6e3, time=3e-3)),
)  # fmt: skip
LINES = np.array([0.0, 30.0, 140.0, 600.0])
CUBIC = simple_model.DriveLaw(
    name="cubic", degree=3, pressure=lambda A, M, m: (A * (1 + m * M) / (1 + m)) ** 3
)
AM = Tacton(am_frequency=140)
GATE = simple_model.DriveLaw(name="gate", pressure=lambda A, M, m: A * (np.asarray(M) > 0.3))
BEATEN = Tacton(rhythm=simple_model.Rhythm(pulses=((0.1, 0.05),), ramp=0.01))


def ecoflex(w):
    return 25e3 * (1 + cmath.rect((w * 0.3e-3) ** 0.33, 0.33 * cmath.pi / 2))


def zener(w):
    power = cmath.rect((w * 0.5e-3) ** 0.6, 0.6 * cmath.pi / 2)
    return (20e3 + 60e3 * power) / (1 + power)


def table_of(material, hertz=HERTZ):
    kept = {"density": material.density, "poisson": material.poisson, "frequencies": hertz}
    return tabulated(**kept, moduli=material.complex_modulus(2 * np.pi * np.asarray(hertz)))


def scene(material, drive="linear", **tacton):
    """A load of zero mean: creep under a mean one takes far longer than a Tacton."""
    given = {"am_frequency": 140, "duration": 0.1} | tacton
    load = MovingPressure(tacton=Tacton(**given), drive=drive)
    body = Body(material=material, width=0.03, height=0.03, depth=0.008, sides="clamped")
    return Scene(pressure=load, body=body, probes=PROBES)


def test_fractional_laws_with_exponent_1_are_kelvin_voigt_and_zener():
    viscous = Material(density=1.0, shear_modulus=25e3, poisson=0.4, viscosity=25e3 * 0.3e-3)
    term = PronyTerm(modulus=40e3, time=5e-4)
    linear = Material(density=1.0, shear_modulus=20e3, poisson=0.4, prony=(term,))
    voigt = simple_model.FractionalKelvinVoigt(shear_modulus=25e3, exponent=0.5, time=0.3e-3)
    for exponent in (1.0, 1 - 1e-14):
        for law, known in ((voigt, viscous), (LAW, linear)):
            found = replace(law, exponent=exponent)(COMPLEX)
            np.testing.assert_allclose(found, known.complex_modulus(COMPLEX), rtol=1e-12)


def test_constants_out_of_range_are_refused():
    for law, said in (({"exponent": 1.5}, "exponent"), ({"fast_modulus": 1e3}, "at rest")):
        with pytest.raises(ValueError, match=said):
            replace(ZENER.law, **law)


def test_a_series_has_its_stated_error_and_few_terms():
    solid, modulus, tolerance = ZENER, zener, 1e-3
    series = solid.series(tolerance)
    f = np.geomspace(*series.band, 997)
    law = np.array([modulus(w) for w in 2 * np.pi * f])
    away = (np.abs(series(2 * np.pi * f) - law) / np.abs(law)).max()
    assert away == pytest.approx(series.error, rel=0.05)
    assert away < tolerance
    assert series.shear_modulus == solid.shear_modulus
    assert len(series.terms) <= 9
    assert len(solid.series(10 * tolerance).terms) < len(series.terms)
    relaxed = solid.relaxing(tolerance).complex_modulus(2 * np.pi * f)
    np.testing.assert_allclose(relaxed, series(2 * np.pi * f), rtol=1e-13)


def test_flat_body_uses_the_series_of_a_table():
    circle = simple_model.Trajectory(shape="circle", size=0.01, speed=4.0)
    # From 0 Hz on, where a table does not leave open what it creeps to.
    table = table_of(ECOFLEX, [0.0, *np.geomspace(1.0, 3000.0, 60)])
    own, law = (scene(m, drive="pressure_squared", trajectory=circle) for m in (table, ECOFLEX))
    found, expected = (compute(each, "flat-body").displacement for each in (own, law))
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_the_expected_error_of_a_plan_includes_the_series():
    noise = np.random.default_rng(0).standard_normal((2, len(HERTZ)))
    moduli = ECOFLEX.complex_modulus(2 * np.pi * HERTZ) * (1 + 0.03 * (noise[0] + 1j * noise[1]))
    rough = tabulated(density=1070, poisson=0.4999, frequencies=HERTZ, moduli=moduli)
    wide = replace(scene(rough).body, width=0.1, height=0.1, sides="absorbing")
    own = replace(scene(rough), body=wide)
    found = skinwave.plan(own, skinwave.SolveOptions(model="flat-body"))
    bodies = own.body, relaxing(own.body, 0.01)
    steady, series = (steady_lines(compliance(x), own.pressure, PROBES)[1] for x in bodies)
    away = np.linalg.norm(series - steady, axis=0) / np.linalg.norm(steady, axis=0)
    assert found.error > 0.95 * away.max() > 0.01
    assert rough.law.series.words in {row.value for row in found.rows}


def test_an_error_of_the_modulus_is_amplified_as_the_motion_of_a_bounded_body(monkeypatch):
    away, loss = 1e-3, PronyTerm(modulus=3e3, time=1e-3)
    solid = Material(density=1070, shear_modulus=25e3, poisson=0.49, prony=(loss,))
    stiffer = replace(solid, shear_modulus=25e3 * (1 + away), prony=(
        replace(loss, modulus=3e3 * (1 + away)),))  # fmt: skip
    own, other = (scene(table_of(each), am_frequency=260) for each in (solid, stiffer))
    a, b = (compute(each, "fem", h=6e-3).displacement for each in (own, other))
    change = (np.linalg.norm(b - a, axis=0) / np.linalg.norm(a, axis=0)).max()
    monkeypatch.setattr(left_out, "_series_deviation", lambda *given: away)
    assert change > 4 * away
    assert left_out.series_error(own, "fem", 0.1) == pytest.approx(change, rel=0.15)


def test_a_load_beyond_a_table_is_refused():
    own = scene(table_of(ECOFLEX, [20.0, 60.0, 130.0]))
    for model in ("auto", "flat-body-harmonic"):
        with pytest.raises(ValueError, match="130 Hz"):
            skinwave.simulate(own, model)


def test_a_table_continues_by_its_series():
    table = table_of(ECOFLEX)
    assert table.complex_modulus(2 * np.pi * 1500.0) == ECOFLEX.complex_modulus(2 * np.pi * 1500.0)
    for f in (2000.0, 2.0, 100.0 - 30j):
        found, law = (m.complex_modulus(2 * np.pi * f) for m in (table, ECOFLEX))
        assert abs(found - law) < 0.02 * abs(law), f
    assert table.shear_modulus == table.complex_modulus(0.0).real
    rested = table_of(ECOFLEX, [0.0, *HERTZ])
    assert rested.shear_modulus == ECOFLEX.shear_modulus
    halfway = np.mean(ECOFLEX.complex_modulus(2 * np.pi * HERTZ[3:5]))
    assert table.complex_modulus(2 * np.pi * HERTZ[3:5].mean()) == pytest.approx(halfway, rel=1e-12)


@pytest.mark.parametrize(
    ("law", "said"),
    [(lambda w: 25e3 + 10e3j * np.sign(w), "not causal"),
     (lambda w: 25e3 * (1 - 1e-4j * w), "loss modulus")],
)  # fmt: skip
def test_every_model_refuses_an_impossible_law(law, said):
    own = scene(replace(ECOFLEX, law=law))
    with pytest.raises(ValueError, match=said):
        skinwave.plan(own)
    for model in ("flat-body", "fem-harmonic"):
        with pytest.raises(ValueError, match=said):
            compute(own, model)


def test_a_table_is_read_from_the_folder_of_the_scene(tmp_path):
    rows = "200,27e3,5e3\n20,25e3,1e3\n# a comment\n60, 26e3 ,3e3\n"
    (tmp_path / "moduli.csv").write_text(HEADER + rows)
    (tmp_path / "scene.toml").write_text(BODY + 'table = "moduli.csv"\n')
    own = read(tmp_path / "scene.toml")
    moduli = [25e3 + 1e3j, 26e3 + 3e3j, 27e3 + 5e3j]
    expected = tabulated(density=1070, poisson=0.4999, frequencies=[20, 60, 200], moduli=moduli)
    assert own.body.solid == expected
    (point,) = cases(tmp_path / "scene.toml", [{"body.size_x_mm": 60.0}])
    assert point.scene.body.solid == expected
    (tmp_path / "moduli.csv").unlink()
    assert loads(dumps(own)) == own
    with pytest.raises(ValueError, match=r"'moduli.csv' names a file"):
        loads(BODY + 'table = "moduli.csv"\n')


def test_invalid_files_of_moduli_are_refused():
    for text, said in (
        ("", "frequency_hz"), ("1,2\n", "three numbers"), ("10,0,3\n", "storage modulus"),
        ("10,1e4,3\n10,1e4,4\n", "does not rise"), ("0,1e4,3\n10,1e4,4\n", "at 0 Hz"),
        ("210,1e4,-3\n", "-3 Pa at 210 Hz"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            simple_model.modulus_table(text and HEADER + text)


def test_a_loss_factor_is_nearly_constant_and_its_law_causal():
    eta = 2.0
    solid = Material(density=1000, shear_modulus=25e3, poisson=0.49, loss_factor=eta)
    mu = solid.complex_modulus(2 * np.pi * np.geomspace(10, 2000, 200))
    np.testing.assert_allclose(mu.imag / mu.real, eta, rtol=0.025)
    w = 2 * np.pi * 150
    assert solid.complex_modulus(w).real == pytest.approx(25e3, rel=1e-9)
    q = 2 / np.pi * np.arctan(eta)  # Kjartansson's constant Q
    power = np.geomspace(10 / 150, 2000 / 150, 200) ** q
    np.testing.assert_allclose(mu.real, 25e3 * power, rtol=0.035)
    # Kramers and Kronig: mu(inf) - mu(0) = 2 / pi int mu''(x) / x dx, without the viscosity.
    x = 2 * np.pi * np.geomspace(1e-4, 1e8, 20_000)
    loss = solid.complex_modulus(x).imag - solid.without_loss_factor().viscosity * x
    slow, fast = solid.complex_modulus(x[[0, -1]]).real
    assert fast - slow == pytest.approx(2 / np.pi * np.trapezoid(loss, np.log(x)), rel=1e-3)


def test_laws_that_relax_far_below_the_band_have_a_series():
    law = FractionalZener(shear_modulus=10e3, fast_modulus=1e5, exponent=0.05, time=1e-4)
    series, w = simple_model.fit_prony(law, rest=10e3), 2 * np.pi * np.geomspace(1, 2000, 501)
    assert series.error <= 0.005
    assert np.abs(series(w) / law(w) - 1).max() < 0.006
    assert complex(series(0.0)) == pytest.approx(10e3, rel=1e-9)


def saturating(amplitude, modulation, depth):
    """A transducer that saturates: no polynomial of the modulation."""
    return np.tanh(3 * amplitude * (1 + depth * modulation) / (1 + depth)) ** 2 / np.tanh(3) ** 2


SATURATING = simple_model.DriveLaw(name="saturating", pressure=saturating)


def own_scene(material=TWO, **load):
    tacton = Tacton(am_frequency=140, duration=0.05, trajectory=CIRCLE)
    body = Body(material=material, width=0.03, height=0.03, depth=0.008, sides="clamped")
    pressure = MovingPressure(**{"tacton": tacton} | load)
    return Scene(pressure=pressure, body=body, probes=tuple(map(tuple, PLACES.tolist())))


@pytest.mark.parametrize("law", [SATURATING, CUBIC])
def test_lines_of_any_drive_law_match_its_waveform(law):
    tacton = Tacton(am_frequency=100.0, envelope_frequency=20.0, duration=1.0)
    load = MovingPressure(tacton=tacton, drive=law)
    lines = load_lines(load, 1e-6)
    count = 2**16
    spectrum = np.fft.rfft(load.gain(np.arange(count) / count)) / count
    spectrum[1:] *= 2
    found = np.zeros(len(spectrum), np.complex128)
    np.add.at(found, np.round(lines.frequencies).astype(int), lines.coefficients)
    assert np.abs(found - spectrum).max() < 1e-4 * np.abs(spectrum).max()
    above = np.flatnonzero(np.abs(spectrum) > 1e-3 * np.abs(spectrum).max()).max()
    assert above > 2 * 120  # beyond the second order
    assert highest_line(load) >= above
    plain = replace(load, tacton=replace(tacton, envelope_frequency=0.0))
    assert "3f_AM" in simple_model.named_lines(plain)


def test_unusable_laws_are_refused():
    even = lambda x: np.ones(x.shape[:-1])  # noqa: E731
    for ask, said in (
        (lambda: load_lines(MovingPressure(tacton=AM, drive=GATE)), "do not fall"),
        (lambda: simple_model.DriveLaw(name="wrong", degree=2, pressure=saturating), "polynomial"),
        (lambda: MovingPressure(tacton=BEATEN, drive=SATURATING), "product"),
        (lambda: dumps(own_scene(drive=CUBIC)), "Python function"),
        (lambda: dumps(own_scene(replace(TWO, prony=(), law=closed_form))), "Python function"),
        (lambda: compute(own_scene(profile=even), "flat-body"), "flat-body"),
    ):
        with pytest.raises(ValueError, match=said):
            ask()


def test_scenes_and_models_know_a_registered_law(monkeypatch):
    monkeypatch.setitem(simple_model.DRIVES, CUBIC.name, CUBIC)
    own = own_scene(drive="cubic")
    assert 'drive = "cubic"' in dumps(own)
    assert loads(dumps(own)) == own
    assert dumps(own_scene(drive=CUBIC)) == dumps(own)
    times = np.arange(1000) / 1e4
    steady, whole = (
        model(slab(TWO, 0.008), own.pressure, PLACES, times).displacement
        for model in (simple_model.steady_state, simple_model.flat_body)
    )
    assert np.abs(steady - whole)[500:].max() < 1e-3 * np.abs(whole).max()
    kernel = simple_model.point_kernel(own.pressure, PLACES, times).displacement
    gain = own.pressure.gain(times)[:, None]
    np.testing.assert_allclose(kernel, gain * own.pressure.spot(PLACES, CIRCLE.position(times)))


def test_loads_with_functions_are_not_cached():
    assert cache.key(own_scene(drive=CUBIC).pressure) != cache.key(own_scene(drive=CUBIC).pressure)


def closed_form(w):
    return 20e3 + 8e3 / (1 + 1 / (0.4e-3j * w)) + 6e3 / (1 + 1 / (3e-3j * w))


@pytest.fixture(scope="module")
def element():
    mesh = meshes.block((0.01, 0.01, 0.01), 0.01)
    P = fem.pressure_operator(mesh)
    return mesh, P @ np.ones(P.shape[1]), fem.probe_operator(mesh, [[0.0, 0.0]])


def answers(element, material):
    mesh, force, S = element
    found = fem.harmonic(fem.assemble(mesh, replace(material, density=1e-6)), force, LINES)
    return (S @ found.T)[0]


def test_the_stiffness_of_an_element_matches_the_closed_form(element):
    found = answers(element, TWO)
    again = replace(TWO, prony=(*TWO.prony, TWO.prony[0]))  # two terms of one time
    doubled = replace(TWO, prony=(PronyTerm(modulus=16e3, time=0.4e-3), TWO.prony[1]))
    np.testing.assert_allclose(answers(element, again), answers(element, doubled), rtol=1e-12)
    modulus = found[0] / found[1:] * 20e3  # without inertia
    np.testing.assert_allclose(modulus, closed_form(2 * np.pi * LINES[1:]), rtol=1e-6)


def test_a_table_of_a_law_gives_the_harmonic_motion_of_the_law(element):
    f = np.linspace(1, 1500, 3000)
    own = tabulated(density=1000.0, poisson=0.45, frequencies=f, moduli=closed_form(2 * np.pi * f))
    np.testing.assert_allclose(answers(element, own), answers(element, TWO), rtol=2e-3)
    power = compute(own_scene(own), "fem-harmonic", h=0.01).effort
    assert power.energy_imbalance < 1e-6
