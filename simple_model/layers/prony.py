"""Prony series: Maxwell branches in parallel, and their fit to any modulus law of a solid.

    mu(w) = mu + i w viscosity + sum_j mu_j i w tau_j / (1 + i w tau_j)     (time exp(+i w t))

A generalised Maxwell solid (Simo and Hughes, Computational Inelasticity (1998), chapter 10). With
all terms 0 or above it is passive and causal. Every solid whose relaxation modulus is completely
monotonic is the limit of such sums (Bernstein's theorem; Gross, Mathematical Structure of the
Theories of Viscoelasticity (1953)). The fit is linear in the moduli at given, log-spaced times:
non-negative least squares of the relative deviation (Lawson and Hanson, Solving Least Squares
Problems (1974), chapter 23).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers
from simple_model.numbers import plural
from simple_model.typing import Complex, Floats

ModulusLaw = Callable[[Any], Any]  # complex shear modulus in Pa at angular frequencies in rad/s

FIT_TOLERANCE = 0.005  # relative deviation of a series; motion near resonances deviates more


@dataclass(frozen=True, kw_only=True)
class PronyTerm:
    """Prony term, a Maxwell branch in parallel with the rest. The `modulus` in Pa is 0 or above,
    the relaxation `time` in s above 0; other values raise a ValueError.

    >>> complex(PronyTerm(modulus=10e3, time=1e-3)(1000.0))  # Pa, at the peak of its loss
    (5000+5000j)
    """

    modulus: float
    time: float

    def __post_init__(self) -> None:
        check_numbers("a Prony term", self, "modulus", least="0 or above")
        check_numbers("a Prony term", self, "time")

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        phase = 1j * np.asarray(omega) * self.time
        return self.modulus * phase / (1 + phase)


@dataclass(frozen=True, kw_only=True)
class PronySeries:
    """Prony series of a modulus law: `shear_modulus` at rest in Pa, `viscosity` in Pa s, `terms`,
    and the largest relative `error` over its `band` in Hz.
    """

    shear_modulus: float
    viscosity: float
    terms: tuple[PronyTerm, ...]
    error: float
    band: tuple[float, float]

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s, real or complex."""
        lasting = self.shear_modulus + 1j * np.asarray(omega) * self.viscosity
        return sum((term(omega) for term in self.terms), lasting)

    def scaled(self, factor: float) -> PronySeries:
        """Return the series with all moduli multiplied by a factor."""
        terms = tuple(replace(term, modulus=factor * term.modulus) for term in self.terms)
        shear, viscosity = factor * self.shear_modulus, factor * self.viscosity
        return replace(self, shear_modulus=shear, viscosity=viscosity, terms=terms)

    @property
    def words(self) -> str:
        """Terms, error and band, as plans show them."""
        return (
            f"Prony series of {plural(len(self.terms), 'term')}, {100 * self.error:.2g} % from "
            f"the law between {self.band[0]:g} and {self.band[1]:g} Hz"
        )


@lru_cache(maxsize=64)
def fit_prony(
    law: ModulusLaw,
    *,
    band: tuple[float, float] = (1.0, 2000.0),
    rest: float | None = None,
    frequencies: tuple[float, ...] = (),
    tolerance: float = FIT_TOLERANCE,
) -> PronySeries:
    """Fit a Prony series to a modulus law: the one with the fewest terms within a tolerance over a
    band, or, for a noisy law, the shortest of almost equally close ones.

    Raises a ValueError if the law is not passive or not causal in the band.

    Parameters
    ----------
    law : angular frequencies (...) in rad/s -> complex shear moduli (...) in Pa
    band : lowest and highest frequency in Hz; by default of lines of loads and their modes
    rest : float, Pa, modulus at rest; fitted if not given
    frequencies : Hz, within the band, fitted in addition to 40 log-spaced ones per decade
    tolerance : float, largest relative deviation |series - law| / |law|
    """
    count = 2 + round(40 * np.log10(band[1] / band[0]))
    f = np.unique([*np.geomspace(*band, count), *(x for x in frequencies if x > 0)])
    w = 2 * np.pi * f
    mu = np.asarray(np.broadcast_to(law(w), w.shape), np.complex128)
    check_causal(f, mu)
    candidates: list[PronySeries] = []
    beyond = (0.5, 1.0, 2.0, 4.0, 8.0)  # factors by which times extend beyond the ends of a band
    ends = [(w[0] / slow, w[-1] * fast) for slow in beyond for fast in beyond]
    most_terms = 16
    # A law may relax far below the band, as fractional ones of small exponents do.
    for further in ([], [1e3 / w[0]]) if rest else ([],):
        for n in range(most_terms + 1):
            fits = [
                fitted_series(w, mu, np.append(1 / np.geomspace(*end, n), further), rest, band)
                for end in ends[: None if n else 1]
            ]
            candidates.append(min(fits, key=lambda series: series.error))
            if candidates[-1].error <= tolerance:
                return candidates[-1]
    no_better = 1.1  # times the smallest deviation, accepted for fewer terms if data are noisy
    enough = no_better * min(series.error for series in candidates)
    return next(series for series in candidates if series.error <= enough)


def check_causal(frequencies: Floats, moduli: Complex, largest: float = 0.10) -> None:
    """Refuse complex moduli (f,) in Pa at ascending frequencies (f,) in Hz unless they are passive
    and causal: within `largest` (relative, root mean square) of a series of non-negative terms.
    """
    check_passive(frequencies, moduli)
    w = 2 * np.pi * frequencies
    times = 1 / np.geomspace(w[0] / 30, w[-1] * 30, 9 + round(3 * np.log10(w[-1] / w[0])))
    away = np.abs(fitted_series(w, moduli, times, None, (0.0, 0.0))(w) - moduli) / np.abs(moduli)
    mean, worst = float(np.sqrt(np.mean(away**2))), int(away.argmax())
    # Measured moduli with random errors of 5 % in both parts are 7 % from every causal law; a
    # hysteretic loss factor of 0.2 is 10 % away, of 0.3 15 %. The limit applies to the root mean
    # square, so single outliers pass; a warning states their size.
    if mean > largest:
        raise ValueError(
            f"the complex modulus is not causal: it differs by {100 * mean:.0f} % from the nearest "
            f"relaxing solid (root mean square; the limit is {100 * largest:g} %), at "
            f"{frequencies[worst]:.3g} Hz by {100 * away[worst]:.0f} %; the storage modulus must "
            "rise where the loss modulus is large: check both, or give a loss_factor"
        )


def check_passive(frequencies: Floats, moduli: Complex) -> None:
    """Refuse complex moduli (f,) in Pa at frequencies (f,) in Hz that are not passive."""
    least_loss = -1e-9  # of the modulus: round-off of a law without loss
    limits = (
        (~np.isfinite(moduli), "modulus", np.real, "must be finite"),
        (moduli.real <= 0, "storage modulus", np.real, "must be above 0"),
        (moduli.imag < least_loss * np.abs(moduli), "loss modulus", np.imag, "must be 0 or above, "
         "because a passive solid absorbs energy"),
    )  # fmt: skip
    for wrong, name, part, condition in limits:
        if wrong.any():
            k = int(np.argmax(wrong))
            raise ValueError(
                f"{name} is {part(moduli[k]):.4g} Pa at {frequencies[k]:.4g} Hz and {condition}; "
                "check its sign and unit"
            )


def fitted_series(
    w: Floats, mu: Complex, times: Floats, rest: float | None, band: tuple[float, float]
) -> PronySeries:
    """Fit a Prony series of times (n,) in s to moduli (f,) in Pa at w (f,) in rad/s, by
    non-negative least squares of the relative deviation. The modulus at rest in Pa is fitted if it
    is None.
    """
    from scipy.optimize import nnls  # slow to import

    phase = 1j * w[:, None] * times
    columns = np.hstack([np.ones((len(w), 1)), 1j * w[:, None], phase / (1 + phase)])
    least_modulus = 1e-3  # of the first modulus: lowest modulus at rest of a law without one
    lasting = rest or least_modulus * abs(mu[0])
    A, b = columns / np.abs(mu)[:, None], (mu - lasting) / np.abs(mu)
    A[:, 0] *= rest is None
    A = np.vstack([A.real, A.imag])
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    x, _ = nnls(A / size, np.concatenate([b.real, b.imag]))
    x = np.where(A.any(axis=0), x / size, 0.0)
    terms = [
        PronyTerm(modulus=m, time=t)
        for m, t in zip(x[2:].tolist(), times.tolist(), strict=True)
        if m
    ]
    return PronySeries(
        shear_modulus=float(lasting + x[0]), viscosity=float(x[1]), terms=tuple(terms),
        error=float((np.abs(columns @ x + lasting - mu) / np.abs(mu)).max()), band=band,
    )  # fmt: skip


@lru_cache(maxsize=1024)
def constant_loss(
    loss_factor: float, reference: float = 150.0, loss_band: tuple[float, float] = (10.0, 2000.0)
) -> PronySeries:
    """Return the modulus law of a nearly constant loss factor above 0, relative to the storage
    modulus at the frequency `reference` in Hz.

    A modulus mu (1 + i eta) with one eta at all frequencies is not causal. The solid of constant
    loss factor eta has the modulus

        mu(w) = mu (i w / w_0)^a / cos(pi a / 2),   a = (2 / pi) atan(eta)

    (Kjartansson, J Geophys Res 84:4737 (1979), doi 10.1029/JB084iB09p04737), which is 0 at rest. A
    few Maxwell branches with log-spaced times approximate it over a band and have a modulus at rest
    (Emmerich and Korn, Geophysics 52:1252 (1987), doi 10.1190/1.1442386). They define the loss
    factor in every model: eta within 2.5 % over `loss_band` in Hz up to eta = 2, within 10 %
    beyond, half of it at 3 Hz, and 0 at rest, where the modulus is 0.92, 0.76 and 0.35 mu for eta =
    0.03, 0.1 and 0.4.
    """
    w, w_0 = 2 * np.pi * np.geomspace(*loss_band, 93), 2 * np.pi * reference
    power = 2 / np.pi * np.arctan(loss_factor)
    exact = (1j * w / w_0) ** power / np.cos(np.pi * power / 2)
    # Four terms of 8 Hz to 1.6 kHz are best for losses up to 2.
    times = 1 / (2 * np.pi * np.geomspace(8.0, 1600.0, 4))
    series = fitted_series(w, exact, times, None, loss_band)
    return series.scaled(1 / float(series(w_0).real))
