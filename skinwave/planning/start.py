"""The start from rest of a response: what models leave out of it, all of it or what is too fast."""

from collections.abc import Callable
from math import ceil

import numpy as np

from meshes.tetmesh import Floats
from simple_model.layers.flat_body import FINEST
from skinwave.models import Model, named
from skinwave.models.options import SolveOptions
from skinwave.models.prepared import Prepared, answer, steady_waveforms
from skinwave.planning.refinement import relative_change
from skinwave.scene.scene import Scene

FOLLOWED, LONGER = 1000, 4  # samples that a start is followed for at first; factor on them
GOES_ON = 0.02  # of its energy, in what may come after the time that it was followed for
NO_MOTION = 1e-6  # of the largest probe's: the motion of a weaker probe is round-off
EXACT = 1e-3  # relative error of the models that are compared


def start_left_out(
    scene: Scene, model: Model, grid: tuple[Floats, int], prepared: Prepared | None = None
) -> float:
    """Difference of a steady state from the motion from rest, relative to the latter: the largest
    of all probes.

    Parameters
    ----------
    scene : Scene
    model : Model, of the steady state
    grid : times (t,) in s and the first that counts, as of `sample_grid`
    prepared : Prepared, the reduced body of a model of elements

    Returns
    -------
    float; 0 of a model from rest

    Raises
    ------
    ValueError, ArithmeticError
        If the scene has no steady state.
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
    """Part of a wavenumber integral from rest that is above its band, relative and of the worst
    probe.

    Velocity and acceleration jump where a load begins at once. As the band doubles, the error of a
    velocity halves, and is twice the change. The first sample of an acceleration may have no limit:
    three times the change is its error beside sixteen times the band.

    Parameters
    ----------
    scene, model, grid : as for `start_left_out`

    Returns
    -------
    float; 0 of a quantity that does not jump, and of a steady state
    """
    if model.is_steady or not scene.reading.asked.rate:
        return 0.0
    times, first = grid
    parts = max(2, ceil(2 * FINEST * times[1]))  # of a step, with twice the band
    fine = np.asarray(times[1] / parts * np.arange(parts * (len(times) - 1) + 1), np.float64)
    usual, wide = (
        model.solve(scene, t, SolveOptions(tolerance=EXACT)).values for t in (times, fine)
    )
    change = relative_change(usual[first:], wide[::parts][first:])
    return (1 + scene.reading.asked.rate) * change


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
    size = np.maximum(size, NO_MOTION**2 * size.max())
    return float(np.sqrt((energy + later) / np.where(size > 0, size, np.inf)).max())
