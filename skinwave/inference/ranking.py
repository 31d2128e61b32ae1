"""Order of candidates by what they show, those first whose sheet is one that can be measured."""

from collections.abc import Mapping, Sequence
from typing import Any

from skinwave.inference.assess import CLAIMED
from skinwave.results.claims import MUCH_LOWER

PLAUSIBLE = 10.0  # thicknesses, about 1 mm, by which a sheet that was measured may sag
Row = Mapping[str, Any]


def is_plausible(row: Row) -> bool:
    """Whether a sheet sags, in linear statics, no further than one that is measured."""
    return bool(row["sag_over_thickness"] < PLAUSIBLE)


def nearest(rows: Sequence[Row]) -> list[Row]:
    """Rows with a response: plausible sheets first, of these those that show the most of M1 to M3,
    and of these those that come nearest to what M4 and M5 ask.
    """

    def shortfall(row: Row) -> tuple[bool, int, float]:
        beyond = max(row["M4_value"], row["M5_value"] - MUCH_LOWER)
        return not is_plausible(row), -sum(row[f"{c}_holds"] or 0 for c in CLAIMED[:3]), beyond

    return sorted((r for r in rows if r["M5_value"] is not None), key=shortfall)
