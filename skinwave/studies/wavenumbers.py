"""Wavenumbers in the motion of a line of probes, beside a body's dispersion curves.

A pulse of pressure on a focus at rest moves probes on the x axis. Their transfer function, motion
over the pulse at each frequency, is transformed along x for a picture. As bodies are few
wavelengths wide, wavenumbers are better read from a fit: a sum of Hankel functions
sum_j a_j H_0^(2)(k_j r) in least squares beyond the focal spot, begun by the matrix pencil (Y. Hua
and T. K. Sarkar, IEEE Trans Acoust Speech Signal Process 38:814 (1990)), or by the fit at the next
frequency if that is better, and refined by variable projection. A wave counts as resolved if its
wavenumber has a small standard error, by the misfit that is left, and if it does not fade along the
line to where reflections and the errors of elements are as large as it is.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import hankel2

from meshes.tetmesh import Floats
from simple_model import MovingPressure, Response, Rhythm, Tacton
from simple_model.layers.dispersion import DispersionCurves
from simple_model.load.focus import lobe_width
from simple_model.load.sampling import step
from simple_model.quantities import DISPLACEMENT
from simple_model.typing import Complex
from skinwave.scene.load import PRESSURE
from skinwave.scene.scene import Scene

PULSE, RAMP = 2e-3, 1e-3  # s: how long the pulse lasts, and its rise and fall
DURATION = 0.12  # s, in which it has passed
NEAREST, SPACING, MARGIN = 5e-3, 1e-3, 5e-3  # m: first probe, between probes, before the edge
FURTHEST = 60e-3  # m
BEYOND = 1.5  # of the main lobe's radius: where a sum of modes is the motion within 0.1 %
WAVES = 3  # at most, in a fit
MISFIT = 0.02  # of the motion, above which a fit says nothing
LEADS = 0.5  # of the magnitudes of all modes where the fit begins: what the strongest must have
UNSURE = 0.03  # relative standard error of a wavenumber that is not resolved
FADED = 3.0  # nepers: to a twentieth along the line
FAINT = 1e-3  # of the largest singular value: what is no wave of its own
MOST_PADDED = 1024  # wavenumbers of a spectrum


@dataclass(frozen=True, kw_only=True, eq=False)
class LineOfProbes:
    """Transfer functions (f, r) in m/Pa at frequencies (f,) in Hz and distances (r,) in metre."""

    frequencies: Floats
    distances: Floats
    transfer: Complex


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedWaves:
    """Wavenumbers (f, n) in 1/m of exp(i (w t - k x)), the strongest where the fit begins
    first, their motion there (f, n) in m/Pa, the relative standard errors (f, n) of their real
    parts, and the relative misfit (f,); NaN where there are fewer. The `aperture` in metre is that
    of the fit.
    """

    frequencies: Floats
    wavenumbers: Complex
    amplitudes: Complex
    errors: Floats
    misfit: Floats
    aperture: float

    @property
    def is_resolved(self) -> NDArray[np.bool_]:
        """Mask (f, n) of waves that the line resolves."""
        faded = np.abs(self.wavenumbers.imag) * self.aperture > FADED
        return (self.errors <= UNSURE) & ~faded


def pulse_scene(scene: Scene) -> Scene:
    """The scene with a pulse on a focus at rest above the origin, and probes along the x axis up to
    the edge of the body.

    Raises
    ------
    ValueError
        If the body ends too near to the focus.
    """
    body, height = scene.body, scene.pressure.height
    end = body.width / 2 - MARGIN if body.of_kind.is_bounded else FURTHEST
    count = int((min(end, FURTHEST) - NEAREST) / SPACING + 1e-9) + 1
    if count < 20:
        raise ValueError(
            f"the body ends {1e3 * body.width / 2:g} mm from the focus, too near to see waves "
            f"along x; give a size_x_mm of {1e3 * 2 * (NEAREST + MARGIN + 20 * SPACING):g} or more"
        )
    rhythm = Rhythm(pulses=((PULSE, DURATION - PULSE),), ramp=RAMP)
    tacton = Tacton(duration=DURATION, rhythm=rhythm)
    pressure = MovingPressure(
        tacton=tacton, drive="force_corrected", depth_of_modulation=0.0, height=height
    )
    probes = tuple((NEAREST + SPACING * n, 0.0) for n in range(count))
    return replace(
        scene,
        pressure=pressure,
        probes=probes,
        load=PRESSURE,
        quantity=DISPLACEMENT.name,
        depth=0.0,
    )


def transfer_functions(scene: Scene, response: Response, highest: float) -> LineOfProbes:
    """Transfer functions of a response to `pulse_scene`.

    Parameters
    ----------
    scene : Scene, with the pulse
    response : Response
    highest : Hz

    Returns
    -------
    LineOfProbes
    """
    dt = step(response.times)
    pulse = scene.pressure.gain(response.times, over=dt)
    f = np.fft.rfftfreq(len(response.times), dt)
    kept = (f > 0) & (f <= highest)
    found = np.fft.rfft(response.displacement, axis=0)[kept]
    transfer = found / np.fft.rfft(pulse)[kept][:, None]
    distances = np.abs(response.probes[:, 0])
    kept_f: Floats = np.asarray(f[kept], np.float64)
    return LineOfProbes(frequencies=kept_f, distances=distances, transfer=transfer)


def wavenumber_spectrum(line: LineOfProbes, most: float) -> tuple[Floats, Floats]:
    """Magnitude over wavenumber of outgoing waves, with a Hann window along the line; the root of
    the distance makes up for their spreading.

    Parameters
    ----------
    line : LineOfProbes
    most : 1/m, up to which wavenumbers are returned

    Returns
    -------
    wavenumbers (k,) in 1/m and magnitudes (f, k), over the largest at each frequency
    """
    spacing = line.distances[1] - line.distances[0]
    signal = line.transfer * np.sqrt(line.distances) * np.hanning(len(line.distances))
    k = 2 * np.pi * np.fft.fftfreq(MOST_PADDED, spacing)
    magnitude = np.abs(np.fft.fft(signal, MOST_PADDED, axis=1)[:, np.argsort(-k)])
    k = np.sort(-k)
    kept = (k >= 0) & (k <= most)
    shown = magnitude[:, kept]
    return k[kept], shown / shown.max(axis=1, keepdims=True)


def fitted_waves(line: LineOfProbes, height: float) -> FittedWaves:
    """Hankel functions fitted to the motion beyond the focal spot of a height in metre."""
    edge = BEYOND * lobe_width(height)
    beyond = line.distances >= edge
    r = line.distances[beyond]
    found = _fits(r, line.transfer[:, beyond])
    shape = (len(line.frequencies), WAVES)
    wavenumbers, amplitudes = np.full((2, *shape), np.nan + 0j)
    errors = np.full(shape, np.nan)
    for n, fit in enumerate(found):
        at_edge = fit.coefficients * hankel2(0, fit.wavenumbers * edge)
        order, own = np.argsort(-np.abs(at_edge)), slice(len(at_edge))
        wavenumbers[n, own], amplitudes[n, own] = fit.wavenumbers[order], at_edge[order]
        errors[n, own] = fit.errors[order]
    return FittedWaves(
        frequencies=line.frequencies, wavenumbers=wavenumbers, amplitudes=amplitudes,
        errors=errors, misfit=np.array([fit.misfit for fit in found]), aperture=float(np.ptp(r)),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Wavenumbers and coefficients (n,) of Hankel functions at one frequency, the relative standard
    errors (n,) of their real parts, and the relative misfit.
    """

    wavenumbers: Complex
    coefficients: Complex
    errors: Floats
    misfit: float


def _fits(r: Floats, motions: Complex) -> list[_Fit]:
    """The fit of the motion (f, r) at each frequency, the best of those that begin by the matrix
    pencil, and by the fits below and above it.
    """
    found = [_fitted(r, motion, _matrix_pencil(motion * np.sqrt(r), r[1] - r[0]))
             for motion in motions]  # fmt: skip
    upwards = [(n, n - 1) for n in range(1, len(found))]
    downwards = [(n - 1, n) for n, _ in reversed(upwards)]
    for n, other in [*upwards, *downwards]:
        near = _fitted(r, motions[n], found[other].wavenumbers)
        if near.misfit < found[n].misfit:
            found[n] = near
    return found


def _fitted(r: Floats, motion: Complex, start: Complex) -> _Fit:
    """Hankel functions that fit a motion (r,) best, from the wavenumbers (n,) of a start."""
    from scipy.optimize import least_squares  # which takes long to import

    weights = np.sqrt(r)

    def projected(x: Floats) -> tuple[Complex, Complex]:
        k = _wavenumbers(x)
        basis = hankel2(0, k * r[:, None]) * weights[:, None]
        a = np.asarray(np.linalg.lstsq(basis, motion * weights, rcond=None)[0])
        return a, (basis @ a - motion * weights) / np.linalg.norm(motion * weights)

    def residual(x: Floats) -> Floats:
        rest = projected(x)[1]
        return np.concatenate([rest.real, rest.imag])

    low = np.tile([-np.inf, 0.0], len(start))
    x0 = np.column_stack([start.real, np.maximum(-start.imag, 1e-3)]).ravel()
    scale = np.maximum(np.abs(x0), 10.0)
    best = least_squares(residual, x0, bounds=(low, np.inf), x_scale=scale)
    a, rest = projected(best.x)
    k, misfit = _wavenumbers(best.x), float(np.linalg.norm(rest))
    freedom = max(1, 2 * len(r) - 4 * len(k))
    spread = np.diag(np.linalg.pinv(best.jac.T @ best.jac))[::2] * misfit**2 / freedom
    return _Fit(
        wavenumbers=k, coefficients=a, misfit=misfit,
        errors=np.sqrt(spread) / np.maximum(np.abs(k.real), 1e-9),
    )  # fmt: skip


def _wavenumbers(x: Floats) -> Complex:
    """Wavenumbers (n,) of real and negative imaginary parts one after another (2 n,)."""
    return np.asarray(x[::2] - 1j * x[1::2])


def _matrix_pencil(signal: Complex, spacing: float) -> Complex:
    """Wavenumbers (n,) in 1/m, with Im k <= 0, of the exponentials that a signal is made of."""
    size = len(signal) // 2
    rows = np.lib.stride_tricks.sliding_window_view(signal, size)
    _, sizes, right = np.linalg.svd(rows, full_matrices=False)
    count = min(WAVES, max(1, int((sizes > FAINT * sizes[0]).sum())))
    basis = right[:count].T
    turns = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    k = 1j * np.log(turns) / spacing
    return np.asarray(np.where(k.imag > 0, k.conj(), k))


@dataclass(frozen=True, kw_only=True, eq=False)
class Matched:
    """The leading mode at frequencies (g,) in Hz, its wavenumber (g,) in 1/m, and the nearest one
    (g,) that was fitted; and at how many frequencies more the line does not resolve it.
    """

    frequencies: Floats
    modes: Complex
    fitted: Complex
    unresolved: int = 0

    @property
    def apart(self) -> Floats:
        """Relative difference (g,) of their real parts."""
        return np.asarray(np.abs(self.fitted.real / self.modes.real - 1))


def matched_modes(
    curves: DispersionCurves, fitted: FittedWaves, height: float, width: float
) -> Matched:
    """Modes beside fitted waves, at frequencies where a fit leaves less than 2 % of the motion, one
    propagating mode has more than half of the magnitudes of all, and the line resolves the wave
    that is nearest to it.

    Parameters
    ----------
    curves : DispersionCurves, at the frequencies of the fit
    fitted : FittedWaves
    height : metre, of the focus
    width : metre, standard deviation of the focal spot

    Returns
    -------
    Matched
    """
    at = BEYOND * lobe_width(height)
    size = np.nan_to_num([np.abs(mode.amplitude(width, at)) for mode in curves.modes])
    share = size / size.sum(axis=0)
    found, unresolved = [], 0
    for n, f in enumerate(fitted.frequencies):
        best = int(np.argmax(share[:, n]))
        leads = share[best, n] > LEADS and curves.modes[best].is_wave[n]
        waves, k = fitted.wavenumbers[n], curves.modes[best].wavenumbers[n]
        if leads and fitted.misfit[n] < MISFIT:
            nearest = int(np.nanargmin(np.abs(waves - k)))
            if fitted.is_resolved[n, nearest]:
                found.append((f, k, waves[nearest]))
            else:
                unresolved += 1
    f, k, own = np.array(found, np.complex128).reshape(-1, 3).T
    return Matched(frequencies=f.real, modes=k, fitted=own, unresolved=unresolved)
