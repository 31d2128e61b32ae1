"""Extreme loads: speed, frequency, width, place, duration."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

import fem
from simple_model import MovingPressure, Response, Tacton, Trajectory, lines
from simple_model.load.focus import spot_width
from skinwave.bodies.build import Build, build, operators
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import ReducedBody, answer, reduce_scene
from skinwave.scene.scene import STILL, Body, Scene
from skinwave.typing import Floats
from skinwave.verify.case import Checks, below, case, relative
from skinwave.verify.setups import SOURCES, push, read

SCENE = Scene(
    pressure=MovingPressure(tacton=Tacton(), drive="linear"), probes=((0.0, 0.0), (0.01, 0.0)),
    body=Body(width=0.06, height=0.06, depth=0.015, sides="clamped"),
)  # fmt: skip
MESH = "skin, 60 x 60 x 15 mm, elements of 5 mm"
LIMITS = "limit of the linear equation of motion: Graff, Wave Motion in Elastic Solids (1975)"


@case(f"{LIMITS}: a slow load is quasi-static, a fast one acts by its mean", mesh=MESH)
def focus_speeds() -> Checks:
    """Focus speeds from 0.01 to 100 m/s (Mach 0.002 to 20)."""
    path = Trajectory(shape="circle", size=0.02, speed=1.0)
    pressure = replace(SCENE.pressure, tacton=Tacton(trajectory=path))
    rest = _static(pressure, 1)[1]  # the path starts at the second probe
    peak = _response(6.3, speed=0.01).displacement[60000:, 1].max()
    yield relative("0.01 m/s: peak under the focus, over rest", peak, rest, 0.02, "m")
    ring = _static(pressure, 96)
    fast = _response(1.0, speed=100.0).displacement
    for k, place in enumerate(("centre", "rim")):
        mean = fast[len(fast) // 2 :, k].mean()
        yield relative(f"100 m/s: mean at the {place}", mean, ring[k], 0.005, "m")
    for speed in (0.1, 1.0, 10.0):
        ratio = np.abs(_response(1.0, speed=speed).displacement).max() / rest
        yield below(f"{speed:g} m/s: largest motion over that at rest", ratio, 3.0)


@case(f"{LIMITS}: a slow load is quasi-static, a fast one is in its steady state", mesh=MESH)
def modulation_frequencies() -> Checks:
    """Amplitude modulation from 1 Hz to 1 kHz."""
    slow, rest = lines(_response(4.0, am=1.0), [1.0])[0], _static(SCENE.pressure, 1)
    for k, (x, _) in enumerate(SCENE.probes):
        yield relative(f"1 Hz: amplitude at {1e3 * x:g} mm", slow[k], rest[k], 0.005, "m")
    fast = lines(_response(0.5, am=1000.0), [1000.0])[0, 0]
    made, ops = _mesh()
    force = push(made.mesh, lambda x: SCENE.pressure(x[:, :2], 0.0))
    u = read(made.mesh, fem.harmonic(ops, force, 1000.0)[0], 0.0)
    yield relative("1 kHz: amplitude at the focus", fast, abs(u[0]), 0.005, "m")


@case(
    "the integral of a Gaussian; quadrature: Dunavant, Int J Numer Methods Eng 21:1129 (1985)",
    mesh="10-node tetrahedra, 60 x 60 x 15 mm",
    note="The displacement under such a focus is less accurate. The plan warns of elements larger "
    "than twice the standard deviation of the focal spot.",
)
def narrow_focus() -> Checks:
    """Force of a focus down to a third of the size of an element."""
    fine = np.linspace(-0.03, 0.03, 1201)
    grid = np.column_stack([axis.ravel() for axis in np.meshgrid(fine, fine)])
    for height, h in ((0.2, 2.9e-3), (0.02, 2.9e-3), (0.02, 5e-3)):
        load = replace(SCENE.pressure, height=height)
        exact = load(grid, 0.0).sum() * (fine[1] - fine[0]) ** 2
        places = [(x, x / 2) for x in (0.0, 0.6e-3, 1.2e-3, 1.8e-3, 2.4e-3)]
        worst = np.abs(_forces(load, h, places) / exact - 1).max()
        width = f"focal spot of {1e3 * spot_width(height):.1f} mm, elements of {1e3 * h:g} mm"
        yield below(f"{width}: force, worst of 5 places", worst, 0.01)


@case("the integral of half a Gaussian", mesh=MESH)
def degenerate_paths() -> Checks:
    """Path of size 0 as a focus at rest, and half of the force for a focus on the rim."""
    rest = _response(0.1, am=140.0).displacement
    circle = _response(0.1, am=140.0, speed=5.0, size=0.0).displacement
    difference = np.abs(circle - rest).max() / np.abs(rest).max()
    yield below("circle of 0 mm and point: difference", difference, 1e-12)
    middle, rim = _forces(SCENE.pressure, 2.9e-3, [(0.0, 0.0), (0.03, 0.0)])
    yield relative("force on the rim over force in the middle", rim / middle, 0.5, 0.01)


@case(f"conservation of energy: {SOURCES['Hughes']}", mesh=MESH)
def durations() -> Checks:
    """Durations of one sample and of ten seconds."""
    short, long = _response(1e-4, am=140.0), _response(10.0, am=140.0)
    seconds = [long.displacement[k * 10_000 : (k + 1) * 10_000] for k in (1, 9)]
    first, last = (
        float(lines(replace(long, times=np.arange(10_000) / 10_000, values=u), [140.0])[0, 0])
        for u in seconds
    )
    drift = abs(seconds[1][:, 0].mean() - seconds[0][:, 0].mean()) / first
    imbalance = long.effort.energy_imbalance
    yield below("one sample: largest motion", np.abs(short.displacement).max(), 1e-6, "m")
    yield below("10 s: relative imbalance of power", imbalance, 1e-6)
    yield relative("10 s: amplitude in the last second", last, first, 1e-6, "m")
    yield below("10 s: drift of the mean over the amplitude", drift, 1e-6)


@cache
def _prepare() -> ReducedBody:
    return reduce_scene(replace(SCENE, pressure=STILL), SolveOptions(h=5e-3), reduction=1e-4)


@cache
def _mesh() -> tuple[Build, fem.Operators]:
    made = build(SCENE.body, 5e-3)
    return made, operators(made)


def _static(pressure: MovingPressure, count: int) -> Floats:
    """Return the static displacement of the probes under the mean of focal spots on the path."""
    made, ops = _mesh()
    centres = pressure.tacton.trajectory.at_phase(np.arange(count) / count)
    gain = float(pressure.gain(np.zeros(1))[0])
    force = push(made.mesh, lambda x: pressure.spot(x[:, :2], centres).mean(axis=0) * gain)
    return fem.probe_operator(made.mesh, SCENE.probes) @ fem.static(ops, force)


def _response(
    duration: float, *, am: float = 0.0, speed: float = 0.0, size: float = 0.02
) -> Response:
    """Return the response to a focus at rest, or on a circle if a speed is given."""
    path = Trajectory(shape="circle", size=size, speed=speed) if speed else Trajectory()
    tacton = Tacton(am_frequency=am, duration=duration, trajectory=path)
    return answer(_prepare(), replace(SCENE, pressure=replace(SCENE.pressure, tacton=tacton)))


def _forces(load: MovingPressure, h: float, places: Sequence[tuple[float, float]]) -> Floats:
    """Return downward forces (n,) in N with the focus at places of a body with a free rim."""
    mesh = build(replace(SCENE.body, sides="free"), h).mesh
    P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)[:, :2]
    pressure = load.spot(points, np.array(places)) * float(load.gain(np.zeros(1))[0])
    return -np.asarray((P @ pressure.T).reshape(-1, 3, len(places))[:, 2].sum(axis=0))
