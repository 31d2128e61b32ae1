"""Errors by what a model leaves out: the start from rest, motion above its band, a modulus law that
a Prony series replaces, and errors of natural frequencies.

Each function returns a relative error of the worst probe's waveform. Near a resonance, small
discretisation errors of natural frequencies cause much larger errors of the waveform. The
sensitivity is computed by shifting the poles of a coarse reduced model by a thousandth.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import ceil

import numpy as np

from fem.reduced import exponential_sum, line_response
from simple_model import MovingPressure
from simple_model.layers.flat_body import TRANSFORM_RATE, steady_lines
from simple_model.layers.material import Material
from simple_model.load.spectrum import load_lines
from skinwave.bodies.analytic import compliance
from skinwave.bodies.sizes import coarsest_size, default_size
from skinwave.models import Model, named, reduced
from skinwave.models.laws import STRONG, own_laws, relaxing, series_tolerance
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import ReducedBody
from skinwave.models.relative_change import relative_changes
from skinwave.scene.scene import SAMPLE_RATE as RATE
from skinwave.scene.scene import Scene
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Accuracy of the responses that are compared.

    A start is compared in the `first_samples`, then in `longer` times as many, until what may
    follow has at most a `later_share` of its energy.

    A sensitivity is that of a body on a mesh `coarser` than the default one, whose natural
    frequencies are too high by a `detuning`. They are shifted by a relative `shift`.
    """

    options: SolveOptions = field(default_factory=lambda: SolveOptions(tolerance=1e-3))
    first_samples: int = 1000
    longer: int = 4
    later_share: float = 0.02
    coarser: float = 2.0
    detuning: float = 0.010
    shift: float = 1e-3
    duration: float = 1.0  # s of the responses with shifted natural frequencies


COMPARISON = Comparison()


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
        whole = reduced.answer(prepared, scene, times=times).values
        return _start(reduced.steady_waveforms(prepared, scene, times), lambda n: whole[:n], first)
    steady = model.solve(scene, times, COMPARISON.options).values
    transient = named(model.from_rest).solve
    return _start(steady, lambda n: transient(scene, times[:n], COMPARISON.options).values, first)


def _start(
    steady: Floats, transient: Callable[[int], Floats], first: int, own: Comparison = COMPARISON
) -> float:
    """Return that difference from sample `first` on, between a steady state (t, p) and a function
    that returns the first n samples from rest. The number of samples grows until the later ones are
    negligible, assuming that the difference continues at its last level.
    """
    samples = len(steady)
    n = min(samples, own.first_samples)
    while True:
        whole = transient(n)
        squared = (whole - steady[:n]) ** 2
        later = squared[3 * n // 4 :].mean(axis=0) * (samples - n)
        energy = squared[first:].sum(axis=0)
        if n == samples or (later <= own.later_share * energy).all():
            break
        n = min(samples, own.longer * n)
    size = (whole[first:] ** 2).sum(axis=0) + (steady[max(n, first) :] ** 2).sum(axis=0)
    size = np.maximum(size, 1e-12 * size.max())  # motion below 1e-6 is round-off
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
    usual, wide = (model.solve(scene, t, COMPARISON.options).values for t in (times, fine))
    usual, wide = usual[first:], wide[::parts][first:]
    return (1 + scene.reading.record.rate) * float(relative_changes(wide - usual, wide).max())


def sensitivity(
    scene: Scene, prepared: ReducedBody | None = None, own: Comparison = COMPARISON
) -> tuple[float, float]:
    """Return the relative change of the worst probe's waveform per relative change of all natural
    frequencies, and the root-mean-square frequency of the motion in Hz, from two responses of a
    reduced body, by default on a coarse mesh.
    """
    h = min(own.coarser * default_size(scene.body), coarsest_size(scene.body))
    without_sag = replace(scene, load=scene.load.moving)
    coarse = prepared or reduced.reduce_scene(without_sag, SolveOptions(h=h))
    values = coarse.poles.values * (1 - own.detuning)
    frequencies, forces = reduced.reduced_forces(coarse, *scene.loads)
    duration = min(scene.tacton.duration, own.duration)
    times = np.arange(max(2, round(duration * RATE))) / RATE

    def waveforms(shift: float) -> Floats:
        """Return the waveforms (t, p) with shifted natural frequencies."""
        higher = np.asarray(values * (1 + shift), np.complex128)
        poles = replace(coarse.poles, values=higher)
        lines, start = (x @ coarse.read.T for x in line_response(poles, forces, frequencies))
        rates = np.concatenate([2j * np.pi * frequencies, higher])
        return exponential_sum(rates, np.vstack([lines, start]), times)

    whole = waveforms(0.0)
    vibration = whole - whole.mean(axis=0)
    speed = float(np.linalg.norm(np.diff(vibration, axis=0))) * RATE
    change = float(relative_changes(waveforms(own.shift) - whole, whole).max())
    frequency = speed / max(float(np.linalg.norm(vibration)), 1e-300) / (2 * np.pi)
    return change / own.shift, frequency


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
