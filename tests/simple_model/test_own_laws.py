"""Drive laws, focus profiles, paths and materials of a user's own, without editing the source."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
import simple_model
from meshes import cache
from simple_model import DriveLaw, MovingPressure, PronyTerm, Tacton
from simple_model.layers.compliance import slab
from simple_model.load.sampling import highest_line
from simple_model.load.spectrum import load_lines
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Body, Scene

PROBES = np.array([[0.0, 0.0], [0.005, 0.0]])
CIRCLE = simple_model.Trajectory(shape="circle", size=0.01, speed=1.0)
TWO = fem.Material(
    density=1000.0, shear_modulus=20e3, poisson=0.45,
    prony=(PronyTerm(modulus=8e3, time=0.4e-3), PronyTerm(modulus=6e3, time=3e-3)),
)  # fmt: skip
HERTZ = np.array([0.0, 30.0, 140.0, 600.0])
CUBIC = DriveLaw(name="cubic", degree=3, pressure=lambda A, M, m: (A * (1 + m * M) / (1 + m)) ** 3)
AM = Tacton(am_frequency=140)
GATE = DriveLaw(name="gate", pressure=lambda A, M, m: A * (np.asarray(M) > 0.3))
BEATEN = Tacton(rhythm=simple_model.Rhythm(pulses=((0.1, 0.05),), ramp=0.01))


def saturating(amplitude, modulation, depth):
    """A transducer that saturates: no polynomial of the modulation."""
    return np.tanh(3 * amplitude * (1 + depth * modulation) / (1 + depth)) ** 2 / np.tanh(3) ** 2


SATURATING = DriveLaw(name="saturating", pressure=saturating)


def scene(material=TWO, **load):
    tacton = Tacton(am_frequency=140, duration=0.05, trajectory=CIRCLE)
    body = Body(material=material, width=0.03, height=0.03, depth=0.008, sides="clamped")
    pressure = MovingPressure(**{"tacton": tacton} | load)
    return Scene(pressure=pressure, body=body, probes=tuple(map(tuple, PROBES.tolist())))


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
    assert "3f_AM" in simple_model.named_lines(
        replace(load, tacton=replace(tacton, envelope_frequency=0.0))
    )


def test_unusable_laws_are_refused():
    for ask, said in (
        (lambda: load_lines(MovingPressure(tacton=AM, drive=GATE)), "do not fall"),
        (lambda: DriveLaw(name="wrong", degree=2, pressure=saturating), "polynomial"),
        (lambda: MovingPressure(tacton=BEATEN, drive=SATURATING), "product"),
        (lambda: dumps(scene(drive=CUBIC)), "Python function"),
        (lambda: dumps(scene(replace(TWO, prony=(), law=closed_form))), "Python function"),
        (lambda: compute(scene(profile=lambda x: np.ones(x.shape[:-1])), "flat-body"), "flat-body"),
    ):
        with pytest.raises(ValueError, match=said):
            ask()


def test_scenes_and_models_know_a_registered_law(monkeypatch):
    monkeypatch.setitem(simple_model.DRIVES, CUBIC.name, CUBIC)
    own = scene(drive="cubic")
    assert 'drive = "cubic"' in dumps(own)
    assert loads(dumps(own)) == own
    assert dumps(scene(drive=CUBIC)) == dumps(own)
    times = np.arange(1000) / 1e4
    steady, whole = (
        model(slab(TWO, 0.008), own.pressure, PROBES, times).displacement
        for model in (simple_model.steady_state, simple_model.flat_body)
    )
    assert np.abs(steady - whole)[500:].max() < 1e-3 * np.abs(whole).max()
    kernel = simple_model.point_kernel(own.pressure, PROBES, times).displacement
    gain = own.pressure.gain(times)[:, None]
    np.testing.assert_allclose(kernel, gain * own.pressure.spot(PROBES, CIRCLE.position(times)))


def test_loads_with_functions_are_not_cached():
    assert cache.key(scene(drive=CUBIC).pressure) != cache.key(scene(drive=CUBIC).pressure)


def closed_form(w):
    return 20e3 + 8e3 / (1 + 1 / (0.4e-3j * w)) + 6e3 / (1 + 1 / (3e-3j * w))


@pytest.fixture(scope="module")
def element():
    mesh = meshes.block((0.01, 0.01, 0.01), 0.01)
    P = fem.load_operator(mesh)
    return mesh, P @ np.ones(P.shape[1]), fem.probe_operator(mesh, [[0.0, 0.0]])


def answers(element, material):
    mesh, force, S = element
    found = fem.harmonic(fem.assemble(mesh, replace(material, density=1e-6)), force, HERTZ)
    return (S @ found.T)[0]


def test_the_stiffness_of_an_element_matches_the_closed_form(element):
    found = answers(element, TWO)
    again = replace(TWO, prony=(*TWO.prony, TWO.prony[0]))  # two terms of one time
    doubled = replace(TWO, prony=(PronyTerm(modulus=16e3, time=0.4e-3), TWO.prony[1]))
    np.testing.assert_allclose(answers(element, again), answers(element, doubled), rtol=1e-12)
    modulus = found[0] / found[1:] * 20e3  # without inertia
    np.testing.assert_allclose(modulus, closed_form(2 * np.pi * HERTZ[1:]), rtol=1e-6)


def test_a_table_of_a_law_gives_the_harmonic_motion_of_the_law(element):
    f = np.linspace(1, 1500, 3000)
    own = simple_model.tabulated(
        density=1000.0, poisson=0.45, frequencies=f, moduli=closed_form(2 * np.pi * f)
    )
    np.testing.assert_allclose(answers(element, own), answers(element, TWO), rtol=2e-3)
    power = compute(scene(own), "fem-harmonic", h=0.01).effort
    assert power.energy_imbalance < 1e-6
