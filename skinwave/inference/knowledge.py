"""Knowledge from a table of candidates: shares, which parameter decides a claim, in which region it
holds, and what one more measurement would tell.

A claim's entropy H and the information I = H(claim) - H(claim | parameter) are in bits. Few rows in
a bin make I too large: its average over shuffled rows is taken off, and what is not above all of
these is taken as none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from meshes.tetmesh import Floats
from skinwave.inference.assess import CLAIMED
from skinwave.inference.design import PARAMETERS, SUPPORTS, Parameter
from skinwave.inference.ranking import Row
from skinwave.inference.table import HYPERCUBE, SEARCH

Codes = NDArray[np.int_]
Mask = NDArray[np.bool_]

CONFIDENCE = 0.95
BINS = 5  # of a number, of equal width
SHUFFLES = 40
QUARTERS = (0.25, 0.5, 0.75)  # of a range, where a region may end
FEWEST = 20  # rows in a region
CONDITIONS = 3  # of a region
LEAST_GAIN = 0.01  # bits that a condition must tell


@dataclass(frozen=True, kw_only=True)
class Share:
    """Share of rows of which something holds, with its Clopper-Pearson interval."""

    held: int
    of: int

    @property
    def value(self) -> float:
        """The share; nan of no rows."""
        return self.held / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds of the share at 95 % (Clopper and Pearson, Biometrika 26:404 (1934))."""
        found = stats.binomtest(self.held, max(self.of, 1)).proportion_ci(CONFIDENCE, "exact")
        return float(found.low), float(found.high)


@dataclass(frozen=True, kw_only=True)
class Told:
    """Information in bits of a parameter on an outcome, and the outcome's `entropy`."""

    parameter: Parameter
    bits: float
    entropy: float

    @property
    def fraction(self) -> float:
        """Part of the entropy that knowing the parameter takes away."""
        return self.bits / self.entropy if self.entropy else 0.0


@dataclass(frozen=True, kw_only=True)
class Region:
    """Conditions, in words, under which a claim holds most often, and its share there."""

    conditions: tuple[str, ...]
    share: Share


def sample(rows: Sequence[Row]) -> list[Row]:
    """The rows of the hypercube that have a response."""
    return [row for row in rows if row["stage"] == HYPERCUBE and row["status"] == "done"]


def searched(rows: Sequence[Row]) -> list[Row]:
    """The rows of the search that have a response."""
    return [row for row in rows if row["stage"] == SEARCH and row["status"] == "done"]


def holds(rows: Sequence[Row], claim: str) -> Mask:
    """Whether a claim, or "all" of them, holds of each row (r,)."""
    if claim == "all":
        return np.logical_and.reduce([holds(rows, each) for each in CLAIMED])
    return np.array([bool(row[f"{claim}_holds"]) for row in rows], bool)


def share(mask: Mask) -> Share:
    """Share of a mask (r,) that is set."""
    return Share(held=int(mask.sum()), of=len(mask))


def percent(x: float) -> str:
    """A share in percent, without the sign."""
    return f"{100 * x:.0f}" if x > 0.1 or not x else f"{100 * x:.2g}"


def in_percent(found: Share) -> str:
    """A share with its interval."""
    low, high = found.interval
    return f"{percent(found.value)} % ({percent(low)} to {percent(high)} %)"


def told(rows: Sequence[Row], outcome: Codes) -> list[Told]:
    """Information of each parameter on an outcome (r,) of a few values, the largest first."""
    rng = np.random.default_rng(0)
    shuffled = [rng.permutation(outcome) for _ in range(SHUFFLES)]
    total, found = _entropy(outcome), []
    for parameter in PARAMETERS:
        bins = binned(rows, parameter)
        gain = total - _entropy_given(outcome, bins)
        by_chance = [total - _entropy_given(each, bins) for each in shuffled]
        bits = gain - float(np.mean(by_chance)) if gain > max(by_chance) else 0.0
        found.append(Told(parameter=parameter, bits=bits, entropy=total))
    return sorted(found, key=lambda each: -each.bits)


def pattern(rows: Sequence[Row]) -> Codes:
    """Claims that hold, as one number a row (r,)."""
    return np.array([holds(rows, claim) for claim in CLAIMED]).T @ (1 << np.arange(len(CLAIMED)))


def variance_share(rows: Sequence[Row], values: Floats, parameter: Parameter) -> float:
    """First-order Sobol' index of values (r,): Var(E[values | bin]) / Var(values), less what chance
    makes of so many bins.
    """
    bins = binned(rows, parameter)
    counts = np.bincount(bins)
    means = np.bincount(bins, values)[counts > 0] / counts[counts > 0]
    between = float((counts[counts > 0] * (means - values.mean()) ** 2).sum())
    total = float(((values - values.mean()) ** 2).sum())
    groups = int((counts > 0).sum())
    chance = (groups - 1) / max(len(values) - groups, 1) * (total - between)
    return max(0.0, between - chance) / total if total else 0.0


def binned(rows: Sequence[Row], parameter: Parameter) -> Codes:
    """Bin (r,) of each row's value."""
    values = [row[parameter.key] for row in rows]
    if parameter.bounds is None:
        return np.array([parameter.values.index(value) for value in values], int)
    low, high = parameter.bounds
    place = (np.array(values) - low) / (high - low)
    return np.clip((BINS * place).astype(int), 0, BINS - 1)


def region(rows: Sequence[Row], mask: Mask) -> Region:
    """The conditions that tell most of a mask (r,), one after the other, each on the side where
    it is set more often.
    """
    inside, conditions = np.ones(len(rows), bool), list[str]()
    for _ in range(CONDITIONS):
        best = max(_splits(rows, mask, inside), key=lambda split: split[0], default=None)
        if best is None or best[0] < LEAST_GAIN:
            break
        conditions.append(best[1])
        inside = inside & best[2]
    return Region(conditions=tuple(conditions), share=share(mask[inside]))


def _splits(rows: Sequence[Row], mask: Mask, inside: Mask) -> Iterator[tuple[float, str, Mask]]:
    """Gain in bits, words and mask (r,) of each condition, on the side where a mask is set more
    often.
    """
    outcome = mask[inside].astype(int)
    before = _entropy(outcome)
    for parameter in PARAMETERS:
        for words, condition in _conditions(rows, parameter):
            within = condition[inside]
            if min(within.sum(), (~within).sum()) < FEWEST:
                continue
            if outcome[within].mean() >= outcome[~within].mean():
                yield before - _entropy_given(outcome, within.astype(int)), words, condition


def _conditions(rows: Sequence[Row], parameter: Parameter) -> Iterator[tuple[str, Mask]]:
    values = [row[parameter.key] for row in rows]
    if parameter.bounds is None:
        for value in parameter.values:
            same = np.array([each == value for each in values])
            yield f"{parameter.words} {value_words(value)}", same
            if len(parameter.values) > 2:
                yield f"{parameter.words} not {value_words(value)}", ~same
        return
    low, high = parameter.bounds
    numbers, unit = np.array(values), f" {parameter.unit}" if parameter.unit else ""
    for quarter in QUARTERS:
        limit = low + quarter * (high - low)
        yield f"{parameter.words} above {limit:.3g}{unit}", numbers > limit
        yield f"{parameter.words} below {limit:.3g}{unit}", numbers <= limit


def value_words(value: str) -> str:
    """A value of a parameter in words."""
    return SUPPORTS[value].words if value in SUPPORTS else value.replace("_", " ")


def _entropy(codes: Codes) -> float:
    """Shannon entropy in bits of codes (r,)."""
    p = np.bincount(codes) / max(len(codes), 1)
    return float(-(p[p > 0] * np.log2(p[p > 0])).sum())


def _entropy_given(codes: Codes, bins: Codes) -> float:
    """Conditional entropy in bits of codes (r,), given bins (r,)."""
    weights = np.bincount(bins) / max(len(bins), 1)
    return float(sum(w * _entropy(codes[bins == k]) for k, w in enumerate(weights) if w))
