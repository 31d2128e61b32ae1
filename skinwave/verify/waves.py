"""Waves: half-space, surface, plate; and absorbing sides."""

from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

import fem
import meshes
from meshes import TetMesh
from skinwave.bodies.absorbing_layer import layer_drag, layer_of
from skinwave.bodies.slab import slab_grid_lines
from skinwave.scene.scene import Body
from skinwave.typing import Array
from skinwave.verify import references
from skinwave.verify.case import Checks, absolute, below, case, misfit, relative
from skinwave.verify.predictions import peak
from skinwave.verify.setups import (
    FOREARM,
    QUARTER,
    RADII,
    SLIDING,
    SOURCES,
    WIDTH,
    frequencies,
    gaussian,
    nearest,
    push,
    quarter_space,
    read,
    unit_solid,
)


@case(
    f"{SOURCES['Lamb']}; {SOURCES['Hankel']}",
    mesh="a quarter; 3 mm to 20 mm from the focus, sides fixed at 100 mm", slow=True,
)  # fmt: skip
def steady_focus() -> Checks:
    """Gaussian focus of steady frequency on a viscous half-space, 80 to 210 Hz."""
    mesh = quarter_space(0.10, 1.5, 0.02, 0.003)
    for nu, lines in ((0.4999, (80.0, 140.0)), (0.49, (210.0,))):
        ops = fem.assemble(mesh, fem.Material(**FOREARM, poisson=nu), fixed=QUARTER)
        for hz in lines:
            ours = read(mesh, fem.harmonic(ops, push(mesh, gaussian()), hz)[0], RADII)
            w = 2 * np.pi * hz
            mu = FOREARM["shear_modulus"] + 1j * w * FOREARM["viscosity"]
            kernel = partial(references.half_space_kernel, w=w, density=1000, mu=mu, poisson=nu)
            exact = references.gaussian_response(kernel, RADII, width=WIDTH)
            what, f, e = f"{hz:g} Hz, nu = {nu:g}", abs(ours), abs(exact)
            yield relative(f"{what}: amplitude at the focus, 1 Pa", f[0], e[0], 0.02, "um")
            yield relative(f"{what}: amplitude at 0 to 20 mm, worst", f, e, 0.05, "um")
            yield misfit(f"{what}: complex amplitude, relative L2", ours, exact, 0.03, "um")


@case(
    "Pekeris, PNAS 41:469 (1955); Mooney, Bull Seismol Soc Am 64:473 (1974), convolved with a "
    "Gaussian pulse",
    mesh="a quarter in cylindrical cells, 3.5 elements per shortest wave; dashpots at r = 2.3, "
    "fixed at depth 2.3", slow=True,
)  # fmt: skip
def lamb() -> Checks:
    """Lamb's problem: a pulse of force on a half-space, nu = 0.25."""
    mesh = _sector(2.3, 0.14)
    fixed = {"front": "y", "back": "x", "bottom": "xyz"}
    ops = fem.assemble(mesh, unit_solid(0.25), fixed=fixed, absorbing="right")
    delay, width = 0.8, 0.2
    force = push(mesh, gaussian(0.012))
    force /= 4 * np.abs(force[2::3].sum())
    dt, steps, radii = 0.02, 145, np.array([1.0, 1.5])
    S = fem.probe_operator(mesh, np.column_stack([radii, 0 * radii]))
    states = fem.transient(ops, lambda t: force * np.exp(-(((t - delay) / width) ** 2) / 2), dt)
    motion = np.array([S @ s.displacement for s in islice(states, steps + 1)])
    t = np.arange(steps + 1) * dt
    exact = np.column_stack(
        [references.lamb_pulse(t, r, mu=1, shear_speed=1, delay=delay, width=width) for r in radii]
    )
    yield misfit("vertical motion at r = 1, relative L2", motion[:, 0], exact[:, 0], 0.02)
    yield misfit("vertical motion at r = 1.5, relative L2", motion[:, 1], exact[:, 1], 0.02)
    ours, theirs = (0.5 / np.diff([peak(t, u) for u in each.T])[0] for each in (motion, exact))
    yield relative("Rayleigh speed: 0.5 over the crest's time between both", ours, theirs, 0.01)


@case(
    f"Rayleigh, Proc London Math Soc 17:4 (1885); {SOURCES['Achenbach']}, chapter 5",
    mesh="half a wavelength between sliding ends, 2.5 wavelengths deep",
)
def rayleigh() -> Checks:
    """Rayleigh waves, nu = 0 to 0.4999."""
    down = meshes.graded_axis(2.5, 0.05, meshes.Grading(radius=0.3, growth=1.15))
    mesh = meshes.extrude(np.linspace(0, 0.5, 11), [0, 0.05], -down[::-1])
    top = np.unique(mesh.facets["top"])
    for nu in (0.0, 0.25, 0.45, 0.4999):
        material = unit_solid(nu)
        exact, what = references.rayleigh_ratio(nu), f"c_R / c_s, nu = {nu:g}"
        yield relative(f"material's formula: {what}", material.rayleigh_speed, exact, 1e-9)
        ops = fem.assemble(mesh, material, fixed={**SLIDING, "bottom": "xyz"})
        hz, shapes = fem.modes(ops, 6)
        # The mode whose top is most similar to a wave of length 1.
        wave = np.abs(np.cos(2 * np.pi * mesh.points[top, 0]) @ shapes[3 * top + 2])
        yield relative(f"finite elements: {what}", hz[np.argmax(wave)], exact, 1e-3)


@case(
    f"Lamb, Proc R Soc A 93:114 (1917); {SOURCES['Achenbach']}, chapter 6",
    mesh="half a wavelength between sliding ends, 4 cells through the thickness",
)
def plate_waves() -> Checks:
    """Rayleigh-Lamb waves of a plate, A0 and S0, nu = 0.3."""
    wavenumbers = (0.2, 0.5, 1.0, 2.0, 4.0)
    strips = [_strip_modes(k) for k in wavenumbers]
    for name in ("A0", "S0"):
        for k, w in zip(wavenumbers, strips, strict=True):
            exact = references.rayleigh_lamb(k, thickness=1, poisson=0.3, symmetric=name == "S0")
            what = f"{name}: c / c_s at k h = {k:g}"
            yield relative(what, nearest(w, exact) / k, exact / k, 0.005)


@case(f"{SOURCES['Lysmer']}: no reflection at normal incidence", mesh="50 cells high")
def absorbed_pulse() -> Checks:
    """Shear pulse that runs down a column and leaves through a viscous boundary."""
    material = fem.Material(density=1000, shear_modulus=25e3, poisson=0.45)
    mesh = meshes.extrude([0, 0.002], [0, 0.002], np.linspace(-0.1, 0, 51))
    ops = fem.assemble(mesh, material, fixed={"sides": "yz"}, absorbing="bottom")
    top = np.unique(mesh.facets["top"])
    force = np.zeros(mesh.n_dofs)
    force[3 * top] = 1e-6 / len(top)
    states = fem.transient(ops, lambda t: force * np.exp(-(((t - 0.004) / 0.001) ** 2)), 2e-5)
    later = np.array([s.displacement[3 * top].mean() for s in islice(states, 3000)])[600:]
    exact = 1e-6 * 0.001 * np.sqrt(np.pi) / (1000 * 5.0 * 4e-6)
    yield below("later motion of the top / displacement", np.ptp(later) / later.mean(), 1e-3)
    what = "displacement = impulse / (density c_s area)"
    yield relative(what, later.mean(), exact, 0.01, "um")


@case(
    f"{SOURCES['Lysmer']}, from the boundary condition; displacement amplitudes",
    mesh="strip of half a trace wavelength, 8 elements per shear wavelength, 3 long",
)
def oblique_p_sv() -> Checks:
    """P and SV waves at an angle on a viscous boundary, nu = 0.25."""
    for kind, row, degrees in (("P", 0, 30), ("P", 0, 60), ("SV", 1, 20), ("SV", 1, 30)):
        k = 2 * np.pi * np.sin(np.radians(degrees)) * (np.sqrt(1 / 3) if kind == "P" else 1)
        exact, waves = references.in_plane_reflection(k, 2 * np.pi, poisson=0.25)
        amplitudes = _reflected_in_plane(k, waves)[row]
        for name, ours, theirs in zip(("P", "SV"), amplitudes, exact[row], strict=True):
            yield absolute(f"{kind} in at {degrees} degrees, {name} out", ours, theirs, 0.003)


@case(
    "a body so wide that no reflection arrives",
    mesh="plane slab 50 mm wide and 15 mm deep, cells of 2.5 mm, the layer 105 mm wide",
    note="With dashpots alone (Lysmer and Kuhlemeyer, 1969), the error reaches 17 %.",
)
def absorbing_layer() -> Checks:
    """Absorbing layer around a slab."""
    hertz = np.array([20.0, 51.0, 70.0, 80.0, 90.0, 100.0, 111.0, 140.0, 191.0, 271.0])
    slab = Body(width=0.05, height=0.05)
    exact, ours = (_plane_slab(body, hertz) for body in (replace(slab, width=1.6), slab))
    errors = np.abs(ours - exact).max(axis=1) / np.abs(exact).max(axis=1)
    yield below("largest error at any line, over the motion at the focus", errors.max(), 0.02)
    yield below("at 20 and 51 Hz", errors[:2].max(), 0.001)


def _plane_slab(body: Body, hertz: Array, h: float = 2.5e-3) -> Array:
    """Return displacements (f, p) in m under a line focus, in the half x > 0 of a slab."""
    x, _, z = slab_grid_lines(body, h)
    mesh = meshes.half(meshes.extrude(x, [0, h], z), "x")
    ops = fem.assemble(
        mesh, body.solid, fixed={"bottom": "xyz", "mirror_x": "x", "front": "y", "back": "y"},
        absorbing="right", drag=layer_drag(body, layer_of(body), mesh),
    )  # fmt: skip
    force = push(mesh, lambda x: np.exp(-(x[:, 0] ** 2) / (2 * WIDTH**2)))
    motion = fem.harmonic(ops, force, hertz)
    return np.array([read(mesh, u, np.arange(5) * 0.005, h / 2) for u in motion])


def _strip_modes(k: float) -> Array:
    """Return angular frequencies of half a wavelength of a plate between sliding ends."""
    x = np.linspace(0, np.pi / k, max(8, int(np.ceil(2 * np.pi / k))) + 1)
    mesh = meshes.extrude(x, [0, 0.25], np.linspace(-1, 0, 5))
    return 2 * np.pi * frequencies(mesh, unit_solid(0.3), SLIDING, 12)


def _sector(length: float, h: float) -> TetMesh:
    """Return a quarter of a cylinder around a thin hole, in three curved cells of 30 degrees."""
    out = meshes.graded_axis(length, 0.004, meshes.Grading(radius=0.0, growth=1.35, coarsest=h))
    down = meshes.graded_axis(length, 0.01, meshes.Grading(radius=0.0, growth=1.35, coarsest=h))
    box = meshes.extrude(0.003 + out, np.linspace(0, np.pi / 2, 4), -down[::-1])
    r, angle, z = box.points.T
    return replace(box, points=np.column_stack([r * np.cos(angle), r * np.sin(angle), z]))


def _reflected_in_plane(k: float, waves: Array) -> Array:
    """Return reflections (P and SV in, P and SV out) at the base, from two loads on the top."""
    h, length = 0.125, 3.0
    width = np.linspace(0, np.pi / k, int(np.ceil(np.pi / k / h)) + 1)  # half a trace wavelength
    mesh = meshes.extrude(width, [0, h], np.linspace(-length, 0, int(length / h) + 1))
    x, _, z = mesh.points.T
    along, into, kz = waves.T
    inner = np.abs(z + length / 2) < 0.35 * length
    wave = np.exp(-1j * np.outer(z[inner] + length, -1.0 * kz))
    sideways = -1j * along * np.sin(k * x[inner])[:, None] * wave
    downwards = into * np.cos(k * x[inner])[:, None] * wave
    amplitudes = []
    ops = fem.assemble(mesh, unit_solid(0.25), fixed=SLIDING, absorbing="bottom")
    pressure = push(mesh, lambda x: np.cos(k * x[:, 0]))
    sine = push(mesh, lambda x: np.sin(k * x[:, 0]))
    traction = np.roll(sine.reshape(-1, 3), 1, axis=1).ravel()  # along x
    for force in (pressure, traction):
        u = fem.harmonic(ops, force, 1.0)[0].reshape(-1, 3)
        motion = np.concatenate([u[inner, 0], -u[inner, 2]])
        amplitudes.append(np.linalg.lstsq(np.vstack([sideways, downwards]), motion, rcond=None)[0])
    incident, reflected = np.split(np.array(amplitudes), 2, axis=1)
    return np.linalg.solve(incident, reflected)
