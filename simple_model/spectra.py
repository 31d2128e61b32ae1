"""Amplitude spectrum and lines of a response, as records that draw themselves."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simple_model.choices import choose
from simple_model.drawing import curves, new_axes, small
from simple_model.numbers import counted
from simple_model.quantities import Quantity, quantity
from simple_model.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEEPEST = 1e-4  # of the largest amplitude, -80 dB: shown
LISTED = 5  # names of lines where they are printed
BROAD, LONG = 1.3, 0.6  # a name, and of it a letter, over the size of letters
LEFT = 0.8  # of axes as they are before their labels are drawn
NONE_RESOLVED = "no line of the load is resolved;\nin a longer Tacton more are"
LOUD = 1e-3  # of it, from which on frequencies are shown


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
        return f"<Spectrum of {self.record.words}: {said}, {counted(len(self.probes), 'probe')}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the spectrum at every probe, amplitudes to -80 dB of the largest on a logarithmic
        axis, up to the highest frequency that has -60 dB.
        """
        ax = new_axes(ax)
        shown = self.record.per_unit * self.amplitudes
        largest = float(shown.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, np.maximum(shown, 1e-3 * DEEPEST * largest), self.probes)
        loud = self.frequencies[(shown > LOUD * largest).any(axis=1)]
        ax.set_yscale("log")
        ax.set_xlim(0, 1.1 * max(float(loud.max(initial=0.0)), 100.0))
        ax.set_ylim(DEEPEST * largest, 3 * largest)
        ax.set_xlabel("frequency, Hz")
        ax.set_ylabel(f"amplitude, {self.record.shown}")
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
    amplitudes: NDArray[np.complex128]
    probes: Floats
    quantity: str

    @property
    def record(self) -> Quantity:
        """The record of its quantity."""
        return quantity(self.quantity)

    def __getitem__(self, name: str) -> NDArray[np.complex128]:
        """Amplitudes (p,) of the line of a name; raises a ValueError if it is none of them."""
        return np.asarray(self.amplitudes[self.names.index(choose("line", name, self.names))])

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        strongest = np.argsort(-np.abs(self.amplitudes).max(axis=1, initial=0.0), kind="stable")
        named = ", ".join(self.names[k] for k in strongest[:LISTED])
        said = f"{counted(len(self), 'line')}, {counted(len(self.probes), 'probe')}"
        said += f"; the strongest: {named}" if named else ""
        return f"<Lines of {self.record.words}: {said}>"

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw the moduli at every probe, each line with its name, or say that none is resolved."""
        ax = new_axes(ax)
        size = self.record.per_unit * np.abs(self.amplitudes)
        largest = float(size.max(initial=0.0)) or 1.0
        curves(ax, self.frequencies, size, self.probes, ls="none", marker="o", ms=4)
        heights = size.max(axis=1, initial=0.0)
        loud = np.flatnonzero(heights > LOUD * largest)
        end = 1.1 * max(float(self.frequencies[loud].max(initial=0.0)), 100.0)
        width, height = LEFT * 72 / ax.figure.dpi * np.array(ax.get_window_extent().size)  # points
        apart = BROAD * small() / width * end
        low, high = np.log10([LOUD / 3 * largest, 10 * largest])
        chosen = list[int]()  # whose names have room: none is near a stronger one
        for k in loud[np.argsort(-heights[loud], kind="stable")].tolist():
            if (np.abs(self.frequencies[k] - self.frequencies[chosen]) > apart).all():
                chosen.append(k)
        for k in chosen:
            ax.annotate(
                self.names[k], (self.frequencies[k], heights[k]), xytext=(0, 5),
                textcoords="offset points", rotation=90, ha="center", fontsize=small(),
                parse_math=False,
            )  # fmt: skip
            share = min((5 + LONG * small() * len(self.names[k])) / height, 0.6)
            high = max(high, (np.log10(heights[k]) - share * low) / (1 - share))
        if not len(self):
            ax.text(0.5, 0.5, NONE_RESOLVED, transform=ax.transAxes, ha="center", va="center")
        ax.set_yscale("log")
        ax.set_ylim(10**low, 10**high)
        ax.set_xlim(0, end)
        ax.set_xlabel("frequency, Hz")
        ax.set_ylabel(f"amplitude, {self.record.shown}")
        return ax
