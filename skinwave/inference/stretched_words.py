"""Claims at large deflection, in words and as a table, from the rows alone."""

from collections.abc import Iterable, Iterator, Sequence

from skinwave.inference.knowledge import Row, value_words
from skinwave.inference.large_deflection import CLAIMS, claims_of, refusal, verdict
from skinwave.inference.nearest_sheets import sheets
from skinwave.inference.stretched_table import PHASE
from skinwave.system.numbers import decibel, significant

NONE = (
    f"None of the sheets was computed at {PHASE}: skinwave infer --large-deflection 3, with this "
    "folder as --out, adds three."
)
LARGE = (
    "By fem-nonlinear, in steps of 0.1 ms for 1 s from rest, under the Tactons that "
    "decide: each without a path for M1, which asks for its harmonics; for M4 and M5 each "
    "modulated one with a path if the linear sheet shows the claim, else the one under which its "
    "strongest rival, or multiple, of f_AM is: a claim that fails there fails, and one "
    "that does not is computed under all. Beside it "
    "the same modes of the same elements without stretching, in the steady state. Curl and clips "
    "are left out."
)


def outcomes(
    rows: Sequence[Row], stretched: Sequence[Row]
) -> Iterator[tuple[str, Row, bool | None, bool | None]]:
    """Claim, sheet, and its `verdict` of the linear elements and at large deflection."""
    by_key = {row["key"]: row for row in rows}
    for claim in CLAIMS:
        for key in dict.fromkeys(row["sheet"] for row in stretched):
            own = [row for row in stretched if row["sheet"] == key and row["status"] == "done"]
            if any(row.get(f"{claim}_large_holds") is not None for row in own) and key in by_key:
                yield claim, by_key[key], verdict(own, claim, "linear"), verdict(own, claim)


def stretched_sentences(rows: Sequence[Row], stretched: Sequence[Row]) -> str:
    """Whether a claim changes at large deflection, in sentences."""
    found = list(outcomes(rows, stretched))
    if not found:
        return NONE
    count = len({sheet["key"] for _, sheet, _, _ in found})
    each = [
        f"{claim} holds in {_count(large for *_, large in own)} of {len(own)} "
        f"({_count(linear for _, _, linear, _ in own)} if it does not stretch)"
        for claim in CLAIMS
        if (own := [each for each in found if each[0] == claim])
    ]
    changed = sorted({c for c, _, *both in found if None not in both and both[0] != both[1]})
    said = f"{' and '.join(changed)} changes" if changed else "no claim changes"
    return (
        f"At {PHASE} {_of_which(count)}, under the Tactons that decide, {', '.join(each)}: "
        f"{said}. {_deflections(stretched)}"
    )


def _count(verdicts: Iterable[bool | None]) -> str:
    """How many hold, and how many are open."""
    each = list(verdicts)
    still = each.count(None)
    return f"{each.count(True)}" + (f" or up to {each.count(True) + still}" if still else "")


def _of_which(count: int) -> str:
    if count == 1:
        return "of the nearest sheet that elements take"
    return f"of the {count} nearest sheets that elements take"


def _deflections(stretched: Sequence[Row]) -> str:
    """How much less the sheets deflect than linear ones, and how far levels move."""
    done = [row for row in stretched if row["status"] == "done"]
    worst = max(done, key=lambda row: row["linear_over_thickness"])
    pairs = [(row.get(f"{c}_linear"), row.get(f"{c}_large")) for row in done for c in CLAIMS]
    moved = [abs(b - a) for a, b in pairs if a is not None and b is not None]
    said = f", and levels move by up to {decibel(max(moved))} dB" if moved else ""
    return (
        f"They deflect by up to {significant(worst['large_over_thickness'], 2)} thicknesses at the "
        f"points under these, where linear ones do by "
        f"{significant(worst['linear_over_thickness'], 2)}{said}."
    )


def refused_sentence(rows: Sequence[Row], stretched: Sequence[Row]) -> str:
    """Sentence on the nearest sheets that were not computed, and why; empty if all were."""
    there = {row["sheet"] for row in stretched}
    said = [f"sheet {k}, since {why}" for k, row in enumerate(sheets(rows), 1)
            if row["key"] not in there and (why := refusal(row))]  # fmt: skip
    return f"Not computed: {'; '.join(said)}." if said else ""


def stretched_table(
    rows: Sequence[Row], stretched: Sequence[Row]
) -> tuple[list[str], list[list[str]]]:
    """Levels that decide each claim, of plates, and of elements without and with stretching."""
    by_key = {row["key"]: row for row in rows}
    table = []
    order = list(dict.fromkeys(row["sheet"] for row in stretched))
    for row in sorted(stretched, key=lambda row: order.index(row["sheet"])):
        sheet = by_key[row["sheet"]]
        named = f"{sheet['size']}, {value_words(sheet['support'])}"
        if row["status"] != "done":
            table.append([named, row["tacton"], "-", row["error"], "-", "-"])
            continue
        for claim in claims_of(row["tacton"]):
            if row.get(f"{claim}_large_holds") is None:
                continue
            table.append([
                named, row["tacton"],
                claim, _level(row, claim, "linear"), _level(row, claim, "large"),
                f"{significant(row['linear_over_thickness'], 2)} and "
                f"{significant(row['large_over_thickness'], 2)}",
            ])  # fmt: skip
    header = ["sheet", "Tacton", "claim", "without stretching", PHASE,
              "mean deflection, thicknesses, without and with"]  # fmt: skip
    return header, table


def _level(row: Row, claim: str, how: str) -> str:
    if (value := row[f"{claim}_{how}"]) is None:
        return "a line is missing, fails"
    return (
        f"{decibel(value, signed=True)} dB, {'holds' if row[f'{claim}_{how}_holds'] else 'fails'}"
    )
