"""The scene with the estimates of a fit, each with the spread that the fit leaves it."""

from collections.abc import Iterator, Mapping
from math import expm1, sqrt
from typing import Any

import numpy as np
from scipy.special import ndtri

from meshes.tetmesh import Floats
from skinwave.bodies.parts import solid_of
from skinwave.measure.identify import LEVEL, Estimate, half_widths
from skinwave.measure.parameters import Parameter, of_scene
from skinwave.measure.solve import Solution
from skinwave.scene.distributions import Distribution, parent_of
from skinwave.scene.file import to_table, with_distributions
from skinwave.scene.keys import DERIVED, LOSSES, MODULI, SCALES, write_material
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import varied
from skinwave.system.numbers import significant

Estimates = tuple[Estimate, ...]
CORRELATED = 0.1  # from which it is said that a correlation is dropped


def fitted(scene: Scene, solution: Solution, estimates: Estimates) -> Scene:
    """The scene with the estimates. A number has the standard error of its interval, normal or, if
    it was varied by its logarithm, lognormal; one without an interval, or at a limit, is uniform
    between its limits. Numbers of a preset that were not fitted keep what is known of the preset.
    """
    changed = varied(scene, of_scene(solution.problem.parameters.values(solution.u)))
    given = dict(changed.spreads) | of_presets(scene, changed)
    given = {key: x for key, x in given.items() if key not in solution.problem.parameters.ties}
    given |= {key: x for key, x in spreads(solution, estimates).items() if _has_place(changed, key)}
    return with_distributions(changed, given)


def spreads(solution: Solution, estimates: Estimates) -> dict[str, Distribution]:
    """Distributions of the estimates that are keys of a scene."""
    free = solution.problem.parameters.free
    each = zip(free, estimates, half_widths(solution), strict=True)
    found = {limits.key: _distribution(limits, one, float(half)) for limits, one, half in each}
    return {key: found[key] for key in of_scene(dict.fromkeys(found, 0.0))}


def _distribution(limits: Parameter, found: Estimate, half: float) -> Distribution:
    """Distribution of an estimate by half of its interval, in parts of the range."""
    if not found.is_resolved or found.at_limit:
        return Distribution(shape="uniform", measure="bounds", width=(limits.low, limits.high))
    deviation = half * limits.span / float(ndtri((1 + LEVEL) / 2))
    shape = "lognormal" if limits.is_log else "normal"
    error = found.value * sqrt(expm1(deviation**2)) if limits.is_log else deviation
    return Distribution(shape=shape, measure="standard_error", width=(error,))


def _has_place(scene: Scene, key: str) -> bool:
    """Whether a scene file can hold a spread at a key: not of one that is not written, nor of a
    coordinate.
    """
    if key.partition(".")[2] in DERIVED:
        return False
    path, _, name = key.rpartition(".")
    at = parent_of(to_table(scene), f"{path}.shear_modulus_pa" if "young_modulus" in name else key)
    return isinstance(at[0], dict)


def of_presets(scene: Scene, changed: Scene) -> dict[str, Distribution]:
    """Distributions of the numbers of presets that became tables: of all moduli, and all losses."""
    left = {spread.key for spread in spreads_of(changed)}
    found: dict[str, Distribution] = {}
    for spread in spreads_of(scene):
        place, _, scale = spread.key.rpartition(".")
        if spread.key not in left and scale in SCALES:
            keys = _scaled_keys(to_table(scene), place, scale)
            found |= {key: spread.distribution for key in keys if _has_place(changed, key)}
    return found


def _scaled_keys(table: Mapping[str, Any], place: str, scale: str) -> Iterator[str]:
    """Dotted keys of the numbers of a preset that are moduli, or that are losses."""
    parent, last = parent_of(table, place)
    plain = solid_of(parent[last])
    with_loss = set(_changed(write_material(plain), write_material(plain.scaled(loss=2.0)), place))
    if scale == LOSSES:
        yield from with_loss
        return
    assert scale == MODULI
    every = _changed(write_material(plain), write_material(plain.scaled(modulus=2.0)), place)
    yield from (key for key in every if key not in with_loss)


def _changed(one: Any, other: Any, path: str) -> Iterator[str]:
    """Dotted keys of the numbers in which two tables differ."""
    if isinstance(one, dict | list):
        for key, inner in one.items() if isinstance(one, dict) else enumerate(one):
            yield from _changed(inner, other[key], f"{path}.{key}")
    elif one != other:
        yield path


def notes(solution: Solution, estimates: Estimates, correlations: Floats) -> list[str]:
    """Sentences, without a full stop, on what a scene with the estimates does not hold."""
    parameters = solution.problem.parameters
    values = parameters.values(solution.u)
    said = [
        f"{key} = {value:.6g} of the measurement, which is no part of the scene"
        for key, value in values.items() if "." not in key
    ]  # fmt: skip
    said += [
        f"{each.key} is not resolved by the measurement: its spread is that between its limits"
        for each in estimates if not each.is_resolved and "." in each.key
    ]  # fmt: skip
    said += [
        f"{each.key} is at a limit of its range, and its spread is that range"
        for each in estimates if each.is_resolved and each.at_limit
    ]  # fmt: skip
    said += [
        f"{key} was tied to others, and has no spread" for key in parameters.ties if "." in key
    ]
    return said + _dropped(parameters.keys, correlations)


def _dropped(keys: tuple[str, ...], correlations: Floats) -> list[str]:
    """Sentence on the correlations of numbers of a scene, which a scene file cannot hold."""
    is_part = np.array(["." in key for key in keys])
    table = np.where(np.outer(is_part, is_part), np.nan_to_num(correlations), 0.0)
    np.fill_diagonal(table, 0.0)
    first, second = divmod(int(np.argmax(np.abs(table))), len(keys))
    largest = float(table[first, second])
    if abs(largest) < CORRELATED:
        return []
    return [
        f"spreads are independent of each other: correlations of the estimates are dropped, as "
        f"{significant(largest, 2)} between {keys[first]} and {keys[second]}"
    ]
