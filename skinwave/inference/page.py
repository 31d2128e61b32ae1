"""Page of an inference: its paragraph, figures and tables, and the sheets that come nearest."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from skinwave.inference.assess import CLAIMED
from skinwave.inference.conclusions import (
    conclusions,
    decider,
    readings,
)
from skinwave.inference.deflection import bound_table
from skinwave.inference.design import MEASUREMENT, PARAMETERS, SHEET
from skinwave.inference.figures import (
    decision_figure,
    region_figure,
    rival_figure,
    share_figure,
)
from skinwave.inference.knowledge import (
    Row,
    holds,
    in_percent,
    pattern,
    region,
    sample,
    share,
    told,
    value_words,
)
from skinwave.inference.nearest_sheets import heading, left_out, sheet_table, sheets
from skinwave.inference.stretched_words import LARGE, refused_sentence, stretched_table
from skinwave.report.figures import png
from skinwave.results.claims import MUCH_LOWER, TEXTS
from skinwave.system import document

TITLE = "Which sheet did they measure?"
METHOD = (
    "Each candidate is one value of every parameter below. Its sheet is a rectangular, "
    "orthotropic, stretched thin plate with the air on both sides as in a baffle; a clip holds a "
    "square of 10 mm in a corner; modes by Ritz's method; the steady displacement or velocity at "
    "five points, 5 mm apart, under all 15 Tactons; then the claims as skinwave compare assesses "
    "them, M4 in the quantity that was read. Intervals are those of Clopper and Pearson at 95 %. "
    "Information is of numbers in five bins, less what chance makes of as many rows."
)
LEFT_OUT = (
    "Left out of the candidates: the mean deflection, which stretches a sheet on fixed edges. A "
    "clamped disc of office paper, 100 mm in radius, deflects by three thicknesses under 2.6 mN, "
    "and its edge then pulls by a few N/m, within the tensions of the candidates; gravity, curl, "
    "humidity and creases; sheets that touch or leave their support, which rattle; radiation of "
    "sound; the flow of air around edges without a baffle; the noise and the resolution of the "
    "vibrometer; what the device does to a focus that moves fast. M1 asks for a third harmonic, "
    "which no linear sheet adds: of the drive laws only the clipped and the compressed ones have "
    "it."
)
WHY_NOT = (
    'M4 is about all lines: f_AM is to be the highest. M5 is about "these frequency harmonics", '
    "the multiples of f_AM and f_d, which are to be there, above -60 dB, and much lower: here by "
    "20 dB. A load without a mean has none of them, and shows neither M3 nor M5. Why both ask so "
    "much of a linear sheet: on the path the load itself has a line at f_d that is 1.25, 1.57 and "
    "1.71 times as strong as that at f_AM, for paths of 10, 20 and 30 mm (force corrected; weaker "
    "by a quarter where the squared pressure is modulated to its full depth). The sheet would "
    "have to weaken f_d and 2 f_AM by a factor of ten and more at every point and for each f_AM. "
    "It does so where its waves are much longer than the path, and else by chance between two of "
    "its modes."
)
LIMITS = (0.0, -6.0, -10.0, MUCH_LOWER)  # dB
HALF_DRIVE = (
    "A test of all candidates at once is to measure at half the drive: in a linear sheet under a "
    "drive law that is a power of the amplitude no ratio of two lines changes, in one that "
    "stretches or rattles they do."
)
AS_SCENES = (
    "Their scenes, under AM 140 Hz on the circle of 20 mm, are sheet-1.toml, sheet-2.toml and so "
    "on beside this page."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawing:
    """A figure of the page: its name, caption and image (PNG)."""

    name: str
    caption: str
    image: bytes


def drawings(rows: Sequence[Row]) -> list[Drawing]:
    """All figures of the page."""
    fair = sample(rows)
    made: list[tuple[str, str, Figure]] = [
        ("shares", "Candidates that show each claim, and several together; how many above each "
         "bar, with the interval of the share.", share_figure(fair)),
        ("rivals", "Level of the strongest line other than f_AM at any of the five points under "
         "AM+STM: part of the candidates below it. Dashed: that of the multiples of f_AM and f_d "
         "alone, which a load without a mean has none of.", rival_figure(fair)),
        ("decides", "What each parameter tells: the part of a claim's entropy, and of the variance "
         "of the strongest rival's level, that knowing it takes away. Claims that hold always or "
         "never have none.", decision_figure(fair)),
        ("regions", "Level of the strongest rival over each parameter: median and middle half. "
         "M4 asks for less than 0 dB.", region_figure(fair)),
    ]  # fmt: skip
    return [
        Drawing(name=name, caption=caption, image=png(figure)) for name, caption, figure in made
    ]


def page(rows: Sequence[Row], drawn: Sequence[Drawing], stretched: Sequence[Row] = ()) -> str:
    """The page, from the rows of the tables alone.

    Parameters
    ----------
    rows : of the table
    drawn : Drawing, of the same rows
    stretched : of the table of the nearest sheets at large deflection

    Returns
    -------
    HTML
    """
    fair = sample(rows)
    picture = {each.name: document.picture(each.image, each.caption, each.name) for each in drawn}
    return document.page(
        TITLE,
        *map(document.paragraph, conclusions(rows, stretched)),
        picture["shares"],
        document.table(*claim_table(fair)),
        document.section("Candidates by how far they deflect",
                         document.table(*bound_table(fair))),
        document.section("If M4 and M5 are read less strictly", picture["rivals"],
                         document.table(*reading_table(fair)), document.paragraph(WHY_NOT)),
        document.section("Which parameter decides", picture["decides"],
                         document.table(*region_table(fair)), picture["regions"]),
        document.section("What one more measurement would tell",
                         document.table(*next_table(fair)), document.paragraph(HALF_DRIVE)),
        *_sheets(rows),
        *_stretched(rows, stretched),
        document.section("How it was computed", document.paragraph(METHOD),
                         document.table(*parameter_table()), document.paragraph(LEFT_OUT)),
        *_failed(rows),
    )  # fmt: skip


def claim_table(fair: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Each claim, its share, and the parameter that tells most of it."""
    rows = []
    for claim in CLAIMED:
        mask = holds(fair, claim)
        best = decider(fair, mask)
        most = f"{best.parameter.words}, {100 * best.fraction:.0f} %" if best else "-"
        rows.append([claim, TEXTS[claim].removeprefix("Measured, "), in_percent(share(mask)), most])
    rows.append(["all", "all five", in_percent(share(holds(fair, "all"))), "-"])
    return ["claim", "as measured", "holds in", "decided by, of its entropy"], rows


def reading_table(fair: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """M4 and M5 of fewer lines, at fewer points or on fewer paths, and with other bars."""
    rows = [
        [words, *(in_percent(share(levels < limit)) for limit in LIMITS)]
        for words, levels in readings(fair)
    ]
    header = ["f_AM compared with", "highest", *(f"{-limit:g} dB above" for limit in LIMITS[1:])]
    return header, rows


def region_table(fair: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Conditions under which each claim holds most often."""
    rows = []
    for claim in (*CLAIMED, "all"):
        mask = holds(fair, claim)
        found = region(fair, mask)
        where = "; ".join(found.conditions) or ("everywhere" if mask.all() else "nowhere")
        if not found.conditions and 0 < mask.sum() < len(mask):
            where = "no condition tells enough"
        rows.append([claim, where, in_percent(found.share), str(found.share.of)])
    return ["claim", "conditions, each the one that tells most", "holds in", "of candidates"], rows


def next_table(fair: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Information of each parameter on which of the five claims hold."""
    rows = [
        [each.parameter.words, each.parameter.of, f"{each.bits:.3f}", f"{100 * each.fraction:.1f}"]
        for each in told(fair, pattern(fair))
    ]
    header = ["if it were known", "of", "bits on which claims hold", "of their entropy, %"]
    return header, rows


def parameter_table() -> tuple[list[str], list[list[str]]]:
    """The parameters and their values."""
    rows = [
        [p.words, p.of, ", ".join(map(value_words, p.values)) if p.bounds is None
         else f"{p.bounds[0]:g} to {p.bounds[1]:g} {p.unit}".strip()]
        for p in sorted(PARAMETERS, key=lambda p: (SHEET, MEASUREMENT).index(p.of))
    ]  # fmt: skip
    return ["parameter", "of", "values, all equally likely"], rows


def _sheets(rows: Sequence[Row]) -> Iterator[str]:
    done = [row for row in rows if row["status"] == "done"]
    parts = [document.paragraph(left_out(done))]
    if sheets(done):
        parts = [document.table(*sheet_table(done)), *parts, document.paragraph(AS_SCENES)]
    yield document.section(heading(done), *parts)


def _stretched(rows: Sequence[Row], stretched: Sequence[Row]) -> Iterator[str]:
    if stretched:
        yield document.section(
            "At large deflection", document.table(*stretched_table(rows, stretched)),
            *map(document.paragraph, filter(None, [refused_sentence(rows, stretched), LARGE])),
        )  # fmt: skip


def _failed(rows: Sequence[Row]) -> Iterator[str]:
    failed = [row for row in rows if row["status"] == "failed"]
    if failed:
        yield document.paragraph(
            f"{len(failed)} of {len(rows)} candidates have no response: {failed[0]['error']}."
        )
