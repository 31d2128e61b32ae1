"""Wavenumber-integral solution, without a mesh, for layers, a half-space or a thin sheet, all
laterally infinite, under a moving focus.

Where a focal spot at rest displaces a point by g(x, w) (`wavenumber_integral`; time exp(+i w t)), a
focus that runs a closed path at f_d = 1/T, x(t) = X(f_d t), moves a probe by

    u(w) = sum_n h_n(w) Q(w - 2 pi n f_d),   h_n = int_0^1 g(x_p - X(a), w) exp(-2 pi i n a) da

where Q is the transform of the pressure at the focus. With splines B_j(r) that interpolate g(r, w)
= sum_j g_j(w) B_j(r), the path and the probes are apart from the body,

    h_n = sum_j g_j(w) int_0^1 B_j(|x_p - X(a)|) exp(-2 pi i n a) da

and a recorded path, which may be long and run through once, moves the probe by

    u(w) = sum_j g_j(w) int q(t) B_j(|x_p - x(t)|) exp(-i w t) dt

Displacement normal to the surface is one component, g(r) itself. A `Field` has m, each a sum of
integrals times weights that depend on x_p - x.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from simple_model.compliance import Compliance
from simple_model.focus import gaussian_width
from simple_model.load_spectrum import (
    foci_harmonics,
    load_lines,
    merge_lines,
    path_fourier,
    path_samples,
    path_strengths,
    path_weights,
    synthesise,
)
from simple_model.material import Complex
from simple_model.pressure import MovingPressure, check_lines
from simple_model.response import Effort, Response, step
from simple_model.sampling import finer, highest, reached, shown, transform
from simple_model.trajectory import Floats
from simple_model.wavenumber_integral import Field, normal_field, point_integrals

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

PADDING = 2.0  # the transform's period over the duration; what wraps round is damped by WRAPPED
WRAPPED = 1e-5
AT_ONCE = 2**19  # pairs of frequency and distance: some ten megabytes
STEPS_PER_WIDTH = 6  # distances of a spline in a standard deviation of the focal spot
FEWEST_STEPS = 8  # of them
FEW_DISTANCES = 40  # are integrated one by one, without a spline
ANYWHERE = np.array([[1.0, 0.3], [0.2, 1.0], [-0.7, 0.4]])  # of no symmetry
FAINT = 1e-7  # of the strongest harmonic of the path, which a transient leaves out
NEGLIGIBLE = 1e-4  # of the largest response, where a transient stops looking at frequencies


def steady_lines(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Steady-state lines, by wavenumber integrals.

    Parameters
    ----------
    compliance : Compliance
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre; may be a whole map
    threshold : of the strongest line of the load; only its lines above this are computed

    Returns
    -------
    frequencies (f,) in Hz >= 0 and complex amplitudes a (f, p) in metre of Re a exp(2 pi i f t)

    Raises
    ------
    ValueError
        If the focus is not Gaussian, or its path recorded, or as `pressure.check_lines` does.
    """
    f, amplitudes = field_lines(normal_field(compliance), pressure, probes, threshold=threshold)
    return f, amplitudes[..., 0]


def field_lines(
    field: Field, pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Steady-state lines of all components of a field.

    Parameters
    ----------
    field : Field
    pressure, probes, threshold : as of `steady_lines`

    Returns
    -------
    frequencies (f,) in Hz >= 0 and complex amplitudes a (f, p, m) of Re a exp(2 pi i f t)

    Raises
    ------
    ValueError
        As `steady_lines` does.
    """
    _check(pressure)
    if pressure.tacton.trajectory.shape == "recorded":
        raise ValueError("a recorded path has no steady state; ask for its motion from rest")
    lines = load_lines(pressure, threshold)
    f, which = np.unique(lines.frequencies, return_inverse=True)
    away = _offsets(pressure, probes)
    respond = _response_at(field, pressure, away, 2 * np.pi * f)
    weights = path_weights(pressure)
    blocks = max(1, away[..., 0].size * len(f) // AT_ONCE)
    amplitudes = [
        path_fourier(respond(part) * weights)[which, ..., lines.harmonics]
        * lines.coefficients[:, None, None]
        for part in np.array_split(away, min(blocks, len(away)))
    ]
    return merge_lines(lines.frequencies, np.hstack(amplitudes))


def sampled_lines(
    field: Field, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> tuple[Floats, Complex]:
    """Lines of `field_lines` that samples at some times can show.

    Parameters
    ----------
    field, pressure, probes : as of `field_lines`, with its errors
    times : (t,) float, s, equally spaced

    Returns
    -------
    frequencies (f,) in Hz >= 0 and complex amplitudes a (f, p, m)
    """
    f, a = field_lines(field, pressure, probes)
    below = shown(pressure, f, times)
    return f[below], a[below]


def steady_state(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Response:
    """Steady state, as if the load had always been there: its lines below half the sampling rate.

    That is `flat_body` without its initial transient, for a twentieth of the time.

    Parameters
    ----------
    compliance : Compliance
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre
    times : (t,) float, s, equally spaced

    Returns
    -------
    Response, displacement (t, p) in metre

    Raises
    ------
    ValueError
        As `steady_lines` does.
    """
    started = time.perf_counter()
    probes = np.atleast_2d(np.array(probes, np.float64))
    times = np.array(times)
    f, a = sampled_lines(normal_field(compliance), pressure, probes, times)
    found = synthesise(f, a[..., 0], times)
    return _timed("flat-body-harmonic", started, times, probes, found, steps=len(f), dofs=len(f))


def flat_body(
    compliance: Compliance, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Response:
    """Motion of probes from rest.

    By FFT over twice the duration with exponential damping, which reduces the wrap-around to 1e-5.
    Lines above half the sampling rate are left out. The rest position is that before the load: the
    deflection of an infinite sheet under a load with non-zero mean grows without bound.

    Parameters
    ----------
    compliance : Compliance
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre
    times : (t,) float, s, equally spaced

    Returns
    -------
    Response, displacement (t, p) in metre

    Raises
    ------
    ValueError
        If the focus is not Gaussian, or as `pressure.check_lines` does.
    """
    started = time.perf_counter()
    probes, times = np.atleast_2d(np.array(probes, np.float64)), np.array(times)
    found = field_history(normal_field(compliance), pressure, probes, times)[..., 0]
    effort = {"steps": len(times), "dofs": _padded(times) // 2 + 1}
    return _timed("flat-body", started, times, probes, found, **effort)


def field_history(
    field: Field, pressure: MovingPressure, probes: ArrayLike, times: Floats
) -> Floats:
    """All components of a field from rest, as `flat_body` computes them.

    Parameters
    ----------
    field : Field
    pressure, probes, times : as of `flat_body`

    Returns
    -------
    (t, p, m) float

    Raises
    ------
    ValueError
        As `flat_body` does.
    """
    _check(pressure)
    probes = np.atleast_2d(np.asarray(probes, np.float64))
    dt, n, padded = step(times), len(times), _padded(times)
    damping = -np.log(WRAPPED) / (padded * dt)
    t = np.asarray(np.arange(padded) * dt, np.float64)
    w = 2 * np.pi * np.fft.rfftfreq(padded, dt) - 1j * damping
    window = (np.arange(padded) < n) * np.exp(-damping * t)
    answered = _recorded if pressure.tacton.trajectory.shape == "recorded" else _circling
    u = answered(field, pressure, probes, w, window, dt)
    return np.fft.irfft(u, padded, axis=0)[:n] * np.exp(damping * t[:n, None, None])


def _padded(times: Floats) -> int:
    """Samples of the transform."""
    return int(PADDING * len(times))


def _timed(
    model: str, started: float, times: Floats, probes: Floats, displacement: Floats, **effort: int
) -> Response:
    """The response, with the seconds since its computation started."""
    seconds = {"evaluate": time.perf_counter() - started}
    return Response(
        model=model,
        times=times,
        probes=probes,
        values=displacement,
        effort=Effort(seconds=seconds, **effort),  # type: ignore[arg-type]
    )


def _circling(
    field: Field,
    pressure: MovingPressure,
    probes: Floats,
    w: Complex,
    window: Floats,
    dt: float,
) -> Complex:
    """Transform (f, p, m) of the field at the probes under foci that run a closed path."""
    f_d, away = pressure.tacton.trajectory.drawing_frequency, _offsets(pressure, probes)
    distance = np.linalg.norm(away, axis=-1)
    table, through = _interpolation(distance, _width(pressure))
    g = point_integrals(field, table, w, _width(pressure), negligible=NEGLIGIBLE)
    shares = through(np.eye(len(table)))(distance) * path_weights(pressure)
    h = path_fourier(np.einsum("mcpk,jpk->cjpmk", field.weights(away), shares))
    orders, _ = path_strengths(pressure, FAINT)
    h = h[..., orders] * foci_harmonics(pressure, orders)
    u = np.zeros((len(w), *h.shape[2:-1]), np.complex128)
    gain = cache(partial(_gain, pressure, window, dt))
    for n, of_path in zip(orders, np.moveaxis(h, -1, 0), strict=True):
        parts = finer(highest(pressure, abs(n) * f_d), dt)

        def turned(late: float, n: int = n, parts: int = parts) -> Complex:
            t, gained = gain(late, parts)
            return gained * np.exp(2j * np.pi * n * f_d * t)

        transformed = transform(turned, w, dt, parts)[:, None, None]
        u += np.tensordot(g, of_path, axes=([0, 2], [0, 1])) * transformed
    return u


def _gain(
    pressure: MovingPressure, window: Floats, dt: float, late: float, parts: int
) -> tuple[Floats, Floats]:
    """Times (t,) in s from `late` on, and the windowed pressure (t,) in Pa at the focus, averaged
    over the `parts` part of dt.
    """
    t = np.asarray(late + np.arange(len(window)) * dt, np.float64)
    gain = pressure.gain(t, over=dt / parts) * window
    if late == 0:
        gain[0] /= 2  # the trapezoidal rule's end point: the load begins in the middle of a sample
    return t, gain


def _recorded(
    field: Field,
    pressure: MovingPressure,
    probes: Floats,
    w: Complex,
    window: Floats,
    dt: float,
) -> Complex:
    """Transform (f, p, m) of the field at the probes under foci that run any path."""
    path, width = pressure.tacton.trajectory, _width(pressure)
    furthest = np.linalg.norm(probes[:, None] - path.outline, axis=2).max()
    table = distance_table(furthest, width)
    g = point_integrals(field, table, w, width, negligible=NEGLIGIBLE)
    carriers = radial_spline(table, np.eye(len(table)))
    parts = finer(reached(pressure), dt)

    def load(late: float, probe: Floats, component: int, integral: int) -> Floats:
        t, gain = _gain(pressure, window, dt, late, parts)
        phases = [np.mod(path.phase(t) + ahead, 1.0) for ahead in pressure.tacton.foci]
        away = [probe - path.at_phase(phase) for phase in phases]
        gains = [gain * pressure.weight(phase) for phase in phases]
        return sum(
            (q * field.weights(x)[component, integral])[:, None]
            * carriers(np.linalg.norm(x, axis=1))
            for q, x in zip(gains, away, strict=True)
        )

    weights = field.weights(ANYWHERE)  # not where x, y or x^2 - y^2 is 0
    u = np.zeros((len(w), len(probes), len(weights)), np.complex128)
    for i, probe in enumerate(probes):
        for component, integral in np.argwhere(weights.any(axis=-1)):
            loaded = partial(load, probe=probe, component=component, integral=integral)
            u[:, i, component] += (g[integral] * transform(loaded, w, dt, parts)).sum(axis=1)
    return u


def distance_table(furthest: float, width: float) -> Floats:
    """Distances (j,) in metre up to `furthest` to interpolate between: the response is as smooth as
    the focal spot, of standard deviation `width` in metre.
    """
    steps = max(FEWEST_STEPS, int(np.ceil(furthest / width * STEPS_PER_WIDTH)))
    return np.linspace(0, furthest, steps)


def radial_spline(table: Floats, values: Complex | Floats, axis: int = 0) -> CubicSpline:
    """Cubic spline through values at distances, flat at distance 0.

    Parameters
    ----------
    table : (j,) float, metre, from 0
    values : array of j along `axis`
    axis : int

    Returns
    -------
    CubicSpline of a distance (...), which replace that axis
    """
    from scipy.interpolate import CubicSpline  # which takes long to import

    flat = (1, np.zeros(np.delete(values.shape, axis), values.dtype))
    return CubicSpline(table, values, axis=axis, bc_type=(flat, "not-a-knot"))


def _check(pressure: MovingPressure) -> None:
    check_lines(pressure)
    if gaussian_width(pressure.height, pressure.profile) is None:
        raise ValueError(
            f"focus '{pressure.profile_name}' has no flat-body solution; use 'gaussian'"
        )


def _width(pressure: MovingPressure) -> float:
    """Standard deviation in metre of the focal spot, which `_check` has found to be Gaussian."""
    width = gaussian_width(pressure.height, pressure.profile)
    assert width is not None
    return width


def _offsets(pressure: MovingPressure, probes: ArrayLike) -> Floats:
    """Offsets (p, k, 2) in metre of the probes from knots of the path."""
    return np.atleast_2d(np.asarray(probes, np.float64))[:, None] - path_samples(pressure)


def _interpolation(
    distance: Floats, width: float
) -> tuple[Floats, Callable[[Complex | Floats], Callable[[Floats], Complex | Floats]]]:
    """Distances (j,) in metre to integrate at, and the interpolant of values (..., j) there: of few
    distances each one, between many a spline.
    """
    unique = np.unique(distance)
    if len(unique) <= FEW_DISTANCES:
        return unique, lambda values: lambda r: values[..., np.searchsorted(unique, r)]
    table = distance_table(distance.max(), width)
    return table, partial(radial_spline, table, axis=-1)


def _response_at(
    field: Field, pressure: MovingPressure, offsets: Floats, w: ArrayLike
) -> Callable[[Floats], Complex]:
    """Components (f, p, m, k) at any of these offsets (p, k, 2) in metre from the focus."""
    width = _width(pressure)
    table, through = _interpolation(np.linalg.norm(offsets, axis=-1), width)
    integrals = through(point_integrals(field, table, w, width))

    def components(away: Floats) -> Complex:
        integral = integrals(np.linalg.norm(away, axis=-1))
        return np.einsum("mcpk,cfpk->fpmk", field.weights(away), integral)

    return components
