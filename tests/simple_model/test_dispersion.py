"""Dispersion curves beside closed forms, published roots and a determinant that shares no code."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
import read_results

from simple_model import Material, Stack
from simple_model.layers.compliance import layered, slab, thin_sheet
from simple_model.layers.dispersion import dispersion_curves, sheet_curves
from simple_model.layers.material import PRESETS
from simple_model.layers.wavenumber_integral import point_response
from skinwave.commands.cli import main
from skinwave.scene.file import loads
from skinwave.studies.dispersion import driven_modes

WIDTH = 4.35e-3  # m, of the focal spot
SOFT = Material(density=1000, shear_modulus=8e3, poisson=0.45, viscosity=1.0)
STIFF = Material(density=1100, shear_modulus=60e3, poisson=0.4, loss_factor=0.1)
CIRCLE = """
[tacton]
am_frequency_hz = 140
duration_s = 0.5
shape = "circle"
size_mm = 20
speed_m_per_s = 12
[body]
"""


def solid(poisson, **loss):
    return Material(density=1000, shear_modulus=25e3, poisson=poisson, **loss)


def roots_of(curves, n=0):
    return np.array([mode.wavenumbers[n] for mode in curves.modes])


@pytest.mark.parametrize(("poisson", "ratio"), [(0.25, 0.919402), (0.4999, 0.955300)])
def test_rayleigh_wave_of_a_half_space(poisson, ratio):
    material = solid(poisson)
    (mode,) = dispersion_curves(Stack(materials=(material,), thicknesses=(inf,)), [50, 200]).modes
    assert mode.name == "Rayleigh wave"
    assert mode.phase_speed / material.shear_speed == pytest.approx([ratio] * 2, rel=1e-6)
    assert mode.group_speed == pytest.approx(mode.phase_speed, rel=1e-6)
    assert set(mode.kinds) == {"propagating"}


def test_rayleigh_wave_with_viscosity_goes_with_the_complex_modulus():
    forearm = PRESETS["forearm"]
    (mode,) = dispersion_curves(Stack(materials=(forearm,), thicknesses=(inf,)), [80, 200]).modes
    speed = 0.955300 * np.sqrt(forearm.complex_modulus(2 * pi * mode.frequencies) / 1000)
    assert mode.wavenumbers == pytest.approx(2 * pi * mode.frequencies / speed, rel=1e-5)
    assert mode.decay_length[1] == pytest.approx(7.3e-3, rel=0.01)  # published beside 3.25 m/s


@pytest.mark.parametrize("poisson", [0.25, 0.4999])
def test_layers_of_the_material_of_the_half_space_below_have_its_rayleigh_wave(poisson):
    material = solid(poisson, loss_factor=0.1)
    stack = Stack(materials=(material, material), thicknesses=(0.004, inf))
    rayleigh = Stack(materials=(material,), thicknesses=(inf,))
    f = np.linspace(100, 300, 5)
    (expected,) = dispersion_curves(rayleigh, f).modes
    found = dispersion_curves(stack, f)
    (waves,) = [mode for mode in found.modes if (mode.kinds == "propagating").any()]
    assert waves.wavenumbers == pytest.approx(expected.wavenumbers, rel=1e-8)
    assert waves.group_speed == pytest.approx(expected.group_speed, rel=1e-5)
    assert waves.residues == pytest.approx(expected.residues, rel=1e-5)
    own, closed = (x.shapes[0] / x.shapes[0, 0, 1] for x in (waves, expected))
    at, depths = found.depths.searchsorted(0.0035), dispersion_curves(rayleigh, f).depths
    for axis in (0, 1):
        there = np.interp(found.depths[at], depths, closed[:, axis])
        assert own[at, axis] == pytest.approx(there, abs=5e-3)


@pytest.mark.parametrize(("w", "a0", "s0"), [(0.1, 0.21697, 1.69026), (5, 0.87612, None)])
def test_rayleigh_lamb_waves_of_a_plate(w, a0, s0):
    material, thickness = solid(0.3), 0.01
    plate = Stack(materials=(material,), thicknesses=(thickness,), base="free")
    found = dispersion_curves(plate, [w * material.shear_speed / thickness / (2 * pi)])
    speeds = np.sort([m.phase_speed[0] for m in found.modes if m.is_wave[0]]) / material.shear_speed
    assert speeds[0] == pytest.approx(a0, rel=1e-4)
    if s0:
        assert speeds[1] == pytest.approx(s0, rel=1e-4)


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_cut_offs_of_a_slab_on_a_rigid_base(poisson):
    """At odd multiples of c_s/4H and of c_p/4H: there a mode has k = 0."""
    material, depth = solid(poisson), 0.015
    stack = Stack(materials=(material,), thicknesses=(depth,))
    shear, pressure = (c / (4 * depth) for c in (material.shear_speed, material.pressure_speed))
    expected = [shear, 3 * shear, 5 * shear] + [pressure, 3 * pressure] * (poisson == 0.3)
    for cut_off in expected:
        found = dispersion_curves(stack, cut_off * np.array([0.999, 1.0, 1.001]))
        below, at, above = (np.nanmin(np.abs(roots_of(found, n))) for n in range(3))
        assert at < 0.05 * min(below, above), cut_off
    first = dispersion_curves(stack, np.linspace(20, 200, 10)).modes[0]
    assert first.cut_on == pytest.approx(shear, rel=1e-3)  # between two frequencies
    assert set(first.kinds[first.frequencies < shear]) == {"evanescent"}


def waves_in(material, omega, k):
    """Motion and stress (4, 4) at z of waves e^{+-p z}, e^{+-s z}, as a function of z."""
    mu = complex(material.complex_modulus(omega))
    lam = 2 * material.poisson / (1 - 2 * material.poisson) * mu
    p = np.sqrt(k**2 - material.density * omega**2 / (lam + 2 * mu) + 0j)
    s = np.sqrt(k**2 - material.density * omega**2 / mu + 0j)

    def at(z, reference):
        columns = []
        for b, is_shear in ((p, 0), (-p, 0), (s, 1), (-s, 1)):
            # u = (d phi/dx - d psi/dz, d phi/dz + d psi/dx) of e^{-ikx + b (z - z0)}
            u, w = (-b, -1j * k) if is_shear else (-1j * k, b)
            normal = lam * -1j * k * u + (lam + 2 * mu) * b * w
            z0 = reference[0] if b.real < 0 else reference[1]
            column = np.array([u, w, normal, mu * (b * u - 1j * k * w)])
            columns.append(column * np.exp(b * (z - z0)))
        return np.array(columns).T

    return at


def secular(stack, omega, k):
    """Determinant of the boundary conditions of layers on a rigid or free base."""
    n = len(stack.materials)
    matrix, top, row = np.zeros((4 * n, 4 * n), complex), 0.0, 2
    for j, (material, thickness) in enumerate(zip(stack.materials, stack.thicknesses, strict=True)):
        at, ends = waves_in(material, omega, k), (top, top + thickness)
        upper, lower = at(ends[0], ends), at(ends[1], ends)
        scale = np.array([k, k, 1e4, 1e4]) / 1e4
        upper, lower = upper / scale[:, None], lower / scale[:, None]
        columns = slice(4 * j, 4 * j + 4)
        if j == 0:
            matrix[:2, columns] = upper[2:]
        else:
            matrix[row - 4 : row, columns] = -upper
        if j == n - 1:
            matrix[row:, columns] = lower[2:] if stack.base == "free" else lower[:2]
        else:
            matrix[row : row + 4, columns] = lower
        row, top = row + 4, ends[1]
    sign, size = np.linalg.slogdet(matrix / np.abs(matrix).max(axis=1, keepdims=True))
    return sign * np.exp(size)


def refined(stack, omega, start):
    """The root of the determinant by the secant method."""
    k, before = start * (1 + 1e-4), start * (1 - 2e-4j)
    last = secular(stack, omega, before)
    for _ in range(40):
        value = secular(stack, omega, k)
        if value == last or abs(k - before) < 1e-12 * abs(k):
            break
        k, before, last = k - value * (k - before) / (value - last), k, value
    return k


@pytest.mark.parametrize(("base", "f"), [("clamped", 60.0), ("free", 210.0)])
def test_modes_of_layers_are_roots_of_a_determinant_that_shares_no_code(base, f):
    stack = Stack(materials=(SOFT, STIFF, SOFT), thicknesses=(0.003, 0.004, 0.005), base=base)
    roots = roots_of(dispersion_curves(stack, [f]))
    assert len(roots) == 6
    for k in roots:
        assert abs(refined(stack, 2 * pi * f, k) - k) < 1e-6 * abs(k)


def test_modes_of_a_slab_add_up_to_its_wavenumber_integral():
    palm, f = PRESETS["palm"], 140.0
    stack = Stack(materials=(palm,), thicknesses=(0.015,))
    ((expected,),) = point_response(slab(palm, 0.015), [0.03], [2 * pi * f], WIDTH)
    found = sum(m.amplitude(WIDTH, 0.03)[0] for m in dispersion_curves(stack, [f], most=12).modes)
    assert abs(found - expected) < 1e-6 * abs(expected)


def test_bending_waves_of_a_sheet_in_vacuum_and_in_air():
    paper = PRESETS["paper"]
    bare = sheet_curves(paper, 1e-4, [140.0], air_density=0)
    alone = thin_sheet(paper, 1e-4, air_density=0)
    ((expected,),) = point_response(alone, [0.02], [280 * pi], WIDTH)
    assert abs(sum(m.amplitude(WIDTH, 0.02)[0] for m in bare.modes) / expected - 1) < 1e-6
    elastic = replace(paper, loss_factor=0.0)
    (wave, _) = sheet_curves(elastic, 1e-4, [140.0], air_density=0).modes
    assert wave.group_speed[0] == pytest.approx(2 * wave.phase_speed[0], rel=1e-6)
    aired, not_aired = (
        sheet_curves(paper, 1e-4, [80.0, 191.0], air_density=air).modes[0].phase_speed
        for air in (1.2, 0.0)
    )
    slower = aired / not_aired
    assert (np.abs(slower - 0.94) < 0.03).all()  # by 4 to 8 %, less at higher ones
    assert slower[1] > slower[0]


def test_a_stiff_skin_on_a_softer_half_space_begins_to_leak():
    stack = Stack(materials=(PRESETS["dermis"], PRESETS["muscle"]), thicknesses=(0.002, inf))
    mode = dispersion_curves(stack, np.arange(20, 301, 20)).modes[0]
    assert mode.kinds[0] == "propagating"
    assert mode.kinds[-1] == "leaky"
    below = np.sqrt(PRESETS["muscle"].complex_modulus(2 * pi * mode.frequencies) / 1000)
    slower = mode.phase_speed < 1 / (1 / below).real
    assert slower[[0, -1]].tolist() == [True, False]


def test_frequencies_are_checked():
    for f in ([], [0.0, 10.0], [20.0, 10.0], [10.0, inf]):
        with pytest.raises(ValueError, match="ascending"):
            dispersion_curves(Stack(materials=(SOFT,), thicknesses=(0.01,)), f)


@pytest.fixture(scope="module")
def driven():
    return driven_modes(loads(CIRCLE + 'kind = "slab"'), spacing=24)


def test_lines_of_a_load_are_at_their_own_frequencies_on_the_curves(driven):
    line = driven.lines[0]
    assert line.name == "f_d"
    assert line.frequency == pytest.approx(12 / (pi * 0.02))
    assert line.frequency in driven.curves.frequencies
    (alone,) = [m for m in dispersion_curves(
        Stack(materials=(PRESETS["palm"],), thicknesses=(0.015,)), [line.frequency]).modes
        if abs(m.phase_speed[0] / line.phase_speed - 1) < 1e-6]  # fmt: skip
    assert alone.decay_length[0] == pytest.approx(line.decay_length, rel=1e-6)
    assert line.mach_angle == pytest.approx(np.degrees(np.arcsin(line.phase_speed / 12)))
    below = next(line for line in driven.lines if line.name == "f_d-f_AM")  # 51 Hz
    assert (below.kind, below.mach_angle) == ("evanescent", None)


def test_command_writes_a_page_a_table_and_arrays(tmp_path):
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(CIRCLE + 'kind = "slab"')
    assert main(f"dispersion {scene} --modes 3 --highest 300 -o {out}".split()) == 0
    header, first = (out / "dispersion.csv").read_text().splitlines()[:2]
    assert header.split(",")[:4] == ["mode", "kind", "frequency_hz", "re_k_rad_per_m"]
    assert first.split(",")[2] == "10"
    assert "<table" in (out / "index.html").read_text()
    arrays = read_results.arrays(out / "dispersion.npz")
    assert arrays["wavenumber_per_m"].shape == (3, len(arrays["frequency_hz"]))
    assert arrays["frequency_hz"].max() == 300


def bound_speeds(stack, hertz, slowest, fastest):
    """Speeds, ascending, where 1/G of the surface, which is real without loss, passes through 0."""
    w = 2 * np.pi * hertz
    k = np.linspace(w / fastest, w / slowest, 20_000)
    stiff = (1 / layered(stack)(k + 0j, np.array([[w + 0j]])))[0].real
    size = np.abs(stiff)
    crossing = np.flatnonzero(stiff[1:-2] * stiff[2:-1] < 0) + 1
    found = [i for i in crossing if size[i - 1] > size[i] and size[i + 2] > size[i + 1]]
    return w / k[found][::-1]


@pytest.mark.parametrize("depth", [inf, 6.0])
def test_few_frequencies_lose_no_wave(depth):
    solids = [Material(density=1900, shear_modulus=1900 * c**2, poisson=0.4) for c in (200, 700)]
    stack = Stack(materials=tuple(solids), thicknesses=(6.0, depth))
    hertz = np.array([10.0, 20.0, 40.0, 60.0, 100.0])
    curves = dispersion_curves(stack, hertz, most=4)
    for j, f in enumerate(hertz):
        speeds = np.array([mode.phase_speed[j] for mode in curves.modes])
        for exact in bound_speeds(stack, f, 180.0, 690.0)[:4]:
            assert np.nanmin(np.abs(speeds / exact - 1)) < 1e-3, (f, exact)
