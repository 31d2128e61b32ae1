"""Page, table and CSV of published measurements beside the models."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from skinwave.bodies import Body
from skinwave.report.figures import png
from skinwave.system import document
from skinwave.system.document import Markup
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table
from skinwave.verify import modulation, zigzag
from skinwave.verify import validation_figures as figures
from skinwave.verify.compared import ABOVE, BELOW, COLUMNS, WITHIN, Compared, csv_row, tallies
from skinwave.verify.finger import Decay
from skinwave.verify.modulation import Harmonics
from skinwave.verify.published import (
    ALL,
    LENGTH,
    NOT_COMPARED,
    OPTIMUM,
    SPEED,
    Published,
    all_sources,
)
from skinwave.verify.published_waves import BODIES, WORDS
from skinwave.verify.validation import Validation, headline, particulars

TITLE = "Models beside published measurements"
SCOPE = (
    "Verification asks whether the equations are solved right; this page asks whether they are the "
    "right ones, as far as published numbers tell. The preset forearm was made from Zhang's "
    "constants. palm and palm-stiff were chosen for optimum speeds of 5 and 7 m/s. palm-layers was "
    "fitted to the waves of Potts, Manfredi and SkinSource, forearm-layers to Zhang's. The tables "
    "mark these; there agreement is no evidence. skin-slab and the hand have the material palm. "
    "All other values are predictions. A factor is ours over the published value, or over the "
    "nearer end of its spread."
)
FACTORS = (
    "Each point is a preset at a frequency; grey: within 5 %, what can be read off a curve. "
    "Hollow: the preset was fitted to that source; filled: it predicts it. "
    f"Factors beyond {figures.FURTHEST:g} are drawn there."
)
WAVES = (
    "Points: sources, with the spread between people, or a standard deviation, where one is "
    "published. Grey: from the lowest to the highest source at each frequency. Lines: the wave of "
    "each preset that moves the surface most at the edge of the focal spot (half-spaces solid, "
    "layers on bone dashed); its line is broken where another mode takes the lead, and missing "
    "where none propagates. Lengths are those of plane waves, without geometric spreading."
)
FOCUS = (
    "Largest deflection on a circle under a constant pressure that runs along it, by the "
    "wavenumber integral; triangles: its maximum. Grey: the published range."
)
ZIGZAG = (
    "RMS of the velocity normal to the skin in the middle of the zigzag, while it is drawn once "
    f"along {1e3 * zigzag.LENGTH:g} mm (assumed) and back, at full drive of 50 Pa, which is known "
    "to a factor of 2. The hand is taken as a laterally infinite body. Black: the RMS over all of "
    "a recording, silence included, along the line in which its places extend furthest."
)
FINGER = (
    "Blue: the palmar side of the finger that reaches furthest, of the material palm on an "
    "elastic support in place of bone, without joints; on the example hand elements of 5 and of "
    "8 mm, not 6.5 mm, change the 1/e lengths by up to 8 %. Black: SkinSource, dorsal, from "
    "files that were given. The 1/e length of the text is fitted to all points."
)


def write(folder: Path, found: Validation) -> None:
    """index.html, its figures as PNG, validation.csv."""
    rows = [*map(csv_row, found.rows), *map(_harmonic_row, found.harmonics)]
    (folder / "validation.csv").write_bytes(csv_table(COLUMNS, rows))

    def picture(name: str, figure: Figure, caption: str) -> str:
        drawn = png(figure)
        (folder / f"{name}.png").write_bytes(drawn)
        return document.picture(drawn, caption, name)

    bands = (all_sources(SPEED), all_sources(LENGTH))
    parts = [
        document.paragraph(" ".join(headline(found))),
        *map(document.paragraph, particulars(found)),
        picture("factors", figures.factors_figure(found.rows), FACTORS),
        document.paragraph(SCOPE),
        document.section("Speed and decay of waves",
                         picture("waves", figures.waves_figure(found.curves, bands), WAVES),
                         *_wave_tables(found.rows)),
        document.section("Speed of the focus at the largest deflection",
                         picture("focus-speed", figures.speed_figure(found.sweeps), FOCUS),
                         document.table(*_focus_table(found))),
        document.section("Harmonics of amplitude-modulated radiation force",
                         document.paragraph(_harmonics_words()),
                         document.table(*_harmonics_table(found.harmonics))),
        document.section(
            "A zigzag along the hand",
            picture("zigzag", figures.zigzag_figure(found.predicted, found.measured), ZIGZAG),
            document.table(*_zigzag_table(found))),
        document.section("Decay along a finger", *_finger(found, picture)),
        document.section("All sets", document.table(*_summary(found.rows))),
        document.section("Sources", document.table(*_sources(found.rows))),
        document.section("Published, and not compared",
                         document.table(("source", "what", "why not"), NOT_COMPARED)),
        document.section("Presets", document.table(*_presets(found.rows))),
    ]  # fmt: skip
    (folder / "index.html").write_text(document.page(TITLE, *parts), encoding="utf-8")


def _outcome(row: Compared, text: str) -> Markup:
    """Text in the colour of agreement or of a miss; of a construction in none."""
    kind = {WITHIN: "yes", ABOVE: "no", BELOW: "no"}.get(row.outcome, "")
    return Markup('<span class="{}">{}</span>').format("" if row.is_built else kind, text)


def _cell(row: Compared) -> Markup:
    """Ours, and its factor where it misses."""
    if row.ours != row.ours:
        return Markup("no wave")
    size = row.published.quantity.size
    shown = significant(row.ours / size) if np.isfinite(row.ours) else "∞"
    factor = f" ({significant(row.factor, 2)})" if row.factor not in (1.0, np.inf) else ""
    return _outcome(row, f"{shown}{factor}{'*' if row.is_built else ''}")


def published_words(row: Compared) -> str:
    """Value and spread in the unit of the set."""
    size = row.published.quantity.size
    value, low, high = (significant(x / size) for x in (row.value, row.low, row.high))
    if not row.published.has_spread:
        return value
    return f"{low} to {high}" if row.value != row.value else f"{value} ({low} to {high})"


def _wave_tables(rows: Iterable[Compared]) -> Iterator[str]:
    """A table for each set: frequencies by presets."""
    by_set: dict[str, list[Compared]] = {}
    for row in rows:
        if row.body in BODIES and row.frequency == row.frequency:
            by_set.setdefault(row.published.name, []).append(row)
    for own in by_set.values():
        each = own[0].published
        unit = f", {each.quantity.unit}" if each.quantity.unit else ""
        yield Markup("<h3>{}, {}{}</h3>").format(each.name, each.site, unit)
        yield document.paragraph(_conditions(each))
        names = list(dict.fromkeys(row.body for row in own))
        at = list(dict.fromkeys(row.frequency for row in own))
        table = [[f"{f:g}", *_line([row for row in own if row.frequency == f], names)] for f in at]
        yield document.table(("frequency, Hz", "published", *names), table)
    yield document.paragraph(
        "In brackets the factor of a miss. * The preset was fitted to this source, or chosen by "
        "it; without the mark, it predicts the source."
    )


def _conditions(each: Published) -> str:
    said = (f"{text[0].upper()}{text[1:]}." for text in (each.conditions, each.remark) if text)
    return " ".join(said)


def _line(rows: list[Compared], names: list[str]) -> list[str]:
    by_name = {row.body: row for row in rows}
    return [published_words(rows[0]), *(_cell(by_name[name]) for name in names)]


def _focus_table(found: Validation) -> tuple[tuple[str, ...], list[list[str]]]:
    header = ("preset", "path", "published, m/s", "ours, m/s", "outcome")
    rows = [row for row in found.rows if row.published.name.startswith(OPTIMUM.name)]
    return header, [
        [row.body, row.published.name.partition(f"{OPTIMUM.name}, ")[2], published_words(row),
         significant(row.ours), _outcome(row, row.words)]
        for row in rows
    ]  # fmt: skip


def _harmonics_words() -> str:
    return (
        f"{modulation.SOURCE} (abstract): sine AM gives {modulation.FOUND['sine']}, square AM "
        f"{modulation.FOUND['square']}; displacement is linear in force up to 10 um. Ours is on "
        f"the half-space {modulation.BODY} at {modulation.FREQUENCY:g} Hz, linear throughout; the "
        "abstract has neither frequency nor amplitudes, and the phantom is not ours, so that only "
        "which harmonic is the larger one is compared. Ratios are amplitudes over that at f."
    )


def _harmonics_table(found: Sequence[Harmonics]) -> tuple[tuple[str, ...], list[list[str]]]:
    header = ("modulation", "drive law", "load, 2f", "load, 3f", "displacement, 2f",
              "displacement, 3f", "outcome")  # fmt: skip

    def shown(x: float) -> str:
        return significant(x, 2) if x > modulation.ABSENT else "0"

    return header, [
        [h.wave, h.drive, *map(shown, h.load[1:]), *map(shown, h.motion[1:]),
         Markup('<span class="{}">{}</span>').format("yes" if h.agrees else "no", h.words)]
        for h in found
    ]  # fmt: skip


def _harmonic_row(h: Harmonics) -> list[object]:
    """Cells of validation.csv: the second or third harmonic, whichever was found."""
    order = 2 if h.wave == "sine" else 3
    return [
        f"AM radiation force, {h.wave}", "phantom", f"{order}f over f of displacement", "",
        f"{modulation.FREQUENCY:g}", f"{modulation.BODY}, drive law {h.drive}", "", "", "",
        f"{h.motion[order - 1]:.6g}", "", f"{modulation.FOUND[h.wave]}: {h.words}", "no",
        "seen in the abstract only", modulation.SOURCE,
    ]  # fmt: skip


def _zigzag_table(found: Validation) -> tuple[tuple[str, ...], list[list[str]]]:
    header = ("speed, m/s", "of", "median of the places, mm/s", "largest, mm/s",
              "predicted over measured")  # fmt: skip
    measured = {m.speed: m for m in found.measured}
    rows = []
    for each in sorted((*found.predicted, *found.measured), key=lambda p: p.speed):
        own = measured.get(each.speed)
        ratio = significant(each.middle / own.middle, 2) if own and each in found.predicted else "-"
        rows.append([f"{each.speed:g}", each.name, significant(1e3 * each.middle),
                     significant(1e3 * float(each.rms.max())), ratio])  # fmt: skip
    return header, rows


def _finger(found: Validation, picture) -> Iterator[str]:  # type: ignore[no-untyped-def]
    decays = [*([found.hand] if found.hand else []), *found.people]
    if found.hand is None:
        yield document.paragraph(
            "The hand in finite elements was left out, as it takes minutes; skinwave validate "
            "--hand has it. SkinSource's range stands among the speeds and lengths above."
        )
    else:
        yield document.paragraph(
            f"{found.hand.dofs:,} dofs; elements of the finger have edges of "
            f"{1e3 * found.hand.edge:.0f} mm, beside shear waves of {_shortest(found.hand)} mm at "
            "the highest frequency; 1/e lengths "
            + ", ".join(f"{significant(1e3 * length, 2)} mm at {f:g} Hz"
                        for f, length in zip(found.hand.frequencies, found.hand.lengths,
                                             strict=True))
            + "."
        )  # fmt: skip
    if decays:
        f = decays[0].frequencies
        yield picture("finger", figures.finger_figure(decays, f), FINGER)


def _shortest(hand: Decay) -> str:
    """Shear wavelength of the hand's material at its highest frequency, mm."""
    f = float(hand.frequencies[-1])
    solid = Body().solid
    speed = np.sqrt(abs(solid.complex_modulus(2 * np.pi * f)) / solid.density)
    return significant(1e3 * float(speed) / f, 2)


def _summary(rows: Iterable[Compared]) -> tuple[tuple[str, ...], list[list[str]]]:
    header = ("set", "preset", "outcome", "fitted to it or predicts it")
    return header, [
        [t.rows[0].published.name, t.rows[0].body, t.words,
         "fitted" if t.rows[0].is_built else "predicts"]
        for t in tallies(rows)
    ]  # fmt: skip


def _presets(rows: Iterable[Compared]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Presets with the sources that each was fitted to, and those that it predicts."""
    sources: dict[tuple[str, bool], dict[str, None]] = {}
    for row in rows:
        if not row.published.name.startswith(ALL):
            known = sources.setdefault((row.body, row.is_built), {})
            known[row.published.name.split(":")[0]] = None

    def names(preset: str, is_built: bool) -> str:
        return ", ".join(sources.get((preset, is_built), {})) or "none"

    header = ("name", "what it is", "fitted to", "predicts")
    return header, [[name, words, names(name, True), names(name, False)]
                    for name, words in WORDS.items()]  # fmt: skip


def _sources(rows: Iterable[Compared]) -> tuple[tuple[str, ...], list[list[str]]]:
    header = ("set", "site", "source", "how sure", "contradictions and assumptions")
    sets = {row.published.name: row.published for row in rows}
    return header, [[s.name, s.site, s.source, s.how, s.remark] for s in sets.values()]
