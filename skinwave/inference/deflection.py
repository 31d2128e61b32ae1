"""Deflection of candidates under the mean of the pressure, and shares within bounds of it.

A plate that deflects by more than half a thickness stretches, which a linear one leaves out: a
clamped disc is stiffer by a factor 1 + 0.488 (w/h)^2 (Timoshenko and Woinowsky-Krieger, section
97). Its tension counts in the deflection, its curl is none of what varies.
"""

from collections.abc import Sequence

import numpy as np

from skinwave.inference.assess import CLAIMED
from skinwave.inference.knowledge import Mask, Row, Share, holds, in_percent, percent, share
from skinwave.inference.ranking import PLAUSIBLE
from skinwave.system.numbers import significant

LINEAR = 0.5  # thicknesses: a plate that deflects further stretches
BOUNDS = (PLAUSIBLE, 2.0, LINEAR)  # thicknesses of the linear static deflection


def within(rows: Sequence[Row], bound: float) -> Mask:
    """Whether the linear static deflection of each row (r,) is below so many thicknesses."""
    return np.array([row["sag_over_thickness"] < bound for row in rows], bool)


def bound_words(bound: float) -> str:
    """A bound in words."""
    return "half a thickness" if bound == LINEAR else f"{bound:g} thicknesses"


def shares_within(rows: Sequence[Row], bound: float) -> dict[str, Share]:
    """Share of the rows within a bound in which each claim holds, and all of them."""
    inside = within(rows, bound)
    return {claim: share(holds(rows, claim)[inside]) for claim in (*CLAIMED, "all")}


def bound_table(fair: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Shares of each claim among all candidates, and among those within each bound."""
    bounds = (np.inf, *BOUNDS)
    found = [shares_within(fair, bound) for bound in bounds]
    counts = ["candidates", *(f"{each['all'].of:,}" for each in found)]
    table = [[claim, *(in_percent(each[claim]) for each in found)] for claim in (*CLAIMED, "all")]
    header = ["linear static deflection", "any", *(f"below {bound_words(b)}" for b in BOUNDS)]
    return header, [counts, *table]


def deflection_words(fair: Sequence[Row]) -> str:
    """How far the candidates deflect, and which claims hold within the bounds, in sentences."""
    sags = np.array([row["sag_over_thickness"] for row in fair])
    parts = [
        f"below {bound_words(bound)} in {percent(share(within(fair, bound)).value)} %"
        for bound in reversed(BOUNDS)
    ]
    vibrates = np.array([row["vibration_over_thickness"] < LINEAR for row in fair])
    return (
        f"All this is of linear sheets: the static deflection under the mean of the pressure is "
        f"{', '.join(parts)} of them, {significant(float(sags.max()))} thicknesses at the most; "
        f"the vibration is below half a thickness in {percent(share(vibrates).value)} %. "
        f"{_bounded(fair)}"
    )


def _bounded(fair: Sequence[Row]) -> str:
    """Shares within the bounds, where there are candidates."""
    said = []
    for bound in BOUNDS[1:]:
        found = shares_within(fair, bound)
        if of := found["all"].of:
            each = ", ".join(f"{claim} in {in_percent(found[claim])}" for claim in CLAIMED)
            said.append(
                f"Of the {of:,} below {bound_words(bound)} {found['all'].held or 'none'} "
                f"{'shows' if found['all'].held == 1 else 'show'} all five; {each}."
            )
    return " ".join(said)
