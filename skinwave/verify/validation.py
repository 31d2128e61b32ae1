"""Comparison of models with published measurements: rows, verdict, figures and page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isnan, nan
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model.numbers import EN_DASH, interval, significant
from skinwave.report.figures import REPORT, legend, png, with_style
from skinwave.system.document import Details, Part, Picture, Report, Section, contents
from skinwave.system.effort import Progress, silent
from skinwave.system.table import Column, Table
from skinwave.verify import predictions
from skinwave.verify.predictions import BODIES, USUAL, Curves, Samples, peak
from skinwave.verify.published import (
    ALL,
    CONTACTS,
    EXPONENT,
    FORCE,
    LENGTH,
    NOT_COMPARED,
    OPTIMUM,
    SKINSOURCE,
    SOFTEST,
    SPEED,
    WAVES,
    Observable,
    Published,
    all_sources,
)

Outcome = Literal["within", "below", "above", "no wave"]
QUANTITIES = SPEED, LENGTH, EXPONENT, FORCE, SOFTEST  # each with a sentence and a row
HAND = "hand, finite elements"
COLOURS = {
    "forearm": "#D55E00", "palm": "#0072B2", "palm-stiff": "#56B4E9", "skin-slab": "#009E73",
    "palm-layers": "#CC79A7", "forearm-layers": "#E69F00", HAND: "#000000", "range": "#dddddd",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A body's value `ours`, in SI, nan without a wave, and value number k of a published set."""

    published: Published
    k: int
    body: str
    ours: float

    @property
    def is_fitted(self) -> bool:
        """Whether the body was fitted to this source, so that agreement is no evidence."""
        return self.body in self.published.fitted

    @property
    def frequency(self) -> float:
        """Frequency in Hz."""
        return self.published.frequencies[self.k]

    @property
    def factor(self) -> float:
        """Our value over the nearest published one: 1 within the spread, nan without our value."""
        low, high = self.published.between(self.k)
        margin = 0.0 if self.published.lows else self.published.reading_error
        if (1 - margin) * low <= self.ours <= (1 + margin) * high:
            return 1.0
        return self.ours / (high if self.ours > high else low)

    @property
    def miss(self) -> float:
        """The factor or its reciprocal, whichever is above 1."""
        return max(self.factor, 1 / self.factor) if self.factor else inf

    @property
    def outcome(self) -> Outcome:
        """Where our value lies relative to the published one."""
        if isnan(self.factor):
            return "no wave"
        return "within" if self.factor == 1.0 else "above" if self.factor > 1 else "below"


def compare_set(published: Published, body: str, ours: Iterable[float]) -> list[Compared]:
    """Return rows of a set and a body with values (n,), in SI, at the frequencies of the set."""
    return [Compared(published=published, k=k, body=body, ours=float(value))
            for k, value in enumerate(ours)]  # fmt: skip


def validate(
    progress: Progress, *, hand: Path | None = None, samples: Samples = USUAL
) -> tuple[Mapping[str, Curves], list[Compared]]:
    """Return the leading wave of each body, and rows of all published sets.

    With the file of a `hand`, rows include the decay along its finger, by finite elements.
    """
    f = (200.0, 300.0, 400.0)
    of_hand = compare_finger(f, predictions.along_finger(hand, progress, f)) if hand else []
    progress("waves", 0.02)
    curves = {name: predictions.leading_wave(body, samples.frequencies)
              for name, body in BODIES.items()}  # fmt: skip
    sets = (*WAVES, all_sources(SPEED), all_sources(LENGTH), *CONTACTS, OPTIMUM)
    return curves, compare_sets(sets, curves, progress, samples) + of_hand


def compare_sets(
    sets: Sequence[Published], curves: Mapping[str, Curves], progress: Progress = silent,
    samples: Samples = USUAL,
) -> list[Compared]:  # fmt: skip
    """Return rows of published sets for their bodies, some with several contacts or paths."""
    rows = []
    for k, each in enumerate(sets):
        progress(each.quantity.name, 0.1 + 0.9 * k / len(sets))
        for name in each.bodies:
            for under, ours in _predicted(each, name, curves, samples).items():
                rows += compare_set(replace(each, name=each.name + under), name, ours)
    return rows


def _predicted(
    each: Published, name: str, curves: Mapping[str, Curves], samples: Samples
) -> Mapping[str, Iterable[float]]:
    """Return the predictions (n,) of a body at the frequencies of a set by contact or path."""
    body, f = BODIES[name], each.frequencies
    contacts = {f", {1e4 * area:.2g} cm²": area for area in each.areas}
    if each.quantity is EXPONENT:
        return {"": predictions.decay_exponents(body, f)}
    if each.quantity is FORCE:
        return {of: predictions.threshold_force(body, area, f) for of, area in contacts.items()}
    if each.quantity is SOFTEST:
        least = partial(predictions.least_impedance, body, samples=samples)
        return {of: [least(area)] for of, area in contacts.items()}
    if each is OPTIMUM:
        found = {}
        for perimeter in samples.perimeters:
            largest, swing = predictions.deflections(body, perimeter, samples.speeds)
            for what, deflection in (("largest", largest), ("peak to peak", swing)):
                where = f", {what}, {1e3 * perimeter:g} mm around"
                found[where] = [peak(samples.speeds, deflection)]
        return found
    return {"": curves[name].at(each.quantity, f)}


def compare_finger(frequencies: Sequence[float], lengths: Iterable[float]) -> list[Compared]:
    """Return rows that compare lengths (f,) in m along a finger with the people of SkinSource."""
    lows, highs = zip(*(SKINSOURCE.between(SKINSOURCE.frequencies.index(f)) for f in frequencies),
                      strict=True)  # fmt: skip
    own = replace(SKINSOURCE, frequencies=tuple(frequencies), values=(nan,) * len(lows), lows=lows,
                  highs=highs)  # fmt: skip
    return compare_set(own, HAND, lengths)


def verdict(rows: Sequence[Compared]) -> list[str]:
    """Return sentences that sum up the comparisons."""
    single = [row for row in rows if not row.published.name.startswith(ALL)]
    own = [row for row in single if not row.is_fitted]
    within, low, high, without = _counts(own)
    sentences = [
        f"{within} of {len(own)} independent comparisons agree within the published spread or "
        f"{100 * Published.reading_error:g} %; {low + high} miss, by a factor of {_median(own)} in "
        "the median.",
        f"In {without} the model has no wave. {len(single) - len(own)} more comparisons are of "
        "presets that were fitted to the source; they are no evidence.",
    ]
    for name, number, _, below, by, above, over, apart in _by_quantity(own):
        parts = [f"{below} are too low, by a factor of {by} in the median"] * bool(below)
        parts += [f"{above} are too high, by a factor of {over}"] * bool(above)
        parts += [f"the sources differ by factors of up to {apart}"] * bool(apart)
        sentences.append(f"{name.capitalize()}: of {number} values, {'; '.join(parts)}.")
    optima: dict[str, list[float]] = {}
    for row in own:
        if row.published.name.startswith(f"{OPTIMUM.name}, largest"):
            optima.setdefault(row.body, []).append(row.ours)
    speeds = (f"{interval(min(x), max(x))} m/s on {name}" for name, x in optima.items())
    sentences.append(
        f"The focus speed of the largest deflection is {' and '.join(speeds)}; published are "
        f"{OPTIMUM.lows[0]:g}{EN_DASH}{OPTIMUM.highs[0]:g} m/s."
    )
    if lengths := [significant(1e3 * row.ours, 2) for row in rows if row.body == HAND]:
        sentences.append(f"Along a finger, motion falls to 1/e in {', '.join(lengths)} mm.")
    return sentences


def _by_quantity(own: Sequence[Compared]) -> list[list[Any]]:
    """Return a row for each quantity: numbers of independent values, of those within, below and
    above with median factors, and the largest factor between sources at one frequency.
    """
    rows = []
    for quantity in QUANTITIES:
        alike = [row for row in own if row.published.quantity is quantity]
        within, below, above, _ = _counts(alike)
        low = _median(row for row in alike if row.outcome == "below") if below else None
        high = _median(row for row in alike if row.outcome == "above") if above else None
        band = all_sources(quantity) if quantity in (SPEED, LENGTH) else None
        apart = significant(np.max(np.divide(band.highs, band.lows)), 2) if band else None
        rows.append([quantity.name, len(alike), within, below, low, above, high, apart])
    return rows


def report(curves: Mapping[str, Curves], rows: Sequence[Compared], largest: float = 10.0) -> Report:
    """Return the page with its figures and validation.csv; factors are drawn up to `largest`."""
    sources = {row.published.name: row.published for row in rows}
    first, *others = verdict(rows)
    own = [row for row in rows if not row.is_fitted and not row.published.name.startswith(ALL)]
    factors = (
        "Each point is a preset at a frequency. Grey: within 5 %, the accuracy of reading a curve. "
        "Hollow: the preset was fitted to that source. Filled: it predicts the source. "
        f"Factors beyond {largest:g} are drawn at {largest:g}."
    )
    waves = (
        "Points: sources, with the spread between people or a standard deviation where published. "
        "Grey: range over all sources at each frequency. Lines: for each preset, the wave that "
        "moves the surface most at the edge of the focal spot (half-spaces solid, layers on bone "
        "dashed). A line breaks where another mode leads, and ends where no wave propagates. "
        "Lengths are those of plane waves, without geometric spreading."
    )
    scope = (
        "Verification checks that the equations are solved correctly. This page checks whether "
        "they are the right equations, as far as published numbers show. A preset agrees by "
        "construction with a source that it was fitted to or chosen by; tables mark these pairs "
        "as fitted. All other values are predictions. A factor is the model's value over the "
        "published value, or over the nearer end of its spread."
    )
    parts: list[Part] = [
        Picture(png(_factors(rows, largest)), factors, "factors"),
        " ".join([others[0], *others[1 + len(QUANTITIES):]]), scope,
        Details("Every set and preset", [_summary(rows)]),
        Details("Every value", [_table(rows)]),
        Section("Speed and decay of waves", [Picture(png(_waves(curves)), waves, "waves")]),
        Details("Sources", [Table(
            ["set", "site", "conditions", "source", "quality", "contradictions and assumptions"],
            [(s.name, s.site, s.conditions, s.source, s.how, s.remark) for s in sources.values()],
        )]),
        Details("Published but not compared", [Table(["source", "what", "reason"], NOT_COMPARED)]),
    ]  # fmt: skip
    quantity_columns = (
        "independent comparisons", "values", "within", "too low", "median factor", "too high",
        "median factor", "sources differ by a factor of up to",
    )  # fmt: skip
    table = Table(quantity_columns, _by_quantity(own))
    return Report("Models and published measurements", [first], [table, contents(parts), *parts])


def _counts(rows: Iterable[Compared]) -> list[int]:
    """Return the number of rows within, below, above, and without a wave."""
    return [*map([row.outcome for row in rows].count, get_args(Outcome))]


def _median(rows: Iterable[Compared]) -> str:
    """Return the median factor of rows that miss."""
    misses = [row.miss for row in rows if row.outcome in ("below", "above")]
    return significant(float(np.median(misses or [1.0])), 2)


def _summary(rows: Sequence[Compared]) -> Table:
    """Return a row for each set and preset: counts of outcomes, and the median factor of a miss."""
    groups: dict[tuple[str, str], list[Compared]] = {}
    for row in rows:
        groups.setdefault((row.published.name, row.body), []).append(row)
    columns = ("set", "preset", "fitted or predicted", "values", *get_args(Outcome),
               "median factor of a miss")  # fmt: skip
    return Table(columns, (
        (name, body, "fitted" if group[0].is_fitted else "predicted", len(group), *_counts(group),
         _median(group)) for (name, body), group in groups.items()
    ))  # fmt: skip


def _table(rows: Sequence[Compared]) -> Table:
    """Return a row for every published value and preset."""

    def cells(row: Compared) -> list[Any]:
        each = row.published
        low, high = each.between(row.k) if each.lows else (nan, nan)
        numbers = (x / each.quantity.size for x in (each.values[row.k], low, high, row.ours))
        return [each.name, each.site, each.quantity.name, each.quantity.unit, row.frequency,
                row.body, *numbers, row.factor, row.outcome, row.is_fitted, each.how,
                each.source]  # fmt: skip

    return Table(
        ["set", "site", "quantity", "unit", Column("frequency_hz", "frequency", "Hz"), "body",
         "published", Column("published_low", "lowest"), Column("published_high", "highest"),
         "ours", Column("ours_over_nearest_published", "factor"), "outcome",
         Column("preset_made_from_it", "fitted"), "how", "source"],
        map(cells, rows), name="validation",
    )  # fmt: skip


def _style(name: str) -> dict[str, Any]:
    """Return the colour and line of a preset: half-spaces solid, layers dashed."""
    return {"color": COLOURS[name], "ls": "-" if BODIES[name].depth == inf else "--"}


@with_style
def _factors(rows: Sequence[Compared], largest: float) -> Figure:
    """Draw the factors, a row of points for each set."""
    names, error = list(dict.fromkeys(row.published.name for row in rows)), Published.reading_error
    size = REPORT.size(10.5, 0.24 * len(names) + 1.2)
    figure = Figure(figsize=size, layout="constrained")
    ax = figure.subplots()
    ax.axvspan(1 - error, 1 + error, color=COLOURS["range"], lw=0)
    for row in (row for row in rows if row.outcome != "no wave"):
        offset, colour = (list(COLOURS).index(row.body) - 3) / 9, COLOURS[row.body]
        factor = np.clip(row.factor, 1 / largest, largest)
        ax.plot(
            factor, names.index(row.published.name) + offset, "o", ms=4, mew=1, color=colour,
            mfc="none" if row.is_fitted else None,
        )  # fmt: skip
    ax.set(
        xscale="log", xlim=(0.9 / largest, largest / 0.9), ylim=(len(names) - 0.5, -0.5),
        xlabel="model over nearest published value",
    )  # fmt: skip
    ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10]
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.minorticks_off()
    ax.set_yticks(range(len(names)), names)
    ax.grid(alpha=0.25)
    marks = {name: {"color": colour, "marker": "o", "ls": "", "ms": 4}
             for name, colour in COLOURS.items() if name != "range"}  # fmt: skip
    legend(figure, marks, 7, loc="outside upper right", fontsize=8)
    return figure


@with_style
def _waves(curves: Mapping[str, Curves]) -> Figure:
    """Draw phase speed and 1/e length over frequency: sources as points, presets as lines."""
    figure = Figure(figsize=REPORT.size(11.5, 5.6), layout="constrained")
    for ax, quantity in zip(figure.subplots(1, 2), (SPEED, LENGTH), strict=True):
        _sources(ax, quantity)
        for name, c in curves.items():
            shown = c.frequencies >= 10
            ends = 1 + np.flatnonzero(np.diff(c.mode[shown]))  # where another mode leads
            values = (c.speed if quantity is SPEED else c.length) / quantity.size
            f, y = (np.insert(x[shown], ends, nan) for x in (c.frequencies, values))
            ax.plot(f, y, lw=1.3, **_style(name))
        ax.set(xlim=(-15, 720), xlabel="frequency, Hz", ylabel=f"{quantity.name}, {quantity.unit}")
        ax.set(**{"ylim": (0, 20)} if quantity is SPEED else {"yscale": "log", "ylim": (1, 300)})
        ax.grid(alpha=0.25)
        ax.legend(fontsize=7, frameon=False, loc="upper right")
    entries = {name: _style(name) for name in curves}
    legend(figure, entries, 6, loc="outside upper center", fontsize=8)
    return figure


def _sources(ax: Axes, quantity: Observable) -> None:
    """Draw published values with their spread, or their range, and the range of all sources."""
    size, whole = quantity.size, all_sources(quantity)
    low, high = (np.array(x) / size for x in (whole.lows, whole.highs))
    ax.fill_between(whole.frequencies, low, high, color=COLOURS["range"], lw=0, zorder=0)
    sets = [each for each in WAVES if each.quantity is quantity]
    for marker, each in zip("osv^DPX", sets, strict=False):
        low, high = np.array([each.between(k) for k in range(len(each.values))]).T / size
        middle = np.where(np.isnan(each.values), (low + high) / 2, np.array(each.values) / size)
        errors = np.stack([middle - low, high - middle]) if each.lows else None
        ax.errorbar(each.frequencies, middle, errors, fmt=marker, ms=5, color="k", mfc="w", lw=1,
                    capsize=2, label=f"{each.name}, {each.site}", zorder=3)  # fmt: skip
