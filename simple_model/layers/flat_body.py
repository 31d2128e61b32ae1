"""Wavenumber integrals of a flat, laterally infinite body under a moving focus, without a mesh.

The body is a stack of layers, a half-space or a thin sheet. A focal spot at rest displaces a point
by g(x, w) (`wavenumber_integral`; time exp(+i w t)). A focus that runs a closed path at f_d = 1/T,
x(t) = X(f_d t), moves a probe by

    u(w) = sum_n h_n(w) Q(w - 2 pi n f_d),   h_n = int_0^1 g(x_p - X(a), w) exp(-2 pi i n a) da

where Q is the transform of the pressure at the focus. Splines B_j(r) that interpolate g(r, w) =
sum_j g_j(w) B_j(r) separate path and probes from the body. In the steady state

    h_n = sum_j g_j(w) int_0^1 B_j(|x_p - X(a)|) exp(-2 pi i n a) da

and from rest

    u(w) = sum_j g_j(w) int_0^inf q(t) B_j(|x_p - x(t)|) exp(-i w t) dt

Displacement normal to the surface has one component, g(r). A `Field` has m components, each a sum
of integrals times weights that depend on x_p - x.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import next_fast_len, rfft
from scipy.special import erfc

from simple_model.layers.compliance import Compliance
from simple_model.layers.wavenumber_integral import Field, normal_field, point_integrals
from simple_model.load.focus import GaussianSum, gaussian_sum
from simple_model.load.path_cells import (
    AT_ONCE,
    cells,
    jump_times,
    path_fourier,
    path_samples,
    sampled_load,
)
from simple_model.load.pressure import MovingPressure, check_lines
from simple_model.load.sampling import (
    below_half_the_rate,
    highest_line,
    is_folded,
    oversampling,
    step,
)
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.response import Effort, Response
from simple_model.typing import Complex, Floats, Ints

WRAP_AROUND = 1e-5  # factor by which the wrap-around is damped
TRANSFORM_RATE = 20_000.0  # Hz, of the samples of the transform
STEPS_PER_WIDTH = 6  # distances of a spline per standard deviation of the focal spot

Splines = Callable[[Floats], Floats]


def steady_lines(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Compute steady-state lines of the normal displacement, by wavenumber integrals.

    Frequencies (f,) in Hz >= 0 and amplitudes a (f, p) in m of Re a exp(2 pi i f t) at probes
    (p, 2) in m, for a focus that is a sum of Gaussians. Lines weaker than `threshold` times the
    strongest line of the load are left out.
    """
    f, amplitudes = field_lines(normal_field(compliance), pressure, probes, threshold=threshold)
    return f, amplitudes[..., 0]


def field_lines(
    field: Field, pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Frequencies (f,) and amplitudes (f, p, m) of all components, as in `steady_lines`."""
    path, blocks = _path(field, pressure, probes, threshold)
    g = point_integrals(field, path.distances, 2 * np.pi * path.frequencies, path.spot.width)
    return path.frequencies, np.concatenate([path.combine(g, h) for h in blocks], axis=1)


def weighted_splines(field: Field, splines: Splines, spot: GaussianSum, away: Floats) -> Floats:
    """Splines times weights of a field, (m, c, j, ..., q), at offsets (..., q, 2) in m of probes
    from positions of a focus; components are sums over integrals (c, j).
    """
    total = np.zeros(())
    for offset, share in zip(spot.offsets, spot.shares, strict=True):
        moved = away - offset
        of_distance = np.moveaxis(splines(np.linalg.norm(moved, axis=-1)), -1, 0)
        total = total + field.weights(moved)[:, :, None] * (share * of_distance)
    return total


def steady_history(
    field: Field, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Floats:
    """All components (t, p, m) of a field in the steady state, of lines below half the rate."""
    f, a = field_lines(field, pressure, probes)
    below = below_half_the_rate(f, times)
    history = synthesise(f[below], a[below].reshape(int(below.sum()), -1), times)
    return history.reshape(len(times), *a.shape[1:])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Path:
    """Lines of a load at distinct `frequencies` (f,) in Hz: indices of frequency `lines` (l,) and
    harmonic `orders` (l,), `coefficients` (l,) in Pa; the focal `spot`, and `distances` (j,) in m
    of the integrals.
    """

    spot: GaussianSum
    distances: Floats
    frequencies: Floats
    lines: Ints
    orders: Ints
    coefficients: Complex

    def combine(self, g: Complex, harmonics: Complex) -> Complex:
        """Amplitudes (f, p, m) c sum_cj g_cj(f) h_nmcj of g (c, f, j) and h (n, m, c, j, p)."""
        amplitudes = np.zeros((g.shape[1], harmonics.shape[-1], harmonics.shape[1]), np.complex128)
        for order, harmonic in enumerate(harmonics):
            own = self.orders == order
            moved = np.tensordot(g[:, self.lines[own]], harmonic, axes=([0, 2], [1, 2]))
            moved = self.coefficients[own, None, None] * moved.swapaxes(1, 2)
            np.add.at(amplitudes, self.lines[own], moved)
        return amplitudes


def _path(
    field: Field, pressure: MovingPressure, probes: ArrayLike, threshold: float
) -> tuple[_Path, Iterator[Complex]]:
    """Lines of a load, and blocks of probes of the harmonics (n, m, c, j, p) of a field, h_nmcj =
    int_0^1 W_mc B_j(|x_p - X(a)|) exp(-2 pi i n a) da with its weights W.
    """
    spot = _gaussians(pressure)
    load, places = load_lines(pressure, threshold), np.atleast_2d(np.asarray(probes, np.float64))
    frequencies, lines = np.unique(np.round(load.frequencies, 9), return_inverse=True)
    distinct, orders = np.unique(load.harmonics, return_inverse=True)
    knots = path_samples(pressure)
    table, splines = _interpolation(places, knots, spot)
    path = _Path(
        spot=spot, distances=table, frequencies=frequencies, lines=lines, orders=orders,
        coefficients=load.coefficients,
    )  # fmt: skip
    count = min(len(places), max(1, len(places) * len(table) * len(knots) // AT_ONCE))
    blocks = (
        np.moveaxis(
            path_fourier(pressure, weighted_splines(field, splines, spot, away), distinct), -1, 0
        )
        for away in (some[:, None] - knots for some in np.array_split(places, count))
    )
    return path, blocks


def path_operator(
    pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> Callable[[Compliance], tuple[Floats, Complex]]:
    """Return the function from the compliance of a body to its `steady_lines` under a load."""
    any_body = normal_field(Compliance(lambda k, w: 0 * k))  # its weights suit every body
    path, blocks = _path(any_body, pressure, probes, threshold)
    harmonics = np.ascontiguousarray(np.concatenate(list(blocks), axis=-1))

    def lines_of(compliance: Compliance) -> tuple[Floats, Complex]:
        field, omega = normal_field(compliance), 2 * np.pi * path.frequencies
        g = point_integrals(field, path.distances, omega, path.spot.width)
        return path.frequencies, path.combine(g, harmonics)[..., 0]

    return lines_of


def steady_state(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Response:
    """Compute the steady state of the normal displacement: the lines below half the sampling rate.

    Arguments, result and errors are those of `flat_body`.
    """
    started = time.perf_counter()
    probes = np.atleast_2d(np.array(probes, np.float64))
    times = np.array(times)
    f, a = steady_lines(compliance, pressure, probes)
    below = below_half_the_rate(f, times)
    values = synthesise(f[below], a[below], times)
    count = int(below.sum())
    return _make_response("flat-body-harmonic", started, times, probes, values, count, count)


def flat_body(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Response:
    """Compute the normal displacement of probes from rest, relative to the rest position.

    The FFT over twice the duration has exponential damping, which reduces the wrap-around to 1e-5.
    Lines of the load above half the sampling rate are left out. Raises a ValueError if the focus is
    no sum of Gaussians, or if the load is a subclass of MovingPressure.

    Parameters
    ----------
    compliance : Compliance
    pressure : MovingPressure, with a Gaussian focus or a `SpotMap`
    probes : (p, 2) float, m
    times : (t,) float, s, equally spaced

    >>> from simple_model import Tacton
    >>> from simple_model.layers.compliance import slab
    >>> from simple_model.layers.material import PRESETS
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0, duration=0.05))
    >>> times = np.arange(500) / 1e4
    >>> response = flat_body(slab(PRESETS["palm"], 0.015), load, [[0.0, 0.0], [0.01, 0.0]], times)
    >>> (1e6 * np.abs(response.values).max(axis=0)).round(2)  # micrometre
    array([4.47, 1.03])
    """
    started = time.perf_counter()
    probes, times = np.atleast_2d(np.array(probes, np.float64)), np.array(times)
    values = field_history(normal_field(compliance), pressure, probes, times)[..., 0]
    return _make_response("flat-body", started, times, probes, values, len(times), len(times) + 1)


def field_history(
    field: Field, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Floats:
    """All components (t, p, m) of a field from rest, as in `flat_body`."""
    spot = _gaussians(pressure)
    probes = np.atleast_2d(np.asarray(probes, np.float64))
    within, padded = transform_samples(times)
    dt, n = step(times) / within, (len(times) - 1) * within + 1
    w = _transform_frequencies(padded, dt)
    damping = -w[0].imag
    folded = is_folded(pressure, times)
    if not folded and oversampling(highest_line(pressure), step(times)) > 1:
        passed = below_half_the_rate(w.real / (2 * np.pi), times).astype(float)
    else:  # a spectrum that ended at once would ring after the start of an acceleration
        passed = erfc(3 * (4 * w.real * dt / np.pi - 3)) / 2

    def lasting(t: Floats) -> Floats:
        """Factor (t,) of the load at times in s: it ends smoothly after the record, and has the
        damping of the transform.
        """
        after = (t - n * dt) / ((padded - n) * dt)
        ended = erfc(6 * (2 * after - 1)) / 2
        return np.asarray(np.where(t < 0, 0.0, ended * np.exp(-damping * t)))

    parts = 1
    if folded:
        knots, of_load = _low_passed_load(pressure, 0.5 / step(times), padded, dt, lasting)
    else:
        jumps = jump_times(pressure, 0.0, padded * dt)
        is_abrupt = len(jumps) or len(pressure.tacton.trajectory.parts[1]) > 1
        parts = max(oversampling(highest_line(pressure), dt), 2 if is_abrupt else 1)
        knots, of_load = _sampled_load(pressure, jumps, padded, dt, parts, lasting)
    table, splines = _interpolation(probes, knots, spot)
    g = _transient(field, tuple(table.tolist()), padded, dt, spot.width)
    u = np.zeros((len(w), len(probes), len(field.uses)), np.complex128)
    for i, probe in enumerate(probes):
        weighted = weighted_splines(field, splines, spot, probe - knots)
        for m, c in np.argwhere(field.uses):
            blocks = min(len(table), len(table) * padded * parts // AT_ONCE + 1)
            for some in np.array_split(np.arange(len(table)), blocks):
                x = of_load(weighted[m, c, some].T)
                transformed = rfft(x, axis=0)[: g.shape[1]] / parts
                u[: g.shape[1], i, m] += np.einsum("wj,wj->w", g[c][:, some], transformed)
    t = dt * np.arange(n)[::within]
    u *= passed[:, None, None]
    return np.fft.irfft(u, padded, axis=0)[:n:within] * np.exp(damping * t[:, None, None])


def _transform_frequencies(padded: int, dt: float) -> Complex:
    """Frequencies (f,) in rad/s of a transform, below the real axis by its damping."""
    damping = -np.log(WRAP_AROUND) / (padded * dt)
    return np.asarray(2 * np.pi * np.fft.rfftfreq(padded, dt) - 1j * damping)


@lru_cache(maxsize=4)
def _transient(
    field: Field, distances: tuple[float, ...], padded: int, dt: float, width: float,
    negligible: float = 1e-4,
) -> Complex:  # fmt: skip
    """Integrals (c, f, r) of a transient, up to the last frequency where they are not negligible.
    They depend on the body, not on the Tacton, so that all loads of a sweep share them.
    """
    w = _transform_frequencies(padded, dt)
    g = point_integrals(field, np.array(distances), w, width, negligible=negligible)
    used = 1 + int(np.flatnonzero(g.any(axis=(0, 2))).max(initial=0))
    g = g[:, :used].copy()
    g.flags.writeable = False
    return g


def transform_samples(times: Floats) -> tuple[int, int]:
    """Samples of the transform from one of the times (t,) in s to the next, and in all."""
    within = max(1, int(np.ceil(step(times) * TRANSFORM_RATE - 1e-6)))
    padded = 2 * ((len(times) - 1) * within + 1) + 256
    return within, next_fast_len(padded, real=True)


def _sampled_load(
    pressure: MovingPressure, jumps: Floats, padded: int, dt: float, parts: int,
    lasting: Callable[[Floats], Floats],
) -> tuple[Floats, Callable[[Floats], Floats]]:  # fmt: skip
    """Positions (q, 2) in m of the foci, and the function from responses to unit pressure there
    (q, j) to responses to the load (t, j), in samples of dt / parts from 0.
    """
    fine = dt / parts
    at, shares = cells(np.append(jumps, 0.0), -fine / 2, fine, padded * parts)
    gain = pressure.gain(np.maximum(at, 0.0)) * lasting(at)
    knots, mixed = sampled_load(pressure, at, gain)
    return knots, (shares @ mixed).__matmul__


def _low_passed_load(
    pressure: MovingPressure, highest: float, padded: int, dt: float,
    lasting: Callable[[Floats], Floats],
) -> tuple[Floats, Callable[[Floats], Floats]]:  # fmt: skip
    """The same with samples of dt, for lines of the load below a frequency in Hz."""
    lines = load_lines(pressure)
    below = lines.frequencies < highest
    f, orders = lines.frequencies[below], lines.harmonics[below]
    t = np.asarray(dt * np.arange(padded), np.float64)
    window = lasting(t)
    window[0] /= 2  # the load begins in the middle of a sample

    def of_load(values: Floats) -> Floats:
        amplitudes = lines.coefficients[below, None] * path_fourier(pressure, values.T, orders).T
        return synthesise(f, amplitudes, t) * window[:, None]

    return path_samples(pressure), of_load


def _make_response(
    model: str, started: float, times: Floats, probes: Floats, values: Floats, steps: int, dofs: int
) -> Response:
    """Make the response, with the seconds since its computation started."""
    seconds = {"evaluate": time.perf_counter() - started}
    effort = Effort(seconds=seconds, steps=steps, dofs=dofs)
    return Response(model=model, times=times, probes=probes, values=values, effort=effort)


def _gaussians(pressure: MovingPressure) -> GaussianSum:
    """The focal spot as a sum of Gaussians; raises a ValueError for any other load."""
    check_lines(pressure)
    spot = gaussian_sum(pressure.height, pressure.profile)
    if spot is None:
        raise ValueError(
            f"flat-body models do not support the focus '{pressure.profile_name}'; use 'gaussian', "
            "or a map"
        )
    return spot


def spline_steps(furthest: float, multiple: int = 8) -> int:
    """Number of distances of a spline up to a distance in standard deviations of the focal spot.
    Its steps are a `multiple`, so that loads share their integrals.
    """
    return multiple * max(1, int(np.ceil(furthest * STEPS_PER_WIDTH / multiple))) + 1


def _interpolation(
    probes: Floats, knots: Floats, spot: GaussianSum, few: int = 40
) -> tuple[Floats, Splines]:
    """Distances (j,) in m of the integrals, and the function from distances (...) to the shares
    (..., j) that interpolate between them: cubic splines, flat at 0. A `few` distances are used
    directly.
    """
    if len(knots) * len(probes) * len(spot.shares) <= few:
        away = (probes[:, None] - knots)[:, :, None] - spot.offsets
        unique: Floats = np.unique(np.linalg.norm(away, axis=-1))
        return unique, lambda r: (r[..., None] == unique).astype(float)
    from scipy.interpolate import CubicSpline  # slow to import

    steps = spline_steps(furthest(probes, knots, spot) / spot.width)
    table: Floats = spot.width / STEPS_PER_WIDTH * np.arange(steps, dtype=np.float64)
    flat = (1, np.zeros(steps))
    return np.asarray(table), CubicSpline(table, np.eye(steps), bc_type=(flat, "not-a-knot"))


def furthest(probes: Floats, knots: Floats, spot: GaussianSum) -> float:
    """Largest distance in m of probes (p, 2) from Gaussians of a spot at positions (q, 2)."""
    away = max(np.linalg.norm(probe - knots, axis=1).max() for probe in probes)
    return float(away + np.linalg.norm(spot.offsets, axis=1).max())
