"""What propagation changes over many Tactons: a verdict, medians with ranges, and a dot plot."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from simple_model.numbers import interval, significant
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.report.figures import with_style
from skinwave.report.palette import ink_colour, label, line_style
from skinwave.report.styles import Style
from skinwave.results.propagation import OUTSIDE, Propagation
from skinwave.results.run import Run
from skinwave.system.table import Table
from skinwave.typing import Floats

Effects = Mapping[str, Mapping[str, Propagation]]  # by Tacton and column
NOT_SKIN = "thresholds are known only for skin"
OF_PRESSURE = "none (a pressure)"


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of a Tacton on a body and of the kernel, in SI units; None if there is no value.

    Pages show it times `factor`, in `unit`. `reason` says why a body may have no value.
    """

    name: str
    unit: str
    of: Callable[[Propagation], float | None]
    of_kernel: Callable[[Propagation], float | None] = lambda effect: None
    reason: str = NOT_SKIN
    factor: float = 1e3


def _reach(effect: Propagation) -> float | None:
    """Return the reach above threshold in m; 0 if nothing exceeds it."""
    if not effect.above_threshold:
        return None
    once = effect.above_threshold[1]
    return once.metre if once else 0.0


NUMBERS = (
    Number(
        name="half of the motion within, from the path", unit="mm", of=lambda e: e.half,
        of_kernel=lambda e: e.kernel_half, reason="no map",
    ),
    Number(
        name=f"motion outside the kernel's {OUTSIDE:g} dB region", unit="%", of=lambda e: e.share,
        of_kernel=lambda e: None if e.share is None else 0.0, reason="no map", factor=100.0,
    ),
    Number(
        name="highest sensation level at the probes", unit="dB", factor=1.0,
        of=lambda e: e.highest_sensation.level if e.highest_sensation else None,
    ),
    Number(name="reach above threshold, from the path", unit="mm", of=_reach),
    Number(
        name="delay of the kernel's strongest line", unit="ms", of=lambda e: e.delay,
        of_kernel=lambda e: 0.0, reason="too weak at the probes",
    ),
)  # fmt: skip


def columns_of(effects: Effects) -> list[str]:
    """Return the columns of all Tactons, in order."""
    return list(dict.fromkeys(column for each in effects.values() for column in each))


def _values(effects: Effects, number: Number, column: str) -> Floats:
    """Return a number of all Tactons that have it, on a body or of the kernel, in its unit."""
    if column == SAME_LOAD.name:
        each = ([number.of_kernel(e) for e in of_tacton.values()] for of_tacton in effects.values())
        found = (next((v for v in values if v is not None), None) for values in each)
    else:
        found = (number.of(each[column]) for each in effects.values() if column in each)
    return np.array([number.factor * value for value in found if value is not None])


def _text(values: Floats, unit: str) -> str:
    """Return the median with its range, in a unit."""
    low, middle, high = (float(each) for each in np.quantile(values, (0, 0.5, 1)))
    if significant(low, 2) == significant(high, 2):
        return f"{significant(middle, 2)} {unit}"
    return f"{significant(middle, 2)} {unit} ({interval(low, high)})"


def table(effects: Effects) -> Table:
    """Return the median of each number with its range, of the kernel and on each body."""
    columns = [SAME_LOAD.name, *columns_of(effects)]
    rows = []
    for number in NUMBERS:
        each = [_values(effects, number, column) for column in columns]
        if any(map(len, each)):
            texts = (
                _text(v, number.unit) if len(v) else f"none ({number.reason})" for v in each[1:]
            )
            of_kernel = _text(each[0], number.unit) if len(each[0]) else OF_PRESSURE
            rows.append([number.name, of_kernel, *texts])
    return Table([f"{len(effects)} Tactons, same loads", *map(label, columns)], rows)


@with_style
def figure(effects: Effects, style: Style) -> Figure:
    """Draw every number: a row of dots for the kernel and for each body."""
    columns = [SAME_LOAD.name, *columns_of(effects)]
    shown = [each for each in NUMBERS if any(len(_values(effects, each, c)) for c in columns)]
    size = style.size(2.2 * len(shown), 0.35 * len(columns) + 1.0)
    drawn = Figure(figsize=size, layout="constrained")
    axes = np.atleast_1d(drawn.subplots(1, len(shown), sharey=True))
    for ax, number in zip(axes, shown, strict=True):
        for row, column in enumerate(columns):
            if len(values := _values(effects, number, column)):
                at = np.full(len(values), row)
                ax.plot(values, at, ls="", ms=5, alpha=0.6, **line_style(column))
                ax.plot(np.median(values), row, marker="|", ms=18, mew=2, color=ink_colour(column))
        words = number.name.replace(", from the path", "").replace(" at the probes", "")
        half = words.find(" ", len(words) // 2)
        text = f"{words[:half]}\n{words[half + 1 :]}, {number.unit}"
        ax.set_xlabel(text.replace(" -", " \N{MINUS SIGN}").replace("\n-", "\n\N{MINUS SIGN}"))
        ax.grid(axis="x", alpha=0.3)
    axes[0].set(yticks=range(len(columns)), yticklabels=map(label, columns))
    axes[0].set_ylim(len(columns) - 0.4, -0.6)  # the kernel first
    return drawn


def sentences(effects: Effects, groups: Mapping[str, Sequence[Run]]) -> list[str]:
    """Return how bodies differ from the kernel over all Tactons, in place and strongest line."""
    columns = columns_of(effects)
    kernel = _values(effects, NUMBERS[0], SAME_LOAD.name)
    halves = {c: v for c in columns if len(v := _values(effects, NUMBERS[0], c))}
    parts = []
    if halves:
        each = _in_words(f"{_text(v, 'mm')} on the {label(c)}" for c, v in halves.items())
        parts.append(
            f"Under the same {len(effects)} loads, half of the motion lies within "
            f"{_text(kernel, 'mm')} of the path in the kernel, {each}: waves carry it out of the "
            "focus, and the edges of a sheet reflect them."
        )
    gains = {c: _gains(effects, groups, c) for c in columns}
    most = max(gains, key=lambda c: len(gains[c]))
    if gains[most]:
        others = _in_words([f"{label(c)}: {len(own)}" for c, own in gains.items() if c != most])
        parts.append(
            f"In {len(gains[most])} of {len(effects)} Tactons{f' ({others})' * bool(others)} the "
            f"strongest line on the {label(most)} is not that of the kernel: resonances amplify it "
            f"{_text(np.array(gains[most]), 'times')} as much as the kernel's strongest line."
        )
    return parts


def _gains(effects: Effects, groups: Mapping[str, Sequence[Run]], column: str) -> list[float]:
    """Return, for each Tacton whose strongest line on a body is not the kernel's, how much more the
    body amplifies the pressure of that line than that of the kernel's strongest line.
    """
    gains = []
    for tacton, each in effects.items():
        tables = {run.column: run.table.amplitudes for run in groups[tacton]}
        effect = each.get(column)
        if not (effect and effect.strongest and effect.kernel_strongest):
            continue
        one, other = effect.strongest.name, effect.kernel_strongest.name
        if one != other and SAME_LOAD.name in tables:
            both = (tables[column], tables[SAME_LOAD.name])
            own, of_kernel = (float(a[one].max() / a[other].max()) for a in both)
            gains.append(own / of_kernel)
    return gains


def _in_words(texts: Iterable[str]) -> str:
    """Return texts as a list in words."""
    *first, last = [*texts] or [""]
    return f"{', '.join(first)} and {last}" if first else last
