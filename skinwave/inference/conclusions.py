"""Conclusions in words, from the rows of the table alone."""

from collections.abc import Iterator, Sequence

import numpy as np

from meshes.tetmesh import Floats
from skinwave.inference.assess import CLAIMED
from skinwave.inference.deflection import deflection_words
from skinwave.inference.design import PARAMETERS
from skinwave.inference.knowledge import (
    Mask,
    Region,
    Row,
    Share,
    Told,
    holds,
    in_percent,
    pattern,
    percent,
    region,
    sample,
    searched,
    share,
    told,
    variance_share,
)
from skinwave.inference.nearest_sheets import rival_level
from skinwave.inference.ranking import nearest
from skinwave.inference.stretched_words import stretched_sentences
from skinwave.results.claims import MUCH_LOWER
from skinwave.scene.paper15 import PATHS
from skinwave.system.numbers import decibel, significant

FIRST = 3  # parameters that are named
CERTAIN = 0.5  # of a claim's entropy: a parameter that takes this away decides it
BARS = (-10.0, -6.0)  # dB, of M5
SIZES = tuple(f"{1e3 * size:g} mm" for size, _ in PATHS if size)


def conclusions(rows: Sequence[Row], stretched: Sequence[Row] = ()) -> list[str]:
    """The paragraphs that the page begins with: the result, why, what would tell more, and how far
    sheets deflect.

    Parameters
    ----------
    rows : of the table
    stretched : of that of the nearest sheets at large deflection

    Returns
    -------
    list of str

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
        _next(fair),
        f"{deflection_words(fair)} {stretched_sentences(rows, stretched)}",
    ]


def together(rows: Sequence[Row]) -> list[tuple[str, Share]]:
    """Shares of rows in which the first claim holds, the first two, and so on."""
    found, mask = [], np.ones(len(rows), bool)
    for k, claim in enumerate(CLAIMED, 1):
        mask = mask & holds(rows, claim)
        found.append((" and ".join(CLAIMED[:k]), share(mask)))
    return found


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


def _all_five(fair: Sequence[Row], more: Sequence[Row]) -> str:
    found, also = share(holds(fair, "all")), share(holds(more, "all"))
    _, high = found.interval
    said = f"Of {found.of:,} candidates {found.held or 'none'} show all five claims"
    said += f", {in_percent(found)}." if found.held else f" (below {percent(high)} %)."
    if also.of:
        said += f" A search of {also.of:,} more near the best of them found {also.held or 'none'}."
    said += _with_other_bars(fair, more)
    best = nearest([*fair, *more])[0]
    shown = [claim for claim in CLAIMED if best[f"{claim}_holds"]]
    return (
        f"{said} The nearest, on a sheet that sags by {significant(best['sag_over_thickness'], 2)} "
        f"thicknesses, shows {', '.join(shown)}, its other lines at {rival_level(best)} dB or "
        "below."
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
            f"{claim} {verb} the {best.parameter.words} ({percent(best.fraction)} % of its "
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
        f"({percent(counts[common] / len(fair))} %), on the path of {SIZES[largest]} in "
        f"{percent(on_path.value)} %; its level is {median} dB in the median and {least} dB at "
        f"the least, where M4 asks for 0 dB, and goes most with the {tells.words} "
        f"({percent(variance_share(fair, levels, tells))} % of its variance). {_multiples(fair)}"
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
    best = [each for each in told(fair, pattern(fair)) if each.bits > 0][:FIRST]
    if not best:
        return "No parameter tells which claims hold."
    each = [f"the {t.parameter.words} ({t.bits:.2f} of {t.entropy:.2f} bits)" for t in best]
    return f"To know one thing more, {each[0]} would tell most" + (
        f", then {' and '.join(each[1:])}." if each[1:] else "."
    )
