"""Supports that move: a shaken layer in closed form, from rest, and in the files of scenes."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import skinwave
from skinwave import Body, Load, SupportMotion, dumps, loads
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import prepare
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.results.run import SUPPORT, Run

RHO, MU, VISCOSITY, DEPTH = 1000.0, 2e4, 20.0, 12e-3
SOLID = fem.Material(density=RHO, shear_modulus=MU, poisson=0.0, viscosity=VISCOSITY)
COLUMN = Body(material=SOLID, width=6e-3, height=6e-3, depth=DEPTH, sides="free")
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
ADRIFT = (
    '[body]\nbase = "free"\nsides = {left="free", right="free", front="free", back="absorbing"}'
)


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
    stiff = replace(SOLID, shear_modulus=2e8, viscosity=0.0)
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
    probes = np.zeros((1, 2))
    first, louder = (
        prepare(COLUMN, probes, h=6e-3, load=Load(support_motion=each))
        for each in (UP, replace(UP, frequency=90.0, amplitude=1e-6))
    )
    assert "factorise and reduce" not in louder.effort.seconds
    assert louder.load.support_motion.frequency == 90.0
    np.testing.assert_array_equal(first.inertia, louder.inertia)
    along = prepare(COLUMN, probes, h=6e-3, load=Load())
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
        (SHAKEN, "sides that do not absorb"),
        (SHAKEN + '[body]\nbase = "absorbing"\nsides = "clamped"', "do not absorb"),
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
