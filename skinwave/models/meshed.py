"""Meshed body of a model: its operators, load and probes."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem import load_and_probe
from fem.krylov import EXPANSION_POINT
from fem.stress import materials_at, strain_operator
from meshes import cache
from meshes.tetmesh import corner_volumes
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
from skinwave.models.sheet_probes import sheet_rows
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import Reading
from skinwave.system.effort import Clock, Progress, one_thread, peak_memory, versions
from skinwave.typing import Floats


def mesh_body(
    body: Body, h: float | None, clock: Clock, report: Progress, symmetry: str = "",
    discretise: Discretise | None = None,
) -> Build:  # fmt: skip
    """Mesh a body with `bodies.build.build`, timed and reported."""
    with clock("mesh"), one_thread():
        report("mesh", 0.0)
        return build_body(body, h, symmetry, discretise)


def assemble(build: Build, clock: Clock, report: Progress) -> fem.Operators:
    """Return the operators of a meshed body, timed and reported."""
    with clock("assemble"):
        report("assemble", 0.0)
        return operators_of(build)


def energy_balance(
    energies: fem.EnergyBalance, stored: float = 0.0, when: str = ""
) -> tuple[float, float]:
    """Return the relative error of an energy or power balance, given the energy in J `stored` at
    its end, and the radiated share of the losses. Raises `fem.Diverged` if the error is too large.
    """
    imbalance = fem.imbalance(energies, stored)
    most_imbalance = 0.01  # relative error of the energy balance, above which a response is refused
    if not imbalance <= most_imbalance:
        raise fem.Diverged(
            f"the energy balance has an error of {100 * imbalance:.2g} %{when}, above the limit of "
            f"{100 * most_imbalance:g} %; use another solver, or a finer mesh at thin parts"
        )
    radiated = energies.radiated / energies.lost if energies.lost > 0 else 0.0
    return imbalance, radiated


def with_cost(effort: Effort, clock: Clock, build: Build, h: float) -> Effort:
    """Return the effort with time, memory, versions, mesh and element size in m."""
    return replace(
        effort, seconds=clock.seconds, peak_memory=peak_memory(), h=h, versions=versions(),
        mesh=cache.digest(build.mesh.points, build.mesh.tets),
        cells=len(build.mesh.tets) << len(build.symmetry),
    )  # fmt: skip


def expansion_point(
    body: Body, build: Build, *, per_crossing: float = 3.8,
    within: tuple[float, float] = (2 * np.pi * 50.0, 2 * np.pi * 1000.0),
) -> float:  # fmt: skip
    """Return the expansion point in rad/s with which a body's reduced model needs few vectors.

    The lowest natural frequency of tissue on bone follows the time in which shear waves cross the
    mean depth, which is volume over top area seen from above. The point is `per_crossing` over this
    time; the best one of palms, slabs, a fingertip and a hand is 0.7 to 1.6 times it.
    """
    if body.of_kind.is_plate:
        return EXPANSION_POINT
    mesh = build.mesh
    slowness = {region: 1 / solid.shear_speed for region, solid in build.material.items()}
    volumes = corner_volumes(mesh.points, mesh.tets[:, :4])
    crossing = sum(volumes[mesh.region == k].sum() * each for k, each in slowness.items())
    area = np.abs(load_and_probe.facet_geometry(mesh.points[mesh.facets["top"]])[1][..., 2]).sum()
    return float(np.clip(per_crossing * area / crossing, *within))


def surface_load(build: Build, load: Load = PRESSURE) -> tuple[sparse.csr_array, Floats]:
    """Return the load operator P (3 n, c k), nodal forces in N of the c components of a load in Pa
    on a surface across the beam, and the points (k, 3) in m where it takes each component.
    """
    normals, points = (
        load_and_probe.facet_normals(build.mesh),
        load_and_probe.facet_points(build.mesh),
    )
    each = [load_and_probe.traction_operator(build.mesh, t) for t in load.tractions(normals)]
    return each[0] if len(each) == 1 else sparse.hstack(each, format="csr"), points


def spread(P: sparse.csr_array, values: Floats) -> Floats:
    """Return the nodal forces (3 n, c m) of patterns (k, m) of each component of a load."""
    count = P.shape[1] // len(values)
    return np.hstack([P[:, k * len(values) :][:, : len(values)] @ values for k in range(count)])


def load_in_steps(
    pressures: Sequence[MovingPressure], points: Floats, times: Floats, dt: float
) -> Callable[[float], Floats]:
    """Return the function of a time in s to the components (c k,) in Pa at points (k, 3), for time
    steps of a response at times (t,), without lines above half the rate of these times.
    """
    if not any(is_folded(pressure, times) for pressure in pressures):
        return lambda t: np.concatenate([_mean_in_step(p, points, t, dt) for p in pressures])
    weakest_line = 1e-6  # of the strongest line of a load
    f, lines = load_lines_at(pressures, points, weakest_line)
    below = below_half_the_rate(f, times)
    f, lines = f[below], lines[below]
    return lambda t: (np.exp(2j * np.pi * f * t) @ lines).real


def _mean_in_step(pressure: MovingPressure, points: Floats, t: float, dt: float) -> Floats:
    """Return the pressure (k,) in Pa at a time, or its mean over a step in which it jumps."""
    start, end = max(t - dt / 2, 0.0), t + dt / 2
    jumps = jump_times(pressure, start, end) if isinstance(pressure, MovingPressure) else []
    if not len(jumps):
        return pressure(points, t)
    bounds = np.unique([start, *jumps, end])
    share = np.diff(bounds) / (end - start)
    return np.asarray(share @ pressure(points, (bounds[1:] + bounds[:-1]) / 2))


def load_lines_at(
    pressures: Sequence[MovingPressure], points: Floats, threshold: float
) -> tuple[Floats, fem.Complex]:
    """Return distinct frequencies (f,) in Hz and amplitudes (f, c k) in Pa of the c components of a
    load at points (k, 3); `threshold` is that of `load_lines`.
    """
    each = [pressure_lines(pressure, points, threshold) for pressure in pressures]
    if len(each) == 1:
        return each[0]
    k, last = len(points), len(each) - 1
    rows = [np.pad(a, ((0, 0), (c * k, (last - c) * k))) for c, (_, a) in enumerate(each)]
    return merge_lines(np.concatenate([f for f, _ in each]), np.vstack(rows))


def sag(
    build: Build, operators: fem.Operators, outputs: sparse.csr_array, load: Load, solver: str
) -> Floats:
    """Return the static response (p c,) of `outputs` (p c, 3 n) to gravity."""
    if not load.gravity:
        return np.zeros(outputs.shape[0])
    weight = load.gravity * inertia(build, (0.0, 0.0, -1.0))
    return np.asarray(outputs @ fem.static(operators, weight, solver=solver))


def translation(build: Build, direction: Sequence[float]) -> Floats:
    """Return the rigid translation (3 n,) along a unit vector."""
    return np.tile(np.asarray(direction, np.float64), len(build.mesh.points))


def inertia(build: Build, direction: Sequence[float]) -> Floats:
    """Return the nodal forces M r (3 n,) in N per m/s2 of a body along a unit vector r."""
    whole = operators_of(replace(build, fixed={}, held=None))  # fixed nodes have mass, too
    return whole.expand(whole.M @ translation(build, direction)[whole.free])


def with_sag(components: Floats, sag: Floats | float, quantity: Quantity) -> Floats:
    """Add the static components under gravity to components (t, p c), except for rates."""
    return components if quantity.rate else components + sag


def surface_motion(body: Body, build: Build, probes: Floats) -> sparse.csr_array:
    """Return the probe operator S (p, 3 n) of the displacement into a body at probes (p, 2) in m.

    The surface of a file consists of flat triangles, whose normals jump at edges. There the
    direction into the body is that of the mean normal around a probe.
    """
    return load_and_probe.probe_operator(build.mesh, probes, patch=body.of_kind.normal_patch)


def probe_rows(
    body: Body, build: Build, probes: Floats, reading: Reading
) -> tuple[sparse.csr_array, tuple[Material, ...]]:
    """Return the probe operator S (p c, 3 n) of the c static components of a quantity at probes (p,
    2) in m, and the material at each probe, or () if the quantity does not depend on it.

    Raises a ValueError if a probe is outside the body, or reads strain or stress in a coat.
    """
    quantity = reading.record
    check_coat(build, reading)
    if quantity.is_normal and (reading.is_on_surface or body.of_kind.is_plate):
        return surface_motion(body, build, probes), ()
    if body.of_kind.is_plate:
        return sheet_rows(body, build, probes, reading)
    mesh = build.mesh
    places, normals = load_and_probe.surface_frame(mesh, probes, patch=body.of_kind.normal_patch)
    points = places - np.broadcast_to(reading.depths or 0.0, len(probes))[:, None] * normals
    if quantity.is_normal:
        inwards = sparse.block_diag(-normals[:, None], format="csr")
        return (inwards @ load_and_probe.displacement_operator(mesh, points)).tocsr(), ()
    solids = materials_at(mesh, build.material, points)
    rows = sparse.block_diag([quantity.rows(solid) for solid in solids], format="csr")
    if quantity.field == STRAIN:
        return (rows @ strain_operator(mesh, build.material, points)).tocsr(), solids
    return (rows @ load_and_probe.displacement_operator(mesh, points)).tocsr(), solids


def check_coat(build: Build, reading: Reading) -> None:
    """Raise a ValueError for strain and stress in a coat, which has no elements."""
    thickness = sum(build.coat.thicknesses) if build.coat else 0.0
    least = min(reading.depths, default=0.0)
    if reading.record.field == STRAIN and least < thickness:
        raise ValueError(
            f"{reading.record.words} at a depth of {1e3 * least:g} mm is in the layers of the top "
            f"{1e3 * thickness:g} mm, which are modelled as a coat without elements; use smaller "
            "elements, or a greater depth"
        )


def line_factor(
    quantity: Quantity, s: Any, solids: tuple[Material, ...], outputs: int
) -> fem.Complex:
    """Return the factor (f, p c) of the components of a quantity at complex frequencies s (f,) in
    rad/s, for all p c `outputs` and the p materials of the probes, if any.
    """
    if not quantity.relaxes:
        return np.broadcast_to(np.asarray(quantity.factor(s))[:, None], (len(s), outputs))
    each = {solid: quantity.factor(s, fem.relaxation(solid, s)) for solid in set(solids)}
    return np.stack([each[solid] for solid in solids], axis=1).repeat(
        outputs // len(solids), axis=1
    )
