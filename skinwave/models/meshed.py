"""Meshed body of a model: its operators, its load and probes, and its mirror symmetry.

Across a plane of symmetry of a body every load is the sum of an even and an odd part, and so is the
motion. Normal motion on the plane is that of the even part alone: that of the part of the body on
one side, with symmetry conditions on the plane, under the mean of the load and its mirror image.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.load_and_probe import (
    displacement_operator,
    facet_normals,
    facet_points,
    probe_operator,
    surface_frame,
    traction_operator,
)
from fem.stress import materials_at, strain_operator
from meshes import cache
from simple_model import Effort, Material, MovingPressure
from simple_model.load.path_cells import jump_times
from simple_model.load.sampling import below_half_the_rate, is_folded
from simple_model.load.spectrum import merge_lines, pressure_lines
from simple_model.quantities import STRAIN, Quantity
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build
from skinwave.bodies.build import build as build_body
from skinwave.bodies.build import operators as operators_of
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.parts import FLAT
from skinwave.models.sheet_probes import sheet_rows
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import Reading
from skinwave.system.effort import Clock, Progress, peak_memory, versions
from skinwave.typing import Floats

MOST_IMBALANCE = 0.01  # relative error of the energy balance, beyond which a response is refused
ON_PLANE = 1e-9  # m: nearer to a plane a probe is on it
FAINTEST = 1e-6  # of the strongest line of a load


def meshed(
    body: Body,
    h: float | None,
    clock: Clock,
    report: Progress,
    symmetry: str = "",
    discretise: Discretise | None = None,
) -> Build:
    """Mesh of a body, as of `bodies.build.build`, timed and reported."""
    with clock("mesh"):
        report("mesh", 0.0)
        return build_body(body, h, symmetry, discretise)


def assembled(build: Build, clock: Clock, report: Progress) -> fem.Operators:
    """Operators of a meshed body, timed and reported."""
    with clock("assemble"):
        report("assemble", 0.0)
        return operators_of(build)


def energy_balance(
    energies: fem.EnergyBalance, stored: float = 0.0, when: str = ""
) -> tuple[float, float]:
    """Relative error of the energy balance, and the share of the losses that was radiated: of
    energies or powers, with the energy `stored` at the end. Raises `fem.Diverged` if the error is
    too large to trust a response.
    """
    imbalance = fem.imbalance(energies, stored)
    if not imbalance <= MOST_IMBALANCE:
        raise fem.Diverged(
            f"the energy balance is off by {100 * imbalance:.2g} %{when}, above the limit of "
            f"{100 * MOST_IMBALANCE:g} %; try another solver, or a finer mesh where it is thin"
        )
    radiated = energies.radiated / energies.lost if energies.lost > 0 else 0.0
    return imbalance, radiated


def spent(effort: Effort, clock: Clock, build: Build, h: float) -> Effort:
    """Cost of a response with its time, memory and mesh of elements of h in metre."""
    return replace(
        effort, seconds=clock.seconds, peak_memory=peak_memory(), h=h, versions=versions(),
        mesh=cache.digest(build.mesh.points, build.mesh.tets),
    )  # fmt: skip


def surface_load(build: Build, load: Load = PRESSURE) -> tuple[sparse.csr_array, Floats]:
    """Load operator P (3 n, c k): nodal forces in N of the c components of a load in Pa on a
    surface across the beam, one after the other, and the points (k, 3) in metre where each is
    taken.
    """
    normals, points = facet_normals(build.mesh), facet_points(build.mesh)
    each = [traction_operator(build.mesh, t) for t in load.tractions(normals)]
    return each[0] if len(each) == 1 else sparse.hstack(each, format="csr"), points


def spread(P: sparse.csr_array, values: Floats) -> Floats:
    """Nodal forces (3 n, c m) of patterns (k, m) of each component of a load."""
    count = P.shape[1] // len(values)
    return np.hstack([P[:, k * len(values) :][:, : len(values)] @ values for k in range(count)])


def load_in_steps(
    pressures: Sequence[MovingPressure], points: Floats, times: Floats, dt: float
) -> Callable[[float], Floats]:
    """Load at points (k, 3) for time steps of a response at times (t,), without its lines above
    half the rate of these: a function of a time in s, to components (c k,) in Pa as of
    `surface_load`.
    """
    folded = [is_folded(pressure, times) for pressure in pressures]
    if not any(folded):
        return lambda t: np.concatenate([about(each, points, t, dt) for each in pressures])
    f, lines = load_lines_at(pressures, points, FAINTEST)
    below = below_half_the_rate(f, times)
    f, lines = f[below], lines[below]
    return lambda t: (np.exp(2j * np.pi * f * t) @ lines).real


def about(pressure: MovingPressure, points: Floats, t: float, over: float) -> Floats:
    """Pressure (k,) in Pa at a time: its mean over a step in which it jumps."""
    start, end = max(t - over / 2, 0.0), t + over / 2
    jumps = jump_times(pressure, start, end) if isinstance(pressure, MovingPressure) else []
    if not len(jumps):
        return pressure(points, t)
    bounds = np.unique([start, *jumps, end])
    share = np.diff(bounds) / (end - start)
    return np.asarray(share @ pressure(points, (bounds[1:] + bounds[:-1]) / 2))


def load_lines_at(
    pressures: Sequence[MovingPressure], points: Floats, threshold: float
) -> tuple[Floats, fem.Complex]:
    """Lines of the c components of a load at points (k, 3): distinct frequencies (f,) in Hz and
    amplitudes (f, c k) in Pa; the threshold is as of `load_lines`.
    """
    each = [pressure_lines(pressure, points, threshold) for pressure in pressures]
    k, found = len(points), np.concatenate([f for f, _ in each])
    rows = [np.pad(a, ((0, 0), (c * k, (len(each) - 1 - c) * k))) for c, (_, a) in enumerate(each)]
    return each[0] if len(each) == 1 else merge_lines(found, np.vstack(rows))


def sag(
    build: Build, operators: fem.Operators, outputs: sparse.csr_array, load: Load, solver: str
) -> Floats:
    """Static response (p c,) of `outputs` (p c, 3 n) to gravity."""
    if not load.gravity:
        return np.zeros(outputs.shape[0])
    weight = load.gravity * inertia(build, (0.0, 0.0, -1.0))
    return np.asarray(outputs @ fem.static(operators, weight, solver=solver))


def translation(build: Build, direction: Sequence[float]) -> Floats:
    """Rigid translation (3 n,) along a unit vector."""
    return np.tile(np.asarray(direction, np.float64), len(build.mesh.points))


def inertia(build: Build, direction: Sequence[float]) -> Floats:
    """Nodal forces M r (3 n,) in N per m/s2 of a body along a unit vector r."""
    whole = operators_of(replace(build, fixed={}, held=None))  # fixed nodes have a share of a mass
    return whole.expand(whole.M @ translation(build, direction)[whole.free])


def with_sag(components: Floats, sag: Floats | float, asked: Quantity) -> Floats:
    """Components (t, p c) of a quantity with those under gravity, of which rates have none."""
    return components if asked.rate else components + sag


def surface_motion(body: Body, build: Build, probes: Floats) -> sparse.csr_array:
    """Probe operator S (p, 3 n): displacement into a meshed body at probes (p, 2) in metre.

    The surface in a file is made of flat triangles, at whose edges its own normals jump: there the
    direction into the body is that of the mean normal about a probe.
    """
    return probe_operator(build.mesh, probes, patch=body.of_kind.normal_patch)


def probe_rows(
    body: Body, build: Build, probes: Floats, reading: Reading
) -> tuple[sparse.csr_array, tuple[Material, ...]]:
    """Probe operator S (p c, 3 n) of what probes (p, 2) in metre read at rest, the c components of
    a probe next to each other, and the material at each probe, none where nothing depends on them.
    Raises a ValueError if a probe is not in the body, or its strain in a coat.
    """
    asked = reading.record
    check_coat(build, reading)
    if asked.is_normal and (reading.is_on_surface or body.of_kind.is_plate):
        return surface_motion(body, build, probes), ()
    if body.of_kind.is_plate:
        return sheet_rows(body, build, probes, reading)
    mesh = build.mesh
    places, normals = surface_frame(mesh, probes, patch=body.of_kind.normal_patch)
    points = places - np.broadcast_to(reading.depths or 0.0, len(probes))[:, None] * normals
    if asked.is_normal:
        inwards = sparse.block_diag(-normals[:, None], format="csr")
        return (inwards @ displacement_operator(mesh, points)).tocsr(), ()
    solids = materials_at(mesh, build.material, points)
    rows = sparse.block_diag([asked.rows(solid) for solid in solids], format="csr")
    if asked.field == STRAIN:
        return (rows @ strain_operator(mesh, build.material, points)).tocsr(), solids
    return (rows @ displacement_operator(mesh, points)).tocsr(), solids


def check_coat(build: Build, reading: Reading) -> None:
    """Refuse strain and stress in a coat, where elements are of the material below."""
    thickness = sum(build.coat.thicknesses) if build.coat else 0.0
    least = min(reading.depths, default=0.0)
    if reading.record.field == STRAIN and least < thickness:
        raise ValueError(
            f"{reading.record.words} at a depth of {1e3 * least:g} mm is in layers of "
            f"{1e3 * thickness:g} mm that are a coat, without elements of their own; take smaller "
            "elements, or a greater depth"
        )


def line_factor(asked: Quantity, s: Any, solids: tuple[Material, ...], outputs: int) -> fem.Complex:
    """Factor (f, p c) of the components of a quantity at complex frequencies s (f,) in rad/s, of
    all p c `outputs`, with the p materials of the probes or none.
    """
    if not asked.relaxes:
        return np.broadcast_to(np.asarray(asked.factor(s))[:, None], (len(s), outputs))
    each = {solid: asked.factor(s, fem.relaxation(solid, s)) for solid in set(solids)}
    return np.stack([each[solid] for solid in solids], axis=1).repeat(
        outputs // len(solids), axis=1
    )


def mirrored_axes(body: Body, reading: Reading, load: Load) -> str:
    """Axes across which a body is its mirror image, and what probes read keeps its sign."""
    if not body.of_kind.is_symmetric or body.placement != FLAT:
        return ""
    if not reading.record.is_normal:  # others change sign, or are recovered across the plane
        return ""
    if load.moving != PRESSURE:  # which may have a direction
        return ""
    return body.symmetry


def axes_of_probes(probes: Floats, among: str) -> str:
    """Axes, of some of "xy", on whose middle planes all probes (p, 2) in metre lie."""
    return "".join(axis for axis in among if np.abs(probes[:, "xy".index(axis)]).max() < ON_PLANE)


def modelled_axes(body: Body, probes: Floats, symmetry: str, reading: Reading, load: Load) -> str:
    """Axes, of "xy", across whose middle planes only one side of a body is modelled: across those
    of `symmetry` the load is its own mirror image at all times, on others all probes lie.
    """
    seen = axes_of_probes(probes, mirrored_axes(body, reading, load))
    return "".join(axis for axis in "xy" if axis in symmetry or axis in seen)


def images(probes: Floats, axes: str) -> Floats:
    """Mirror images (p, 2) of probes in the part of a body with positive coordinates."""
    found = probes.copy()
    for axis in ("xy".index(a) for a in axes):
        found[:, axis] = np.abs(found[:, axis])
    return found


def even_part(P: sparse.csr_array, points: Floats, axes: str) -> tuple[sparse.csr_array, Floats]:
    """Load operator (3 n, j k) of the even part of a load, on the part of a body with positive
    coordinates across some axes: it takes the load at the points (k, 3) of an operator P (3 n, k)
    and at their mirror images (j k, 3), in metre.
    """
    for axis in axes:
        image = points.copy()
        image[:, "xyz".index(axis)] *= -1
        P, points = sparse.hstack([P / 2, P / 2], format="csr"), np.vstack([points, image])
    return P, points
