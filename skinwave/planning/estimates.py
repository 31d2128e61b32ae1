"""A-priori estimates: the relevant lines of a response, and reflections from the sides."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from simple_model import Trajectory
from simple_model.layers.flat_body import field_history, steady_lines
from simple_model.layers.flat_quantities import surface_field
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import gaussian_sum
from simple_model.load.spectrum import load_lines, merge_lines
from simple_model.load.trajectory import BY_POINTS
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.analytic import compliance, is_flat_layer, is_laterally_infinite, stack
from skinwave.bodies.supports import EDGES
from skinwave.scene.scene import SAMPLE_RATE, Body, Scene
from skinwave.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True)
class ReflectionEstimate:
    """Numbers of the estimates of reflections from the sides of a body.

    Reflections of the four sides may be `in_phase`; slabs reflected 0.5 to 0.9 times as much. Where
    viscosity dominates, a free side reflects more than its image source: `overdamped` slabs of 80
    to 120 mm reflected 0.9 to 1.1 times the estimate with both factors, of 70 mm up to 1.5 times.
    On a base that is not clamped, waves of all frequencies bend the body as a whole: the factor is
    `unclamped`, and small plates had up to 2.3.
    """

    unknown: float = 2.0  # difference of two waveforms over the larger one, never exceeded
    far: float = 0.25  # m, beyond which waves are neglected
    duration: float = 0.1  # s of the responses
    in_phase: float = 2.0
    overdamped: float = 1.5
    unclamped: float = 2.0
    absorbing: float = 0.03  # reflection coefficient of an absorbing side and its layer


ESTIMATE = ReflectionEstimate()


def response_spectrum(scene: Scene, tolerance: float) -> tuple[Floats, Floats]:
    """Return frequencies (f,) in Hz of the lines that move the probes, and each line's share (f, p)
    of the power at the probes of an infinite body; of the power of the load if that body has no
    wavenumber integral.
    """
    body = scene.body
    if scene.tacton.trajectory.shape == "recorded":
        lines = load_lines(scene.pressure, tolerance / 100)
        f, a = merge_lines(lines.frequencies, lines.strengths[:, None].astype(complex))
    elif body.of_kind.compliance is None or not any(m.has_loss for _, m in body.strata):
        f, a = _lines_of_load(scene, tolerance)
    else:
        pressure = scene.pressure
        if gaussian_sum(pressure.height, pressure.profile) is None:
            # A Gaussian of the same width shows which lines matter.
            pressure = replace(pressure, profile="gaussian")
        try:
            f, a = steady_lines(
                compliance(body), pressure, scene.probe_points, threshold=tolerance / 100
            )
        except ArithmeticError:  # almost no loss
            f, a = _lines_of_load(scene, tolerance)
    a = a * scene.reading.record.factor(2j * np.pi * f)[:, None]
    power = np.abs(a) ** 2 * np.where(f > 0, 0.5, 1.0)[:, None]
    return f, power / np.maximum(power.sum(axis=0), 1e-300)


def _lines_of_load(scene: Scene, tolerance: float) -> tuple[Floats, Complex]:
    lines = load_lines(scene.pressure, tolerance / 100)
    return merge_lines(lines.frequencies, lines.coefficients[:, None])


def cutoff_frequency(frequencies: Floats, shares: Floats, tolerance: float) -> float:
    """Return the frequency in Hz above which lines change no probe by a third of the tolerance."""
    above = np.cumsum(shares[::-1], axis=0)[::-1].max(axis=1)
    return float(frequencies[np.flatnonzero(np.sqrt(above) > tolerance / 3).max(initial=0)])


@lru_cache(maxsize=64)
def side_reflections(scene: Scene, given: ReflectionEstimate = ESTIMATE) -> float:
    """Return the ratio of reflections from the sides to the motion of the probes in an infinite
    body, at most `unknown`, which also stands for reflections that cannot be estimated.

    The reflection of a side at a probe is the motion of an infinite body at the mirror image of the
    probe. The estimate is the root of the four energies, times the factors of `given`. Absorbing
    sides do not reflect, and a half-space has no sides.
    """
    body, probes = scene.body, scene.probe_points
    if (
        not is_flat_layer(body)
        or gaussian_sum(scene.pressure.height, scene.pressure.profile) is None
    ):
        return given.unknown
    half = np.array([body.width, body.height]) / 2
    each = zip(EDGES, _mirror_images(probes, half), strict=True)  # left, right, front and back
    images = [image for name, image in each if body.side(name) != "absorbing"]
    if is_laterally_infinite(body) or not images:
        return 0.0
    if not scene.load.is_normal or _to_edge(scene, half) < 2 * scene.pressure.spot_scale:
        return given.unknown
    duration = min(scene.tacton.duration, given.duration)
    times = np.arange(max(2, round(duration * SAMPLE_RATE))) / SAMPLE_RATE
    points = np.vstack([probes, *images])
    # Other quantities reflect about as the displacement of the surface does.
    quantity = scene.reading.record if scene.reading.record.is_normal else DISPLACEMENT
    field = surface_field(quantity, compliance(body))
    u = field_history(field, scene.pressure, points, times)[..., 0]
    own, *reflected = (u**2).mean(axis=0).reshape(-1, len(probes))
    ratio = float(np.sqrt((sum(reflected) / np.maximum(own, 1e-300)).max()))
    critical = min(1.0, _loss_at_cut_off(body) / 2)
    ratio *= given.in_phase * (1 + (given.overdamped - 1) * critical)
    if body.base != "clamped":
        ratio *= given.unclamped
        ratio /= max(1 - ratio, ratio / given.unknown)
    return min(given.unknown, ratio)


def _loss_at_cut_off(body: Body) -> float:
    """Return the largest loss tangent at the lowest cut-off of shear waves across the depth."""
    layers = stack(body)
    pairs = zip(layers.materials, layers.thicknesses, strict=True)
    w = np.pi / 2 / sum(thickness / material.shear_speed for material, thickness in pairs)
    moduli = [material.complex_modulus(w) for material in layers.materials]
    return float(max(modulus.imag / modulus.real for modulus in moduli))


def absorbing_reflection(
    scene: Scene, half: Floats, highest: float, given: ReflectionEstimate = ESTIMATE
) -> float:
    """Return the ratio of the reflection of absorbing sides, at distances `half` (2,) in m from the
    middle, to the steady motion of the probes; 1, unknown, for a body with too little loss.

    The wavenumber integral of the infinite body gives the motion due to mirror images of the focus
    in the four sides, for lines of the load up to `highest` in Hz.
    """
    width, path = scene.pressure.spot_scale, path_places(scene.tacton.trajectory)
    if _to_edge(scene, half) < 2 * width:
        return 1.0
    foci = np.array([path, *_mirror_images(path, half)])
    distances = np.linalg.norm(scene.probe_points[:, None] - foci[:, None], axis=-1)  # (5, p, k)
    lines = load_lines(replace(scene.pressure, profile="gaussian"), 1e-2)
    low = lines.frequencies <= max(highest, 1.0)
    frequencies, index = np.unique(lines.frequencies[low], return_inverse=True)
    strength = np.bincount(index, lines.strengths[low] ** 2)
    table = np.arange(0.0, given.far, width / 2)
    try:
        g = point_response(compliance(scene.body), table, 2 * np.pi * frequencies, width)
    except ArithmeticError:
        return 1.0
    power = np.interp(distances, table, strength @ np.abs(g) ** 2).mean(axis=2)
    ratio = power[1:].sum(axis=0) / np.maximum(power[0], 1e-300)
    return min(1.0, given.absorbing * float(np.sqrt(ratio.max())))


def _mirror_images(points: Floats, half: Floats) -> list[Floats]:
    """Return the mirror images (n, 2) of points (n, 2) in the four sides."""
    return [
        np.where(np.arange(2) == axis, 2 * sign * half - points, points)
        for axis in (0, 1)
        for sign in (-1, 1)
    ]


def _to_edge(scene: Scene, half: Floats) -> float:
    """Return the distance in m from the path or the probes to the nearest side."""
    points = np.vstack([path_places(scene.tacton.trajectory), scene.probe_points])
    return float((half - np.abs(points).max(axis=0)).min())


def path_places(path: Trajectory, count: int = 24) -> Floats:
    """Return positions (k, 2) in m of the focus on its path, about `count`."""
    if path.shape in BY_POINTS:
        return path.outline[:: max(1, len(path.points) // count)]
    return path.at_phase(np.arange(count) / count)


def mean_gain(scene: Scene) -> float:
    """Return the mean pressure in Pa of all foci together over a Tacton."""
    # Random times, because evenly spaced ones would see some modulations as constant.
    times = np.random.default_rng(0).uniform(0, scene.tacton.duration, 20_000)
    gain: Floats = scene.pressure.gain(np.sort(times))
    return float(abs(gain.mean())) * len(scene.tacton.foci)
