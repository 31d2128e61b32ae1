"""Figures of an inference (matplotlib): shares, what decides, levels of the strongest rival."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skinwave.inference.assess import CLAIMED
from skinwave.inference.conclusions import SIZES, together
from skinwave.inference.design import PARAMETERS, Parameter
from skinwave.inference.knowledge import (
    BINS,
    Row,
    Share,
    binned,
    holds,
    share,
    told,
    variance_share,
)
from skinwave.report.figures import REPORT
from skinwave.report.palette import SPARE
from skinwave.report.styles import Style
from skinwave.results.claims import MUCH_LOWER

BLUE, ORANGE = "#0072B2", "#D55E00"
LEVEL = "strongest line but f_AM, dB re f_AM"


def share_figure(rows: Sequence[Row], style: Style = REPORT) -> Figure:
    """Share of candidates that show each claim, and the first ones together, with intervals."""
    each = [(claim, share(holds(rows, claim))) for claim in CLAIMED]
    both = [(f"M1 to {words[-2:]}", found) for words, found in together(rows)[1:]]
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(8.5, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(5, 4))
        _bars(left, each, BLUE, "each claim")
        _bars(right, both, ORANGE, "claims together")
        left.set(ylabel="share of candidates, %", ylim=(0, 108))
    return figure


def _bars(ax: Axes, found: Sequence[tuple[str, Share]], colour: str, title: str) -> None:
    values = np.array([100 * each.value for _, each in found])
    bounds = 100 * np.array([each.interval for _, each in found]).T
    ax.bar(range(len(found)), values, 0.6, color=colour, yerr=np.abs(bounds - values), capsize=3)
    for k, (_, each) in enumerate(found):
        ax.annotate(f"{each.held}", (k, bounds[1, k]), ha="center", va="bottom", fontsize="small")
    ax.set_xticks(range(len(found)), [name for name, _ in found])
    ax.set_title(f"{title}, of {found[0][1].of:,}", fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)


def decision_figure(rows: Sequence[Row], style: Style = REPORT) -> Figure:
    """How much of each claim's entropy, and of the variance of the strongest rival's level, each
    parameter takes away.
    """
    claims = [claim for claim in CLAIMED if 0 < holds(rows, claim).sum() < len(rows)]
    columns = []
    for claim in claims:
        by_key = {t.parameter.key: t.fraction for t in told(rows, holds(rows, claim).astype(int))}
        columns.append([by_key[p.key] for p in PARAMETERS])
    levels = np.array([row["M4_value"] for row in rows])
    columns.append([variance_share(rows, levels, p) for p in PARAMETERS])
    table = 100 * np.array(columns).T
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(7.5, 6.2), layout="constrained")
        ax = figure.subplots()
        image = ax.imshow(table, cmap="Blues", vmin=0, vmax=100, aspect="auto")
        for (i, j), value in np.ndenumerate(table):
            if value >= 0.5:
                ax.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize="small",
                        color="white" if value > 55 else "black")  # fmt: skip
        ax.set_xticks(range(len(columns)), [*claims, "rival's level"])
        ax.set_yticks(range(len(PARAMETERS)), [p.words for p in PARAMETERS])
        figure.colorbar(image, ax=ax, label="entropy, or variance, that it takes away, %")
    return figure


def rival_figure(rows: Sequence[Row], style: Style = REPORT) -> Figure:
    """Distribution of the level of the strongest line other than f_AM, by the size of the path."""
    by_path = np.array([row["rival_by_path_db"] for row in rows])
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(7.0, 3.6), layout="constrained")
        ax = figure.subplots()
        part = 100 * np.arange(1, len(rows) + 1) / len(rows)
        colours = (SPARE[0], BLUE, ORANGE)
        for levels, size, colour in zip(by_path.T, SIZES, colours, strict=True):
            ax.step(np.sort(levels), part, where="post", color=colour, label=f"path of {size}")
        worst = np.sort(by_path.max(axis=1))
        ax.step(worst, part, where="post", color="black", lw=2, label="all paths")
        multiples = np.sort([row["M5_value"] for row in rows])
        ax.step(multiples, part, where="post", color="black", ls="--", label="multiples alone")
        for limit, words in ((0.0, "M4 asks"), (MUCH_LOWER, "M5 asks")):
            ax.axvline(limit, color="grey", ls=":")
            ax.text(limit, 101, words, ha="center", va="bottom", fontsize="small", color="grey")
        low = min(MUCH_LOWER - 5, float(np.quantile(by_path, 0.001)))
        ax.set(xlabel=LEVEL, ylabel="candidates below it, %", ylim=(0, 100),
               xlim=(low, float(np.quantile(by_path, 0.995))))  # fmt: skip
        ax.legend(frameon=False, fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def region_figure(rows: Sequence[Row], style: Style = REPORT) -> Figure:
    """Level of the strongest rival over each parameter: median, and the middle half."""
    levels = np.array([row["M4_value"] for row in rows])
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(11.0, 9.5), layout="constrained")
        axes = figure.subplots(4, 4, sharey=True).ravel()
        for ax, parameter in zip(axes, PARAMETERS, strict=True):
            _panel(ax, rows, parameter, levels)
        for ax in axes[::4]:
            ax.set_ylabel("dB re f_AM")
    return figure


def _panel(ax: Axes, rows: Sequence[Row], parameter: Parameter, levels: np.ndarray) -> None:
    bins = binned(rows, parameter)
    count = len(parameter.values) or BINS
    inside = [levels[bins == k] for k in range(count)]
    quartiles = np.array([np.quantile(x, (0.25, 0.5, 0.75)) if len(x) else [np.nan] * 3
                          for x in inside]).T  # fmt: skip
    at = np.arange(count) + 0.5
    if parameter.bounds:
        low, high = parameter.bounds
        at = low + at / count * (high - low)
        ax.fill_between(at, quartiles[0], quartiles[2], color=BLUE, alpha=0.2, lw=0)
        ax.plot(at, quartiles[1], "o-", color=BLUE, ms=4)
        ax.set_xlim(low, high)
    else:
        ax.vlines(at, quartiles[0], quartiles[2], color=BLUE, alpha=0.3, lw=6)
        ax.plot(at, quartiles[1], "o", color=BLUE, ms=5)
        names = [value.replace("_", " ") for value in parameter.values]
        ax.set_xticks(at, names, rotation=25, ha="right", fontsize="small")
    ax.axhline(0, color="grey", ls=":", lw=1)
    ax.set_title(f"{parameter.words}{f', {parameter.unit}' if parameter.unit else ''}",
                 fontsize="small")  # fmt: skip
    ax.spines[["top", "right"]].set_visible(False)
