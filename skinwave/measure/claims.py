"""Claims of Lim, Seifi and Park, assessed on a measurement with noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simple_model.numbers import decibel
from skinwave.measure.lines import MeasuredLines
from skinwave.results.claims import CLAIMS, Claim, LinesByName, is_resolved, is_single
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

HOLDS, FAILS, UNDECIDED = "holds", "fails", "cannot be decided"


@dataclass(frozen=True, kw_only=True)
class MeasuredClaim:
    """A claim, its result in a measurement (`HOLDS`, `FAILS` or `UNDECIDED`), and the reason."""

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
    """Return lines at the probes of a scene by all names; `names` maps first names to all."""
    size = np.abs(lines.mean)
    confidence = 0.95  # that all true amplitudes are within their bounds
    radius = lines.radius(1 - (1 - confidence) / max(size.size, 1))
    every = [(name, k) for k, aliases in enumerate(names.values()) for name in aliases]
    return LinesByName(
        tacton=scene.name, scene=scene, places=scene.probe_points,
        frequencies={name: float(lines.frequencies[k]) for name, k in every},
        lines={name: size[k] for name, k in every}, radius={name: radius[k] for name, k in every},
        unresolved=tuple(unresolved), spectrum=spectrum,
    )  # fmt: skip


def assess_measured(measured: LinesByName) -> list[MeasuredClaim]:
    """Return the claims about a Tacton of this kind.

    A claim is decided if all amplitudes within the noise agree.
    """
    if not is_single(measured):
        return []
    kind = measured.is_am, measured.is_stm
    return [
        MeasuredClaim(claim=claim.name, finding=finding, sentence=sentence)
        for claim in CLAIMS.values() if kind in claim.kinds
        for finding, sentence in [_assess(measured, claim)]
    ]  # fmt: skip


def _assess(measured: LinesByName, claim: Claim) -> tuple[str, str]:
    if reason := _undecidable(measured, claim):
        return UNDECIDED, reason
    if claim.is_of_peaks:
        holds, _, _, sentence = claim.assess([measured])
        return HOLDS if holds else FAILS, sentence
    at = measured.lines["f_AM"] > measured.radius["f_AM"]
    clear = replace(
        measured, places=measured.places[at],
        lines={name: a[at] for name, a in measured.lines.items()},
        radius={name: r[at] for name, r in measured.radius.items()},
    )  # fmt: skip
    best, worst = (
        [claim.assess([_vary(clear, claim, way, am)]) for am in (-1, 1)] for way in (1, -1)
    )
    sentence = claim.assess([clear])[3]
    if not at.all():
        sentence += f"; assessed at {at.sum()} of {len(at)} places, where f_AM is above the noise"
    if all(one[0] for one in worst):
        return HOLDS, sentence
    if not any(one[0] for one in best):
        return FAILS, sentence
    low, high = (pick(one[1] for one in (*best, *worst)) for pick in (min, max))
    return UNDECIDED, (
        f"{sentence}; the noise allows {decibel(low)} to {decibel(high)} dB, and the threshold of "
        f"the claim is {best[0][2]:g} dB"
    )  # fmt: skip


def _undecidable(measured: LinesByName, claim: Claim) -> str:
    """Return why a claim cannot be assessed, or ""."""
    if claim.is_of_paths:
        return "the claim is about several paths, and the record has one"
    if not is_resolved(measured, claim):
        lost = ", ".join(measured.unresolved) or "its lines"
        return f"the record is too short, or sampled too slowly, to resolve {lost}"
    known = measured.frequencies.keys()
    about = next((n for n in claim.needs if known >= set(n)), tuple(known))
    if any(np.isnan(measured.radius[name]).any() for name in about):
        return "the noise is unknown, without repetitions and bins between the lines"
    if claim.is_of_peaks and not len(measured.spectrum[0]):
        return "the record has single lines, without the spectrum between them"
    needed = about if claim.is_of_peaks else ("f_AM",)
    weak = [n for n in needed if not (measured.lines[n] > measured.radius[n]).any()]
    return f"{', '.join(weak)} not above the noise at any place" if weak else ""


def _vary(measured: LinesByName, claim: Claim, way: int, am: int) -> LinesByName:
    """Return amplitudes varied within the noise for a claim (way 1) or against it (-1)."""
    of_am = measured.frequencies["f_AM"]

    def sign(name: str) -> int:
        if measured.frequencies[name] == of_am:
            return am
        return way if name in claim.expects else -way

    return replace(measured, lines={
        name: np.maximum(a + sign(name) * measured.radius[name], 0.0)
        for name, a in measured.lines.items()
    })  # fmt: skip
