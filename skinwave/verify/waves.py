"""Waves: half-space, surface, plate; and the absorbing (viscous) boundary."""

from functools import lru_cache, partial
from itertools import islice
from typing import Any

import numpy as np

import fem
import meshes
from meshes import TetMesh
from skinwave.verify import references
from skinwave.verify.case import Case, Plot, absolute, below, described, largest, misfit, relative
from skinwave.verify.references import Floats
from skinwave.verify.statics import QUARTER, RADII, WIDTH, focus_force, on_axis, quarter_space

FOREARM: dict[str, Any] = {"density": 1000.0, "shear_modulus": 7.86e3, "viscosity": 5.03}
ACHENBACH = "Achenbach, Wave Propagation in Elastic Solids (1973)"
SLIDING = {"left": "x", "right": "x", "front": "y", "back": "y"}
LYSMER = "Lysmer and Kuhlemeyer, J Eng Mech Div ASCE 95:859 (1969)"


def steady_focus(frequency: float, poisson: float) -> Case:
    """A Gaussian focus of steady frequency on a viscoelastic half-space."""
    (mesh, ops), w = _half_space(poisson), 2 * np.pi * frequency
    found = on_axis(mesh, RADII) @ fem.harmonic(ops, focus_force(mesh), frequency)[0]
    mu = FOREARM["shear_modulus"] + 1j * w * FOREARM["viscosity"]
    r = np.append(RADII, np.linspace(0, 0.02, 60))
    exact = references.gaussian_response(
        lambda k: references.half_space_kernel(k, w, density=1000, mu=mu, poisson=poisson),
        r, width=WIDTH,
    )  # fmt: skip
    reference, curve = exact[: len(RADII)], exact[len(RADII) :]
    return Case(
        title=f"Gaussian focus of {frequency:g} Hz on a viscous half-space, nu = {poisson:g}",
        source="Lamb, Phil Trans R Soc A 203:1 (1904); Hankel's integral on the real axis",
        mesh=described(mesh, "a quarter; 3 mm to 20 mm from the focus, sides fixed at 100 mm"),
        checks=(
            relative("amplitude at the focus, 1 Pa", abs(found[0]), abs(reference[0]), 0.02, "um"),
            largest("amplitude at 0 to 20 mm, worst", abs(found), abs(reference), 0.05, "um"),
            misfit("complex amplitude, relative L2", found, reference, 0.03, "um"),
        ),
        plot=Plot(
            x="distance, mm", y="amplitude, um", drawn=("closed form",),
            lines={"finite elements": (1e3 * RADII, 1e6 * abs(found)),
                   "closed form": (1e3 * r[len(RADII):], 1e6 * abs(curve))},
        ),
    )  # fmt: skip


@lru_cache(maxsize=1)  # which frequencies share
def _half_space(poisson: float) -> tuple[TetMesh, fem.Operators]:
    mesh = quarter_space(0.10, 1.5, 0.02, 0.003)
    return mesh, fem.assemble(mesh, fem.Material(**FOREARM, poisson=poisson), fixed=QUARTER)


def lamb() -> Case:
    """A pulse of force on a half-space: pressure, shear and Rayleigh arrivals."""
    mesh = sector(2.3, 0.14)
    ops = fem.assemble(
        mesh, fem.Material(density=1, shear_modulus=1, poisson=0.25),
        fixed={"front": "y", "back": "x", "bottom": "xyz"}, absorbing="right",
    )  # fmt: skip
    P, spot, delay, width = fem.load_operator(mesh), 0.012, 0.8, 0.2
    points = fem.facet_points(mesh)
    push = P @ np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / spot**2)
    push /= 4 * np.abs(push[2::3].sum())
    dt, steps, radii = 0.02, 145, np.array([1.0, 1.5])
    S = fem.probe_operator(mesh, np.column_stack([radii, 0 * radii]))
    states = fem.transient(ops, lambda t: push * np.exp(-(((t - delay) / width) ** 2) / 2), dt)
    found = np.array([S @ s.displacement for s in islice(states, steps + 1)])
    t = np.arange(steps + 1) * dt
    exact = np.column_stack(
        [references.lamb_pulse(t, r, mu=1, shear_speed=1, delay=delay, width=width) for r in radii]
    )
    return Case(
        title="Lamb's problem: a pulse of force on a half-space, nu = 0.25",
        source="Pekeris, PNAS 41:469 (1955); Mooney, Bull Seismol Soc Am 64:473 (1974), convolved "
        "with a Gaussian pulse",
        mesh=described(mesh, "a quarter in cylindrical cells; 3.5 elements in the shortest wave"),
        checks=(
            misfit("vertical motion at r = 1, relative L2", found[:, 0], exact[:, 0], 0.02),
            misfit("vertical motion at r = 1.5, relative L2", found[:, 1], exact[:, 1], 0.02),
            relative("Rayleigh speed: 0.5 over the crest's time between both",
                     0.5 / np.diff(_crest(t, found))[0], 0.5 / np.diff(_crest(t, exact))[0], 0.01),
        ),
        plot=Plot(
            x="c_s t / r, r = 1", y="mu u r / F", drawn=("closed form",),
            lines={"finite elements": (t[::4], found[::4, 0]), "closed form": (t, exact[:, 0])},
        ),
        note="The outside at r = 2.3 has dashpots, the base at depth 2.3 is fixed.",
    )  # fmt: skip


def rayleigh_speed() -> Case:
    """The speed of surface waves, by formula and from the vibration of half a wavelength."""
    down = meshes.graded_axis(2.5, 0.05, meshes.Grading(radius=0.3, growth=1.15))
    mesh = meshes.extrude(np.linspace(0, 0.5, 11), [0, 0.05], -down[::-1])
    ratios, checks, measured = (0.0, 0.25, 0.45, 0.4999), [], []
    for nu in ratios:
        material = fem.Material(density=1, shear_modulus=1, poisson=nu)
        ratio = references.rayleigh_ratio(nu)
        measured.append(_surface_wave(mesh, material))
        what = f"c_R / c_s, nu = {nu:g}"
        formula = relative(f"material's formula: {what}", material.rayleigh_speed, ratio, 1e-9)
        checks += [formula, relative(f"finite elements: {what}", measured[-1], ratio, 1e-3)]
    fine = np.linspace(0, 0.5, 60)
    return Case(
        title="Rayleigh waves, nu = 0 to 0.4999",
        source=f"Rayleigh, Proc London Math Soc 17:4 (1885); {ACHENBACH}, chapter 5",
        mesh=described(mesh, "half a wavelength between sliding ends, 2.5 wavelengths deep"),
        checks=tuple(checks),
        plot=Plot(
            x="Poisson's ratio", y="c_R / c_s", drawn=("root",),
            lines={"finite elements": (ratios, measured),
                   "root": (fine, [references.rayleigh_ratio(nu) for nu in fine])},
        ),
    )  # fmt: skip


def plate_waves() -> Case:
    """Bending and stretching waves of a plate from the vibration of half a wavelength."""
    wavenumbers, fine = np.array([0.2, 0.5, 1.0, 2.0, 4.0]), np.linspace(0.15, 4.2, 80)
    frequencies = [_strip_modes(k) for k in wavenumbers]
    checks, lines = [], {}
    for name in ("A0", "S0"):
        wave = partial(references.rayleigh_lamb, thickness=1, poisson=0.3, symmetric=name == "S0")
        for k, w in zip(wavenumbers, frequencies, strict=True):
            nearest = w[np.argmin(np.abs(w / wave(k) - 1))]
            what = f"{name}: c / c_s at k h = {k:g}"
            checks.append(relative(what, nearest / k, wave(k) / k, 0.005))
        lines[name] = (wavenumbers, [c.value for c in checks[-len(wavenumbers) :]])
        lines[f"{name} exact"] = (fine, [wave(k) / k for k in fine])
    return Case(
        title="Rayleigh-Lamb waves of a plate, A0 and S0, nu = 0.3",
        source=f"Lamb, Proc R Soc A 93:114 (1917); {ACHENBACH}, chapter 6",
        mesh="half a wavelength between sliding ends, 4 cells through the thickness",
        checks=tuple(checks),
        plot=Plot(
            x="wavenumber times thickness", y="c / c_s", lines=lines, drawn=("A0 exact", "S0 exact")
        ),
    )


def _strip_modes(k: float) -> Floats:
    """Angular frequencies of half a wavelength of a plate between sliding ends."""
    x = np.linspace(0, np.pi / k, max(8, int(np.ceil(2 * np.pi / k))) + 1)
    mesh = meshes.extrude(x, [0, 0.25], np.linspace(-1, 0, 5))
    material = fem.Material(density=1, shear_modulus=1, poisson=0.3)
    return 2 * np.pi * fem.modes(fem.assemble(mesh, material, fixed=SLIDING), 12)[0]


def absorbed_pulse() -> Case:
    """A shear pulse runs down a column and leaves through its base."""
    material = fem.Material(density=1000, shear_modulus=25e3, poisson=0.45)
    mesh = meshes.extrude([0, 0.002], [0, 0.002], np.linspace(-0.1, 0, 51))
    ops = fem.assemble(mesh, material, fixed={"sides": "yz"}, absorbing="bottom")
    top = np.unique(mesh.facets["top"])
    push = np.zeros(mesh.n_dofs)
    push[3 * top] = 1e-6 / len(top)
    states = fem.transient(ops, lambda t: push * np.exp(-(((t - 0.004) / 0.001) ** 2)), 2e-5)
    moved = np.array([s.displacement[3 * top].mean() for s in islice(states, 3000)])[600:]
    far = 1e-6 * 0.001 * np.sqrt(np.pi) / (1000 * 5.0 * 4e-6)
    return Case(
        title="A shear pulse leaves through a viscous boundary",
        source=f"{LYSMER}: no reflection at normal incidence",
        mesh=described(mesh, "50 cells high"),
        checks=(
            below("later motion of the top / displacement", np.ptp(moved) / moved.mean(), 1e-3),
            relative("displacement = impulse / (density c_s area)", moved.mean(), far, 0.01, "um"),
        ),
    )


def oblique_shear() -> Case:
    """Horizontally polarised shear waves meet a viscous boundary at an angle."""
    degrees = np.array([0.0, 20.0, 30.0, 45.0, 60.0, 70.0])
    exact = np.abs(references.horizontal_shear_reflection(np.radians(degrees)))
    found = np.array([_reflected_sh(np.radians(a)) for a in degrees])
    checks = [
        absolute(f"reflected amplitude at {a:g} degrees", f, e, 0.002)
        for a, f, e in zip(degrees, found, exact, strict=True)
    ]
    fine = np.linspace(0, 75, 100)
    curve = np.abs(references.horizontal_shear_reflection(np.radians(fine)))
    return Case(
        title="SH waves at an angle on a viscous boundary",
        source=f"{LYSMER}, from the boundary condition: (cos a - 1) / (cos a + 1)",
        mesh="strip of half a trace wavelength, 8 elements a wavelength",
        checks=tuple(checks),
        plot=Plot(
            x="angle of incidence, degrees", y="reflected amplitude", drawn=("exact",),
            lines={"finite elements": (degrees, found), "exact": (fine, curve)},
        ),
    )  # fmt: skip


def oblique_in_plane() -> Case:
    """Pressure and vertically polarised shear waves at an angle, converted into each other."""
    checks, ratio = [], np.sqrt(1 / 3)
    for kind, row, degrees in (("P", 0, 30), ("P", 0, 60), ("SV", 1, 20), ("SV", 1, 30)):
        k = 2 * np.pi * np.sin(np.radians(degrees)) * (ratio if kind == "P" else 1)
        exact, waves = references.in_plane_reflection(k, 2 * np.pi, poisson=0.25)
        found = _reflected_in_plane(k, waves)
        for name, f, e in zip(("P", "SV"), found[row], exact[row], strict=True):
            checks.append(absolute(f"{kind} in at {degrees} degrees, {name} out", f, e, 0.003))
    return Case(
        title="P and SV waves at an angle on a viscous boundary, nu = 0.25",
        source=f"{LYSMER}, from the boundary condition",
        mesh="strip of half a trace wavelength, 8 elements a shear wavelength, 3 long",
        checks=tuple(checks),
        note="Displacement amplitudes; errors are those of complex amplitudes.",
    )


def _surface_wave(mesh: TetMesh, material: fem.Material) -> float:
    """Frequency of the mode that moves the top most like cos(2 pi x)."""
    ops = fem.assemble(mesh, material, fixed={**SLIDING, "bottom": "xyz"})
    hz, shapes = fem.modes(ops, 6)
    top = np.unique(mesh.facets["top"])
    wave = np.abs(np.cos(2 * np.pi * mesh.points[top, 0]) @ shapes[3 * top + 2])
    return float(hz[np.argmax(wave)])


def sector(length: float, h: float) -> TetMesh:
    """A quarter of a cylinder about a thin hole, in three curved cells of thirty degrees."""
    out = meshes.graded_axis(length, 0.004, meshes.Grading(radius=0.0, growth=1.35, coarsest=h))
    down = meshes.graded_axis(length, 0.01, meshes.Grading(radius=0.0, growth=1.35, coarsest=h))
    box = meshes.extrude(0.003 + out, np.linspace(0, np.pi / 2, 4), -down[::-1])
    r, angle, z = box.points.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    return TetMesh(points=points, tets=box.tets, facets=box.facets)


def _crest(t: Floats, u: Floats) -> Floats:
    """Times of the largest value of each column, by a parabola through three samples."""
    k, columns = np.argmax(u, axis=0), np.arange(u.shape[1])
    a, b, c = u[k - 1, columns], u[k, columns], u[k + 1, columns]
    return t[k] + (t[1] - t[0]) * (a - c) / (a - 2 * b + c) / 2


def _strip(k: float, length: float, h: float) -> TetMesh:
    """Half a trace wavelength wide (one cell for normal incidence), one cell across."""
    width = np.pi / k if k else h
    n = int(np.ceil(width / h))
    z = np.linspace(-length, 0, int(length / h) + 1)
    return meshes.extrude(np.linspace(0, width, n + 1), [0, h], z)


def _reflected_sh(angle: float) -> float:
    """|reflected / incident| of SH waves of unit speed and wavelength, fitted over depth."""
    k = 2 * np.pi * np.sin(angle)
    mesh = _strip(k, 2.0, 0.125)
    fixed = np.ones(mesh.points.shape, bool)
    fixed[:, 1] = False
    material = fem.Material(density=1, shear_modulus=1, poisson=0.25)
    ops = fem.assemble(mesh, material, fixed=fixed, absorbing="bottom")
    P, x = fem.load_operator(mesh), fem.facet_points(mesh)[:, 0]
    vertical = (P @ np.cos(k * x)).reshape(-1, 3)
    u = fem.harmonic(ops, np.roll(vertical, -1, axis=1).ravel(), 1.0)[0].reshape(-1, 3)[:, 1]
    edge = (mesh.points[:, 0] == 0) & (np.abs(mesh.points[:, 2] + 1.0) < 0.8)
    down = -mesh.points[edge, 2]
    q = 2 * np.pi * np.cos(angle)
    waves = np.exp(1j * q * np.outer(down, [-1, 1]))
    incident, reflected = np.linalg.lstsq(waves, u[edge], rcond=None)[0]
    return float(abs(reflected / incident))


def _reflected_in_plane(k: float, waves: Floats) -> Floats:
    """Reflection (P and SV in, P and SV out) at the base, from two ways to push the top."""
    mesh, length = _strip(k, 3.0, 0.125), 3.0
    material = fem.Material(density=1, shear_modulus=1, poisson=0.25)
    ops = fem.assemble(mesh, material, fixed=SLIDING, absorbing="bottom")
    P, x = fem.load_operator(mesh), fem.facet_points(mesh)[:, 0]
    normal = P @ np.cos(k * x)
    shear = np.roll((P @ np.sin(k * x)).reshape(-1, 3), 1, axis=1).ravel()
    fits = [_fitted(mesh, fem.harmonic(ops, f, 1.0)[0], k, waves, length) for f in (normal, shear)]
    amplitudes = np.array(fits)
    return np.linalg.solve(amplitudes[:, :2], amplitudes[:, 2:])


def _fitted(mesh: TetMesh, u: Floats, k: float, waves: Floats, length: float) -> Floats:
    """Amplitudes (4,) of P in, SV in, P out, SV out, their phase counted from the base."""
    x, _, z = mesh.points.T
    along, into, kz = waves.T
    inner = np.abs(z + length / 2) < 0.35 * length
    wave = np.exp(-1j * np.outer(z[inner] + length, -1.0 * kz))
    sideways = -1j * along * np.sin(k * x[inner])[:, None] * wave
    downwards = into * np.cos(k * x[inner])[:, None] * wave
    moved = u.reshape(-1, 3)[inner]
    known = np.concatenate([moved[:, 0], -moved[:, 2]])
    return np.linalg.lstsq(np.vstack([sideways, downwards]), known, rcond=None)[0]
