"""One reduced-order model for the bodies of all samples, where they differ in materials and
thicknesses alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import fem
from meshes.tetmesh import Floats
from skinwave.bodies.sizes import default_size
from skinwave.models.affine_scenes import check_scene
from skinwave.models.free_keys import free_keys
from skinwave.models.linear_elements import FEM
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, Spread
from skinwave.sweeps.families import Family, reduced_anew
from skinwave.sweeps.solutions import Method
from skinwave.system.effort import Progress

# Quantiles of each number between which bodies are reduced together: a palm takes 785 vectors for
# those of a hundred samples, and more than one model has for the farthest of 256.
ENDS = (0.01, 0.99)
# Samples for each number that is free: a palm known to a factor of 2 in its moduli and 3 in its
# losses takes the time of some 45 samples of their own.
LEAST = 24


def shared_body(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    progress: Progress | None = None,
) -> Family | None:
    """Family of the bodies of nearly all samples, reduced and cached on disk.

    Parameters
    ----------
    scene, spreads, values, method : as for `family_of`
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Family; None if a sample needs a body of its own
    """
    family = family_of(scene, spreads, values, method)
    if family:
        size = method.h or default_size(scene.body)
        try:
            reduced_anew(family, size, method.tolerance, method.solver, progress)
        except (ValueError, fem.Diverged):  # wider than one reduced-order model reaches, say
            return None
    return family


def family_of(
    scene: Scene, spreads: Sequence[Spread], values: Floats, method: Method
) -> Family | None:
    """Family of the bodies of nearly all samples, if one reduced-order model may serve them.

    Parameters
    ----------
    scene : Scene, with the central values
    spreads : (d,) Spread
    values : (n, d) float, of all samples
    method : Method

    Returns
    -------
    Family; None if there is none, or so few samples that bodies of their own cost less
    """
    free = {
        spread.key: _range(spread, column)
        for spread, column in zip(spreads, values.T, strict=True)
        if spread.key != PRESSURE
    }
    few = len(values) < LEAST * max(len(free), 1)
    of_elements = method.model == FEM.name and method.same_load and not method.mapped
    if few or not (
        free and of_elements and scene.reading.is_plain and scene.pressure.peak_pressure
    ):
        return None
    plain = replace(scene, spreads=())
    try:
        check_scene(plain, free_keys(plain.body, free), method.tolerance)
    except ValueError:
        return None
    ranges = tuple((key, *ends) for key, ends in free.items())
    return Family(scene=plain, hardest=plain.body, ranges=ranges, members=len(values))


def has(family: Family, values: Mapping[str, float]) -> bool:
    """Whether a sample's body, of values by key, is one of a family."""
    return all(low <= values[key] <= high for key, low, high in family.ranges)


def _range(spread: Spread, values: Floats) -> tuple[float, float]:
    """Range of values (n,) of a number without its ends, which few of them are in."""
    low, high = spread.distribution.quantile(spread.value, np.array(ENDS)).tolist()
    return max(low, float(values.min())), min(high, float(values.max()))
