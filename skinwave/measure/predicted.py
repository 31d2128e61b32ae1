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

from simple_model import MovingPressure
from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.layers.flat_quantities import from_rest, steady, surface_field
from simple_model.layers.wavenumber_integral import Field
from simple_model.load.spectrum import merge_lines
from simple_model.quantities import Quantity
from simple_model.response import fit_lines
from simple_model.typing import Complex, Floats
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
from skinwave.models.advice import check_taken
from skinwave.models.covering import covering, tried_together
from skinwave.models.flat_body import fields_read
from skinwave.models.options import SolveOptions
from skinwave.models.parametric import ParametricBody
from skinwave.planning.simulate import compute
from skinwave.scene.scene import SAMPLE_RATE, Scene
from skinwave.scene.variation import varied
from skinwave.system.effort import Progress

Predict = Callable[[Values], np.ndarray]
SAME = 1e-3  # of a frequency: lines as near as that are one
KEPT = 32  # predictions
RUNS = 200  # of a fit, about
THRESHOLD = 1e-5  # of the strongest line of the load: weaker ones are left out of a prediction
SETTLED = 1e-4  # of the largest motion: what is left of the transient where it is left out
PARTS = (1 / 12, 1 / 4)  # of a record, after which the transient may have decayed
BEFORE_END = 0.9  # of such a part: its last samples see it end


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
        changed = varied(self.scene, of_scene(values)) if of_scene(values) else self.scene
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

    Raises
    ------
    ValueError
        If the model or the quantity is not one of motion normal to a body, a place is not known or
        off the body, or the model refuses the scene or its load.
    """
    if not quantity.is_normal:
        raise ValueError(
            "a fit is to displacement, velocity or acceleration into the body, not "
            f"{quantity.words}"
        )
    if not np.isfinite(places).all():
        raise ValueError(
            "some places of the measurement are not known; give them, or select the others"
        )
    record = named(model)
    if not record.needs_body:
        raise ValueError(f"{model} has no body whose motion could be fitted; take another model")
    found = Target(scene=scene, model=model, quantity=quantity, places=places)
    moved = found.varied({})
    check_taken(record, moved)
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
    found = tried_together(together, SolveOptions(progress=progress))
    return replace(aim, reduced=found) if found else aim


def predicted_lines(aim: Target, frequencies: Floats) -> Predict:
    """Prediction of the complex amplitudes (f, p), SI, of Re a exp(2 pi i f t) at frequencies (f,)
    in Hz.

    Raises
    ------
    ValueError
        On evaluation, if the load has no line at one of them.
    """
    unscaled = _flat_lines if aim.record.is_infinite else _sampled_lines
    unscaled = _reduced_lines if aim.reduced else unscaled
    base = _kept(lambda values: unscaled(aim, values, frequencies))

    def predict(values: Values) -> Complex:
        late = np.exp(-2j * pi * frequencies * values.get(DELAY, 0.0) / 1e3)
        return aim.factor(values) * late[:, None] * base(aim.rest(values))

    return predict


def predicted_waveforms(aim: Target, times: Floats) -> Predict:
    """Prediction of waveforms (t, p) from rest at t = 0, SI, at times (t,) in s."""
    base = _kept(lambda values: _history(aim, values, float(times[-1])))

    def predict(values: Values) -> Floats:
        t = times - values.get(DELAY, 0.0) / 1e3
        begun = (t >= 0)[:, None]
        return aim.factor(values) * np.where(begun, base(aim.rest(values))(t), 0.0)

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
    _check_lines(f[at], frequencies, values)
    return np.asarray(a[at])


def _reduced_lines(aim: Target, values: Values, frequencies: Floats) -> Complex:
    """Lines of a body that is reduced for all of its materials."""
    assert aim.reduced is not None
    f, a = parametric.lines(aim.reduced, values)
    return np.asarray(a[np.abs(f[:, None] - frequencies).argmin(axis=0)])


def _check_lines(found: Floats, wanted: Floats, values: Values) -> None:
    apart = np.abs(found - wanted) > SAME * wanted
    if apart.any():
        raise ValueError(
            f"the load has no line at {wanted[apart][0]:.1f} Hz, which was measured, with "
            f"{', '.join(f'{key} = {value:g}' for key, value in values.items())}; do not vary what "
            "moves the lines, or fit waveforms from rest"
        )


def _sampled_lines(aim: Target, values: Values, frequencies: Floats) -> Complex:
    """Lines of any model's waveforms."""
    return np.asarray(fit_lines(compute(aim.varied(values), aim.model), frequencies)[0])


def _history(aim: Target, values: Values, last: float) -> CubicSpline:
    """Interpolated waveforms (t, p) from rest up to `last` in s."""
    if aim.reduced:
        found = parametric.answer(aim.reduced, values)
        return CubicSpline(found.times, found.values)
    scene = aim.varied(values)
    if not aim.record.is_infinite:
        found = compute(scene, aim.model)
        return CubicSpline(found.times, found.values)
    times = np.asarray(np.arange(int(np.ceil(last * SAMPLE_RATE)) + 2) / SAMPLE_RATE, np.float64)
    return CubicSpline(times, _flat_history(scene, times))


def _flat_lines_of(scene: Scene) -> tuple[Floats, Complex]:
    """Lines of the normal motion that a scene's probes read: frequencies (f,) in Hz, amplitudes (f,
    p), SI.
    """
    points = scene.probe_points
    if scene.load.is_plain:
        body = compliance(scene.body)
        f, a = steady_lines(body, scene.pressure, points, threshold=THRESHOLD)
        return f, a * scene.reading.asked.factor(2j * np.pi * f)[:, None]
    each = [field_lines(*part, points, threshold=THRESHOLD) for part in _parts(scene)]
    frequencies, amplitudes = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(amplitudes)[..., 0])


def _flat_history(scene: Scene, times: Floats) -> Floats:
    """Waveforms (t, p), SI, of the same from rest at times (t,) in s, equally spaced from 0; the
    steady state where the transient has decayed.
    """
    parts, asked, points = _parts(scene), scene.reading.asked, scene.probe_points

    def begun(until: Floats) -> Floats:
        each = (from_rest(field, asked, load, points, until) for field, load in parts)
        return np.asarray(sum(each), np.float64)

    if scene.tacton.trajectory.shape == "recorded":
        return begun(times)
    later = np.asarray(sum(steady(field, asked, load, points, times) for field, load in parts))
    for part in PARTS:
        n = int(part * len(times))
        first = begun(times[:n])[: int(BEFORE_END * n)]
        left = np.abs(first - later[: len(first)])[2 * n // 3 :].max()
        if left <= SETTLED * np.abs(later).max():
            return np.concatenate([first, later[len(first) :]])
    return begun(times)


def _parts(scene: Scene) -> list[tuple[Field, MovingPressure]]:
    """Field of each component of the load, and that."""
    if scene.load.is_plain:
        body = compliance(scene.body)
        return [(surface_field(scene.reading.asked, body), scene.pressure)]
    return list(zip(fields_read(scene, 0.0), scene.loads, strict=True))
