"""Measured lines with their noise, and models beside them, place by place."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshes.tetmesh import Floats
from simple_model.quantities import Quantity
from skinwave.report.figures import REPORT
from skinwave.report.palette import inked, label, marker
from skinwave.report.styles import Style

MOST_LINES = 6
NORMAL_95 = 1.96
BESIDE = 0.12  # of the distance between two places, by which models are drawn apart
FAINT = 0.02  # of a line's largest amplitude, below which a phase is not drawn


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

    Returns
    -------
    Figure
    """
    strongest = np.sort(np.argsort(-np.abs(measured).max(axis=1), kind="stable")[:MOST_LINES])
    names = list(lines)
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 1.45 * len(strongest) + 1.7), layout="constrained")
        axes = figure.subplots(len(strongest), 2, sharex=True, squeeze=False)
        for (left, right), k in zip(axes, strongest, strict=True):
            _amplitudes(left, measured[k], error[k], quantity)
            _phase_noise(right, measured[k], error[k])
            for n, (column, model) in enumerate(models.items()):
                offset = BESIDE * (n - (len(models) - 1) / 2)
                _model(left, right, column, offset, measured[k], model[k], differs[column][k],
                       quantity)  # fmt: skip
            left.set_ylabel(f"{names[k]}\n{lines[names[k]]:.1f} Hz", fontweight="bold",
                            parse_math=False)  # fmt: skip
        _labels(axes, places, quantity)
        _legend(figure, list(models))
    return figure


def _amplitudes(ax: Axes, measured: np.ndarray, error: Floats, quantity: Quantity) -> None:
    at, size = np.arange(len(measured)), quantity.per_unit * np.abs(measured)
    bars = quantity.per_unit * NORMAL_95 * np.nan_to_num(error)
    ink = mpl.rcParams["text.color"]
    ax.errorbar(at, size, bars, fmt="_", ms=14, mew=2, capsize=4, color=ink, zorder=3)
    ax.grid(alpha=0.25)


def _phase_noise(ax: Axes, measured: np.ndarray, error: Floats) -> None:
    """Twice the standard error of the measured phase about 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        band = np.degrees(NORMAL_95 * np.nan_to_num(error) / np.abs(measured))
    at = np.arange(len(measured))
    ax.bar(at, 2 * np.minimum(band, 180), bottom=-np.minimum(band, 180), width=0.7, color="0.8",
           zorder=0)  # fmt: skip
    ax.axhline(0, color=mpl.rcParams["text.color"], lw=1)
    ax.set_ylim(-190, 190)
    ax.set_yticks([-180, -90, 0, 90, 180])
    ax.grid(alpha=0.25)


def _model(
    left: Axes,
    right: Axes,
    column: str,
    offset: float,
    measured: np.ndarray,
    model: np.ndarray,
    differs: np.ndarray,
    quantity: Quantity,
) -> None:
    at = np.arange(len(measured)) + offset
    phase = np.degrees(np.angle(model * measured.conj()))
    seen = np.abs(model) > FAINT * np.abs(model).max(initial=0.0)
    for ax, y, drawn in (
        (left, quantity.per_unit * np.abs(model), seen | True),
        (right, phase, seen),
    ):
        style: dict[str, Any] = {"color": inked(column), "ls": "", "marker": _marker(column)}
        for mask, face in ((differs, inked(column)), (~differs, "none")):
            ax.plot(at[mask & drawn], y[mask & drawn], ms=6, mfc=face, **style)


def _marker(column: str) -> str:
    """The marker of a column, where it is a cross a filled one, to be open or not."""
    return marker(column).replace("x", "X")


def _labels(axes: np.ndarray, places: Floats, quantity: Quantity) -> None:
    axes[0, 0].set_title(f"amplitude, {quantity.shown}", fontsize="medium")
    axes[0, 1].set_title("phase of the model less the measured one, degrees", fontsize="medium")
    for ax in axes[-1]:
        ax.set_xticks(range(len(places)))
        ax.set_xticklabels([f"{1e3 * x:.3g}\n{1e3 * y:.3g}" for x, y in places])
        ax.set_xlabel("place, x above y, mm")
        ax.set_xlim(-0.6, len(places) - 0.4)
    for ax in axes[:, 0]:
        ax.set_ylim(bottom=0)


def _legend(figure: Figure, columns: Sequence[str]) -> None:
    ax, ink = figure.axes[0], mpl.rcParams["text.color"]
    handles: list[Any] = [ax.plot([], [], color=ink, marker="_", ms=14, mew=2, ls="")[0]]
    labels = ["measured, bars of 95 %"]
    for column in columns:
        style: dict[str, Any] = {"color": inked(column), "ls": "", "marker": _marker(column)}
        handles.append(ax.plot([], [], ms=6, **style)[0])
        labels.append(label(column))
    handles.append(ax.plot([], [], ls="", marker="o", mfc="none", color="0.4")[0])
    labels.append("open: within the noise")
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
