"""Delay and gain between a measurement and a model, from their spectral lines.

A record begins at an unknown time of the response, and in an unknown unit of pressure: measured =
gain * model(t - delay). Both follow from the complex amplitudes of the lines by weighted least
squares; the gain in closed form for each delay, and the delay as the highest correlation of the
lines, at sub-sample accuracy.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from skinwave.measure.delays import correlation, maxima
from skinwave.measure.lines import MeasuredLines
from skinwave.typing import Floats

AS_GOOD = 10.83  # of chi-square: 99.9 % of one degree of freedom
SHARED = 20.0  # degrees of freedom
MISFITS = 3.0  # chi-square over its degrees of freedom: a model leaves more than noise
NEARLY = 1.3  # times the power that a misfit leaves at the best delay: it is nearly as small


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """Gain and delay: measured(t) = gain * model(t - delay).

    Parameters
    ----------
    delay, delay_error : s, and its standard error from the noise; 0 of one that was given
    gain, gain_error : unit of the measurement over that of the model, likewise
    repeats : s, how far from the delay the nearest other one is that fits as well within the noise;
        inf if there is none in the window that was searched
    chi_square : of the differences left, over their degrees of freedom: 1 if they are noise
    """

    delay: float
    delay_error: float
    gain: float
    gain_error: float
    repeats: float = np.inf
    chi_square: float = np.nan

    def applied(self, frequencies: Floats, model: np.ndarray) -> np.ndarray:
        """Amplitudes (f, p) of a model with the gain and the delay."""
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
    """Delay and gain by weighted least squares over the lines.

    The gain is taken as positive unless another is given. Of delays that fit equally well within
    the noise, as those a period apart do, the least is taken; of those of a model that leaves more
    than noise, of all whose misfit is nearly as small.

    Parameters
    ----------
    lines : MeasuredLines
    model : (f, p) complex, amplitudes of the same lines in the model
    window, centre : s, the delay is sought within half of the window either way of its centre
    delay : s, if it is known
    gain : unit of the measurement over that of the model, if it is known

    Returns
    -------
    Alignment; its standard errors are those of the noise alone, robust to noise that differs from
    place to place

    Raises
    ------
    ValueError
        If the model has none of the lines, or a given number is not finite.
    """
    for name, given in (("delay", delay), ("gain", gain)):
        if given is not None and not np.isfinite(given):
            raise ValueError(f"{name} = {given} must be a finite number; leave it out to fit it")
    f, weights = lines.frequencies, _weights(lines)
    size = float((weights * np.abs(model) ** 2).sum())
    if not size > 0:
        raise ValueError("the model has none of the measured lines; compare one that moves")
    products = (weights * model.conj() * lines.mean).sum(axis=1)
    found, repeats = (float(delay), np.inf) if delay is not None else _delay(
        lines, products * np.sign(gain or 1.0), size, abs(gain or 0.0), window, centre)  # fmt: skip
    height, bend = (float(correlation(f, products, np.array([found]), n)[0]) for n in (0, 2))
    fitted = height / size if gain is None else float(gain)
    turned = weights * (model * np.exp(-2j * np.pi * f * found)[:, None]).conj()
    scale = -1 / bend * np.sign(fitted) if -bend * fitted > 0 else np.inf
    of_delay = _error(2j * np.pi * f[:, None] * turned, lines) * scale
    result = Alignment(
        delay=found, gain=fitted, repeats=repeats,
        delay_error=0.0 if delay is not None else float(np.hypot(of_delay, lines.shift_error)),
        gain_error=_error(turned, lines) / size if gain is None else 0.0,
    )  # fmt: skip
    away = lines.mean - result.applied(f, model)
    freedom = 2 * away.size - (delay is None) - (gain is None)
    if freedom <= 0 or not (lines.variance > 0).any():
        return result
    chi_square = float(2 * (weights * np.abs(away) ** 2).sum() / freedom)
    return replace(result, chi_square=chi_square)


def opposite_sign(of: str, has_delay: bool) -> str:
    """Sentence, without a full stop, where the other sign of a measurement fits a model as well,
    perhaps at another delay.
    """
    return (
        f"with its sign turned the measurement fits {of} as well or better"
        + ", at another delay" * has_delay
        + ": check which direction was taken as positive"
    )


def _weights(lines: MeasuredLines) -> Floats:
    """Weight (f, 1) of each line: one over its variance; 1 where none is known.

    A line's variance is its mean over the places, drawn to that of all lines by as much as
    `SHARED` degrees of freedom: weights by few repetitions follow the noise that they are to weigh.
    """
    known = np.isfinite(lines.variance) & (lines.variance > 0)
    counts = known.sum(axis=1, keepdims=True)
    if not counts.any():
        return np.ones((len(lines.frequencies), 1))
    sums = np.where(known, lines.variance, 0).sum(axis=1, keepdims=True)
    own, overall = lines.freedom * counts, float(sums.sum() / counts.sum())
    return np.asarray((own + SHARED) / (lines.freedom * sums + SHARED * overall))


def _delay(
    lines: MeasuredLines,
    products: np.ndarray,
    size: float,
    gain: float,
    window: float,
    centre: float,
) -> tuple[float, float]:
    """The least delay in s that fits as well as any within the noise, and how far off the next is.

    Chi-square is 2 (sum w |z|^2 - c^2 / b) with correlation c and size b or, with a given gain g,
    2 (sum w |z|^2 - 2 g c + g^2 b). Where the model does not fit within the noise, what it leaves
    takes the place of the noise, and what it leaves at other delays is as systematic.
    """
    shifted = products * np.exp(2j * np.pi * lines.frequencies * centre)
    delays, heights = maxima(lines.frequencies, shifted, window)
    delays = delays + centre
    whole = float((_weights(lines) * np.abs(lines.mean) ** 2).sum())
    left = 2 * (whole - (2 * gain * heights - gain**2 * size if gain else heights**2 / size))
    scale = float(left.min()) / max(2 * lines.variance.size - 2, 1)
    if np.isfinite(lines.variance).any():  # whose noise is known
        scale = max(scale, 1.0)
    most = left.min() + AS_GOOD * scale + 1e-9 * np.abs(left).max()
    alike = delays[left <= max(most, NEARLY * left.min() * (scale > MISFITS))]
    chosen = float(alike[np.argmin(np.abs(alike))])
    away = np.abs(alike - chosen)
    return chosen, float(away[away > 1e-9 * window].min(initial=np.inf))


def _error(factors: np.ndarray, lines: MeasuredLines) -> float:
    """Standard error of the real part of the sum of lines times factors (f, p), by variances each
    known to some degrees of freedom: widened so that 1.96 of it are Student's 95 % (Satterthwaite
    1946).
    """
    terms = np.nan_to_num(np.abs(factors) ** 2 * lines.variance / 2)
    squares = float((terms**2 / lines.freedom).sum())
    if not squares > 0:
        return 0.0
    known = float(terms.sum()) ** 2 / squares
    return float(np.sqrt(lines.variance_of(factors)) * stdtrit(known, 0.975) / 1.96)
