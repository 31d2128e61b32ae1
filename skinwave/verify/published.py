"""Published values for comparison with models, from `published.toml`.

`how` is the quality of a set: read in the source, quoted elsewhere, from the abstract only, or
computed from the source's numbers. `fitted` names the presets that were fitted to a source or
chosen by it; their agreement with it is no evidence.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

ALL = "All sources"  # start of the names of `all_sources`


@dataclass(frozen=True)
class Observable:
    """What was measured: its name, its unit on pages, and the size of that unit in SI."""

    name: str
    unit: str
    size: float = 1.0


SPEED = Observable("phase speed", "m/s")
LENGTH = Observable("1/e length", "mm", 1e-3)
EXPONENT = Observable("decay exponent", "")
FOCUS_SPEED = Observable("speed of the focus", "m/s")
FORCE = Observable("force at the detection threshold", "mN", 1e-3)
SOFTEST = Observable("frequency of least impedance", "Hz")


@dataclass(frozen=True, kw_only=True)
class Published:
    """Published `values` (n,) of one quantity, in SI, at `frequencies` (n,) in Hz.

    A frequency is nan for a value without one; a value is nan if only a range is published. `lows`
    and `highs` (n,) span people or a standard deviation; they are empty without a spread. Values
    have a relative `reading_error` if they are read off a curve. `bodies` of `predictions` are
    compared with the set, under contacts of each of the `areas` in m2.
    """

    name: str
    site: str
    quantity: Observable
    frequencies: tuple[float, ...]
    values: tuple[float, ...]
    lows: tuple[float, ...] = ()
    highs: tuple[float, ...] = ()
    conditions: str
    source: str
    how: str
    bodies: Sequence[str]
    fitted: Sequence[str] = ()
    areas: tuple[float, ...] = ()
    remark: str = ""
    reading_error: float = 0.05

    def between(self, k: int) -> tuple[float, float]:
        """Return the lowest and highest value, in SI, at frequency number k."""
        return (self.lows[k], self.highs[k]) if self.lows else (self.values[k], self.values[k])


def rayleigh_wave(modulus: float, viscosity: float, frequency: float) -> tuple[float, float]:
    """Return phase speed in m/s and 1/e length in m of Rayleigh waves in an incompressible solid.

    By Voigt's law, k = w sqrt(rho / (mu1 + i w mu2)) / 0.9553.
    """
    w = 2 * np.pi * frequency
    density, ratio = 1000.0, 0.955313  # kg/m3; speed of Rayleigh over that of shear waves
    k = w * np.sqrt(density / (modulus + 1j * w * viscosity)) / ratio
    return float(w / k.real), float(1 / abs(k.imag))


def _read_published(table: dict[str, Any]) -> Published:
    """Return a set of values from its table in the file."""
    known = SPEED, LENGTH, EXPONENT, FOCUS_SPEED, FORCE, SOFTEST
    quantity = {each.name: each for each in known}[table.pop("quantity")]
    frequencies = tuple(map(float, table.pop("frequencies")))
    numbers = {"values": (np.nan,) * len(frequencies)} | {
        name: tuple(quantity.size * x for x in table.pop(name))
        for name in ("values", "lows", "highs") if name in table
    }  # fmt: skip
    if attenuations := table.pop("attenuations", ()):
        numbers["values"] = tuple(quantity.size / x for x in attenuations)
    if voigt := table.pop("voigt", None):  # two constants, each a mean and a standard deviation
        means = tuple(mean for mean, _ in voigt.values())
        ends = product(*((mean - spread, mean + spread) for mean, spread in voigt.values()))
        lengths = np.array([[rayleigh_wave(mu, eta, f)[1] for f in frequencies]
                            for mu, eta in (means, *ends)])  # fmt: skip
        numbers = {"values": tuple(lengths[0]), "lows": tuple(lengths[1:].min(axis=0)),
                   "highs": tuple(lengths[1:].max(axis=0))}  # fmt: skip
    return Published(
        quantity=quantity, frequencies=frequencies, **numbers,
        areas=tuple(1e-4 * area for area in table.pop("areas_cm2", ())), **table,
    )  # fmt: skip


_FILE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
WAVES = tuple(map(_read_published, _FILE["wave"]))  # speeds, 1/e lengths, exponents by frequency
SKINSOURCE = next(each for each in WAVES if each.name.startswith("SkinSource"))
OPTIMUM = _read_published(_FILE["optimum"])
CONTACTS = tuple(map(_read_published, _FILE["contact"]))
NOT_COMPARED = tuple(tuple(each.values()) for each in _FILE["not_compared"])


def all_sources(quantity: Observable) -> Published:
    """Return the range over all sources, at frequencies that two or more sources have."""
    sets = [each for each in WAVES if each.quantity is quantity]
    shared = {}
    for f in range(100, 701, 100):
        having = [each for each in sets if f in each.frequencies]
        if len(having) > 1:
            shared[float(f)] = [each.between(each.frequencies.index(f)) for each in having]
    return Published(
        name=f"{ALL}: {quantity.name}", quantity=quantity, frequencies=tuple(shared),
        values=(np.nan,) * len(shared), **_FILE["all_sources"],
        lows=tuple(min(low for low, _ in pairs) for pairs in shared.values()),
        highs=tuple(max(high for _, high in pairs) for pairs in shared.values()),
    )  # fmt: skip
