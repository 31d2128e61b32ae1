"""Wavenumbers in the motion of a line of probes, beside a body's dispersion curves.

A pulse of pressure on a focus at rest moves probes on the x axis. Their transfer function, motion
over the pulse at each frequency, is transformed along x for a picture. As bodies are few
wavelengths wide, wavenumbers are better read from a fit: a sum of Hankel functions
sum_j a_j H_0^(2)(k_j r) in least squares beyond the focal spot, begun by the matrix pencil (Y. Hua
and T. K. Sarkar, IEEE Trans Acoust Speech Signal Process 38:814 (1990)) and refined by variable
projection.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import hankel2

from meshes.tetmesh import Floats
from simple_model import MovingPressure, Rhythm, Tacton
from simple_model.dispersion import DispersionCurves
from simple_model.focus import lobe_width
from simple_model.material import Complex
from simple_model.response import Response, step
from skinwave.load import PRESSURE
from skinwave.scene import Scene

PULSE, RAMP = 2e-3, 1e-3  # s: how long the pulse lasts, and its rise and fall
DURATION = 0.12  # s, in which it has passed
NEAREST, SPACING, MARGIN = 5e-3, 1e-3, 5e-3  # m: first probe, between probes, before the edge
FURTHEST = 60e-3  # m
BEYOND = 1.5  # of the main lobe's radius: where a sum of modes is the motion within 0.1 %
WAVES = 3  # at most, in a fit
MISFIT = 0.02  # of the motion, above which a fit says nothing
LEADS = 0.5  # of the magnitudes of all modes where the fit begins: what the strongest must have
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
    first, their motion there (f, n) in m/Pa, and the relative misfit (f,); NaN where there are
    fewer.
    """

    frequencies: Floats
    wavenumbers: Complex
    amplitudes: Complex
    misfit: Floats


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
    return replace(scene, pressure=pressure, probes=probes, load=PRESSURE)


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


def ridge(wavenumbers: Floats, magnitudes: Floats) -> Floats:
    """Wavenumber (f,) in 1/m at which a spectrum is largest at each frequency."""
    return np.asarray(wavenumbers[magnitudes.argmax(axis=1)])


def fitted_waves(line: LineOfProbes, height: float) -> FittedWaves:
    """Hankel functions fitted to the motion beyond the focal spot of a height in metre."""
    edge = BEYOND * lobe_width(height)
    beyond = line.distances >= edge
    r = line.distances[beyond]
    shape = (len(line.frequencies), WAVES)
    wavenumbers, amplitudes = np.full((2, *shape), np.nan + 0j)
    misfit = np.zeros(len(line.frequencies))
    for n, motion in enumerate(line.transfer[:, beyond]):
        k, a, misfit[n] = _fitted(r, motion)
        at_edge = a * hankel2(0, k * edge)
        order = np.argsort(-np.abs(at_edge))
        wavenumbers[n, : len(k)], amplitudes[n, : len(k)] = k[order], at_edge[order]
    return FittedWaves(
        frequencies=line.frequencies, wavenumbers=wavenumbers, amplitudes=amplitudes, misfit=misfit
    )


def _fitted(r: Floats, motion: Complex) -> tuple[Complex, Complex, float]:
    """Wavenumbers and coefficients of Hankel functions, and the relative misfit."""
    start = _matrix_pencil(motion * np.sqrt(r), r[1] - r[0])
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
    x = least_squares(residual, x0, bounds=(low, np.inf), x_scale=np.maximum(np.abs(x0), 10.0)).x
    a, rest = projected(x)
    return _wavenumbers(x), a, float(np.linalg.norm(rest))


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
    (g,) that was fitted.
    """

    frequencies: Floats
    modes: Complex
    fitted: Complex

    @property
    def apart(self) -> Floats:
        """Relative difference (g,) of their real parts."""
        return np.asarray(np.abs(self.fitted.real / self.modes.real - 1))


def matched_modes(
    curves: DispersionCurves, fitted: FittedWaves, height: float, width: float
) -> Matched:
    """Modes beside fitted waves, at frequencies where a fit leaves less than 2 % of the motion and
    one propagating mode has more than half of the magnitudes of all.

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
    found = []
    for n, f in enumerate(fitted.frequencies):
        best = int(np.argmax(share[:, n]))
        leads = share[best, n] > LEADS and curves.modes[best].is_wave[n]
        waves = fitted.wavenumbers[n][np.isfinite(fitted.wavenumbers[n])]
        if leads and fitted.misfit[n] < MISFIT:
            k = curves.modes[best].wavenumbers[n]
            found.append((f, k, waves[np.argmin(np.abs(waves - k))]))
    f, k, own = np.array(found, np.complex128).reshape(-1, 3).T
    return Matched(frequencies=f.real, modes=k, fitted=own)
