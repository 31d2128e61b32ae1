"""Measured lines with their noise, and models beside them, place by place."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model.quantities import Quantity
from skinwave.report.figures import REPORT, legend, styled, written
from skinwave.report.palette import inked, label, marker
from skinwave.report.styles import Style
from skinwave.typing import Floats

MOST_LINES = 6
NORMAL_95 = 1.96
BESIDE = 0.12  # of the distance between two places, by which models are drawn apart
FAINT = 0.02  # of a line's largest amplitude, below which a phase is not drawn


@styled
def lines_figure(
    lines: Mapping[str, float],
    places: Floats,
    measured: np.ndarray,
    error: Floats,
    models: Mapping[str, np.ndarray],
    differs: Mapping[str, np.ndarray],
    quantity: Quantity,
    *,
    style: Style = REPORT,
) -> Figure:
    """Amplitudes and phases of the strongest measured lines at each place.

    Parameters
    ----------
    lines : frequencies in Hz by name
    places : (p, 2) float, metre
    measured : (f, p) complex, SI
    error : (f, p) float, standard errors of amplitudes, SI; nan if unknown
    models : (f, p) complex by `Run.column`, with gain and delay, SI
    differs : (f, p) bool likewise, where a difference is beyond the noise
    quantity : Quantity
    style : Style
    """
    strongest = np.sort(np.argsort(-np.abs(measured).max(axis=1), kind="stable")[:MOST_LINES])
    figure = Figure(figsize=style.size(10.5, 1.45 * len(strongest) + 1.7), layout="constrained")
    axes = figure.subplots(len(strongest), 2, sharex=True, squeeze=False)
    for (left, right), k in zip(axes, strongest, strict=True):
        noise = NORMAL_95 * np.nan_to_num(error[k])
        _measured(left, right, quantity.per_unit * np.abs(measured[k]), quantity.per_unit * noise)
        for n, (column, model) in enumerate(models.items()):
            at = np.arange(len(places)) + BESIDE * (n - (len(models) - 1) / 2)
            size = np.abs(model[k])
            seen = size > FAINT * size.max(initial=0.0)
            phase = np.where(seen, np.degrees(np.angle(model[k] * measured[k].conj())), np.nan)
            style_of = _drawn_as(column)
            for mask, face in (
                (differs[column][k], style_of["color"]),
                (~differs[column][k], "none"),
            ):
                left.plot(at[mask], quantity.per_unit * size[mask], mfc=face, **style_of)
                right.plot(at[mask], phase[mask], mfc=face, **style_of)
        left.set_ylim(bottom=0)
        name = list(lines)[k]
        left.set_ylabel(f"{written(name)}\n{lines[name]:.1f} Hz", fontweight="bold")
    axes[0, 0].set_title(f"amplitude, {quantity.shown}", fontsize="medium")
    axes[0, 1].set_title("phase of the model less the measured one, degrees", fontsize="medium")
    for ax in axes[-1]:
        ax.set_xticks(range(len(places)), [f"{1e3 * x:.3g}\n{1e3 * y:.3g}" for x, y in places])
        ax.set(xlabel="place, x above y, mm", xlim=(-0.6, len(places) - 0.4))
    entries: dict[str, dict[str, Any]] = {
        "measured, bars of 95 %": {
            "color": mpl.rcParams["text.color"], "marker": "_", "ms": 14, "mew": 2, "ls": ""
        }
    }  # fmt: skip
    entries |= {label(column): _drawn_as(column) for column in models}
    open_one = {"ls": "", "marker": "o", "mfc": "none", "color": "0.4"}
    entries["open: within the noise"] = open_one
    legend(figure, entries, 5, loc="outside upper center", fontsize=None)
    return figure


def _measured(left: Axes, right: Axes, size: Floats, noise: Floats) -> None:
    """Amplitudes (p,) with bars, and twice the standard error of the phase about 0."""
    at, ink = np.arange(len(size)), mpl.rcParams["text.color"]
    left.errorbar(at, size, noise, fmt="_", ms=14, mew=2, capsize=4, color=ink, zorder=3)
    with np.errstate(divide="ignore", invalid="ignore"):
        band = np.minimum(np.degrees(noise / size), 180)
    right.bar(at, 2 * band, bottom=-band, width=0.7, color="0.8", zorder=0)
    right.axhline(0, color=ink, lw=1)
    right.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
    for ax in (left, right):
        ax.grid(alpha=0.25)


def _drawn_as(column: str) -> dict[str, Any]:
    """Marker of a column, where it is a cross a filled one, to be open or not."""
    return {"color": inked(column), "ls": "", "ms": 6, "marker": marker(column).replace("x", "X")}
