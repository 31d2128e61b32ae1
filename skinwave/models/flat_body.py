"""Wavenumber integrals of a laterally infinite body: in time from rest, and the steady state."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import isfinite, log, pi

import numpy as np

import simple_model
from simple_model import Effort, ErrorPart, Response
from simple_model.layers.compliance import thick_plate
from simple_model.layers.flat_body import (
    TRANSFORM_RATE,
    WRAP_AROUND,
    field_history,
    furthest,
    spline_steps,
    steady_history,
    transform_samples,
)
from simple_model.layers.flat_quantities import quantity_field, surface_field, traction_field
from simple_model.layers.wavenumber_integral import FEWEST_NODES, MOST_NODES, Field
from simple_model.load.focus import gaussian_sum
from simple_model.load.path_cells import AT_ONCE, is_abrupt, path_samples
from simple_model.load.sampling import highest_line, is_folded, oversampling
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies import sheet
from skinwave.bodies.analytic import compliance, stack
from skinwave.bodies.parts import FLAT
from skinwave.bodies.sizes import stratum_thicknesses
from skinwave.models import Cost, Limit, Model, limits, register
from skinwave.models.costs import UNITS, Cheaper, computed_times, lines_below, synthesis
from skinwave.models.laws import has_table
from skinwave.models.options import Solve, SolveOptions, response_of, sample_times
from skinwave.models.plate_modes import shear_part
from skinwave.models.relative_change import relative_changes
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

METHOD = "wavenumber integral"


def _solver(model: str, normal: Callable[..., Response], history: Callable[..., Floats]) -> Solve:
    """Return the function that solves a scene: by `normal` for normal displacement under a
    pressure, otherwise by the `history` of components at the probes of each depth.
    """

    def solve(scene: Scene, times: Floats, options: SolveOptions) -> Response:
        options.progress(METHOD, 0.0)
        if scene.reading.is_plain and scene.load.is_plain:
            return normal(compliance(scene.body), scene.pressure, scene.probe_points, times)
        started, depths = time.perf_counter(), np.array(scene.depths)
        values = np.empty((len(times), len(depths)))
        for depth in np.unique(depths).tolist():
            here = depths == depth
            components = [
                history(field, pressure, scene.probe_points[here], times)
                for field, pressure in zip(fields_read(scene, depth), scene.loads, strict=True)
            ]
            total = np.sum(components, axis=0)
            values[:, here] = scene.reading.record.waveforms(total, int(here.sum()))
        effort = Effort(seconds={"evaluate": time.perf_counter() - started}, steps=len(times))
        return response_of(scene, model, times, values, effort)

    return solve


def fields_read(scene: Scene, depth: float) -> tuple[Field, ...]:
    """Return the fields of a scene's quantity, one for each component of its load."""
    if scene.load.is_plain:
        return (field_read(scene, depth),)
    upright = scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0]
    layers = stack(scene.body)
    return tuple(traction_field(scene.reading.record, layers, direction) for direction in upright)


def field_read(scene: Scene, depth: float) -> Field:
    """Return the field of a scene's quantity under a pressure, at a depth in m."""
    if scene.body.of_kind.is_layer:
        return quantity_field(scene.reading.record, stack(scene.body), depth)
    return surface_field(scene.reading.record, compliance(scene.body))


def _parts(scene: Scene, options: SolveOptions) -> Iterator[ErrorPart]:
    """Yield the parts of the error of a wavenumber integral, compared with finite elements."""
    error = 0.002  # compared with finite elements
    yield ErrorPart(
        name="integral", source="the wavenumber integral", error=error,
        cure=f"use a tolerance of {100 * error:g} % or more, the limit of the method",
    )  # fmt: skip
    if scene.body.of_kind.is_plate:
        # The error of a thin sheet is 0.6 to 1.2 times the effect of shear, by layered bodies.
        yield shear_part(scene, 1.25 * _effect_of_shear(scene))


def _effect_of_shear(scene: Scene, longest: float = 0.1) -> float:
    """Return the change of a sheet's motion by shear and rotary inertia, in `longest` s or less."""
    times = sample_times(scene)
    times = times[: max(2, int(np.searchsorted(times, longest)))]
    thin, thick = (
        field_history(surface_field(DISPLACEMENT, each), scene.pressure, scene.probe_points, times)
        for each in (
            sheet.compliance(scene.body), sheet.compliance(scene.body, correction=thick_plate)
        )
    )  # fmt: skip
    return float(relative_changes((thick - thin)[..., 0], thick[..., 0]).max())


def _limits(scene: Scene) -> Iterator[Limit]:
    body, reading, load, pressure = scene.body, scene.reading, scene.load, scene.pressure
    if body.of_kind.compliance is None:
        yield Limit(why=f"needs a slab or a sheet, not a {body.kind}")
        return
    if body.placement != FLAT:
        yield Limit(
            why="needs a body that lies flat at the origin, not a tilted or moved one",
            cure="remove [placement]", change=limits.of_body(placement=FLAT),
        )  # fmt: skip
    if body.of_kind.is_plate:
        yield from limits.isotropic_limits(body)
    if gaussian_sum(pressure.height, pressure.profile) is None:
        yield Limit(
            why=f"needs a Gaussian focus or a map, not the profile {pressure.profile_name}",
            cure='set profile = "gaussian"',
            change=lambda scene: replace(
                scene, pressure=replace(scene.pressure, profile="gaussian")
            ),
        )
    of_surface = reading.record.is_normal and reading.is_on_surface
    if body.of_kind.is_plate and not of_surface:
        yield limits.reading_limit(scene)
    if not load.is_plain and (body.of_kind.is_plate or load.gravity or load.support_motion):
        yield limits.load_limit(scene)
    elif not (load.is_plain or of_surface):
        yield Limit(
            why=f"does not compute {reading.words} under {load.words}",
            cure="read the displacement at the surface", change=limits.displacement_at_surface,
        )  # fmt: skip


def _steady_limits(scene: Scene) -> Iterator[Limit]:
    yield from _limits(scene)
    if not any(solid.has_loss for solid in scene.body.solids):
        yield Limit(
            why="needs a material with loss, because resonances without loss are unbounded",
            cure="give the material a viscosity_pa_s", change=_with_loss,
        )  # fmt: skip


def _with_loss(scene: Scene) -> Scene:
    """Return the scene with a loss tangent of 0.1 at 100 Hz."""
    viscosity = 0.1 * scene.body.solid.shear_modulus / (2 * np.pi * 100)
    return limits.of_part("solid", viscosity=viscosity)(scene)


def _distances(scene: Scene, pattern: float = 1.2e-8) -> tuple[int, int, float]:
    """Return the numbers of distances at which a field is integrated and of Gaussians, and the
    seconds of a position of the path; `pattern` is in s of a distance and a probe.
    """
    pressure = scene.pressure
    spot = gaussian_sum(pressure.height, pressure.profile)
    assert spot is not None  # the limits
    far = furthest(scene.probe_points, path_samples(pressure), spot)
    distances = spline_steps(far / spot.width)
    return distances, len(spot.shares), pattern * len(scene.probes) * distances


def _integrals(scene: Scene, omega: float) -> tuple[int, int, float, float]:
    """Return the numbers of fields and of their integrals, the seconds of a wavenumber at a
    frequency, and the loss tangent at `omega` in rad/s, which keeps poles off the path of
    integration.
    """
    body, depths = scene.body, sorted(set(scene.depths))
    layers = sum(isfinite(each) for each in stratum_thicknesses(body.strata)) + isfinite(body.depth)
    fields = [each for depth in depths for each in fields_read(scene, depth)]
    terms = sum(int(np.count_nonzero(each.uses)) for each in fields)
    moduli = [solid.complex_modulus(omega) for _, solid in body.strata]
    loss = max(float(each.imag / each.real) for each in moduli) if isfinite(body.depth) else 1.0
    is_plain = scene.reading.is_plain and scene.load.is_plain
    orders = 1.0 if is_plain else sum(len(each.orders) for each in fields) / len(fields)
    evaluation = 2.5e-7  # s of a wavenumber, a frequency and a layer
    return len(fields), terms, evaluation * (0.5 + layers) * orders, loss


def _cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    times, count, omega = computed_times(scene, options), len(scene.probes), 2 * pi * 200.0
    distances, gaussians, position = _distances(scene)
    fields, terms, evaluation, loss = _integrals(scene, omega)
    _, padded = transform_samples(times)
    damped = loss - 2 * log(WRAP_AROUND) / (padded / TRANSFORM_RATE) / omega
    # Evaluations with much loss; loss tangent below which they increase; s of a sample, a distance
    # and a probe in a transform.
    least, resonant, transform = 1.1e5, 0.12, 2.5e-8
    evaluations = fields * least * max(1.0, (resonant / damped) ** 2)
    parts = oversampling(highest_line(scene.pressure), 1 / TRANSFORM_RATE)
    folded = is_folded(scene.pressure, times)
    parts = 1 if folded else max(parts, 1 + is_abrupt(scene.pressure))
    transformed = terms / fields * count * distances * padded * parts
    made = count * padded * lines_below(scene, times) * UNITS.line[0] if folded else 0.0
    at_once = min(distances * padded * parts, AT_ONCE)
    along_path = position * (gaussians - 1) * len(path_samples(scene.pressure))
    values = padded * (3 * count * terms / fields + distances)
    return Cost(
        parts={
            f"{Cheaper.PROBES}, or a smaller path": UNITS.start
            + transform * transformed
            + along_path,
            Cheaper.LINES: made,
            Cheaper.LOSS: evaluation * evaluations,
        },
        memory=UNITS.process + 48 * at_once + 8 * values,
    )


def _steady_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    times, (distances, gaussians, position) = computed_times(scene, options), _distances(scene)
    fields, _, evaluation, loss = _integrals(scene, 2 * pi * 200.0)
    # Wavenumbers of a line times its loss tangent; s of a wavenumber and a distance.
    resonant, bessel = 30.0, 4e-7
    nodes = min(max(resonant / loss, FEWEST_NODES), MOST_NODES)
    lines = lines_below(scene, times)
    seconds, size = synthesis(scene, times)
    evaluations = fields * max(2 * nodes, 3 * FEWEST_NODES) * lines
    return Cost(
        parts={
            Cheaper.DURATION: UNITS.start + seconds,
            Cheaper.LINES: position * (gaussians * len(path_samples(scene.pressure)) + lines),
            Cheaper.LOSS: evaluation * evaluations + bessel * fields * nodes * distances,
        },
        memory=UNITS.process + size + 16 * nodes * distances,
    )


FLAT_BODY = register(
    Model(
        name="flat-body",
        method=METHOD,
        words="linear waves of a laterally infinite flat body, by the wavenumber integral",
        solve=_solver("flat-body", simple_model.flat_body, field_history),
        limits=_limits,
        parts=_parts,
        cost=_cost,
        colour="#009E73",
        sources=(
            "E. Kausel, J. M. Roesset: Stiffness matrices for layered soils. Bulletin of the "
            "Seismological Society of America 71 (1981) 1743-1761",
        ),
        is_infinite=True,
        takes_series=has_table,
    )
)
HARMONIC = register(
    replace(
        FLAT_BODY,
        name="flat-body-harmonic",
        method="wavenumber integral, line by line",
        words="the steady state of linear waves of a laterally infinite flat body, by the "
        "wavenumber integral",
        solve=_solver("flat-body-harmonic", simple_model.steady_state, steady_history),
        limits=_steady_limits,
        cost=_steady_cost,
        colour="#E69F00",
        from_rest="flat-body",
        takes_series=lambda body: False,
    )
)
