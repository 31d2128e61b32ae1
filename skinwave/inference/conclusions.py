"""Conclusions in words, from the rows of the table alone."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from meshes.tetmesh import Floats
from skinwave.inference.assess import CLAIMED
from skinwave.inference.design import PARAMETERS, Parameter, used
from skinwave.inference.knowledge import (
    Mask,
    Region,
    Row,
    Share,
    Told,
    holds,
    is_linear,
    pattern,
    region,
    sample,
    searched,
    share,
    told,
    value_words,
    variance_share,
)
from skinwave.inference.table import nearest
from skinwave.numbers import decibel, significant
from skinwave.studies.claims import MUCH_LOWER
from skinwave.studies.paper15 import PATHS

SHEETS = 3  # that are shown
CERTAIN = 0.5  # of a claim's entropy: a parameter that takes this away decides it
BARS = (-10.0, -6.0)  # dB, of M5
SIZES = tuple(f"{1e3 * size:g} mm" for size, _ in PATHS if size)


def conclusions(rows: Sequence[Row]) -> list[str]:
    """The paragraphs that the page begins with: the result, why, and what would tell more.

    Raises
    ------
    ValueError
        If no candidate of a hypercube has a response.
    """
    fair = sample(rows)
    if not fair:
        raise ValueError(
            f"none of {len(rows)} rows is a candidate with a response; compute some first"
        )
    return [
        f"{_all_five(fair, searched(rows))} {_each(fair)} {_rivals(fair)}",
        " ".join(_deciders(fair)),
        f"{_next(fair)} {_validity(fair)}",
    ]


def in_percent(found: Share) -> str:
    """A share with its interval."""
    low, high = found.interval
    return f"{_percent(found.value)} % ({_percent(low)} to {_percent(high)} %)"


def together(rows: Sequence[Row]) -> list[tuple[str, Share]]:
    """Shares of rows in which the first claim holds, the first two, and so on."""
    found, mask = [], np.ones(len(rows), bool)
    for k, claim in enumerate(CLAIMED, 1):
        mask = mask & holds(rows, claim)
        found.append((" and ".join(CLAIMED[:k]), share(mask)))
    return found


def sheets(rows: Sequence[Row]) -> list[Row]:
    """The best rows of all, each of another size or support."""
    found: list[Row] = []
    for row in nearest(rows):
        if all((row["size"], row["support"]) != (r["size"], r["support"]) for r in found):
            found.append(row)
    return found[:SHEETS]


def decider(rows: Sequence[Row], mask: Mask) -> Told | None:
    """The parameter that tells most of a mask (r,); None if none does."""
    best = told(rows, mask.astype(int))[0]
    return best if best.bits > 0 else None


def readings(rows: Sequence[Row]) -> list[tuple[str, Floats]]:
    """Levels (r,) in dB re f_AM of the strongest other line if the claims are read less strictly,
    by words; not finite where M3 fails, of the multiples that it is about.
    """
    by_point, by_path = _levels(rows, "rival_db"), _levels(rows, "rival_by_path_db")
    found = [("all lines, at all five points, on all paths", by_path.max(axis=1))]
    found += [(f"the same on the path of {size}", level)
              for size, level in zip(SIZES, by_path.T, strict=True)]  # fmt: skip
    found += [(f"all lines, at point {k} alone, on all paths", level)
              for k, level in enumerate(by_point.T, 1)]  # fmt: skip
    found.append(("all lines, at any one of the points, on all paths", by_point.min(axis=1)))
    found.append(("all lines, in the root mean square over the points",
                  np.array([row["rival_of_mean_db"] for row in rows])))  # fmt: skip
    without = np.where(holds(rows, "M3"), 0.0, np.inf)
    by_path = _levels(rows, "multiple_by_path_db") + without[:, None]
    words = "multiples of f_AM and f_d alone, where M3 holds"
    found.append((f"{words}, at all five points, on all paths", by_path.max(axis=1)))
    found += [(f"the same on the path of {size}", level)
              for size, level in zip(SIZES, by_path.T, strict=True)]  # fmt: skip
    at_any = _levels(rows, "multiple_db").min(axis=1) + without
    return [*found, (f"{words}, at any one of the points", at_any)]


def _levels(rows: Sequence[Row], column: str) -> Floats:
    return np.array([row[column] for row in rows])


def _percent(x: float) -> str:
    return f"{100 * x:.0f}" if x > 0.1 or not x else f"{100 * x:.2g}"


def _all_five(fair: Sequence[Row], more: Sequence[Row]) -> str:
    found, also = share(holds(fair, "all")), share(holds(more, "all"))
    _, high = found.interval
    said = f"Of {found.of:,} candidates {found.held or 'none'} show all five claims"
    said += f", {in_percent(found)}." if found.held else f" (below {_percent(high)} %)."
    if also.of:
        said += f" A search of {also.of:,} more near the best of them found {also.held or 'none'}."
    said += _with_other_bars(fair, more)
    best = nearest([*fair, *more])[0]
    shown = [claim for claim in CLAIMED if best[f"{claim}_holds"]]
    return (
        f"{said} The best shows {', '.join(shown)}, its other lines at {_level(best)} dB or below."
    )


def _with_other_bars(fair: Sequence[Row], more: Sequence[Row]) -> str:
    """How many show all five if "much lower" is less than 20 dB: the paper has no number."""
    rows = [row for row in (*fair, *more) if all(row[f"{claim}_holds"] for claim in CLAIMED[:4])]
    at = [(bar, sum(row["M5_value"] < bar for row in rows)) for bar in BARS]
    counts = " and ".join(f"{count or 'none'} with {-bar:g} dB" for bar, count in at)
    return f' "Much lower" is {-MUCH_LOWER:g} dB here; of all candidates {counts} would.'


def _each(fair: Sequence[Row]) -> str:
    each = [f"{claim} in {in_percent(share(holds(fair, claim)))}" for claim in CLAIMED]
    three = together(fair)[2][1]
    both = share(holds(fair, "M3") & holds(fair, "M5"))
    return (
        f"{', '.join(each[:-1])} and {each[-1]} of them; M1, M2 and M3 together in "
        f"{in_percent(three)}, M3 and M5 in {in_percent(both)}."
    )


def _deciders(fair: Sequence[Row]) -> Iterator[str]:
    for claim in CLAIMED:
        mask = holds(fair, claim)
        best = decider(fair, mask)
        if best is None:
            yield f"{claim} {_undecided(mask)}."
            continue
        verb = "is decided by" if best.fraction > CERTAIN else "depends most on"
        yield (
            f"{claim} {verb} the {best.parameter.words} ({_percent(best.fraction)} % of its "
            f"entropy){_where(region(fair, mask))}."
        )


def _undecided(mask: Mask) -> str:
    if 0 < mask.sum() < len(mask):
        return f"holds in too few or too many of {len(mask):,} to say what decides it"
    return "always holds" if mask.all() else "never holds"


def _where(found: Region) -> str:
    if not found.conditions:
        return ""
    return f" and holds in {in_percent(found.share)} with {', '.join(found.conditions)}"


def _rivals(fair: Sequence[Row]) -> str:
    levels = np.array([row["M4_value"] for row in fair])
    lines, counts = np.unique([row["rival_line"] for row in fair], return_counts=True)
    paths = np.argmax([row["rival_by_path_db"] for row in fair], axis=1)
    common, largest = int(np.argmax(counts)), int(np.bincount(paths).argmax())
    on_path = share(paths == largest)
    tells = max(PARAMETERS, key=lambda p: variance_share(fair, levels, p))
    median, least = (decibel(float(x), signed=True) for x in (np.median(levels), levels.min()))
    return (
        f"The strongest rival of f_AM is {lines[common]} most often "
        f"({_percent(counts[common] / len(fair))} %), on the path of {SIZES[largest]} in "
        f"{_percent(on_path.value)} %; its level is {median} dB in the median and {least} dB at "
        f"the least, where M4 asks for 0 dB, and goes most with the {tells.words} "
        f"({_percent(variance_share(fair, levels, tells))} % of its variance). {_multiples(fair)}"
    )


def _multiples(fair: Sequence[Row]) -> str:
    there = [row["M5_value"] for row in fair if row["M3_holds"]]
    if not there:
        return "No candidate shows M3."
    median, least = (decibel(float(x), signed=True) for x in (np.median(there), min(there)))
    return (
        f"Where M3 holds, the strongest multiple of f_AM or f_d is at {median} dB in the median "
        f"and {least} dB at the least, where M5 asks for {MUCH_LOWER:g} dB."
    )


def _next(fair: Sequence[Row]) -> str:
    best = [each for each in told(fair, pattern(fair)) if each.bits > 0][:SHEETS]
    if not best:
        return "No parameter tells which claims hold."
    each = [f"the {t.parameter.words} ({t.bits:.2f} of {t.entropy:.2f} bits)" for t in best]
    return f"To know one thing more, {each[0]} would tell most" + (
        f", then {' and '.join(each[1:])}." if each[1:] else "."
    )


def _validity(fair: Sequence[Row]) -> str:
    within = is_linear(fair, "mean")
    mean, vibration = share(within), share(is_linear(fair, "vibration"))
    said = (
        f"All this is of linear sheets: the mean deflection is below half a thickness in "
        f"{_percent(mean.value)} % of them, the vibration in {_percent(vibration.value)} %"
    )
    if not mean.held:
        return f"{said}."
    highest = share(holds(fair, "M4")[within])
    return f"{said}; of the former M4 holds in {in_percent(highest)}."


def sheet_table(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """The best sheets side by side: what they show, and their parameters."""
    best = sheets(rows)

    def line(words: str, of: Callable[[Row], str]) -> list[str]:
        return [words, *map(of, best)]

    lines = [
        line("shows", lambda r: ", ".join(c for c in CLAIMED if r[f"{c}_holds"])),
        line("strongest rival of f_AM", lambda r: f"{r['rival_line']}, {_level(r)} dB"),
        line("under", lambda r: r["rival_tacton"]),
        line("first mode, Hz", lambda r: significant(r["first_mode_hz"])),
        line("mean deflection, thicknesses", lambda r: significant(r["mean_over_thickness"])),
    ]
    lines += [
        line(f"{p.words}{f', {p.unit}' if p.unit else ''}", partial(_value, p)) for p in PARAMETERS
    ]
    return ["sheet", *(str(k) for k in range(1, len(best) + 1))], lines


def _value(p: Parameter, row: Row) -> str:
    if p.key not in used(row):
        return "-"
    return value_words(row[p.key]) if p.bounds is None else significant(row[p.key])


def _level(row: Row) -> str:
    return decibel(float(row["M4_value"]), signed=True)
