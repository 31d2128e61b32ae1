"""Errors by what a model leaves out: the start from rest, motion above its band, stretching of a
sheet, a modulus law that a Prony series replaces, and errors of natural frequencies.

Each function returns a relative error of the worst probe's waveform.

A sheet of thickness h that deflects by w stiffens in proportion to (w / h)^2. Near a resonance,
small discretisation errors of natural frequencies cause much larger errors of the waveform. The
sensitivity is computed by shifting the poles of a coarse reduced model by a thousandth.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from math import ceil

import numpy as np

from fem.reduced import exponential_sum, line_response
from simple_model import MovingPressure, Response
from simple_model.layers.flat_body import TRANSFORM_RATE, steady_lines
from simple_model.layers.material import Material
from simple_model.load.focus import spot_width
from simple_model.load.spectrum import load_lines
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.analytic import compliance
from skinwave.bodies.sizes import coarsest_size, default_size
from skinwave.bodies.supports import FRAME
from skinwave.models import Model, named, plate_modes
from skinwave.models.laws import STRONG, own_laws, relaxing, series_tolerance
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import (
    FROM_REST,
    STRETCHED,
    first_part,
    linear_error,
    middle_compliance,
    relative_modulus,
)
from skinwave.models.reduced import ReducedBody, answer, prepare, reduced_forces, steady_waveforms
from skinwave.models.relative_change import relative_changes
from skinwave.planning.estimates import mean_gain, spot_scale
from skinwave.scene.scene import SAMPLE_RATE as RATE
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

EXACT = SolveOptions(tolerance=1e-3)  # of the models that are compared
LINEAR = 0.5  # deflection over thickness up to which bending of a sheet may be taken as linear
NEGLIGIBLE = 0.1  # of the tolerance, of an error that is bounded rather than measured


def start_error(
    scene: Scene, model: Model, grid: tuple[Floats, int], prepared: ReducedBody | None = None
) -> float:
    """Return the difference of a steady state from the motion from rest; 0 for a model from rest.

    `grid` is that of `sample_grid`; a model of elements needs its `prepared` body. Raises a
    ValueError or ArithmeticError if the scene has no steady state.
    """
    if not model.is_steady:
        return 0.0
    times, first = grid
    if prepared:
        whole = answer(prepared, scene, times=times).values
        return _start(steady_waveforms(prepared, scene, times), lambda n: whole[:n], first)
    steady, from_rest = model.solve, named(model.from_rest).solve
    return _start(
        steady(scene, times, EXACT).values, lambda n: from_rest(scene, times[:n], EXACT).values,
        first,
    )  # fmt: skip


def _start(steady: Floats, from_rest: Callable[[int], Floats], first: int) -> float:
    """Return that difference from sample `first` on, between a steady state (t, p) and a function
    that returns the first n samples from rest. The number of samples grows until the rest is
    negligible, assuming that the difference continues at its last level.
    """
    samples = len(steady)
    first_samples, longer = 1000, 4  # samples of a start that are compared at first; factor on them
    n = min(samples, first_samples)
    later_share = 0.02  # of the energy of a start: what may follow the compared samples
    while True:
        whole = from_rest(n)
        squared = (whole - steady[:n]) ** 2
        later = squared[3 * n // 4 :].mean(axis=0) * (samples - n)
        energy = squared[first:].sum(axis=0)
        if n == samples or (later <= later_share * energy).all():
            break
        n = min(samples, longer * n)
    size = (whole[first:] ** 2).sum(axis=0) + (steady[max(n, first) :] ** 2).sum(axis=0)
    no_start = 1e-6  # of the largest probe's motion: weaker motion is round-off
    size = np.maximum(size, no_start**2 * size.max())
    return float(np.sqrt((energy + later) / np.where(size > 0, size, np.inf)).max())


def above_band_error(scene: Scene, model: Model, grid: tuple[Floats, int]) -> float:
    """Return the share of a wavenumber integral from rest above its band; 0 for a quantity without
    jumps, and for a steady state.

    Velocity and acceleration jump where a load begins abruptly. Doubling the band halves the error
    of a velocity, so that the error is twice the change. The first sample of an acceleration may
    have no limit; its error, measured with sixteen times the band, is three times the change.
    """
    if model.is_steady or not scene.reading.record.rate:
        return 0.0
    times, first = grid
    parts = max(2, ceil(2 * TRANSFORM_RATE * times[1]))  # of a step, with twice the band
    fine = np.asarray(times[1] / parts * np.arange(parts * (len(times) - 1) + 1), np.float64)
    usual, wide = (model.solve(scene, t, EXACT).values for t in (times, fine))
    usual, wide = usual[first:], wide[::parts][first:]
    return (1 + scene.reading.record.rate) * float(relative_changes(wide - usual, wide).max())


def linear_deflection(scene: Scene) -> float:
    """Return the largest linear deflection of a supported sheet relative to its thickness: at its
    probes and middle from rest, or at its middle under the mean load. It is 0 for other bodies, and
    for curled sheets, which are stiffened by their rise.
    """
    body = scene.body
    flat = body.of_kind.is_plate and not body.mounting.is_curled
    if not (flat and body.sides == "clamped"):
        return 0.0
    return max(_largest_deflection(_displacement_scene(scene)), mean_sag(scene) / body.depth)


@lru_cache(maxsize=64)
def _largest_deflection(scene: Scene) -> float:
    """Return the largest deflection over thickness in a response from rest, or 0."""
    middle = tuple(float(x) for x in scene.body.placement.offset)
    with_middle = replace(
        scene, probes=tuple(dict.fromkeys((*scene.probes, (middle[0], middle[1]))))
    )
    if not takes(FROM_REST, with_middle):
        return 0.0
    u = FROM_REST.solve(with_middle, sample_times(scene), SolveOptions()).values
    return float(np.abs(u).max()) / scene.body.depth


@lru_cache(maxsize=64)
def _measured_linear_error(scene: Scene, samples: int) -> float:
    """Return the relative error of linear bending in the first samples of a displacement."""
    times = sample_times(scene)[:samples]
    return linear_error(scene, times, FROM_REST.solve(scene, times, SolveOptions()).values)


def _displacement_scene(scene: Scene) -> Scene:
    """Return the scene with probes that read the displacement of the surface."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0, name="", spreads=())


def stretching_error(scene: Scene, model: Model, tolerance: float) -> float:
    """Return the error of a linear model for a sheet that stretches; 0 for other models and bodies.

    If the deflection is small, its square bounds the error. Otherwise `plate-modes-nonlinear`
    measures it in the displacement over the whole record, if this model takes the scene.
    """
    is_linear = model.needs_body and not model.is_nonlinear
    if not (is_linear and scene.body.of_kind.is_plate):
        return 0.0
    plain, negligible = _displacement_scene(scene), NEGLIGIBLE * tolerance
    bound = _stretching_bound(scene, negligible)
    if bound > negligible and takes(STRETCHED, plain):
        return _measured_linear_error(plain, len(sample_times(plain)))
    return min(1.0, bound)


def _stretching_bound(scene: Scene, negligible: float) -> float:
    """Return a bound of the relative error of linear bending at small deflection, no sharper than
    to decide whether it is negligible: stretching raises natural frequencies by at most `hardening`
    (w / h)^2, and a resonance multiplies this.
    """
    squared, plain = linear_deflection(scene) ** 2, _displacement_scene(scene)
    # Relative error of linear bending over (w / h)^2 away from a resonance: 0.4 to 3.3 for paper
    # sheets of 30 to 210 mm, on four edges, two or in clips, with tension and without.
    steepest = 7.0
    bound = steepest * squared
    if not squared or bound > negligible or not takes(FROM_REST, plain):
        return bound
    # Relative change of natural frequencies over (w / h)^2, under a mean deflection w: 0.7 of a
    # clamped plate, 2.6 of a simply supported one.
    hardening = 2.6
    return max(bound, hardening * plate_modes.sensitivity(plain) * squared)


def stretches(scene: Scene, tolerance: float) -> float:
    """Return the error of a linear model of a sheet if it stretches or deflects too much for one,
    otherwise 0. The first part of the record decides, if it suffices.
    """
    if not takes(STRETCHED, scene):
        return 0.0
    plain, negligible = _displacement_scene(scene), NEGLIGIBLE * tolerance
    if _stretching_bound(scene, negligible) > negligible:
        error = _measured_linear_error(plain, len(first_part(plain, sample_times(plain))))
        if error > tolerance / 2:
            return error
    error = stretching_error(scene, FROM_REST, tolerance)
    is_beyond = error > tolerance / 2 or linear_deflection(scene) > LINEAR
    return error if is_beyond else 0.0


def deflection_ratio(scene: Scene, response: Response) -> float:
    """Return the largest deflection of a sheet relative to its thickness, at its probes in a
    response or from `linear_deflection`, without the rigid-body motion of an unconstrained sheet.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return 0.0
    u = response.displacement if response.record is DISPLACEMENT else np.zeros((1, 1))
    bending = u if body.is_held else u - u.mean(axis=1, keepdims=True)
    return max(float(np.abs(bending).max()) / body.depth, linear_deflection(scene))


def mean_sag(scene: Scene) -> float:
    """Return the linear deflection in m of the middle of a supported sheet under its mean load,
    applied there: 0.0056 F a^2 / D for a clamped square (Timoshenko and Woinowsky-Krieger 1959,
    table 37), otherwise from the modes of the plate.
    """
    body = scene.body
    if body.mounting == FRAME and body.solid.orthotropy is None:
        at_rest = relative_modulus(body, 0.0).real * body.bending_stiffness
        compliance_of_middle = 0.0056 * min(body.width, body.height) ** 2 / at_rest
    else:
        compliance_of_middle = middle_compliance(body)
    return float(_mean_force(scene) * compliance_of_middle)


def _mean_force(scene: Scene) -> float:
    """Return the mean force in N on the middle of a flat body."""
    if scene.load.moving.is_plain:
        return float(2 * np.pi * spot_width(scene.pressure.height) ** 2 * mean_gain(scene))
    downwards = -scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0, 2]
    forces = [2 * np.pi * spot_scale(each) ** 2 * mean_gain(replace(scene, pressure=each))
              for each in scene.loads]  # fmt: skip
    return float(downwards @ forces)


def sensitivity(scene: Scene, prepared: ReducedBody | None = None) -> tuple[float, float]:
    """Return the relative change of the worst probe's waveform per relative change of all natural
    frequencies, and the root-mean-square frequency of the motion in Hz, from two responses of a
    reduced body, by default on a coarse mesh.
    """
    coarsening = 2.0  # of the default element size
    h = min(coarsening * default_size(scene.body), coarsest_size(scene.body))
    moving = replace(scene, load=scene.load.moving)
    coarse = prepared or prepare(moving, SolveOptions(h=h))
    detuning = 0.010  # relative excess of the natural frequencies of the coarse mesh
    values = coarse.poles.values * (1 - detuning)
    frequencies, forces = reduced_forces(coarse, *scene.loads)
    sensitivity_duration = 1.0  # s of the responses that are compared
    duration = min(scene.tacton.duration, sensitivity_duration)
    times = np.arange(max(2, round(duration * RATE))) / RATE

    def waveforms(shift: float) -> Floats:
        """Return the waveforms (t, p) with shifted natural frequencies."""
        higher = np.asarray(values * (1 + shift), np.complex128)
        poles = replace(coarse.poles, values=higher)
        lines, start = (x @ coarse.read.T for x in line_response(poles, forces, frequencies))
        rates = np.concatenate([2j * np.pi * frequencies, higher])
        return exponential_sum(rates, np.vstack([lines, start]), times)

    whole = waveforms(0.0)
    moving = whole - whole.mean(axis=0)
    speed = float(np.linalg.norm(np.diff(moving, axis=0))) * RATE
    frequency_shift = 1e-3  # of natural frequencies, for the sensitivity
    change = float(relative_changes(waveforms(frequency_shift) - whole, whole).max())
    return change / frequency_shift, speed / max(float(np.linalg.norm(moving)), 1e-300) / (
        2 * np.pi
    )


def series_error(
    scene: Scene, model: str, tolerance: float, prepared: ReducedBody | None = None
) -> float:
    """Return the error of Prony series in place of modulus laws; 0 for a model that uses the laws.
    A `prepared` body on any mesh saves the reduction of a coarse one.
    """
    solids, known, allowed = own_laws(scene.body), named(model), series_tolerance(tolerance)
    if not solids or not known.takes_series(scene.body):
        return 0.0
    worst = max(_series_deviation(solid, scene.pressure, allowed) for solid in solids)
    if known.is_infinite:
        return _steady_change(scene, allowed, worst)
    # An error d of a modulus shifts natural frequencies by d / 2 and static motion by d.
    return worst * max(1.0, sensitivity(scene, prepared)[0] / 2)


def _series_deviation(solid: Material, pressure: MovingPressure, allowed: float) -> float:
    """Return the largest relative deviation of a series from its law in its band or at a line."""
    series, f = solid.series(allowed), load_lines(pressure, STRONG).frequencies
    w = 2 * np.pi * f[f >= series.band[0]]
    law = solid.complex_modulus(w)
    return max(series.error, float((np.abs(series(w) - law) / np.abs(law)).max(initial=0.0)))


def _steady_change(scene: Scene, allowed: float, otherwise: float) -> float:
    """Return the relative change of an infinite body's steady motion due to the series."""
    if scene.tacton.trajectory.shape == "recorded":
        return otherwise
    own, series = (
        steady_lines(compliance(body), scene.pressure, scene.probe_points, threshold=STRONG / 10)[1]
        for body in (scene.body, relaxing(scene.body, allowed))
    )
    return float(relative_changes(own - series, own).max())
