"""Predictions of a model at the places of a measurement, as functions of its parameters.

Linear waves are in proportion to the peak pressure, so that it is a factor as the gain is, and with
the delay costs no run of the model. A prediction is kept for the parameters that it last had.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.load.spectrum import merge_lines
from simple_model.quantities import Quantity
from simple_model.response import fit_lines
from skinwave.bodies.analytic import compliance
from skinwave.measure.parameters import (
    DELAY,
    FORCE,
    GAIN,
    OFFSET_X,
    OFFSET_Y,
    PRESSURE,
    Parameters,
    Values,
    of_scene,
)
from skinwave.models import Model, named, parametric
from skinwave.models.covering import covering, try_shared_body
from skinwave.models.flat_body import fields_read
from skinwave.models.limits import check_taken
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.parametric import ParametricBody
from skinwave.planning.simulate import compute
from skinwave.scene.scene import SAMPLE_RATE, Scene
from skinwave.scene.variation import with_values
from skinwave.system.effort import Progress
from skinwave.typing import Complex, Floats

Predict = Callable[[Values], np.ndarray]
SAME = 1e-3  # of a frequency: lines as near as that are one
KEPT = 32  # predictions
RUNS = 200  # of a fit, about
THRESHOLD = 1e-5  # of the strongest line of the load: weaker ones are left out of a prediction


@dataclass(frozen=True, kw_only=True)
class Target:
    """Prediction's target: a `scene` whose parameters are varied, the model, and what it is
    compared with: a quantity of the normal motion at places (p, 2) in metre. A body that is reduced
    once for all values of its materials is `reduced`.
    """

    scene: Scene
    model: str
    quantity: Quantity
    places: Floats
    reduced: ParametricBody | None = None

    @property
    def record(self) -> Model:
        """The record of the model."""
        return named(self.model)

    @property
    def linear(self) -> tuple[str, ...]:
        """Keys that a prediction is in proportion to."""
        load, (key, strength) = self.scene.load, self.strength
        alone = not (load.gravity or load.support_motion or self.record.is_nonlinear)
        return (GAIN, key) if strength > 0 and alone else (GAIN,)

    @property
    def strength(self) -> tuple[str, float]:
        """Key of the strength of the load, and its value in the scene: of a device its pressure,
        else its force.
        """
        if self.scene.load.of_kind.is_of_device:
            return PRESSURE, self.scene.pressure.peak_pressure
        return FORCE, self.scene.load.force

    def varied(self, values: Values) -> Scene:
        """The scene at values of its keys, its probes at the places with their offset."""
        changed = with_values(self.scene, of_scene(values)) if of_scene(values) else self.scene
        offset = np.array([values.get(OFFSET_X, 0.0), values.get(OFFSET_Y, 0.0)]) / 1e3
        places = [(float(x), float(y)) for x, y in self.places + offset]
        return replace(changed, probes=tuple(places), depth=0.0, quantity=self.quantity.name)

    def factor(self, values: Values) -> float:
        """Factor of the linear keys."""
        key, strength = self.strength
        relative = values[key] / strength if self._is_scaled(values) else 1.0
        return float(values.get(GAIN, 1.0) * relative)

    def rest(self, values: Values) -> dict[str, float]:
        """Values of all keys but the delay and the linear ones."""
        left_out = {GAIN, DELAY} | ({self.strength[0]} if self._is_scaled(values) else set())
        return {key: value for key, value in values.items() if key not in left_out}

    def predicts(self, frequencies: Floats) -> np.ndarray:
        """Mask (f,) of lines that are predicted: a reduced body has no faint ones."""
        known = frequencies if self.reduced is None else self.reduced.frequencies
        return np.asarray((np.abs(known[:, None] - frequencies) <= SAME * frequencies).any(axis=0))

    def _is_scaled(self, values: Values) -> bool:
        return self.strength[0] in values and self.strength[0] in self.linear


def target(scene: Scene, model: str, quantity: Quantity, places: Floats) -> Target:
    """Target of a model by its name, for a quantity of the normal motion at places (p, 2) in metre.

    Raises a ValueError if the model or the quantity is not one of motion normal to a body, a place
    is not known or off the body, or the model refuses the scene or its load.
    """
    if not quantity.is_normal:
        raise ValueError(
            f"a fit is to motion normal to the body, not to {quantity.words}; measure such"
        )
    if not np.isfinite(places).all():
        raise ValueError(
            "some places of the measurement are not known; give them, or select the others"
        )
    record = named(model)
    if not record.needs_body:
        raise ValueError(f"{model} has no body whose motion could be fitted; take another model")
    found = Target(scene=scene, model=model, quantity=quantity, places=places)
    check_taken(record, found.varied({}))
    return found


def with_reduction(aim: Target, parameters: Parameters, progress: Progress) -> Target:
    """Target whose body is reduced once, where the model reduces bodies and of its scene only
    materials, thicknesses and the pressure are varied, within ranges that one reduced-order model
    serves.
    """
    ranges = {each.key: (each.low, each.high) for each in parameters.free}
    ranges = {key: ranges[key] for key in aim.rest(dict.fromkeys(ranges, 1.0))}
    if not aim.record.is_reduced or parameters.ties or not ranges:
        return aim
    together = covering(aim.varied({}), ranges, RUNS)
    found = try_shared_body(together, SolveOptions(progress=progress))
    return replace(aim, reduced=found) if found else aim


def predicted_lines(aim: Target, frequencies: Floats) -> Predict:
    """Prediction of the complex amplitudes (f, p), SI, of Re a exp(2 pi i f t) at frequencies (f,)
    in Hz; it raises a ValueError if the load has no line at one of them.
    """
    unscaled = _flat_lines if aim.record.is_infinite else _sampled_lines
    unscaled = _reduced_lines if aim.reduced else unscaled
    base = _kept(lambda values: unscaled(aim, values, frequencies))

    def predict(values: Values) -> Complex:
        late = np.exp(-2j * pi * frequencies * values.get(DELAY, 0.0) / 1e3)
        return aim.factor(values) * late[:, None] * base(aim.rest(values))

    return predict


def predicted_waveforms(aim: Target, times: Floats) -> Predict:
    """Prediction of waveforms (t, p) from rest at t = 0, SI, at times (t,) in s; raises a
    ValueError if the Tacton is shorter.
    """
    last, duration = float(times[-1]), aim.scene.tacton.duration
    if last > duration + 1 / SAMPLE_RATE:
        raise ValueError(
            f"the record ends at {1e3 * last:.4g} ms, and the scene's Tacton after "
            f"{1e3 * duration:.4g} ms; make the Tacton as long, or cut the record off"
        )
    base = _kept(lambda values: _history(aim, values, last))

    def predict(values: Values) -> Floats:
        t = times - values.get(DELAY, 0.0) / 1e3
        history = base(aim.rest(values))
        begun, at = (t >= 0)[:, None], np.minimum(t, history.x[-1])
        return aim.factor(values) * np.where(begun, history(at), 0.0)

    return predict


def _kept(function: Callable[[Values], Any]) -> Callable[[Values], Any]:
    """The function, with its last results kept."""

    @lru_cache(maxsize=KEPT)
    def of_items(items: tuple[tuple[str, float], ...]) -> Any:
        return function(dict(items))

    return lambda values: of_items(tuple(sorted(values.items())))


def _flat_lines(aim: Target, values: Values, frequencies: Floats) -> Complex:
    """Lines by wavenumber integrals."""
    f, a = _flat_lines_of(aim.varied(values))
    at = np.abs(f[:, None] - frequencies).argmin(axis=0)
    apart = np.abs(f[at] - frequencies) > SAME * frequencies
    if apart.any():
        raise ValueError(
            f"the load has no line at {frequencies[apart][0]:.1f} Hz, which was measured, with "
            f"{', '.join(f'{key} = {value:g}' for key, value in values.items())}; do not vary what "
            "moves the lines, or fit waveforms from rest"
        )
    return np.asarray(a[at])


def _reduced_lines(aim: Target, values: Values, frequencies: Floats) -> Complex:
    """Lines of a body that is reduced for all of its materials."""
    assert aim.reduced is not None
    f, a = parametric.lines(aim.reduced, values)
    return np.asarray(a[np.abs(f[:, None] - frequencies).argmin(axis=0)])


def _sampled_lines(aim: Target, values: Values, frequencies: Floats) -> Complex:
    """Lines of any model's waveforms."""
    return np.asarray(fit_lines(compute(aim.varied(values), aim.model), frequencies)[0])


def _history(aim: Target, values: Values, last: float) -> CubicSpline:
    """Interpolated waveforms (t, p) from rest up to `last` in s, or twice that if the Tacton lasts
    as long.
    """
    if aim.reduced:
        found = parametric.answer(aim.reduced, values)
    else:
        scene = aim.varied(values)
        times = sample_times(scene)
        count = int(np.ceil(2 * last * SAMPLE_RATE)) + 2
        found = compute(scene, aim.model, times=times[:count])
    return CubicSpline(found.times, found.values)


def _flat_lines_of(scene: Scene) -> tuple[Floats, Complex]:
    """Lines of the normal motion that a scene's probes read: frequencies (f,) in Hz, amplitudes (f,
    p), SI.
    """
    points = scene.probe_points
    if scene.load.is_plain:
        body = compliance(scene.body)
        f, a = steady_lines(body, scene.pressure, points, threshold=THRESHOLD)
        return f, a * scene.reading.record.factor(2j * np.pi * f)[:, None]
    parts = zip(fields_read(scene, 0.0), scene.loads, strict=True)
    each = [field_lines(*part, points, threshold=THRESHOLD) for part in parts]
    frequencies, amplitudes = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(amplitudes)[..., 0])
