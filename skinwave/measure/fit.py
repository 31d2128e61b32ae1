"""Fit of a scene to a measurement: estimates with intervals, and the scene that has them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import expm1, sqrt
from typing import Any

import numpy as np
from scipy.special import ndtri

from simple_model.choices import choose
from skinwave.bodies.parts import solid_of
from skinwave.measure.intervals import LEVEL, Estimate, Intervals, intervals
from skinwave.measure.measurement import Measurement
from skinwave.measure.observed import KINDS, data_of
from skinwave.measure.parameters import Parameter, check, of_scene, parse
from skinwave.measure.predicted import Target, target, with_reduction
from skinwave.measure.search import Problem, Solution, solve
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import takes
from skinwave.scene.distributions import Distribution
from skinwave.scene.file import to_table, with_distributions
from skinwave.scene.keys import DERIVED, LOSSES, SCALES, value_at, write_material
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import with_values
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats

STARTS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Fit of a scene to a measurement: the target has the scene whose parameters were varied, and
    the model.
    """

    measured: Measurement
    target: Target
    solution: Solution
    intervals: Intervals

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates with their intervals, one a parameter."""
        return self.intervals.estimates

    @property
    def values(self) -> dict[str, float]:
        """Values by key at the solution, those that are tied too."""
        return self.solution.problem.parameters.values(self.solution.u)

    @property
    def scene(self) -> Scene:
        """The scene with the estimates. A number has the standard error of its interval, normal or,
        if it was varied by its logarithm, lognormal; one without an interval, or at a limit, is
        uniform between its limits. Numbers of a preset that were not fitted keep what is known of
        the preset.
        """
        scene, parameters = self.target.scene, self.solution.problem.parameters
        changed = with_values(scene, of_scene(self.values))
        given = dict(changed.spreads) | _of_presets(scene, changed)
        given = {key: x for key, x in given.items() if key not in parameters.ties}
        each = zip(parameters.free, self.estimates, self.intervals.half.tolist(), strict=True)
        spreads = {limits.key: _distribution(limits, one, half) for limits, one, half in each}
        for key in of_scene(dict.fromkeys(spreads, 0.0)):
            if _has_place(changed, key):
                given[key] = spreads[key]
        return with_distributions(changed, given)

    @property
    def predicted(self) -> Floats:
        """Prediction (n, s) at the solution."""
        return self.solution.problem.predicted(self.solution.u)

    @property
    def misfit(self) -> float:
        """Relative L2 norm of what the fit leaves of the data."""
        values = self.solution.problem.data.values
        return float(np.linalg.norm(self.predicted - values) / np.linalg.norm(values))


def fit(
    scene: Scene,
    measured: Measurement,
    vary: Sequence[str],
    *,
    tie: Sequence[str] = (),
    kind: str = "",
    model: str = "auto",
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Weighted least-squares fit of keys of a scene to a measurement.

    Parameters
    ----------
    scene : Scene, whose Tacton is the one that was measured
    measured : Measurement of displacement, velocity or acceleration
    vary : "KEY=low:high" each, keys of the scene's file, or "gain", "delay_ms", "offset_x_mm",
        "offset_y_mm", by which the measurement may differ from it
    tie : "KEY=expression" each, of keys that are varied
    kind : "waveforms", "lines" or "amplitudes", what of the measurement; if not given, waveforms
        or, of spectra, lines
    model : name of a model, or "auto": the wavenumber integral where the body has one, else "fem"
    starts : how many, between the limits
    seed : of the starts
    progress : called with the name of the phase and the fraction done

    Raises
    ------
    ValueError
        If a key, a limit or the model does not fit the scene, or the measurement has no such data.
    """
    parameters = parse(vary, tie)
    kind = choose("kind", kind or ("lines" if measured.is_spectrum else "waveforms"), KINDS)
    if model == "auto":
        model = FLAT_BODY.name if takes(FLAT_BODY, scene) else "fem"
    aim = target(scene, model, measured.record, measured.places)
    check(scene, parameters)
    aim = with_reduction(aim, parameters, progress)
    problem = Problem(
        parameters=parameters, data=data_of(kind, measured, aim), linear=aim.linear
    )  # fmt: skip
    solution = solve(problem, starts, seed, progress)
    return Fit(measured=measured, target=aim, solution=solution, intervals=intervals(solution))


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
    key = f"{path}.shear_modulus_pa" if "young_modulus" in name else key
    return not name.isdecimal() and value_at(to_table(scene), key) is not None


def _of_presets(scene: Scene, changed: Scene) -> dict[str, Distribution]:
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
    plain = solid_of(value_at(table, place))
    with_loss = set(_changed(write_material(plain), write_material(plain.scaled(loss=2.0)), place))
    stiff = _changed(write_material(plain), write_material(plain.scaled(modulus=2.0)), place)
    yield from with_loss if scale == LOSSES else (key for key in stiff if key not in with_loss)


def _changed(one: Any, other: Any, path: str) -> Iterator[str]:
    """Dotted keys of the numbers in which two tables differ."""
    if isinstance(one, dict | list):
        for key, inner in one.items() if isinstance(one, dict) else enumerate(one):
            yield from _changed(inner, other[key], f"{path}.{key}")
    elif one != other:
        yield path
