"""All comparisons with published measurements, and what they come to in sentences."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from skinwave.system.effort import Progress
from skinwave.system.numbers import significant
from skinwave.verify import finger, zigzag
from skinwave.verify.compared import (
    ABOVE,
    BELOW,
    DIGITISED,
    NONE,
    WITHIN,
    Compared,
    compared,
    times,
    worst,
)
from skinwave.verify.focus_speed import PERIMETERS, Sweep, compare_sweeps, sweep
from skinwave.verify.modulation import FOUND, Harmonics, harmonics
from skinwave.verify.published import ALL, EXPONENT, LENGTH, OPTIMUM, SPEED
from skinwave.verify.published_waves import BODIES, Curves, compare_waves, leading_wave, ours_of
from skinwave.verify.zigzag import Profile


@dataclass(frozen=True, kw_only=True, eq=False)
class Validation:
    """Curves and sweeps by body, rows of all sets, harmonics, zigzags predicted and measured, and
    decay along a finger: of the hand if it was computed, and of people whose files were given.
    """

    curves: Mapping[str, Curves]
    sweeps: Mapping[str, tuple[Sweep, ...]]
    rows: tuple[Compared, ...]
    harmonics: tuple[Harmonics, ...]
    predicted: tuple[Profile, ...]
    measured: tuple[Profile, ...]
    hand: finger.Decay | None = None
    people: tuple[finger.Decay, ...] = ()


def validate(
    report: Progress,
    *,
    hand: Path | None = None,
    zigzags: Sequence[tuple[Path, float]] = (),
    skinsource: Path | None = None,
) -> Validation:
    """Published measurements beside the models.

    Parameters
    ----------
    report : called with the name of the phase and the fraction done
    hand : file of a hand, for the decay along its finger by finite elements; left out if None
    zigzags : recordings of the zigzag, each with its longitudinal speed in m/s
    skinsource : folder of SkinSource's impulse responses

    Returns
    -------
    Validation

    Raises
    ------
    ValueError
        If a file is not there or cannot be read.
    """
    if hand:
        finger.check_hand(hand)
    report("read the files", 0.0)
    measured = [zigzag.measured(file, speed) for file, speed in zigzags]
    people = finger.of_skinsource(skinsource) if skinsource else []
    report("waves", 0.02)
    curves = {name: leading_wave(body) for name, body in BODIES.items()}
    rows = compare_waves(curves)
    rows += _of_people(people, curves)
    report("speed of the focus", 0.15)
    sweeps = {
        name: tuple(sweep(BODIES[name], around) for around in PERIMETERS) for name in OPTIMUM.bodies
    }
    rows += compare_sweeps(sweeps)
    report("harmonics", 0.4)
    of_force = harmonics()
    report("zigzag", 0.45)
    predicted = [
        zigzag.predicted(body, speed) for body in zigzag.BODIES_SHOWN for speed in zigzag.SPEEDS
    ]
    of_hand = finger.of_hand(hand, report) if hand else None
    if of_hand:
        rows += finger.compare_hand(of_hand)
    return Validation(
        curves=curves, sweeps=sweeps, rows=tuple(rows), harmonics=tuple(of_force),
        predicted=tuple(predicted), measured=tuple(measured), hand=of_hand, people=tuple(people),
    )  # fmt: skip


def _of_people(people: list[finger.Decay], curves: Mapping[str, Curves]) -> list[Compared]:
    """Rows of SkinSource's set as a user's files give it."""
    if not people:
        return []
    own = finger.from_files(people)
    return [row for name in own.bodies
            for row in compared(own, name, ours_of(own, name, curves[name]))]  # fmt: skip


def sentences(found: Validation) -> list[str]:
    """All sentences of the page's beginning."""
    return [*headline(found), *particulars(found)]


def headline(found: Validation) -> list[str]:
    """How many values agree, and by how much speed, length and exponent miss."""
    quantities = ((SPEED, "Phase speeds"), (LENGTH, "1/e lengths"), (EXPONENT, "Decay exponents"))
    return [
        _counted(found.rows),
        *(_of_quantity(found.rows, q.name, words) for q, words in quantities),
        *(_of_all_sources(found.rows, q.name) for q, _ in quantities[:2]),
    ]


def particulars(found: Validation) -> list[str]:
    """Sentences on the speed of the focus, harmonics, the zigzag and the finger."""
    return [_optima(found), _of_harmonics(found.harmonics), _of_zigzags(found), _of_hand(found)]


def _own(rows: Iterable[Compared]) -> list[Compared]:
    """Rows of single sources, without those that a preset was made from."""
    return [row for row in rows
            if not row.is_built and not row.published.name.startswith(ALL)]  # fmt: skip


def _counted(rows: Sequence[Compared]) -> str:
    own = _own(rows)
    built = sum(row.is_built and not row.published.name.startswith(ALL) for row in rows)
    within = sum(row.outcome == WITHIN for row in own)
    without = sum(row.outcome == NONE for row in own)
    far = worst(own)
    said = (
        f"Of {len(own)} comparisons of a published value with a model that was not made from it, "
        f"{within} agree: within the published spread or, where none is published, within "
        f"{100 * DIGITISED:g} %; in {without} the model has no wave, and "
        f"{len(own) - within - without} miss, by a median factor of {significant(_median(own), 2)}"
    )
    if far:
        at = f" at {far.frequency:g} Hz" if far.frequency == far.frequency else ""
        said += (
            f", and by {significant(far.miss, 2)} at most ({far.published.name}, {far.body}{at}, "
            f"{far.outcome} it)"
        )
    return f"{said}. {built} more are of presets that were made from the source, and prove nothing."


def _median(rows: Iterable[Compared]) -> float:
    """Median factor of the rows that miss."""
    return float(np.median([row.miss for row in rows if row.outcome in (ABOVE, BELOW)] or [1.0]))


def _of_quantity(rows: Iterable[Compared], quantity: str, words: str) -> str:
    own = [row for row in _own(rows) if row.published.quantity.name == quantity]
    parts = []
    for outcome in (BELOW, ABOVE):
        missed = [row for row in own if row.outcome == outcome]
        if missed:
            parts.append(
                f"{outcome} the published in {len(missed)} of {len(own)}, by a median factor of "
                f"{significant(_median(missed), 2)}"
            )
    return f"{words} are {' and '.join(parts)}." if parts else f"{words} all agree."


def _of_all_sources(rows: Iterable[Compared], quantity: str) -> str:
    """How far sources are from each other, and how often each preset is between them."""
    band = [row for row in rows if row.published.name == f"{ALL}: {quantity}"]
    apart = max(row.high / row.low for row in band)
    inside = {
        name: sum(row.outcome == WITHIN for row in band if row.body == name) for name in BODIES
    }
    each = ", ".join(f"{name} {count}" for name, count in inside.items())
    return (
        f"The sources themselves differ in {quantity} by a factor of up to {significant(apart, 2)} "
        f"at one frequency; between the lowest and the highest of them are, of "
        f"{len(band) // len(BODIES)} frequencies: {each}."
    )


def _optima(found: Validation) -> str:
    low, high = OPTIMUM.lows[0], OPTIMUM.highs[0]
    said = []
    for name in found.sweeps:
        own = [row for row in found.rows
               if row.body == name
               and row.published.name.startswith(f"{OPTIMUM.name}, largest")]  # fmt: skip
        shown = " and ".join(significant(row.ours, 2) for row in own)
        missed = [row for row in own if row.outcome != WITHIN]
        outcome = ", ".join(f"{row.outcome} by {times(row.miss)}" for row in missed)
        chosen = ", chosen by it" if own[0].is_built else ""
        said.append(f"{name} at {shown} m/s ({outcome or 'within'}{chosen})")
    around = " and ".join(f"{1e3 * each:g}" for each in PERIMETERS)
    return (
        f"On circles of {around} mm around the focus deflects most, where {low:g} to {high:g} m/s "
        f"is published whatever the path: {'; '.join(said)}."
    )


def _of_harmonics(found: Sequence[Harmonics]) -> str:
    said = []
    for wave, words in FOUND.items():
        right = [h.drive for h in found if h.wave == wave and h.agrees]
        wrong = [h.drive for h in found if h.wave == wave and not h.agrees]
        but = f", and not with {' and '.join(wrong)}" if wrong else ""
        said.append(f"{wave} AM has {words} with the drive law {' and '.join(right)}{but}")
    return f"As in the phantom, {'; '.join(said)}."


def _of_zigzags(found: Validation) -> str:
    said = []
    for body in zigzag.BODIES_SHOWN:
        own = [each for each in found.predicted if each.name == body]
        most = max(own, key=lambda each: each.middle)
        least = min(own, key=lambda each: each.middle)
        said.append(
            f"{body} moves most at {most.speed:g} m/s, {significant(1e3 * most.middle, 2)} mm/s "
            f"RMS, and least at {least.speed:g} m/s, {significant(1e3 * least.middle, 2)} mm/s"
        )
    text = f"Under the zigzag {'; '.join(said)}"
    if not found.measured:
        return f"{text}: predictions, beside which no recording was given."
    ratios = [
        f"{significant(ratio, 2)} at {m.speed:g} m/s ({p.name})"
        for m in found.measured for p in found.predicted if p.speed == m.speed
        for ratio in [p.middle / m.middle]
    ]  # fmt: skip
    if not ratios:
        return f"{text}; no recording is of one of these speeds."
    return f"{text}; predicted over measured, medians of the places: {', '.join(ratios)}."


def _of_hand(found: Validation) -> str:
    if found.hand is None:
        return "Decay along a finger of a hand in finite elements was left out (--hand)."
    lengths = [1e3 * row.ours for row in found.rows if row.body == found.hand.name]
    claims = [f"{row.frequency:g} Hz: {row.words}" for row in found.rows
              if row.body == found.hand.name]  # fmt: skip
    shown = ", ".join(significant(x, 2) for x in lengths)
    return f"Along a finger of the hand motion falls to 1/e in {shown} mm ({'; '.join(claims)})."
