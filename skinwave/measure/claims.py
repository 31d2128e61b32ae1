"""Claims of Lim, Seifi and Park, assessed on a measurement alone: what its noise allows to say."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simple_model.numbers import decibel
from skinwave.measure.lines import MeasuredLines
from skinwave.results.claims import (
    CLAIMS,
    NEEDED,
    PAIRS,
    LinesByName,
    NamedLines,
    is_resolved,
    is_single,
)
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

HOLDS, FAILS, UNDECIDED = "holds", "fails", "cannot be decided"
CONFIDENCE = 0.95  # that all true amplitudes are within their bounds
OF_SEVERAL = "M2"  # the claim about several paths
OF_PLACES = ("S2", "S5")  # claims about the frequencies of peaks
SOUGHT = {  # lines that a claim says are there, where the others are to be weak
    "S3": PAIRS, "M1": ("2f_AM", "3f_AM"), "M3": ("f_d", "2f_AM"),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class MeasuredClaim:
    """A claim and what a measurement says of it: `HOLDS`, `FAILS` or `UNDECIDED`, and why."""

    claim: str
    finding: str
    sentence: str


def by_name(
    scene: Scene,
    names: Mapping[str, tuple[str, ...]],
    lines: MeasuredLines,
    unresolved: Sequence[str],
    spectrum: tuple[Floats, Floats],
) -> LinesByName:
    """Lines at the probes of a scene by every name of each, which `names` has by the first."""
    size = np.abs(lines.mean)
    around = lines.radius(1 - (1 - CONFIDENCE) / max(size.size, 1))
    every = [(name, k) for k, own in enumerate(names.values()) for name in own]
    return LinesByName(
        tacton=scene.name, scene=scene, places=scene.probe_points,
        frequencies={name: float(lines.frequencies[k]) for name, k in every},
        lines={name: size[k] for name, k in every}, radius={name: around[k] for name, k in every},
        unresolved=tuple(unresolved), spectrum=spectrum,
    )  # fmt: skip


def assess_measured(measured: LinesByName) -> list[MeasuredClaim]:
    """Every claim that is about such a Tacton: decided where all amplitudes within the noise agree,
    at the places where f_AM is above the noise.
    """
    if not is_single(measured):
        return []
    kind = measured.is_am, measured.is_stm
    return [
        _assessed(measured, claim, assess)
        for claim, (kinds, assess) in CLAIMS.items()
        if kind in kinds
    ]


def _assessed(
    measured: LinesByName, claim: str, assess: Callable[[Sequence[NamedLines]], tuple]
) -> MeasuredClaim:
    if reason := _undecidable(measured, claim):
        return MeasuredClaim(claim=claim, finding=UNDECIDED, sentence=reason)
    if claim in OF_PLACES:
        holds, _, _, sentence = assess([measured])
        return MeasuredClaim(claim=claim, finding=HOLDS if holds else FAILS, sentence=sentence)
    heard = _where_heard(measured)
    best, worst = ([assess([_varied(heard, claim, way, am)]) for am in (-1, 1)] for way in (1, -1))
    sentence = assess([heard])[3]
    if len(heard.places) < len(measured.places):
        sentence += (
            f"; f_AM is above the noise at {len(heard.places)} of {len(measured.places)} places, "
            "and these count"
        )
    if all(one[0] for one in worst):
        return MeasuredClaim(claim=claim, finding=HOLDS, sentence=sentence)
    if not any(one[0] for one in best):
        return MeasuredClaim(claim=claim, finding=FAILS, sentence=sentence)
    low, high = (pick(one[1] for one in (*best, *worst)) for pick in (min, max))
    return MeasuredClaim(
        claim=claim, finding=UNDECIDED,
        sentence=f"{sentence}; the noise allows {decibel(low)} to {decibel(high)} dB, and the "
        f"claim has {best[0][2]:g} dB for its threshold",
    )  # fmt: skip


def _undecidable(measured: LinesByName, claim: str) -> str:
    """Why a claim cannot be assessed; nothing if it can."""
    if claim == OF_SEVERAL:
        return "it is about several paths, and this is a record of one"
    if not is_resolved(measured, claim):
        lost = ", ".join(measured.unresolved) or "lines that it is about"
        return f"the record is too short, or sampled too slowly, to resolve {lost}"
    known = measured.frequencies.keys()
    about = next((n for n in NEEDED.get(claim, ()) if known >= set(n)), tuple(known))
    if any(np.isnan(measured.radius[name]).any() for name in about):
        return "the noise is unknown: there are no repetitions, and no bins beside the lines"
    of_places = claim in OF_PLACES
    if of_places and not len(measured.spectrum[0]):
        return "the record is of single lines, without the spectrum between them"
    needed = about if of_places else ("f_AM",)
    faint = [n for n in needed if not (measured.lines[n] > measured.radius[n]).any()]
    return f"{', '.join(faint)} not above the noise at any place" if faint else ""


def _where_heard(measured: LinesByName) -> LinesByName:
    """The places alone where f_AM is above the noise."""
    at = measured.lines["f_AM"] > measured.radius["f_AM"]
    return replace(
        measured, places=measured.places[at],
        lines={name: a[at] for name, a in measured.lines.items()},
        radius={name: r[at] for name, r in measured.radius.items()},
    )  # fmt: skip


def _varied(measured: LinesByName, claim: str, way: int, am: int) -> LinesByName:
    """Amplitudes as far towards the claim (way 1), or against it (-1), as the noise allows; those
    of f_AM up (am 1) or down.
    """
    of_am = measured.frequencies["f_AM"]

    def sign(name: str) -> int:
        if measured.frequencies[name] == of_am:
            return am
        return way if name in SOUGHT.get(claim, ()) else -way

    return replace(measured, lines={
        name: np.maximum(a + sign(name) * measured.radius[name], 0.0)
        for name, a in measured.lines.items()
    })  # fmt: skip
