"""Wavenumber integrals against closed forms, and finite elements against wavenumber integrals."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

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
from skinwave.typing import Array
from skinwave.verify import references
from skinwave.verify.case import Checks, below, case, misfit, relative
from skinwave.verify.setups import FOREARM, PAPER, QUARTER, SOURCES, THICKNESS, WIDTH, lossy_paper

Kernel = Callable[[Array], Array]
RADII = np.array([0, 5, 10, 15, 20, 30]) * 1e-3
FREQUENCIES = np.array([20.0, 80.0, 140.0, 191.0, 210.0])  # Hz
SKIN = fem.Material(**FOREARM, poisson=0.49)


@case(f"{SOURCES['Boussinesq']}; {SOURCES['Lamb']}; {SOURCES['Hankel']}; {SOURCES['Zener']}")
def exact_half_space() -> Checks:
    """Wavenumber integral (flat-body): focus on a half-space."""
    poissons = (0.0, 0.3, 0.49, 0.5)
    bodies = [half_space(SKIN, poisson=nu) for nu in poissons]
    rest = [point_response(body, RADII, [0.0], WIDTH)[0] for body in bodies]
    closed = [
        references.gaussian_at_rest(RADII, width=WIDTH, shear_modulus=7.86e3, poisson=nu)
        for nu in poissons
    ]
    yield relative("at rest, nu = 0 to 0.5, 0 to 30 mm, worst", rest, closed, 1e-4, "um")
    ours = point_response(half_space(SKIN, poisson=0.5), RADII, 2 * np.pi * FREQUENCIES, WIDTH)
    exact = _on_half_space(FREQUENCIES)
    yield misfit("20 to 210 Hz, nu = 0.5, relative L2", ours, exact, 1e-4, "um")
    yield relative("20 to 210 Hz, complex amplitude, worst", ours, exact, 0.01, "um")
    hz = np.array([20.0, 80.0, 140.0, 210.0])
    relaxing = fem.Material(
        density=1000.0, shear_modulus=7.86e3, poisson=0.49,
        prony=(fem.PronyTerm(modulus=10e3, time=1e-3),),
    )  # fmt: skip
    ours = point_response(half_space(relaxing, poisson=0.5), RADII, 2 * np.pi * hz, WIDTH)
    turned = 2j * np.pi * hz * 1e-3
    exact = _on_half_space(hz, 7.86e3 + 10e3 * turned / (1 + turned))
    yield misfit("standard linear solid, 20 to 210 Hz, relative L2", ours, exact, 1e-4, "um")


@case(f"Cremer, Heckl and Petersson, Structure-Borne Sound (2005); {SOURCES['Hankel']}")
def exact_sheet() -> Checks:
    """Wavenumber integral (flat-body): focus on paper in air."""
    hz = FREQUENCIES[1:]
    body = thin_sheet(fem.PRESETS["paper"], THICKNESS)
    ours = point_response(body, RADII, 2 * np.pi * hz, WIDTH)
    exact = [references.gaussian_response(_paper(f), RADII, width=WIDTH) for f in hz]
    yield misfit("80 to 210 Hz, complex, relative L2", ours, exact, 1e-3, "um")
    yield relative("80 to 210 Hz, complex amplitude, worst", ours, exact, 0.01, "um")


@case(
    "Vorovich, Aleksandrov and Babeshko (1974); Lamb (1904); quarter-wave resonance: Kramer, "
    "Geotechnical Earthquake Engineering (1996), chapter 7"
)
def exact_slab() -> Checks:
    """Wavenumber integral (flat-body): layer bonded to a rigid base."""
    for poisson, depth in ((0.3, 0.005), (0.45, 0.015), (0.4999, 0.015)):
        body = slab(fem.Material(density=1000, shear_modulus=25e3, poisson=poisson), depth)
        ours = point_response(body, RADII, [0.0], WIDTH)[0].real
        exact = references.gaussian_on_bonded_layer(
            RADII, width=WIDTH, shear_modulus=25e3, poisson=poisson, depth=depth
        )
        what = f"at rest, depth {1e3 * depth:g} mm, nu = {poisson:g}, relative L2"
        yield misfit(what, ours, exact, 1e-3, "um")
    w = 2 * np.pi * FREQUENCIES
    deep = point_response(slab(replace(SKIN, poisson=0.5 - 1e-9), 1.0), RADII, w, WIDTH)
    exact = _on_half_space(FREQUENCIES)
    yield misfit("1 m deep, 20 to 210 Hz, relative L2", deep, exact, 1e-3, "um")
    hz = np.linspace(60, 120, 6001)
    solid = fem.Material(density=1000, shear_modulus=25e3, poisson=0.0, viscosity=0.5)
    omega = np.asarray(2 * np.pi * hz[:, None], np.complex128)
    g = np.abs(slab(solid, 0.02)(np.array([1e-3 + 0j]), omega)[:, 0])
    quarter = np.sqrt(2 * 25e3 / 1000) / 4 / 0.02
    yield relative("thickness resonance, c_p / 4 H", hz[np.argmax(g)], quarter, 1e-3, "Hz")


@case("Graf's addition theorem, Abramowitz and Stegun 9.1.79: J_n(k R) J_n(k r)")
def exact_circles() -> Checks:
    """Wavenumber integral (flat-body): harmonics of a circling focus."""
    for name, body, kernel in (
        ("half-space", half_space(SKIN, poisson=0.5), _space),
        ("paper", thin_sheet(fem.PRESETS["paper"], THICKNESS), _paper),
    ):
        for size, speed in ((0.010, 6.0), (0.020, 12.0), (0.030, 18.0)):
            load, r = _circling(size, speed), size / 2
            f, a = steady_lines(body, load, [[r, 0.0], [0.0, 0.0]])
            f_d = load.tacton.trajectory.drawing_frequency
            lines = np.array([a[np.argmin(np.abs(f - n * f_d))] for n in (1, 2, 3)])
            exact = [
                2 * references.gaussian_response(
                    kernel(n * f_d), np.array([r]), width=WIDTH, circle=r, harmonic=n
                )[0]
                for n in (1, 2, 3)
            ]  # fmt: skip
            where = f"{name}, circle of {1e3 * size:g} mm"
            yield misfit(f"{where}: lines 1 to 3, relative L2", lines[:, 0], exact, 2e-3, "um")
            centre = np.abs(lines[:, 1]).max() / np.abs(lines[:, 0]).max()
            yield below(f"{where}: centre / path, exactly 0", centre, 1e-6)


@case(
    "Bonded layer: Ewing, Jardetzky and Press, Elastic Waves in Layered Media (1957), chapter 4; "
    "verified by the cases on flat-body",
    mesh="a quarter in cells of 3 mm; sides fixed at 60 mm",
)
def circling_on_skin() -> Checks:
    """Circling focus with AM on skin: finite elements against the wavenumber integral."""
    depth = 0.010
    across = meshes.graded_axis(0.06, 0.003, meshes.Grading(radius=0.02, growth=1.5))
    mesh = meshes.extrude(across, across, np.linspace(-depth, 0, 5))
    load = _circling(0.02, 12.0, am=140.0)
    return _strongest_lines(mesh, SKIN, QUARTER, slab(SKIN, depth), load)


@case(
    "Thin plate in vacuum: Cremer, Heckl and Petersson (2005); verified by the cases on flat-body",
    mesh="a quarter in cells of 2.1 mm; free edges at 200 mm; loss factor 0.7 at 190 Hz, so that "
    "the edges reflect nothing",
)
def circling_on_paper() -> Checks:
    """Circling focus on a lossy sheet: finite elements against the wavenumber integral."""
    thickness = 0.5e-3
    solid = lossy_paper(thickness, lag=6e-4)
    grading = meshes.Grading(radius=0.025, growth=1.25, coarsest=0.013)
    across = meshes.graded_axis(0.2, 0.0021, grading)
    mesh = meshes.extrude(across, across, [-thickness, 0])
    body = thin_sheet(solid, thickness, air_density=0.0)
    return _strongest_lines(mesh, solid, {}, body, _circling(0.02, 12.0))


def _circling(size: float, speed: float, am: float = 0.0) -> MovingPressure:
    """Return a focus of 1 Pa on a circle."""
    path = Trajectory(shape="circle", size=size, speed=speed)
    return MovingPressure(tacton=Tacton(am_frequency=am, trajectory=path), peak_pressure=1.0)


def _strongest_lines(
    mesh: TetMesh, solid: fem.Material, fixed: dict[str, str], body: Compliance,
    load: MovingPressure,
) -> Checks:  # fmt: skip
    """Check the strongest lines, at most five above 2 %, at probes on the x axis.

    Harmonic n of the circling focal spot is f(r) exp(-i n angle). Probes on the x axis respond only
    to its cosine part, which is even in y, and even or odd in x like n. A quarter of the body is
    enough.
    """
    probes = np.column_stack([[0.0, 0.005, 0.01, 0.015, 0.02], np.zeros(5)])
    f, exact = steady_lines(body, load, probes)
    size = np.abs(exact).max(axis=1) * (f > 1.0)
    chosen = np.argsort(-size)[:5]
    chosen = chosen[size[chosen] > 0.02 * size.max()]
    even, odd = (
        fem.assemble(mesh, solid, fixed={**fixed, "left": left, "front": "y"})
        for left in ("x", "yz")
    )
    load_at, found = load_lines(load), []
    spots = load.spot(fem.facet_points(mesh), path_samples(load)).T
    P, S = fem.pressure_operator(mesh), fem.probe_operator(mesh, probes)
    for hz in f[chosen]:
        at = np.flatnonzero(np.abs(load_at.frequencies - hz) < 1e-6)
        n = load_at.harmonics[at]
        force = P @ (path_fourier(load, spots, n).real @ load_at.coefficients[at])
        found.append(S @ fem.harmonic(odd if n[0] % 2 else even, force, hz)[0])
    what = "strongest lines at five probes, complex, relative L2"
    yield misfit(what, found, exact[chosen], 0.02, "um")
    for hz, ours, theirs in zip(f[chosen], found, exact[chosen], strict=True):
        p = int(np.argmax(np.abs(theirs)))
        what = f"{hz:.1f} Hz where it is strongest, {1e3 * probes[p, 0]:g} mm"
        yield relative(what, abs(ours[p]), abs(theirs[p]), 0.03, "um")


def _on_half_space(hz: Array, moduli: Array | None = None) -> Array:
    """Return the response (f, r) of an incompressible half-space of `SKIN`, or of other moduli."""
    kernels = [_space(f, None if moduli is None else moduli[k]) for k, f in enumerate(hz)]
    return np.array([references.gaussian_response(k, RADII, width=WIDTH) for k in kernels])


def _space(hz: float, mu: complex | None = None) -> Kernel:
    w = 2 * np.pi * hz
    mu = FOREARM["shear_modulus"] + 1j * w * FOREARM["viscosity"] if mu is None else mu
    return partial(references.half_space_kernel, w=w, density=1000, mu=mu, poisson=0.5)


def _paper(hz: float) -> Kernel:
    w, paper, mass = 2 * np.pi * hz, fem.PRESETS["paper"], PAPER["mass_per_area"]
    stiffness = PAPER["bending_stiffness"] * paper.complex_modulus(w) / paper.shear_modulus
    return partial(references.plate_kernel, w=w, stiffness=stiffness, mass=mass, air=1.2)
