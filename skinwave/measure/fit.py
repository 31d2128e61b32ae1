"""Fit of a scene to a measurement: estimates with intervals, and the scene that has them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import expm1, sqrt
from typing import Any

from scipy.special import ndtri

from simple_model.choices import choose
from skinwave.bodies.parts import solid_of
from skinwave.measure.intervals import CONFIDENCE, Estimate, Intervals, intervals
from skinwave.measure.measurement import Measurement
from skinwave.measure.observed import KINDS, data_of
from skinwave.measure.parameters import Parameter, check_limits, of_scene, parse
from skinwave.measure.predicted import Target, target_of, with_reduction
from skinwave.measure.search import Problem, Solution, minimise
from skinwave.planning.plan import model_from_rest
from skinwave.scene.distributions import Distribution
from skinwave.scene.dotted_keys import value_at
from skinwave.scene.file import to_table, with_distributions
from skinwave.scene.keys import DERIVED, SCALES, write_material
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import with_values
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Fit of a scene to a measurement; the target has the original scene and the model."""

    measured: Measurement
    target: Target
    solution: Solution
    intervals: Intervals

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates with their intervals, one per parameter."""
        return self.intervals.estimates

    @property
    def values(self) -> dict[str, float]:
        """Values by key at the solution, with ties."""
        return self.solution.problem.parameters.values(self.solution.u)

    @property
    def scene(self) -> Scene:
        """The scene with the estimates and their spreads.

        The spread of a number is the standard error of its interval, normal or, for a logarithm,
        lognormal. Without an interval, or at a limit, it is uniform between the limits. Other
        numbers of a preset keep the spread of the preset.
        """
        scene, parameters = self.target.scene, self.solution.problem.parameters
        changed = with_values(scene, of_scene(self.values))
        spreads = dict(changed.spreads) | _of_presets(scene, changed)
        spreads = {key: spread for key, spread in spreads.items() if key not in parameters.ties}
        each = zip(parameters.free, self.estimates, self.intervals.half.tolist(), strict=True)
        for limits, estimate, half in each:
            if of_scene({limits.key: 0.0}) and _may_have_spread(changed, limits.key):
                spreads[limits.key] = _distribution(limits, estimate, half)
        return with_distributions(changed, spreads)

    @property
    def prediction(self) -> Floats:
        """Prediction (n, s) at the solution."""
        return self.solution.problem.predict(self.solution.u)


def fit(
    scene: Scene,
    measured: Measurement,
    vary: Sequence[str],
    *,
    tie: Sequence[str] = (),
    kind: str = "",
    model: str = "auto",
    starts: int = 8,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Return the weighted least-squares fit of keys of a scene to a measurement.

    Parameters
    ----------
    scene : Scene with the Tacton that was measured
    measured : Measurement of displacement, velocity or acceleration
    vary : texts "KEY=low:high" of keys of the scene file, or of "gain", "delay_ms", "offset_x_mm"
        and "offset_y_mm" of the measurement
    tie : texts "KEY=expression" of keys that vary
    kind : "waveforms", "lines" or "amplitudes"; by default waveforms or, for spectra, lines
    model : name of a model, or "auto": that of the plan, from rest
    starts : number of starts between the limits
    seed : of the starts
    progress : called with the name of the phase and the fraction done

    Raises
    ------
    ValueError
        If a key, a limit or the model does not suit the scene, or the measurement has no such data.
    """
    parameters = parse(vary, tie)
    kind = choose("kind", kind or ("lines" if measured.is_spectrum else "waveforms"), KINDS)
    if model == "auto":
        model = model_from_rest(scene)[0].name
    target = target_of(scene, model, measured.record, measured.places)
    check_limits(scene, parameters)
    target = with_reduction(target, parameters, progress)
    data = data_of(kind, measured, target)
    problem = Problem(parameters=parameters, data=data, linear=target.linear)
    solution = minimise(problem, starts, seed, progress)
    return Fit(measured=measured, target=target, solution=solution, intervals=intervals(solution))


def _distribution(limits: Parameter, estimate: Estimate, half: float) -> Distribution:
    """Return the distribution of an estimate; `half` is half its interval, of the unit interval."""
    if not estimate.is_resolved or estimate.at_limit:
        return Distribution(shape="uniform", measure="bounds", width=(limits.low, limits.high))
    deviation = half * limits.span / float(ndtri((1 + CONFIDENCE) / 2))
    shape = "lognormal" if limits.is_log else "normal"
    error = estimate.value * sqrt(expm1(deviation**2)) if limits.is_log else deviation
    return Distribution(shape=shape, measure="standard_error", width=(error,))


def _may_have_spread(scene: Scene, key: str) -> bool:
    """Whether a scene file can store a spread of a key: derived keys and coordinates have none."""
    if key.partition(".")[2] in DERIVED:
        return False
    path, _, name = key.rpartition(".")
    key = f"{path}.shear_modulus_pa" if "young_modulus" in name else key
    return not name.isdecimal() and value_at(to_table(scene), key) is not None


def _of_presets(scene: Scene, changed: Scene) -> dict[str, Distribution]:
    """Return the distributions of all moduli, or all losses, of presets that became tables."""
    left = {spread.key for spread in spreads_of(changed)}
    spreads: dict[str, Distribution] = {}
    for spread in spreads_of(scene):
        place, _, scale = spread.key.rpartition(".")
        if spread.key not in left and scale in SCALES:
            keys = _scaled_keys(to_table(scene), place, scale)
            spreads |= {k: spread.distribution for k in keys if _may_have_spread(changed, k)}
    return spreads


def _scaled_keys(table: Mapping[str, Any], place: str, scale: str) -> Iterator[str]:
    """Yield the dotted keys of the moduli, or of the losses, of a preset."""
    solid = solid_of(value_at(table, place))
    plain = write_material(solid)
    losses = set(_changed_keys(plain, write_material(solid.scaled(loss=2.0)), place))
    moduli = _changed_keys(plain, write_material(solid.scaled(modulus=2.0)), place)
    yield from losses if SCALES[scale] == "loss" else (key for key in moduli if key not in losses)


def _changed_keys(one: Any, other: Any, path: str) -> Iterator[str]:
    """Yield the dotted keys of the numbers in which two tables differ."""
    if isinstance(one, dict | list):
        for key, inner in one.items() if isinstance(one, dict) else enumerate(one):
            yield from _changed_keys(inner, other[key], f"{path}.{key}")
    elif one != other:
        yield path
