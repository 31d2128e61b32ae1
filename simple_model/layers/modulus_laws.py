"""Modulus laws: complex shear moduli of solids that are not a sum of Maxwell branches.

Each is a function of the angular frequency w in rad/s, in Pa (time exp(+i w t)), with a
`shear_modulus` at rest. A Prony series replaces it where internal variables are needed. Powers are
principal values: for Im w <= 0, i w has a real part >= 0 and crosses no branch cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers
from simple_model.layers.prony import ModulusLaw, PronySeries, check_passive, fit_prony
from simple_model.typing import Complex, Floats

COLUMNS = ("frequency_hz", "storage_pa", "loss_pa")


@dataclass(frozen=True, kw_only=True)
class FractionalKelvinVoigt:
    """Fractional Kelvin-Voigt solid: mu (1 + (i w tau)^n), a spring in parallel with a springpot.

    Bagley and Torvik, J Rheol 27:201 (1983); Mainardi, Fractional Calculus and Waves in Linear
    Viscoelasticity (2010), chapter 3. With n = 1 it is the Kelvin-Voigt solid of viscosity mu tau.

    Parameters
    ----------
    shear_modulus : float, Pa, above 0, at rest
    exponent : float, n, above 0 and at most 1
    time : float, tau in s, 0 or above

    Raises a ValueError if a value is out of range.

    >>> law = FractionalKelvinVoigt(shear_modulus=25e3, exponent=0.33, time=0.3e-3)
    >>> round(abs(law(2 * np.pi * 140.0)))  # Pa
    39799
    """

    shear_modulus: float
    exponent: float
    time: float

    def __post_init__(self) -> None:
        _check(self)

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        return self.shear_modulus * (1 + _power(omega, self.time, self.exponent))

    @property
    def words(self) -> str:
        """The law in a few words."""
        return f"fractional Kelvin-Voigt of exponent {self.exponent:g}, time {1e3 * self.time:g} ms"

    def scaled(self, *, modulus: float = 1.0, loss: float = 1.0) -> FractionalKelvinVoigt:
        """Return the law with its modulus and, separately, its springpot multiplied by factors."""
        time = self.time * loss ** (1 / self.exponent)
        return replace(self, shear_modulus=modulus * self.shear_modulus, time=time)


@dataclass(frozen=True, kw_only=True)
class FractionalZener:
    """Fractional Zener solid: mu_0 + (mu_inf - mu_0) (i w tau)^n / (1 + (i w tau)^n).

    The four-parameter model of Pritz, J Sound Vib 195:103 (1996), whose relaxing part is that of
    Cole and Cole; Mainardi (2010), chapter 3. With n = 1 it is the standard linear solid.

    Parameters
    ----------
    shear_modulus : float, mu_0 in Pa, above 0, at rest
    fast_modulus : float, mu_inf in Pa, at least mu_0, in fast motion
    exponent, time : see `FractionalKelvinVoigt`

    Raises a ValueError if a value is out of range.
    """

    shear_modulus: float
    fast_modulus: float
    exponent: float
    time: float

    def __post_init__(self) -> None:
        _check(self)
        if not (isfinite(self.fast_modulus) and self.fast_modulus >= self.shear_modulus):
            raise ValueError(
                f"fast_modulus = {self.fast_modulus} Pa must be finite and at least the "
                f"shear_modulus at rest, {self.shear_modulus:g} Pa"
            )

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        power = _power(omega, self.time, self.exponent)
        return self.shear_modulus + (self.fast_modulus - self.shear_modulus) * power / (1 + power)

    @property
    def words(self) -> str:
        """The law in a few words."""
        return (
            f"fractional Zener of exponent {self.exponent:g}, time {1e3 * self.time:g} ms and "
            f"{self.fast_modulus / 1e3:.4g} kPa in fast motion"
        )

    def scaled(self, *, modulus: float = 1.0, loss: float = 1.0) -> FractionalZener:
        """Multiply all moduli by `modulus`, and their relaxing part also by `loss`."""
        rest, fast = modulus * self.shear_modulus, self.fast_modulus - self.shear_modulus
        return replace(self, shear_modulus=rest, fast_modulus=rest + modulus * loss * fast)


def _power(omega: ArrayLike, time: float, exponent: float) -> Any:
    """(i w tau)^n, exactly i w tau if n = 1."""
    power = 1j * np.asarray(omega) * time
    return power if exponent == 1 else power**exponent


def _check(law: FractionalKelvinVoigt | FractionalZener) -> None:
    check_numbers("a modulus law", law, "shear_modulus")
    check_numbers("a modulus law", law, "time", least="0 or above")
    if not 0 < law.exponent <= 1:
        raise ValueError(
            f"exponent = {law.exponent} must be above 0 (a spring) and at most 1 (a dashpot)"
        )


@dataclass(frozen=True, kw_only=True)
class ModulusTable:
    """Measured complex shear moduli, linear between their frequencies; a modulus law.

    Outside this band, and at complex frequencies, a causal Prony series of the table gives the
    modulus.

    Parameters
    ----------
    frequencies : (k,) Hz, ascending, 0 or above; the loss modulus at 0 Hz must be 0
    moduli : (k,) complex, Pa, with real parts above 0 and imaginary parts of 0 or above

    Raises a ValueError if they are not those of a passive, causal solid.
    """

    frequencies: tuple[float, ...]
    moduli: tuple[complex, ...]

    def __post_init__(self) -> None:
        f, mu = self._arrays
        most_rows = 10_000  # of a table, and about as many that are fitted
        if f.shape != mu.shape or f.ndim != 1 or not (f > 0).any() or len(f) > most_rows:
            raise ValueError(
                f"a table of complex moduli has {len(f)} frequencies and {len(mu)} moduli; give "
                f"one modulus for each frequency, at least one above 0 Hz, at most {most_rows}"
            )
        _check_frequencies(f)
        check_passive(f, mu)
        if f[0] == 0 and mu[0].imag:
            raise ValueError(
                f"loss modulus is {mu[0].imag:g} Pa at 0 Hz and must be 0 there; set it to 0, or "
                "remove the row"
            )
        _ = self.series  # refuses moduli that are not causal

    @property
    def _arrays(self) -> tuple[Floats, Complex]:
        return np.array(self.frequencies), np.array(self.moduli, np.complex128)

    @property
    def series(self) -> PronySeries:
        """Prony series over the whole table."""
        return _series(self)

    @property
    def words(self) -> str:
        """The table in a few words."""
        f = self.frequencies
        return f"{len(f)} measured complex moduli between {f[0]:g} and {f[-1]:g} Hz"

    @property
    def shear_modulus(self) -> float:
        """Modulus in Pa at rest: that at 0 Hz or, without such a row, that of the series."""
        return self.series.shear_modulus

    def between(self, omega: Any) -> Complex:
        """Moduli at real angular frequencies between the first and the last."""
        f, mu = self._arrays
        hertz = np.abs(np.real(omega)) / (2 * np.pi)
        loss = np.interp(hertz, f, mu.imag) * np.sign(np.real(omega))
        return np.asarray(np.interp(hertz, f, mu.real) + 1j * loss)

    def __call__(self, omega: ArrayLike) -> Complex:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        w = np.asarray(omega)
        hertz = np.abs(np.real(w)) / (2 * np.pi)
        first, last = self.frequencies[0] * (1 - 1e-9), self.frequencies[-1] * (1 + 1e-9)
        measured = (np.imag(w) == 0) & (hertz >= first) & (hertz <= last)
        return np.where(measured, self.between(w), self.series(w))

    def scaled(self, *, modulus: float = 1.0, loss: float = 1.0) -> ModulusTable:
        """Return the table with all moduli, or all loss moduli, multiplied by a factor."""
        moduli = tuple(modulus * complex(mu.real, loss * mu.imag) for mu in self.moduli)
        return replace(self, moduli=moduli)


def _check_frequencies(f: Floats) -> None:
    lowest, highest = 1e-3, 1e6  # Hz, of a table
    outside = ((f < lowest) | (f > highest)) & ~((f == 0) & (np.arange(len(f)) == 0))
    for wrong, problem in (
        (outside, f"which is outside {lowest:g} to {highest:g} Hz; only the first may be 0"),
        (np.diff(f, prepend=-1.0) <= 0, "which does not rise; give frequencies in ascending order"),
    ):
        if wrong.any():
            raise ValueError(
                f"a table of complex moduli has the frequency {f[wrong.argmax()]:g} Hz, {problem}"
            )


@lru_cache(maxsize=64)
def _series(table: ModulusTable) -> PronySeries:
    f = np.array(table.frequencies)
    measured = f[f > 0]
    fitted_rows = 300  # of a table, and about as many that are fitted
    fitted = measured[:: max(1, len(f) // fitted_rows)]
    table_tolerance = 0.005  # relative deviation of the series of a table without noise
    return fit_prony(
        table.between,
        band=(float(measured[0]), float(measured[-1])),
        rest=table.moduli[0].real if f[0] == 0 else None,
        frequencies=tuple(fitted.tolist()),
        tolerance=table_tolerance,
    )


@dataclass(frozen=True, kw_only=True)
class ScaledLaw:
    """A modulus law given as a function, with storage and loss moduli multiplied by factors."""

    law: ModulusLaw
    modulus: float
    loss: float

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        mu = self.modulus * self.law(omega)
        return mu if self.loss == 1 else mu.real + 1j * self.loss * mu.imag


MODULUS_LAWS: Mapping[str, type[FractionalKelvinVoigt] | type[FractionalZener]] = {
    "fractional-kelvin-voigt": FractionalKelvinVoigt,
    "fractional-zener": FractionalZener,
}


def modulus_table(text: str) -> ModulusTable:
    """Read a table of complex shear moduli from CSV with the columns frequency_hz, storage_pa and
    loss_pa.

    Columns and rows may be in any order; lines that begin with # are comments. Raises a ValueError
    if a column is missing, an entry is not a number, or as `ModulusTable` does.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    header, *rows = [[cell.strip() for cell in line.split(",")] for line in lines] or [[]]
    if missing := [name for name in COLUMNS if name not in header]:
        raise ValueError(
            f"the table of complex moduli has no column {missing[0]}; name the columns "
            f"{', '.join(COLUMNS)} in its first line"
        )
    places = [header.index(name) for name in COLUMNS]
    values = np.array(sorted(_row(row, places) for row in rows)).reshape(-1, 3)
    moduli = values[:, 1] + 1j * values[:, 2]
    return ModulusTable(frequencies=tuple(values[:, 0].tolist()), moduli=tuple(moduli.tolist()))


def _row(row: list[str], places: list[int]) -> list[float]:
    try:
        return [float(row[place]) for place in places]
    except (ValueError, IndexError):
        raise ValueError(
            f"the table of complex moduli has the row '{','.join(row)[:60]}'; give three numbers"
        ) from None
