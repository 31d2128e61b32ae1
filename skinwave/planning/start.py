"""The start from rest of a response: what models leave out of it, all of it or what is too fast."""

from collections.abc import Callable
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from meshes.tetmesh import Floats
from simple_model.layers.flat_body import FINEST
from skinwave.models import Model, Request, named
from skinwave.models.prepared import Prepared, answer, steady_waveforms
from skinwave.models.sample_grid import sample_grid
from skinwave.planning.refinement import relative_change
from skinwave.scene.scene import Scene
from skinwave.system.effort import silent

FOLLOWED, LONGER = 1000, 4  # samples that a start is followed for at first; factor on them
GOES_ON = 0.02  # of its energy, in what may come after the time that it was followed for
NO_MOTION = 1e-6  # of the largest probe's: the motion of a weaker probe is round-off
EXACT = 1e-3  # relative error of the models that are compared


def start_left_out(
    scene: Scene, model: Model, prepared: Prepared | None = None, times: ArrayLike | None = None
) -> float:
    """Difference of a steady state from the motion from rest, relative to the latter: the largest
    of all probes.

    Parameters
    ----------
    scene : Scene
    model : Model, of the steady state
    prepared : Prepared, the reduced body of a model of elements
    times : (t,) float, s, of the response, as for `simulate`

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
    grid, first = sample_grid(scene, times)

    def solved(which: Model, grid: Floats) -> Floats:
        return which.solve(scene, Request(times=grid, tolerance=EXACT, report=silent)).values

    if prepared:
        whole = answer(prepared, scene, times=grid).values
        return _share(steady_waveforms(prepared, scene, grid), lambda n: whole[:n], first)
    whole_by = named(model.from_rest)
    return _share(solved(model, grid), lambda n: solved(whole_by, grid[:n]), first)


def sudden_left_out(scene: Scene, model: Model, times: ArrayLike | None = None) -> float:
    """Part of a wavenumber integral from rest that is above its band, relative and of the worst
    probe.

    Velocity and acceleration jump where a load begins at once. As the band doubles, the error of a
    velocity halves, and is twice the change. The first sample of an acceleration may have no limit:
    three times the change is its error beside sixteen times the band.

    Parameters
    ----------
    scene, model, times : as for `start_left_out`

    Returns
    -------
    float; 0 of a quantity that does not jump, and of a steady state
    """
    if model.is_steady or not scene.reading.asked.rate:
        return 0.0
    grid, first = sample_grid(scene, times)
    parts = max(2, ceil(2 * FINEST * grid[1]))  # of a step, with twice the band
    fine = np.asarray(grid[1] / parts * np.arange(parts * (len(grid) - 1) + 1), np.float64)
    usual, wide = (
        model.solve(scene, Request(times=t, tolerance=EXACT, report=silent)).values
        for t in (grid, fine)
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
