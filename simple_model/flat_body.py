"""Wavenumber-integral solution, without a mesh, for a half-space, an infinite slab on a rigid base
or an infinite thin sheet.

A pressure q displaces the surface by u = G q at each wavenumber k and complex frequency w (time
exp(+i w t)). A focal spot S of unit pressure at the focus displaces a point at distance r by

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J0(k r) k dk

and a focus that runs a closed path at f_d = 1/T, x(t) = X(f_d t), moves a probe by

    u(w) = sum_n h_n(w) Q(w - 2 pi n f_d),   h_n = int_0^1 g(|x_p - X(a)|, w) exp(-2 pi i n a) da

where Q is the transform of the pressure at the focus. A recorded path may be long and run through
once; with splines B_j(r) that interpolate g(r, w) = sum_j g_j(w) B_j(r), it moves the probe by

    u(w) = sum_j g_j(w) int q(t) B_j(|x_p - x(t)|) exp(-i w t) dt

The path of integration over k runs above the real axis, away from the poles of forward waves, which
lie below it for any loss; and below those of backward waves, which lie above it.
"""

import time
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.special import jv

from simple_model.compliance import Compliance
from simple_model.focus import spot_width
from simple_model.load_spectrum import (
    foci_harmonics,
    harmonics,
    load_lines,
    merge_lines,
    path_fourier,
    path_samples,
    synthesise,
)
from simple_model.material import Complex
from simple_model.pressure import MovingPressure, check_lines
from simple_model.response import Effort, Response, step
from simple_model.sampling import finer, highest, reached, shown, transform
from simple_model.trajectory import Floats

PADDING = 2.0  # the transform's period over the duration; what wraps round is damped by WRAPPED
WRAPPED = 1e-5
INTEGRATION_ERROR = 1e-5  # relative change at which the wavenumber grid is fine enough
FEWEST_NODES, MOST_NODES = 128, 2**16  # of the wavenumber grid
AT_ONCE = 2**19  # pairs of frequency and wavenumber: some hundred megabytes
FEW_DISTANCES = 40  # are integrated one by one, without a spline
UNRESOLVED = "the wavenumber integral does not converge; add some loss"
CHECKED_EACH = 8  # batches: how often the grid is checked by halving
BATCH = 256  # frequencies at a time
NEGLIGIBLE = 1e-4  # of the largest response, where a transient stops looking at frequencies


def point_response(
    compliance: Compliance,
    distances: ArrayLike,
    frequencies: ArrayLike,
    width: float,
    *,
    negligible: float = 0.0,
) -> Complex:
    """Response g(r, w) to a Gaussian focal spot of 1 Pa.

    Parameters
    ----------
    compliance : Compliance
    distances : (r,) float, metre
    frequencies : (f,) float or complex, rad/s, with imaginary part <= 0
    width : metre, standard deviation of the spot
    negligible : a batch of frequencies that stays below this fraction of the largest response so
        far is the last one computed; for frequencies that rise

    Returns
    -------
    (f, r) complex, m/Pa

    Raises
    ------
    ArithmeticError
        If the wavenumber grid cannot be made fine enough.
    """
    r = np.atleast_1d(np.asarray(distances, np.float64))
    w = np.atleast_1d(np.asarray(frequencies, np.complex128))
    found = np.zeros((len(w), len(r)), np.complex128)
    n, before = FEWEST_NODES, 0.0
    for start in range(0, len(w), BATCH):
        part = slice(start, start + BATCH)
        lift = _lift(compliance, r, w[part], width)
        if lift != before or start % (CHECKED_EACH * BATCH) == 0:
            least = n if lift == before else FEWEST_NODES
            n = _enough_nodes(compliance, r, w[part], width, lift, least)
        before = lift
        found[part] = _integrated(compliance, r, w[part], width, lift, n)
        if np.abs(found[part]).max() < negligible * np.abs(found[: part.stop]).max():
            break
    return found


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
    _check(pressure)
    if pressure.tacton.trajectory.shape == "recorded":
        raise ValueError("a recorded path has no steady state; ask for its motion from rest")
    probes = np.atleast_2d(np.asarray(probes, np.float64))
    lines = load_lines(pressure, threshold)
    f, which = np.unique(lines.frequencies, return_inverse=True)
    distance = _distances(pressure, probes)
    respond = _response_at(compliance, pressure, distance, 2 * np.pi * f)
    blocks = max(1, distance.size * len(f) // AT_ONCE)
    amplitudes = [
        path_fourier(respond(part))[which, :, lines.harmonics] * lines.coefficients[:, None]
        for part in np.array_split(distance, min(blocks, len(distance)))
    ]
    return merge_lines(lines.frequencies, np.hstack(amplitudes))


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
    f, a = steady_lines(compliance, pressure, probes)
    times = np.array(times)
    below = shown(pressure, f, times)
    f, a = f[below], a[below]
    effort = {"steps": len(f), "dofs": len(f)}
    return _timed("flat-body-harmonic", started, times, probes, synthesise(f, a, times), **effort)


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
    _check(pressure)
    started = time.perf_counter()
    probes = np.atleast_2d(np.array(probes, np.float64))
    dt, n = step(times), len(times)
    padded = int(PADDING * n)
    damping = -np.log(WRAPPED) / (padded * dt)
    t = np.asarray(np.arange(padded) * dt, np.float64)
    w = 2 * np.pi * np.fft.rfftfreq(padded, dt) - 1j * damping
    window = (np.arange(padded) < n) * np.exp(-damping * t)
    answered = _recorded if pressure.tacton.trajectory.shape == "recorded" else _circling
    u = answered(compliance, pressure, probes, w, window, dt)
    displacement = np.fft.irfft(u, padded, axis=0)[:n] * np.exp(damping * t[:n, None])
    effort = {"steps": n, "dofs": len(w)}
    return _timed("flat-body", started, np.array(times), probes, displacement, **effort)


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
    compliance: Compliance,
    pressure: MovingPressure,
    probes: Floats,
    w: Complex,
    window: Floats,
    dt: float,
) -> Complex:
    """Transform (f, p) of the probes' motion under foci that run a closed path."""
    f_d = pressure.tacton.trajectory.drawing_frequency
    u = np.zeros((len(w), len(probes)), np.complex128)
    h = path_fourier(_on_path(compliance, pressure, probes, w, NEGLIGIBLE))
    orders = harmonics(h.shape[2])
    h[:, :, orders] *= foci_harmonics(pressure, orders)
    largest = np.abs(h).max()
    gain = cache(partial(_gain, pressure, window, dt))
    for m in orders:
        if np.abs(h[:, :, m]).max() > 1e-7 * largest:
            parts = finer(highest(pressure, abs(m) * f_d), dt)

            def turned(late: float, m: int = m, parts: int = parts) -> Complex:
                t, gained = gain(late, parts)
                return gained * np.exp(2j * np.pi * m * f_d * t)

            u += h[:, :, m] * transform(turned, w, dt, parts)[:, None]
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
    compliance: Compliance,
    pressure: MovingPressure,
    probes: Floats,
    w: Complex,
    window: Floats,
    dt: float,
) -> Complex:
    """Transform (f, p) of the probes' motion under foci that run any path."""
    path, width = pressure.tacton.trajectory, spot_width(pressure.height)
    furthest = np.linalg.norm(probes[:, None] - path.outline, axis=2).max()
    table = _table(furthest, width)
    g = point_response(compliance, table, w, width, negligible=NEGLIGIBLE)
    carriers = _spline(table, np.eye(len(table)))
    parts = finer(reached(pressure), dt)

    def load(late: float, probe: Floats) -> Floats:
        t, gain = _gain(pressure, window, dt, late, parts)
        phases = [np.mod(path.phase(t) + ahead, 1.0) for ahead in pressure.tacton.foci]
        away = [np.linalg.norm(probe - path.at_phase(phase), axis=1) for phase in phases]
        gains = [gain * pressure.weight(phase) for phase in phases]
        return sum(q[:, None] * carriers(r) for q, r in zip(gains, away, strict=True))

    loads = [transform(partial(load, probe=probe), w, dt, parts) for probe in probes]
    return np.stack([(g * each).sum(axis=1) for each in loads], axis=1)


def _table(furthest: float, width: float) -> Floats:
    """Distances (j,) in metre to interpolate between: g is as smooth as the focal spot."""
    return np.linspace(0, furthest, max(8, int(np.ceil(furthest / width * 6))))


def _spline(table: Floats, values: Complex | Floats, axis: int = 0) -> CubicSpline:
    """A spline that is flat at distance 0."""
    flat = (1, np.zeros(np.delete(values.shape, axis), values.dtype))
    return CubicSpline(table, values, axis=axis, bc_type=(flat, "not-a-knot"))


def _check(pressure: MovingPressure) -> None:
    check_lines(pressure)
    if pressure.profile != "gaussian":
        raise ValueError(
            f"focus '{pressure.profile_name}' has no flat-body solution; use 'gaussian'"
        )


def _lift(compliance: Compliance, r: Floats, w: Complex, width: float) -> float:
    """Height above the real axis, 1/m, of the path of integration."""
    highest = 1.5 / max(float(r.max()), 5 * width)  # J0 grows by e^1.5 at most
    lift = min(highest, compliance.clearance(w))
    if not lift > 0:
        raise ArithmeticError(UNRESOLVED)
    return lift


def _enough_nodes(
    compliance: Compliance, r: Floats, w: Complex, width: float, lift: float, n: int
) -> int:
    """The fewest wavenumbers, from n, that twice as many do not improve on."""
    coarse = _integrated(compliance, r, w, width, lift, n)
    while n < MOST_NODES:
        fine = _integrated(compliance, r, w, width, lift, 2 * n)
        if np.abs(fine - coarse).max() <= INTEGRATION_ERROR * np.abs(fine).max():
            return n
        coarse, n = fine, 2 * n
    raise ArithmeticError(UNRESOLVED)


def _integrated(
    compliance: Compliance, r: Floats, w: Complex, width: float, lift: float, n: int
) -> Complex:
    """The wavenumber integral by Gauss-Legendre nodes on panels along the raised path."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    # Panels grow away from k = 0, near which the waves of low frequencies have their poles.
    edges = 6.5 / width * np.linspace(0, 1, n // 16 + 1) ** 2
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    x = (middle[:, None] + half[:, None] * nodes).ravel()
    dx = (half[:, None] * weights).ravel()
    ramp = np.tanh(x / lift)
    k, dk = x + 1j * lift * ramp, 1 + 1j * (1 - ramp**2)
    spot = 2 * np.pi * width**2 * np.exp(-((k * width) ** 2) / 2)
    weight = spot * k * dk * dx / (2 * np.pi)
    bessel = jv(0, k[:, None] * r)
    some = np.array_split(w[:, None], max(1, len(w) * n // AT_ONCE))
    return np.concatenate([(compliance(k, part) * weight) @ bessel for part in some])


def _distances(pressure: MovingPressure, probes: Floats) -> Floats:
    """Distances (p, k) in metre from the probes to knots of the path."""
    return np.linalg.norm(probes[:, None] - path_samples(pressure), axis=2)


def _on_path(
    compliance: Compliance,
    pressure: MovingPressure,
    probes: Floats,
    w: ArrayLike,
    negligible: float = 0.0,
) -> Complex:
    """Point response g (f, p, k) from knots of the path to the probes."""
    distance = _distances(pressure, probes)
    return _response_at(compliance, pressure, distance, w, negligible)(distance)


def _response_at(
    compliance: Compliance,
    pressure: MovingPressure,
    distance: Floats,
    w: ArrayLike,
    negligible: float = 0.0,
) -> Callable[[Floats], Complex]:
    """Point response g (f, ...) at any of these distances in metre: computed at each of few,
    interpolated by a spline between many.
    """
    width = spot_width(pressure.height)
    unique = np.unique(distance)
    if len(unique) <= FEW_DISTANCES:
        g = point_response(compliance, unique, w, width, negligible=negligible)
        return lambda some: g[:, np.searchsorted(unique, some)]
    table = _table(distance.max(), width)
    spline = _spline(
        table, point_response(compliance, table, w, width, negligible=negligible), axis=1
    )
    return lambda some: np.asarray(spline(some))
