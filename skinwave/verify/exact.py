"""Wavenumber integrals against closed forms, and finite elements against wavenumber integrals."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

import fem
import meshes
from meshes import TetMesh
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.layers.compliance import Compliance, half_space, slab, thin_sheet
from simple_model.layers.flat_body import steady_lines
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.spectrum import load_lines
from skinwave.verify import references
from skinwave.verify.case import Case, Plot, below, described, largest, misfit, relative
from skinwave.verify.references import Complex, Floats
from skinwave.verify.statics import WIDTH
from skinwave.verify.waves import FOREARM

Kernel = Callable[[Floats], Complex]
RADII = np.array([0, 5, 10, 15, 20, 30]) * 1e-3
FREQUENCIES = np.array([20.0, 80.0, 140.0, 191.0, 210.0])  # Hz
SKIN = fem.Material(**FOREARM, poisson=0.49)
THICKNESS = 1e-4  # m, of paper
PAPER = {"bending_stiffness": 4e9 * 1e-12 / 12 / 0.91, "mass_per_area": 0.08}
CIRCLES = ((0.010, 6.0), (0.020, 12.0), (0.030, 18.0))  # diameter in m and speed in m/s
HANKEL = "Hankel's integral on the real axis: Sneddon, Fourier Transforms (1951)"


def exact_half_space() -> Case:
    """A half-space under a focus at rest and in vibration."""
    poissons = (0.0, 0.3, 0.49, 0.5)
    bodies = [half_space(SKIN, poisson=nu) for nu in poissons]
    rest = [abs(point_response(body, RADII, [0.0], WIDTH)[0]) for body in bodies]
    closed = [
        references.gaussian_at_rest(RADII, width=WIDTH, shear_modulus=7.86e3, poisson=nu)
        for nu in poissons
    ]
    w = 2 * np.pi * FREQUENCIES
    found = point_response(half_space(SKIN, poisson=0.5), RADII, w, WIDTH)
    exact = np.array([_half_space(hz, RADII) for hz in FREQUENCIES])
    return Case(
        title="Wavenumber integral (flat-body): a focus on a half-space",
        source=f"Boussinesq's and Lamb's kernels; {HANKEL}; Gradshteyn and Ryzhik, 6.618.1",
        mesh="none",
        checks=(
            largest("at rest, nu = 0 to 0.5, 0 to 30 mm, worst", rest, closed, 1e-4, "um"),
            misfit("20 to 210 Hz, nu = 0.5, relative L2", found, exact, 1e-4, "um"),
            largest("20 to 210 Hz, complex amplitude, worst", found, exact, 0.01, "um"),
        ),
    )


def exact_sheet() -> Case:
    """A focus on an infinite paper sheet, with the added mass of air."""
    hz = FREQUENCIES[1:]
    body = thin_sheet(fem.PRESETS["paper"], THICKNESS)
    found = point_response(body, RADII, 2 * np.pi * hz, WIDTH)
    exact = [references.gaussian_response(_paper(f), RADII, width=WIDTH) for f in hz]
    return Case(
        title="Wavenumber integral (flat-body): a focus on paper with air",
        source=f"Cremer, Heckl and Petersson, Structure-Borne Sound (2005); {HANKEL}",
        mesh="none",
        checks=(
            misfit("80 to 210 Hz, complex, relative L2", found, exact, 1e-3, "um"),
            largest("80 to 210 Hz, complex amplitude, worst", found, exact, 0.01, "um"),
        ),
    )


def exact_slab() -> Case:
    """A bonded layer: at rest, very deep, and at its thickness resonance."""
    checks = []
    for poisson, depth in ((0.3, 0.005), (0.45, 0.015), (0.4999, 0.015)):
        body = slab(fem.Material(density=1000, shear_modulus=25e3, poisson=poisson), depth)
        found = point_response(body, RADII, [0.0], WIDTH)[0].real
        layer = {"width": WIDTH, "shear_modulus": 25e3, "poisson": poisson, "depth": depth}
        exact = references.gaussian_on_bonded_layer(RADII, **layer)
        name = f"at rest, depth {1e3 * depth:g} mm, nu = {poisson:g}, relative L2"
        checks.append(misfit(name, found, exact, 1e-3, "um"))
    w = 2 * np.pi * FREQUENCIES
    deep = point_response(slab(replace(SKIN, poisson=0.5 - 1e-9), 1.0), RADII, w, WIDTH)
    space = np.array([_half_space(hz, RADII) for hz in FREQUENCIES])
    checks.append(misfit("1 m deep, 20 to 210 Hz, relative L2", deep, space, 1e-3, "um"))
    hz = np.linspace(60, 120, 6001)
    solid = fem.Material(density=1000, shear_modulus=25e3, poisson=0.0, viscosity=0.5)
    omega = np.asarray(2 * np.pi * hz[:, None], np.complex128)
    g = np.abs(slab(solid, 0.02)(np.array([1e-3 + 0j]), omega)[:, 0])
    quarter = np.sqrt(2 * 25e3 / 1000) / 4 / 0.02
    checks.append(relative("thickness resonance, c_p / 4 H", hz[np.argmax(g)], quarter, 1e-3, "Hz"))
    return Case(
        title="Wavenumber integral (flat-body): a layer bonded to a rigid base",
        source="Vorovich, Aleksandrov and Babeshko (1974); Lamb (1904); quarter-wave resonance: "
        "Kramer, Geotechnical Earthquake Engineering (1996), chapter 7",
        mesh="none",
        checks=tuple(checks),
    )


def exact_circles() -> Case:
    """Harmonics of a circling focus, on the path and in its centre."""
    checks = []
    for name, body, kernel in (
        ("half-space", half_space(SKIN, poisson=0.5), _space),
        ("paper", thin_sheet(fem.PRESETS["paper"], THICKNESS), _paper),
    ):
        for size, speed in CIRCLES:
            load = circling(size, speed)
            f, a = steady_lines(body, load, [[size / 2, 0.0], [0.0, 0.0]])
            f_d = load.tacton.trajectory.drawing_frequency
            lines = [a[np.argmin(np.abs(f - n * f_d))] for n in (1, 2, 3)]
            exact = [
                2 * references.gaussian_response(
                    kernel(n * f_d), np.array([size / 2]), width=WIDTH, circle=size / 2, harmonic=n
                )[0]
                for n in (1, 2, 3)
            ]  # fmt: skip
            found = np.array(lines)[:, 0]
            where = f"{name}, circle of {1e3 * size:g} mm"
            checks.append(misfit(f"{where}: lines 1 to 3, relative L2", found, exact, 2e-3, "um"))
            centre = np.abs(np.array(lines)[:, 1]).max() / np.abs(found).max()
            checks.append(below(f"{where}: centre / path, which is 0", centre, 1e-6))
    return Case(
        title="Wavenumber integral (flat-body): harmonics of a circling focus",
        source="Graf's addition theorem, Abramowitz and Stegun 9.1.79: J_n(k R) J_n(k r)",
        mesh="none",
        checks=tuple(checks),
    )


def circling_on_skin(
    solid: fem.Material = SKIN, name: str = "skin", *, half: float = 0.06, growth: float = 1.5
) -> Case:
    """AM and circling focus on a bonded layer, of forearm unless another law is given."""
    depth = 0.010
    across = meshes.graded_axis(half, 0.003, meshes.Grading(radius=0.02, growth=growth))
    mesh = meshes.extrude(across, across, np.linspace(-depth, 0, 5))
    load = circling(0.02, 12.0, am=140.0)
    return _beside_exact_waves(
        f"Circling focus on {name}: finite elements against the wavenumber integral",
        "Bonded layer: Ewing, Jardetzky and Press, Elastic Waves in Layered Media (1957), chapter "
        "4; verified by the cases on flat-body",
        f"sides fixed at {1e3 * half:g} mm, where the response is below a hundredth of that at the "
        "focus",
        mesh, solid, {"right": "xyz", "back": "xyz", "bottom": "xyz"},
        slab(solid, depth), load, 0.02,
    )  # fmt: skip


def circling_on_paper() -> Case:
    """The same on a large and lossy sheet with the bending stiffness and mass of paper."""
    thickness, lag = 0.5e-3, 6e-4
    stiffness, mass = PAPER.values()
    young = 12 * stiffness * 0.91 / thickness**3
    solid = fem.Material(
        density=mass / thickness, shear_modulus=young / 2.6, poisson=0.3,
        viscosity=lag * young / 2.6,
    )  # fmt: skip
    grading = meshes.Grading(radius=0.025, growth=1.25, coarsest=0.013)
    across = meshes.graded_axis(0.2, 0.0021, grading)
    mesh = meshes.extrude(across, across, [-thickness, 0])
    return _beside_exact_waves(
        "Circling focus on a lossy sheet: finite elements against the wavenumber integral",
        "Thin plate in vacuum: Cremer, Heckl and Petersson (2005); verified by the cases on "
        "flat-body",
        "free edges at 200 mm; loss factor 0.7 at 190 Hz, so that they reflect nothing",
        mesh, solid, {},
        thin_sheet(solid, thickness, air_density=0.0), circling(0.02, 12.0), 0.02,
    )  # fmt: skip


def circling(size: float, speed: float, am: float = 0.0) -> MovingPressure:
    """A focus of 1 Pa on a circle."""
    path = Trajectory(shape="circle", size=size, speed=speed)
    return MovingPressure(tacton=Tacton(am_frequency=am, trajectory=path), peak_pressure=1.0)


def _beside_exact_waves(
    title: str,
    source: str,
    sides: str,
    mesh: TetMesh,
    solid: fem.Material,
    fixed: dict[str, str],
    body: Compliance,
    load: MovingPressure,
    bar: float,
) -> Case:
    """The strongest lines at probes on the x axis, complex: at most five, above two per cent."""
    probes = np.column_stack([[0.0, 0.005, 0.01, 0.015, 0.02], np.zeros(5)])
    f, exact = steady_lines(body, load, probes)
    size = np.abs(exact).max(axis=1) * (f > 1.0)
    chosen = np.argsort(-size)[:5]
    chosen = chosen[size[chosen] > 0.02 * size.max()]

    @cache
    def quarter(odd: bool) -> fem.Operators:
        middle = {"left": "yz" if odd else "x", "front": "y"}
        return fem.assemble(mesh, solid, fixed={**fixed, **middle})

    found = np.array([_line(mesh, quarter, load, f[k], probes) for k in chosen])
    exact = exact[chosen]
    what = "strongest lines at five probes, complex, relative L2"
    checks = [misfit(what, found, exact, bar, "um")]
    for hz, ours, theirs in zip(f[chosen], found, exact, strict=True):
        at = int(np.argmax(np.abs(theirs)))
        what = f"{hz:.1f} Hz where it is strongest, {1e3 * probes[at, 0]:g} mm"
        checks.append(relative(what, abs(ours[at]), abs(theirs[at]), 0.03, "um"))
    order = np.argsort(f[chosen])
    lines = {
        f"{name} at {1e3 * probes[p, 0]:g} mm": (f[chosen][order], 1e6 * abs(u[order, p]))
        for p in (2, 4)
        for name, u in (("fem", found), ("analytic", exact))
    }
    drawn = tuple(name for name in lines if name.startswith("analytic"))
    return Case(
        title=title, source=source, mesh=described(mesh, f"a quarter; {sides}"),
        checks=tuple(checks),
        plot=Plot(x="frequency, Hz", y="amplitude, um at 1 Pa", lines=lines, drawn=drawn),
    )  # fmt: skip


def _line(
    mesh: TetMesh, quarter: Callable[[bool], fem.Operators], load: MovingPressure, hz: float,
    probes: Floats,
) -> Complex:  # fmt: skip
    """One line's complex amplitude (p,) in metre from a quarter of the body, odd or even in x.

    Harmonic n of the circling focal spot is f(r) exp(-i n angle); a probe on the x axis responds
    to its cosine part only, which is even in y and, as n is, even or odd in x.
    """
    lines = load_lines(load)
    mine = np.flatnonzero(np.abs(lines.frequencies - hz) < 1e-6)
    n = lines.harmonics[mine]
    ops = quarter(bool(n[0] % 2))
    spots = path_fourier(load, load.spot(fem.facet_points(mesh), path_samples(load)).T, n).real
    force = fem.load_operator(mesh) @ (spots @ lines.coefficients[mine])
    return fem.probe_operator(mesh, probes) @ fem.harmonic(ops, force, hz)[0]


def _half_space(hz: float, r: Floats) -> Complex:
    return references.gaussian_response(_space(hz), r, width=WIDTH)


def _space(hz: float) -> Kernel:
    w = 2 * np.pi * hz
    mu = FOREARM["shear_modulus"] + 1j * w * FOREARM["viscosity"]
    return partial(references.half_space_kernel, w=w, density=1000, mu=mu, poisson=0.5)


def _paper(hz: float) -> Kernel:
    w, paper, mass = 2 * np.pi * hz, fem.PRESETS["paper"], PAPER["mass_per_area"]
    stiffness = PAPER["bending_stiffness"] * paper.complex_modulus(w) / paper.shear_modulus
    return partial(references.plate_kernel, w=w, stiffness=stiffness, mass=mass, air=1.2)
