"""One published value beside one of ours, and how far they are apart in words."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan

from skinwave.system.numbers import significant
from skinwave.verify.published import Published

NONE, WITHIN, ABOVE, BELOW = "no wave", "within", "above", "below"
DIGITISED = 0.05  # of a value without a spread: no nearer can one be read off a curve


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A published value and ours: of `body`, at `frequency` in Hz, both SI, ours nan where no wave
    propagates.
    """

    published: Published
    body: str
    frequency: float
    ours: float
    value: float
    low: float
    high: float

    @property
    def is_built(self) -> bool:
        """Whether the body was made from this source, so that agreement is no evidence."""
        return self.body in self.published.built

    @property
    def factor(self) -> float:
        """Ours over the nearest published value: 1 within the spread, nan without ours."""
        if not isfinite(self.ours):
            return self.ours
        near = 0.0 if self.published.has_spread else DIGITISED
        if (1 - near) * self.low <= self.ours <= (1 + near) * self.high:
            return 1.0
        return self.ours / (self.high if self.ours > self.high else self.low)

    @property
    def miss(self) -> float:
        """The factor, or one over it, whichever is above 1."""
        return max(self.factor, 1 / self.factor) if self.factor else inf

    @property
    def outcome(self) -> str:
        """One of the words above."""
        if self.factor != self.factor:
            return NONE
        if self.factor == 1.0:
            return WITHIN
        return ABOVE if self.factor > 1 else BELOW

    @property
    def words(self) -> str:
        """How far apart they are."""
        if self.outcome == NONE:
            return "no wave propagates in the model"
        if self.outcome == WITHIN:
            said = _inside(self.published)
        else:
            of = "spread" if self.published.has_spread else "value, of which no spread is published"
            by = f"by a factor of {times(self.miss)}" if self.miss < inf else "without bound"
            said = f"{self.outcome} the published {of}, {by}"
        return f"{said}; the preset was made from it" if self.is_built else said


def compared(published: Published, body: str, ours: Iterable[float]) -> list[Compared]:
    """Rows of a set beside a body.

    Parameters
    ----------
    published : Published
    body : str
    ours : (n,) float, SI, at its frequencies

    Returns
    -------
    Rows in the order of its frequencies
    """
    rows = []
    for k, value in enumerate(ours):
        low, high = published.between(k)
        rows.append(Compared(
            published=published, body=body, frequency=published.frequencies[k], ours=float(value),
            value=published.values[k], low=low, high=high,
        ))  # fmt: skip
    return rows


def times(factor: float) -> str:
    """A factor above 1, of which what is above 1 shows."""
    return significant(factor, 2 if factor >= 1.1 else 3)


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Rows of one set and one body, counted."""

    rows: tuple[Compared, ...]

    @property
    def misses(self) -> tuple[Compared, ...]:
        """Rows with a wave that is not within the spread."""
        return tuple(row for row in self.rows if row.outcome in (ABOVE, BELOW))

    @property
    def words(self) -> str:
        """How many are within, and by what factors the others miss."""
        within = sum(row.outcome == WITHIN for row in self.rows)
        without = sum(row.outcome == NONE for row in self.rows)
        inside = _inside(self.rows[0].published)
        parts = [f"{inside} at {within} of {len(self.rows)}"] if within else []
        for outcome in (BELOW, ABOVE):
            factors = [row.miss for row in self.misses if row.outcome == outcome]
            if factors:
                parts.append(f"{outcome} at {len(factors)} by {_range(factors)}")
        parts += [f"no wave at {without}"] if without else []
        return "; ".join(parts)


def tallies(rows: Iterable[Compared]) -> list[Tally]:
    """Rows by set and body, in their order."""
    groups: dict[tuple[str, str], list[Compared]] = {}
    for row in rows:
        groups.setdefault((row.published.name, row.body), []).append(row)
    return [Tally(rows=tuple(group)) for group in groups.values()]


def worst(rows: Iterable[Compared]) -> Compared | None:
    """The row with the largest bounded factor, of those that are no construction."""
    known = [row for row in rows if row.outcome in (ABOVE, BELOW) and isfinite(row.miss)]
    return max((row for row in known if not row.is_built), key=lambda row: row.miss, default=None)


def _inside(published: Published) -> str:
    if published.has_spread:
        return "within the published spread"
    return f"within {100 * DIGITISED:g} % of the value"


def _range(factors: Sequence[float]) -> str:
    low, high = min(factors), max(factors)
    if not isfinite(high):
        return (
            "a factor without bound" if len(factors) == 1 else f"factors of {times(low)} and more"
        )
    if times(low) == times(high):
        return f"a factor of {times(high)}"
    return f"factors of {times(low)} to {times(high)}"


COLUMNS = (
    "set", "site", "quantity", "unit", "frequency_hz", "body", "published", "published_low",
    "published_high", "ours", "ours_over_nearest_published", "claim", "preset_made_from_it", "how",
    "source",
)  # fmt: skip


def csv_row(row: Compared) -> list[object]:
    """Cells of validation.csv."""
    unit = row.published.quantity

    def shown(x: float, size: float = unit.size) -> str:
        return "" if x != x else f"{x / size:.6g}"

    low, high = (row.low, row.high) if row.published.has_spread else (nan, nan)
    return [
        row.published.name, row.published.site, unit.name, unit.unit, shown(row.frequency, 1.0),
        row.body, shown(row.value), shown(low), shown(high), shown(row.ours),
        shown(row.factor, 1.0), row.words, "yes" if row.is_built else "no", row.published.how,
        row.published.source,
    ]  # fmt: skip
