"""Published values for comparison with models, from `published.toml`.

`how` is the quality of a set: read in the source, quoted elsewhere, from the abstract only, or
computed from the source's numbers. `built` names the presets that were fitted to a source or chosen
by it; their agreement with it is no evidence.
"""

import tomllib
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

ALL = "All sources"  # start of the names of `all_sources`


@dataclass(frozen=True)
class Quantity:
    """A published quantity: its name, its unit on pages, and the size of that unit in SI."""

    name: str
    unit: str
    size: float = 1.0


SPEED = Quantity("phase speed", "m/s")
LENGTH = Quantity("1/e length", "mm", 1e-3)
EXPONENT = Quantity("decay exponent", "")
FOCUS_SPEED = Quantity("speed of the focus", "m/s")
FORCE = Quantity("force at the detection threshold", "mN", 1e-3)
SOFTEST = Quantity("frequency of least impedance", "Hz")


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
    quantity: Quantity
    frequencies: tuple[float, ...]
    values: tuple[float, ...]
    lows: tuple[float, ...] = ()
    highs: tuple[float, ...] = ()
    conditions: str
    source: str
    how: str
    bodies: tuple[str, ...]
    built: tuple[str, ...] = ()
    areas: tuple[float, ...] = ()
    remark: str = ""
    reading_error: float = 0.05

    def between(self, k: int) -> tuple[float, float]:
        """Return the lowest and highest value, in SI, at frequency number k."""
        return (self.lows[k], self.highs[k]) if self.lows else (self.values[k], self.values[k])

    def at(self, frequency: float) -> tuple[float, float] | None:
        """Return the same at a frequency in Hz, or None if the source does not have it."""
        equal = np.flatnonzero(np.isclose(self.frequencies, frequency))
        return self.between(int(equal[0])) if len(equal) else None


def rayleigh_wave(modulus: float, viscosity: float, frequency: float) -> tuple[float, float]:
    """Return the phase speed in m/s and 1/e length in m of Rayleigh waves in an incompressible
    Kelvin-Voigt solid: k = w sqrt(rho/(mu1 + i w mu2)) / 0.9553.
    """
    w = 2 * np.pi * frequency
    skin_density = 1000.0  # kg/m3
    rayleigh = 0.955313  # speed of Rayleigh waves over that of shear waves, nu = 0.5
    k = w * np.sqrt(skin_density / (modulus + 1j * w * viscosity)) / rayleigh
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
    if voigt := table.pop("voigt", None):
        numbers = _by_voigt(frequencies, *voigt.values())
    return Published(
        quantity=quantity, frequencies=frequencies, bodies=tuple(table.pop("bodies")),
        built=tuple(table.pop("fitted", ())),
        areas=tuple(1e-4 * area for area in table.pop("areas_cm2", ())), **numbers, **table,
    )  # fmt: skip


def _by_voigt(
    frequencies: tuple[float, ...], *constants: tuple[float, float]
) -> dict[str, tuple[float, ...]]:
    """Return 1/e lengths from constants of Voigt's law, each a mean and a standard deviation."""
    ends = list(product(*((mean - spread, mean + spread) for mean, spread in constants)))
    spread = [[rayleigh_wave(mu, eta, f)[1] for mu, eta in ends] for f in frequencies]
    (mu, _), (eta, _) = constants
    return {
        "values": tuple(rayleigh_wave(mu, eta, f)[1] for f in frequencies),
        "lows": tuple(map(min, spread)), "highs": tuple(map(max, spread)),
    }  # fmt: skip


_FILE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
WAVES = tuple(map(_read_published, _FILE["wave"]))  # speeds, 1/e lengths, exponents by frequency
SKINSOURCE = next(each for each in WAVES if each.name.startswith("SkinSource"))
OPTIMUM = _read_published(_FILE["optimum"])
CONTACTS = tuple(map(_read_published, _FILE["contact"]))
NOT_COMPARED = tuple(tuple(each.values()) for each in _FILE["not_compared"])


def all_sources(quantity: Quantity) -> Published:
    """Return the range over all sources, at frequencies that two or more sources have."""
    sets = [each for each in WAVES if each.quantity is quantity]
    ranges = {f: [x for each in sets if (x := each.at(f))] for f in np.arange(100.0, 701, 100)}
    shared = {float(f): pairs for f, pairs in ranges.items() if len(pairs) > 1}
    return Published(
        name=f"{ALL}: {quantity.name}", site="back of the hand, finger, forearm",
        quantity=quantity, frequencies=tuple(shared), values=(np.nan,) * len(shared),
        lows=tuple(min(low for low, _ in pairs) for pairs in shared.values()),
        highs=tuple(max(high for _, high in pairs) for pairs in shared.values()),
        conditions="lowest to highest of the sources here, where at least two have the frequency",
        source="the sets of this page", how="computed from the source's numbers",
        bodies=("forearm", "palm", "palm-stiff", "skin-slab", "palm-layers", "forearm-layers"),
        remark="Sites and methods differ, so the range is wider than between people at one site; "
        "it includes sets that presets were fitted to",
    )  # fmt: skip
