"""Predictions of a model at the places of a measurement, as functions of its parameters.

Linear waves are proportional to the peak pressure, a factor like the gain. Pressure, gain and delay
need no new run of the model. The last predictions are cached.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi

import numpy as np
from scipy.interpolate import CubicSpline

from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.load.spectrum import merge_lines
from simple_model.quantities import Quantity
from simple_model.response import fit_lines
from skinwave.bodies.analytic import compliance
from skinwave.measure.parameters import DELAY, GAIN, Parameters, Values, of_scene
from skinwave.models import Model, named, parametric
from skinwave.models.covering import covering, try_shared_body
from skinwave.models.flat_body import fields_read
from skinwave.models.limits import check_takes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.parametric import ParametricBody
from skinwave.planning.simulate import compute
from skinwave.scene.scene import SAMPLE_RATE, Scene
from skinwave.scene.spreads import PRESSURE
from skinwave.scene.variation import with_values
from skinwave.system.effort import Progress
from skinwave.typing import Complex, Floats

Predict = Callable[[Values], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Target:
    """A scene with variable keys, a model, and the quantity that it predicts at places (p, 2).

    Frequencies that differ by less than a share `same_line` are of one line.
    """

    scene: Scene
    model: str
    quantity: Quantity
    places: Floats
    reduced: ParametricBody | None = None
    same_line: float = 1e-3

    @property
    def record(self) -> Model:
        """Record of the model."""
        return named(self.model)

    @property
    def linear(self) -> tuple[str, ...]:
        """Keys that a prediction is proportional to."""
        load, (key, strength) = self.scene.load, self.strength
        is_linear = not (load.gravity or load.support_motion or self.record.is_nonlinear)
        return (GAIN, key) if strength > 0 and is_linear else (GAIN,)

    @property
    def strength(self) -> tuple[str, float]:
        """Key and value of the strength of the load: pressure of a device, or force."""
        if self.scene.load.of_kind.is_of_device:
            return PRESSURE, self.scene.pressure.peak_pressure
        return "load.force_n", self.scene.load.force

    def scene_with(self, values: Values) -> Scene:
        """Return the scene with these values, and with probes at the places plus their offset."""
        changed = with_values(self.scene, of_scene(values)) if of_scene(values) else self.scene
        offset = np.array([values.get(f"offset_{axis}_mm", 0.0) for axis in "xy"]) / 1e3
        places = [(float(x), float(y)) for x, y in self.places + offset]
        return replace(changed, probes=tuple(places), depth=0.0, quantity=self.quantity.name)

    def factor(self, values: Values) -> float:
        """Return the factor of the linear keys on predictions."""
        key, strength = self.strength
        relative = values[key] / strength if self._is_scaled(values) else 1.0
        return float(values.get(GAIN, 1.0) * relative)

    def rest(self, values: Values) -> tuple[tuple[str, float], ...]:
        """Return keys and values, sorted, without the delay and the linear keys."""
        left_out = {GAIN, DELAY} | ({self.strength[0]} if self._is_scaled(values) else set())
        return tuple(sorted(item for item in values.items() if item[0] not in left_out))

    def predicts(self, frequencies: Floats) -> np.ndarray:
        """Return a mask (f,) of the lines that are predicted; a reduced body omits weak ones."""
        known = frequencies if self.reduced is None else self.reduced.frequencies
        away = np.abs(known[:, None] - frequencies)
        return np.asarray((away <= self.same_line * frequencies).any(axis=0))

    def _is_scaled(self, values: Values) -> bool:
        return self.strength[0] in values and self.strength[0] in self.linear


def target_of(scene: Scene, model: str, quantity: Quantity, places: Floats) -> Target:
    """Return the target of a model; raise a ValueError if it cannot take scene or quantity."""
    if not quantity.is_normal:
        raise ValueError(f"a fit needs motion normal to the body, not {quantity.words}")
    if not np.isfinite(places).all():
        raise ValueError("some places are unknown; give --places, or choose others with --columns")
    record = named(model)
    if not record.needs_body:
        raise ValueError(f"{model} has no body to fit; choose another model")
    target = Target(scene=scene, model=model, quantity=quantity, places=places)
    check_takes(record, target.scene_with({}))
    return target


def with_reduction(target: Target, parameters: Parameters, progress: Progress) -> Target:
    """Return the target, with a shared reduction of its body if one covers all ranges."""
    ranges = {each.key: (each.low, each.high) for each in parameters.free}
    ranges = {key: ranges[key] for key, _ in target.rest(dict.fromkeys(ranges, 1.0))}
    if not target.record.is_reduced or parameters.ties or not ranges:
        return target
    expected_runs = 200  # of a fit
    together = covering(target.scene_with({}), ranges, expected_runs)
    reduced = try_shared_body(together, SolveOptions(progress=progress))
    return replace(target, reduced=reduced) if reduced else target


def line_predictor(target: Target, frequencies: Floats) -> Predict:
    """Return a function of the values that predicts complex amplitudes (f, p), SI, of Re a exp(2 pi
    i f t) at frequencies (f,) in Hz. It raises a ValueError if the load has no line at one of them.
    """

    @lru_cache(maxsize=32)
    def unscaled(items: tuple[tuple[str, float], ...]) -> Complex:
        values = dict(items)
        if target.reduced:
            f, a = parametric.lines(target.reduced, values)
            return np.asarray(a[np.abs(f[:, None] - frequencies).argmin(axis=0)])
        if target.record.is_infinite:
            return _flat_lines(target, values, frequencies)
        response = compute(target.scene_with(values), target.model)
        return np.asarray(fit_lines(response, frequencies)[0])

    def predict(values: Values) -> Complex:
        late = np.exp(-2j * pi * frequencies * values.get(DELAY, 0.0) / 1e3)
        return target.factor(values) * late[:, None] * unscaled(target.rest(values))

    return predict


def waveform_predictor(target: Target, times: Floats) -> Predict:
    """Return a function of the values that predicts waveforms (t, p) in SI from rest at t = 0."""
    last, duration = float(times[-1]), target.scene.tacton.duration
    if last > duration + 1 / SAMPLE_RATE:
        raise ValueError(
            f"the record ends at {1e3 * last:.4g} ms, after the scene's Tacton of "
            f"{1e3 * duration:.4g} ms; lengthen the Tacton, or cut off the record"
        )

    @lru_cache(maxsize=32)
    def history(items: tuple[tuple[str, float], ...]) -> CubicSpline:
        if target.reduced:
            response = parametric.answer(target.reduced, dict(items))
        else:
            scene = target.scene_with(dict(items))
            count = int(np.ceil(2 * last * SAMPLE_RATE)) + 2
            response = compute(scene, target.model, times=sample_times(scene)[:count])
        return CubicSpline(response.times, response.values)

    def predict(values: Values) -> Floats:
        t = times - values.get(DELAY, 0.0) / 1e3
        unscaled = history(target.rest(values))
        begun, at = (t >= 0)[:, None], np.minimum(t, unscaled.x[-1])
        return target.factor(values) * np.where(begun, unscaled(at), 0.0)

    return predict


def _flat_lines(target: Target, values: Values, frequencies: Floats) -> Complex:
    """Return lines from wavenumber integrals."""
    f, a = _flat_lines_of(target.scene_with(values))
    at = np.abs(f[:, None] - frequencies).argmin(axis=0)
    apart = np.abs(f[at] - frequencies) > target.same_line * frequencies
    if apart.any():
        raise ValueError(
            f"the load has no line at the measured {frequencies[apart][0]:.1f} Hz if "
            f"{', '.join(f'{key} = {value:g}' for key, value in values.items())}; do not vary keys "
            "that change its lines, or use --to waveforms"
        )
    return np.asarray(a[at])


def _flat_lines_of(scene: Scene) -> tuple[Floats, Complex]:
    """Return all lines of the normal motion at the probes: frequencies (f,), amplitudes (f, p)."""
    points = scene.probe_points
    weakest = 1e-5  # of the strongest line of the load; weaker ones are not predicted
    if scene.load.is_plain:
        body = compliance(scene.body)
        f, a = steady_lines(body, scene.pressure, points, threshold=weakest)
        return f, a * scene.reading.record.factor(2j * np.pi * f)[:, None]
    parts = zip(fields_read(scene, 0.0), scene.loads, strict=True)
    each = [field_lines(*part, points, threshold=weakest) for part in parts]
    frequencies, amplitudes = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(amplitudes)[..., 0])
