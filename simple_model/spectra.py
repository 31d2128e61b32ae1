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

DEEPEST, LOUD = 1e-4, 1e-3  # of the largest amplitude: shown; sets the range of frequencies
LISTED = 5  # names of lines where they are printed
NAMES_ABREAST = 28  # names along the axis of frequencies
NONE_RESOLVED = "no line of the load is resolved;\nin a longer Tacton more are"


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """Amplitude spectrum: `frequencies` (f,) in Hz and `amplitudes` (f, p) in the unit of the
    `quantity` at `probes` (p, 2) in metre.
    """

    frequencies: Floats
    amplitudes: Floats
    probes: Floats
    quantity: str

    @property
    def record(self) -> Quantity:
        """The record of its quantity."""
        return quantity(self.quantity)

    def __repr__(self) -> str:
        said = f"{len(self.frequencies):,} frequencies to {self.frequencies[-1]:.5g} Hz"
        return f"<Spectrum of {self.record.words}: {said}, {plural(len(self.probes), 'probe')}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the spectrum at every probe, amplitudes to -80 dB of the largest on a logarithmic
        axis, up to the highest frequency that has -60 dB.
        """
        ax = new_axes(ax)
        shown = self.record.per_unit * self.amplitudes
        largest = float(shown.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, np.maximum(shown, 1e-3 * DEEPEST * largest), self.probes)
        _scale(ax, self.frequencies, shown, self.record)
        ax.set_ylim(DEEPEST * largest, 3 * largest)
        return ax


@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """Resolved lines of a load in a response.

    Parameters
    ----------
    names : (f,) str, such as "f_AM" or "2f_d-f_AM"
    frequencies : (f,) float, Hz
    amplitudes : (f, p) complex, a of Re a exp(2 pi i f t), in the unit of the quantity
    probes : (p, 2) float, metre
    quantity : name of one of `quantities.QUANTITIES`
    """

    names: tuple[str, ...]
    frequencies: Floats
    amplitudes: Complex
    probes: Floats
    quantity: str

    @property
    def record(self) -> Quantity:
        """The record of its quantity."""
        return quantity(self.quantity)

    def __getitem__(self, name: str) -> Complex:
        """Amplitudes (p,) of the line of a name; raises a ValueError if it is none of them."""
        return np.asarray(self.amplitudes[self.names.index(choose("line", name, self.names))])

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        strongest = np.argsort(-np.abs(self.amplitudes).max(axis=1, initial=0.0), kind="stable")
        named = ", ".join(self.names[k] for k in strongest[:LISTED])
        said = f"{plural(len(self), 'line')}, {plural(len(self.probes), 'probe')}"
        said += f"; the strongest: {named}" if named else ""
        return f"<Lines of {self.record.words}: {said}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the moduli at every probe, the strong ones with their names, or say that no line is
        resolved.
        """
        ax = new_axes(ax)
        size = self.record.per_unit * np.abs(self.amplitudes)
        largest = float(size.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, size, self.probes, ls="none", marker="o", ms=4)
        end = _scale(ax, self.frequencies, size, self.record)
        ax.set_ylim(LOUD / 3 * largest, 300 * largest)  # room for the names
        heights = size.max(axis=1, initial=0.0)
        chosen = list[int]()  # none is near a stronger one
        for k in np.argsort(-heights, kind="stable").tolist():
            apart = np.abs(self.frequencies[k] - self.frequencies[chosen]) > end / NAMES_ABREAST
            if heights[k] > LOUD * largest and apart.all():
                chosen.append(k)
                ax.annotate(
                    self.names[k], (self.frequencies[k], heights[k]), xytext=(0, 5),
                    textcoords="offset points", rotation=90, ha="center", fontsize=small(),
                    parse_math=False,
                )  # fmt: skip
        if not len(self):
            ax.text(0.5, 0.5, NONE_RESOLVED, transform=ax.transAxes, ha="center", va="center")
        return ax


def _scale(ax: "Axes", frequencies: Floats, shown: Floats, record: Quantity) -> float:
    """Set scales and labels of the axes of amplitudes (f, p); return the end in Hz of what is seen,
    above the highest frequency with `LOUD` of the largest amplitude.
    """
    loud = frequencies[(shown > LOUD * shown.max(initial=0.0)).any(axis=1)]
    end = 1.1 * max(float(loud.max(initial=0.0)), 100.0)
    ax.set_yscale("log")
    ax.set_xlim(0, end)
    ax.set_xlabel("frequency, Hz")
    ax.set_ylabel(f"amplitude, {record.shown}")
    return end
