"""What a model leaves out of a response: its start from rest, motion above its band, stretching of
a sheet, the law of a material behind a Prony series, and errors of natural frequencies.

Each function gives a relative error of the worst probe's waveform.

A sheet that deflects by w stiffens in proportion to (w / h)^2 of its thickness h. The linear motion
of office paper in a frame without tension is 1 to 3 % off at a tenth of a thickness and 25 to 60 %
at a half.

Discretisation in space and time gives every natural frequency a small error. Near a resonance that
changes the waveform many times as much as elsewhere: the poles of a coarse reduced model, shifted
by a thousandth, give the sensitivity.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from skinwave.models import Model, named
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
from skinwave.planning.estimates import mean_gain, spot_scale
from skinwave.planning.refinement import relative_change
from skinwave.scene.scene import SAMPLE_RATE as RATE
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

FOLLOWED, LONGER = 1000, 4  # samples that a start is followed for at first; factor on them
GOES_ON = 0.02  # of its energy, in what may come after the time that it was followed for
NO_START = 1e-6  # of the largest probe's: the motion of a weaker probe is round-off
EXACT = 1e-3  # relative error of the models that are compared
LINEAR = 0.5  # deflection over thickness up to which bending of a sheet may be taken as linear
# Relative error of linear bending over (w / h)^2: 0.4 to 3.3 of paper sheets of 30 to 210 mm, on
# four edges, two or in clips, with tension and without; 7 with a tenth of their loss.
STEEPEST = 7.0
NEGLIGIBLE = 0.1  # of the tolerance, of an error that is bounded rather than measured
COARSENING = 2.0  # of the default element size
DETUNING = 0.010  # natural frequencies of the coarse mesh are too high by this: corrected first
MOVED = 1e-3
FOLLOWED_FOR = 1.0  # s of the responses that are compared


def start_left_out(
    scene: Scene, model: Model, grid: tuple[Floats, int], prepared: ReducedBody | None = None
) -> float:
    """Difference of a steady state from the motion from rest, relative to the latter; 0 of a model
    from rest. `grid` is as of `sample_grid`; of a model of elements its reduced body is given.
    Raises a ValueError or ArithmeticError if the scene has no steady state.
    """
    if not model.is_steady:
        return 0.0
    times, first = grid
    if prepared:
        whole = answer(prepared, scene, times=times).values
        return _share(steady_waveforms(prepared, scene, times), lambda n: whole[:n], first)

    def solved(which: Model, n: int) -> Floats:
        return which.solve(scene, times[:n], SolveOptions(tolerance=EXACT)).values

    whole_by = named(model.from_rest)
    return _share(solved(model, len(times)), lambda n: solved(whole_by, n), first)


def sudden_left_out(scene: Scene, model: Model, grid: tuple[Floats, int]) -> float:
    """Part of a wavenumber integral from rest that is above its band; 0 of a quantity that does not
    jump, and of a steady state.

    Velocity and acceleration jump where a load begins at once. As the band doubles, the error of a
    velocity halves, and is twice the change. The first sample of an acceleration may have no limit:
    three times the change is its error beside sixteen times the band.
    """
    if model.is_steady or not scene.reading.record.rate:
        return 0.0
    times, first = grid
    parts = max(2, ceil(2 * TRANSFORM_RATE * times[1]))  # of a step, with twice the band
    fine = np.asarray(times[1] / parts * np.arange(parts * (len(times) - 1) + 1), np.float64)
    usual, wide = (
        model.solve(scene, t, SolveOptions(tolerance=EXACT)).values for t in (times, fine)
    )
    change = relative_change(usual[first:], wide[::parts][first:])
    return (1 + scene.reading.record.rate) * change


def _share(steady: Floats, from_rest: Callable[[int], Floats], first: int) -> float:
    """That difference from sample `first` on, of a steady state (t, p) and a function that gives
    the first n samples from rest. The start is followed until what may come later is negligible,
    if it went on as it is then.
    """
    samples = len(steady)
    n = min(samples, FOLLOWED)
    while True:
        whole = from_rest(n)
        left = (whole - steady[:n]) ** 2
        later = left[3 * n // 4 :].mean(axis=0) * (samples - n)
        energy = left[first:].sum(axis=0)
        if n == samples or (later <= GOES_ON * energy).all():
            break
        n = min(samples, LONGER * n)
    size = (whole[first:] ** 2).sum(axis=0) + (steady[max(n, first) :] ** 2).sum(axis=0)
    size = np.maximum(size, NO_START**2 * size.max())
    return float(np.sqrt((energy + later) / np.where(size > 0, size, np.inf)).max())


def deflection(scene: Scene) -> float:
    """Largest linear deflection of a held sheet over its thickness: at its probes and in its middle
    from rest, or in its middle under its mean load. It is 0 of other bodies, and of curled sheets,
    whose rise stiffens them.
    """
    body = scene.body
    flat = body.of_kind.is_plate and not body.mounting.is_curled
    if not (flat and body.sides == "clamped"):
        return 0.0
    return max(_from_rest(_plain(scene)), mean_sag(scene) / body.depth)


@lru_cache(maxsize=64)
def _from_rest(scene: Scene) -> float:
    """Largest deflection over thickness in the first part of a response; 0 if modes have none."""
    middle = tuple(float(x) for x in scene.body.placement.offset)
    seen = replace(scene, probes=tuple(dict.fromkeys((*scene.probes, (middle[0], middle[1])))))
    if not takes(FROM_REST, seen):
        return 0.0
    u = FROM_REST.solve(seen, _first_part(seen), SolveOptions()).values
    return float(np.abs(u).max()) / scene.body.depth


@lru_cache(maxsize=64)
def _measured(scene: Scene) -> float:
    """Relative error of linear bending in the first part of a displacement."""
    times = _first_part(scene)
    return linear_error(scene, times, FROM_REST.solve(scene, times, SolveOptions()).values)


def _plain(scene: Scene) -> Scene:
    """The scene with probes that read displacement, as deflection is that."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0, name="", spreads=())


def _first_part(scene: Scene) -> Floats:
    times: Floats = first_part(scene.pressure, sample_times(scene))
    return times


def stretching_left_out(scene: Scene, model: Model, tolerance: float) -> float:
    """Relative error of a linear model of a sheet that stretches; 0 of other models and bodies.

    Bounded by the square of the deflection where that is small, else measured in the displacement
    by `plate-modes-nonlinear` where it takes the scene.
    """
    if model.is_nonlinear or not model.needs_body:
        return 0.0
    bound = STEEPEST * deflection(scene) ** 2
    plain = _plain(scene)
    if bound > NEGLIGIBLE * tolerance and takes(STRETCHED, plain):
        return _measured(plain)
    return min(1.0, bound)


def beyond_linear(scene: Scene, tolerance: float) -> bool:
    """Whether a sheet stretches or deflects too much for linear models."""
    if not takes(STRETCHED, scene):
        return False
    share = stretching_left_out(scene, FROM_REST, tolerance)
    return share > tolerance / 2 or deflection(scene) > LINEAR


def bent(scene: Scene, response: Response) -> float:
    """Largest deflection of a sheet over its thickness: at its probes in a response, or as of
    `deflection`. The rigid-body motion of an unconstrained sheet is none.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return 0.0
    u = response.displacement if response.record is DISPLACEMENT else np.zeros((1, 1))
    from_rest = u if body.is_held else u - u.mean(axis=1, keepdims=True)
    return max(float(np.abs(from_rest).max()) / body.depth, deflection(scene))


def mean_sag(scene: Scene) -> float:
    """Linear deflection in metre of a held sheet's middle under its mean load, if applied there.

    0.0056 F a^2 / D of a clamped square (Timoshenko and Woinowsky-Krieger 1959, table 37); of other
    supports, and of orthotropic or stretched sheets, by the modes of the plate.
    """
    body = scene.body
    force = _mean_force(scene)
    if body.mounting == FRAME and body.solid.orthotropy is None:
        at_rest = relative_modulus(body, 0.0).real * body.bending_stiffness
        sag = 0.0056 * min(body.width, body.height) ** 2 / at_rest
    else:
        sag = middle_compliance(body)
    return float(force * sag)


def _mean_force(scene: Scene) -> float:
    """Mean force in N that presses on the middle of a flat body."""
    if scene.load.moving.is_plain:
        return float(2 * np.pi * spot_width(scene.pressure.height) ** 2 * mean_gain(scene))
    downwards = -scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0, 2]
    forces = [2 * np.pi * spot_scale(each) ** 2 * mean_gain(replace(scene, pressure=each))
              for each in scene.loads]  # fmt: skip
    return float(downwards @ forces)


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Sensitivity of a response. `value`: relative change of the worst probe's waveform per
    relative change of all natural frequencies; `frequency` in Hz: that of the motion, root mean
    square.
    """

    value: float
    frequency: float


def sensitivity(scene: Scene, prepared: ReducedBody | None = None) -> Sensitivity:
    """Sensitivity from two responses of a reduced body, or of a coarse mesh."""
    h = min(COARSENING * default_size(scene.body), coarsest_size(scene.body))
    coarse = prepared or prepare(scene.body, scene.probe_points, h=h, load=scene.load.moving)
    values = coarse.poles.values * (1 - DETUNING)
    frequencies, forces = reduced_forces(coarse, *scene.loads)
    times = np.arange(max(2, round(min(scene.tacton.duration, FOLLOWED_FOR) * RATE))) / RATE

    def waveforms(moved: float) -> Floats:
        """Waveforms (t, p) where all natural frequencies are higher by so much."""
        higher = np.asarray(values * (1 + moved), np.complex128)
        poles = replace(coarse.poles, values=higher)
        lines, start = (x @ coarse.read.T for x in line_response(poles, forces, frequencies))
        rates = np.concatenate([2j * np.pi * frequencies, higher])
        return exponential_sum(rates, np.vstack([lines, start]), times)

    whole = waveforms(0.0)
    moving = whole - whole.mean(axis=0)
    speed = float(np.linalg.norm(np.diff(moving, axis=0))) * RATE
    return Sensitivity(
        value=relative_change(waveforms(MOVED), whole) / MOVED,
        frequency=speed / max(float(np.linalg.norm(moving)), 1e-300) / (2 * np.pi),
    )


def series_error(
    scene: Scene, model: str, tolerance: float, prepared: ReducedBody | None = None
) -> float:
    """Relative error of the probes' motion by Prony series in place of modulus laws; 0 if the model
    takes the laws themselves. A body that is `prepared` on any mesh saves a coarse one.
    """
    solids, known, allowed = own_laws(scene.body), named(model), series_tolerance(tolerance)
    if not solids or not known.takes_series(scene.body):
        return 0.0
    worst = max(_deviation(solid, scene.pressure, allowed) for solid in solids)
    if known.is_infinite:
        return _moved(scene, allowed, worst)
    # A modulus that is off by d shifts natural frequencies by d / 2; at rest motion goes by d.
    return worst * max(1.0, sensitivity(scene, prepared).value / 2)


def _deviation(solid: Material, pressure: MovingPressure, allowed: float) -> float:
    """Largest relative deviation of a series from its law in its band and at the load's lines."""
    series, f = solid.series(allowed), load_lines(pressure, STRONG).frequencies
    w = 2 * np.pi * f[f >= series.band[0]]
    law = solid.complex_modulus(w)
    return max(series.error, float((np.abs(series(w) - law) / np.abs(law)).max(initial=0.0)))


def _moved(scene: Scene, allowed: float, otherwise: float) -> float:
    """Relative change of the probes' steady motion by the series, in an infinite body."""
    if scene.tacton.trajectory.shape == "recorded":
        return otherwise
    own, series = (
        steady_lines(compliance(body), scene.pressure, scene.probe_points, threshold=STRONG / 10)[1]
        for body in (scene.body, relaxing(scene.body, allowed))
    )
    return relative_change(series, own)
