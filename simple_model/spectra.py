"""Amplitude spectrum and lines of a response, as records that draw themselves."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simple_model.choices import choose
from simple_model.drawing import curves, new_axes, small
from simple_model.numbers import plural
from simple_model.quantities import Quantity, quantity
from simple_model.typing import Complex, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOUD = 1e-3  # of the largest amplitude: louder ones set the frequency range
# Weights of cosines (Harris 1978, doi:10.1109/PROC.1978.10837).
COSINES = {
    "boxcar": (1.0,),
    "hann": (0.5, 0.5),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """Amplitude spectrum: `frequencies` (f,) in Hz, `amplitudes` (f, p) in the unit of the
    `quantity`, and `probes` (p, 2) in m.
    """

    frequencies: Floats
    amplitudes: Floats
    probes: Floats
    quantity: str

    @property
    def record(self) -> Quantity:
        """The record of the quantity."""
        return quantity(self.quantity)

    def __repr__(self) -> str:
        band = f"{len(self.frequencies):,} frequencies to {self.frequencies[-1]:.5g} Hz"
        return f"<Spectrum of {self.record.words}: {band}, {plural(len(self.probes), 'probe')}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the spectrum at every probe on a logarithmic axis, down to -80 dB of the largest
        amplitude and up to the highest frequency above -60 dB.
        """
        ax = new_axes(ax)
        scaled = self.record.per_unit * self.amplitudes
        largest = float(scaled.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, np.maximum(scaled, 1e-7 * largest), self.probes)
        _scale(ax, self.frequencies, scaled, self.record)
        ax.set_ylim(1e-4 * largest, 3 * largest)
        return ax


@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """Resolved lines of a load in a response.

    Parameters
    ----------
    names : (f,) str, such as "f_AM" or "2f_d-f_AM"
    frequencies : (f,) float, Hz
    amplitudes : (f, p) complex, a of Re a exp(2 pi i f t), in the unit of the quantity
    probes : (p, 2) float, m
    quantity : name of one of `quantities.QUANTITIES`
    """

    names: tuple[str, ...]
    frequencies: Floats
    amplitudes: Complex
    probes: Floats
    quantity: str

    @property
    def record(self) -> Quantity:
        """The record of the quantity."""
        return quantity(self.quantity)

    def __getitem__(self, name: str) -> Complex:
        """Amplitudes (p,) of the line with a name; raises a ValueError for an unknown name."""
        return np.asarray(self.amplitudes[self.names.index(choose("line", name, self.names))])

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        strongest = np.argsort(-np.abs(self.amplitudes).max(axis=1, initial=0.0), kind="stable")
        named = ", ".join(self.names[k] for k in strongest[:5])
        strong = f"; the strongest: {named}" if named else ""
        counts = f"{plural(len(self), 'line')}, {plural(len(self.probes), 'probe')}"
        return f"<Lines of {self.record.words}: {counts}{strong}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the amplitudes at every probe, with the names of strong lines."""
        ax = new_axes(ax)
        size = self.record.per_unit * np.abs(self.amplitudes)
        largest = float(size.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, size, self.probes, ls="none", marker="o", ms=4)
        end = _scale(ax, self.frequencies, size, self.record)
        ax.set_ylim(LOUD / 3 * largest, 300 * largest)  # room for the names
        heights = size.max(axis=1, initial=0.0)
        chosen = list[int]()  # none is near a stronger one
        for k in np.argsort(-heights, kind="stable").tolist():
            apart = np.abs(self.frequencies[k] - self.frequencies[chosen]) > end / 28  # a name fits
            if heights[k] > LOUD * largest and apart.all():
                chosen.append(k)
                ax.annotate(
                    self.names[k], (self.frequencies[k], heights[k]), xytext=(0, 5),
                    textcoords="offset points", rotation=90, ha="center", fontsize=small(),
                    parse_math=False,
                )  # fmt: skip
        if not len(self):
            words = "no line of the load is resolved;\na longer Tacton resolves more"
            ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
        return ax


def _scale(ax: "Axes", frequencies: Floats, amplitudes: Floats, record: Quantity) -> float:
    """Set scales and labels of the axes for amplitudes (f, p). Return the upper limit in Hz, above
    the highest frequency with `LOUD` of the largest amplitude.
    """
    loud = frequencies[(amplitudes > LOUD * amplitudes.max(initial=0.0)).any(axis=1)]
    end = 1.1 * max(float(loud.max(initial=0.0)), 100.0)
    ax.set_yscale("log")
    ax.set_xlim(0, end)
    ax.set_xlabel("frequency, Hz")
    ax.set_ylabel(f"amplitude, {record.shown}")
    return end


def cosines(name: str, n: int) -> Floats:
    """Return the periodic window (n,) of a name in `COSINES`; importing scipy.signal is slow."""
    choose("window", name, COSINES)
    if n < 2:
        return np.ones(n)
    turn = np.linspace(-np.pi, np.pi, n + 1)[:n]
    window = np.zeros(n)
    for k, weight in enumerate(COSINES[name]):
        window += weight * np.cos(k * turn)
    return window
