"""Delay and gain between a measurement and a model: measured(t) = gain * model(t - delay).

Both follow from the complex amplitudes of the lines by weighted least squares: the gain in closed
form for each delay, and the delay as the maximum of the correlation of the lines.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from skinwave.measure.delays import correlation, maxima
from skinwave.measure.lines import MeasuredLines
from skinwave.measure.misfit import LARGEST_MISFIT, beyond_noise, systematic, unexplained
from skinwave.typing import Floats

AS_GOOD = 10.83  # of chi-square: 99.9 % of one degree of freedom
PRIOR_FREEDOM = 20.0  # degrees of freedom of the variance that all lines share


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """Gain and delay: measured(t) = gain * model(t - delay).

    Parameters
    ----------
    delay, delay_error : s, and its standard error from noise and misfit: 0 for a given delay, nan
        if unknown or if the model does not describe the record
    gain, gain_error : in units of the measurement per unit of the model, and its standard error
    repeats : s, distance to the nearest other delay that fits equally well within the noise; inf if
        the window has none
    chi_square : chi-square of the residual per degree of freedom; 1 for noise
    misfit, unexplained : RMS of the residual over that of the measured lines, and the part of it
        beyond the noise
    """

    delay: float
    delay_error: float
    gain: float
    gain_error: float
    repeats: float = np.inf
    chi_square: float = np.nan
    misfit: float = np.nan
    unexplained: float = 0.0

    @property
    def is_described(self) -> bool:
        """Whether the model describes the record well enough for errors of gain and delay."""
        return self.unexplained <= LARGEST_MISFIT

    def apply(self, frequencies: Floats, model: np.ndarray) -> np.ndarray:
        """Apply gain and delay to the amplitudes (f, p) of a model."""
        turned = np.exp(-2j * np.pi * frequencies * self.delay)
        return np.asarray(self.gain * turned[:, None] * model)


def align(
    lines: MeasuredLines,
    model: np.ndarray,
    *,
    window: float = 2.0,
    centre: float = 0.0,
    delay: float | None = None,
    gain: float | None = None,
) -> Alignment:
    """Return delay and gain by weighted least squares over the lines.

    The gain is positive unless another is given. Among delays that fit equally well within the
    noise, such as those one period apart, the smallest is taken.

    Parameters
    ----------
    lines : MeasuredLines
    model : (f, p) complex, amplitudes of the same lines in the model
    window, centre : s, the search covers delays within half a window of the centre
    delay : s, if known
    gain : in units of the measurement per unit of the model, if known

    Returns
    -------
    Alignment; noise may vary between places, and a misfit beyond the noise is systematic

    Raises
    ------
    ValueError
        If the model has none of the lines or a given number is not finite.
    """
    for name, value in (("delay", delay), ("gain", gain)):
        if value is not None and not np.isfinite(value):
            raise ValueError(f"{name} = {value} must be a finite number; leave it out to fit it")
    f, weights = lines.frequencies, _weights(lines)
    size = float((weights * np.abs(model) ** 2).sum())
    if not size > 0:
        raise ValueError("the model has none of the measured lines; compare one that moves")
    products = (weights * model.conj() * lines.mean).sum(axis=1)
    best, repeats = float(delay or 0.0), np.inf
    if delay is None:
        signed = products * np.sign(gain or 1.0)
        best, repeats = _best_delay(lines, signed, size, abs(gain or 0.0), window, centre)
    height, bend = (float(correlation(f, products, np.array([best]), n)[0]) for n in (0, 2))
    fitted = height / size if gain is None else float(gain)
    turned = weights * (model * np.exp(-2j * np.pi * f * best)[:, None]).conj()
    scale = -1 / bend * np.sign(fitted) if -bend * fitted > 0 else np.inf
    result = Alignment(delay=best, gain=fitted, repeats=repeats, delay_error=0.0, gain_error=0.0)
    away = lines.mean - result.apply(f, model)
    dof = 2 * away.size - (delay is None) - (gain is None)
    cost = 2 * float((weights * np.abs(away) ** 2).sum())
    misfit = float(np.linalg.norm(away)) / max(float(np.linalg.norm(lines.mean)), 1e-300)
    is_known = bool((lines.variance > 0).any())
    freedom = PRIOR_FREEDOM + float(np.min(lines.freedom)) if is_known else 0.0
    beyond = beyond_noise(cost, dof, freedom) if dof > 0 else 0.0
    result = replace(
        result, misfit=misfit, unexplained=unexplained(misfit, beyond, cost),
        chi_square=cost / dof if dof > 0 and is_known else np.nan,
    )  # fmt: skip

    def error(factors: np.ndarray) -> float:
        if not result.is_described or not (is_known or dof > 0):
            return np.nan
        along = float(np.sqrt((np.abs(factors) ** 2 / weights).sum() / 2))
        return float(np.hypot(_error(factors, lines), systematic(beyond) / 1.96 * along))

    of_delay = error(2j * np.pi * f[:, None] * turned) * scale
    return replace(
        result, gain_error=error(turned) / size if gain is None else 0.0,
        delay_error=0.0 if delay is not None else float(np.hypot(of_delay, lines.shift_error)),
    )  # fmt: skip


def opposite_sign(model: str, has_delay: bool) -> str:
    """Return a warning that a measurement fits a model equally well with the opposite sign."""
    delay = ", at another delay" * has_delay
    return (
        f"with the opposite sign the measurement fits {model} as well or better{delay}: check "
        "which direction was taken as positive"
    )


def _weights(lines: MeasuredLines) -> Floats:
    """Return the weight (f, 1) of each line, one over its variance; 1 if none is known.

    The variance is the mean over the places, shrunk to that of all lines with `PRIOR_FREEDOM`,
    because the weights would otherwise contain the noise of few repetitions.
    """
    known = np.isfinite(lines.variance) & (lines.variance > 0)
    counts = known.sum(axis=1, keepdims=True)
    if not counts.any():
        return np.ones((len(lines.frequencies), 1))
    sums = np.where(known, lines.variance, 0).sum(axis=1, keepdims=True)
    own, overall = lines.freedom * counts, float(sums.sum() / counts.sum())
    return np.asarray((own + PRIOR_FREEDOM) / (lines.freedom * sums + PRIOR_FREEDOM * overall))


def _best_delay(
    lines: MeasuredLines,
    products: np.ndarray,
    size: float,
    gain: float,
    window: float,
    centre: float,
) -> tuple[float, float]:
    """Return the smallest of the best delays in s, and the distance to the next one.

    Chi-square is 2 (sum w |z|^2 - c^2 / b) with correlation c and size b or, with a given gain g, 2
    (sum w |z|^2 - 2 g c + g^2 b). If the model misfits, its residual replaces the noise.
    """
    shifted = products * np.exp(2j * np.pi * lines.frequencies * centre)
    delays, heights = maxima(lines.frequencies, shifted, window)
    delays = delays + centre
    whole = float((_weights(lines) * np.abs(lines.mean) ** 2).sum())
    explained = 2 * gain * heights - gain**2 * size if gain else heights**2 / size
    left = 2 * (whole - explained)
    scale = float(left.min()) / max(2 * lines.variance.size - 2, 1)
    if np.isfinite(lines.variance).any():  # the noise is known
        scale = max(scale, 1.0)
    most = left.min() + AS_GOOD * scale + 1e-9 * np.abs(left).max()
    # Chi-square over its degrees of freedom, above which a model leaves more than noise.
    misfit = 3.0
    nearly = 1.3  # ratio of residuals of nearly equal delays, if the model misfits
    alike = delays[left <= max(most, nearly * left.min() * (scale > misfit))]
    chosen = float(alike[np.argmin(np.abs(alike))])
    away = np.abs(alike - chosen)
    return chosen, float(away[away > 1e-9 * window].min(initial=np.inf))


def _error(factors: np.ndarray, lines: MeasuredLines) -> float:
    """Return the standard error of Re sum(lines * factors (f, p)) (Satterthwaite 1946)."""
    terms = np.nan_to_num(np.abs(factors) ** 2 * lines.variance / 2)
    squares = float((terms**2 / lines.freedom).sum())
    if not squares > 0:
        return 0.0
    freedom = float(terms.sum()) ** 2 / squares
    return float(np.sqrt(lines.variance_of(factors)) * stdtrit(freedom, 0.975) / 1.96)
