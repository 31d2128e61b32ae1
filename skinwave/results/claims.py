"""Claims of Lim, Seifi and Park about spectral lines, evaluated on the responses of any model.

S1 to S5 are claims about their simulation, M1 to M5 about their measurement on paper.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from simple_model.numbers import decibel, plural
from simple_model.quantities import DISPLACEMENT
from skinwave.results.run import OfTacton, Run
from skinwave.scene.scene import Scene
from skinwave.system.table import Table
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits by which claims are assessed: levels in dB re f_AM, and an offset in Hz."""

    present: float = -60.0  # a line this weak is visible above a vibrometer's noise
    absent: float = -120.0
    much_lower: float = -20.0  # a tenth of the amplitude
    on_bin: float = 1.0  # one bin of a spectrum of 1 s


LIMITS = Limits()
PAIRS = ("f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM")


@dataclass(frozen=True, kw_only=True, eq=False)
class LinesByName(OfTacton):
    """Measured lines by name: the attributes of a `Run` that claims use, and the `radius` (p,) of
    the confidence circle of each amplitude. `spectrum` is empty if only lines are known.
    """

    tacton: str
    scene: Scene
    places: Floats
    frequencies: dict[str, float]
    lines: dict[str, Floats]
    radius: dict[str, Floats]
    unresolved: tuple[str, ...]
    spectrum: tuple[Floats, Floats]

    @property
    def is_motion(self) -> bool:
        """Whether the lines are of displacement."""
        return self.scene.reading.record is DISPLACEMENT


NamedLines = Run | LinesByName
Assessment = tuple[bool, float, float, str]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """Statement of the paper about spectral lines.

    kinds : kinds of runs that it is about, as whether each is AM, and STM
    assess : function that returns whether it holds, the value that decides, its limit, a sentence
    needs : sets of lines, one of which it needs; by default it needs all lines
    expects : lines that it expects, while others are to be weak
    is_of_peaks, is_of_paths : whether it is about the frequencies of peaks, and several paths
    """

    name: str
    text: str
    kinds: tuple[tuple[bool, bool], ...]
    assess: Callable[[Sequence[NamedLines]], Assessment]
    needs: tuple[tuple[str, ...], ...] = ()
    expects: tuple[str, ...] = ()
    is_of_peaks: bool = False
    is_of_paths: bool = False


@dataclass(frozen=True, kw_only=True)
class AssessedClaim:
    """Whether a claim holds for a body and a model; its deciding `value`, and the limit `bar`."""

    claim: str
    body: str
    model: str
    holds: bool
    value: float
    bar: float
    sentence: str

    @property
    def column(self) -> str:
        """Name in tables and figures, as `Run.column`."""
        return self.model if self.body == "none" else self.body


def evaluate(runs: Iterable[Run]) -> list[AssessedClaim]:
    """Assess every claim for each body and model whose runs resolve its lines."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in filter(is_single, runs):
        groups.setdefault((run.body, run.model), []).append(run)
    assessed_claims = []
    for (body, model), group in groups.items():
        for claim in CLAIMS.values():
            about = [run for run in group if (run.is_am, run.is_stm) in claim.kinds]
            if chosen := [run for run in about if is_resolved(run, claim)]:
                holds, value, bar, sentence = claim.assess(chosen)
                assessed_claims.append(
                    AssessedClaim(
                        claim=claim.name, body=body, model=model, holds=bool(holds),
                        value=float(value), bar=bar, sentence=sentence,
                    )
                )  # fmt: skip
    return assessed_claims


def assessable_runs(runs: Iterable[Run]) -> list[Run]:
    """Return the runs of the point kernel and of the displacement of a surface."""
    return [run for run in runs if run.is_motion or not run.response.record.of_body]


def write_claims(path: Path, assessed_claims: Iterable[AssessedClaim]) -> None:
    """Write a CSV file with a row for each assessed claim."""
    table = Table([field.name for field in fields(AssessedClaim)], map(astuple, assessed_claims))
    path.write_bytes(table.to_csv())


def is_single(run: NamedLines) -> bool:
    """Whether the Tacton is of the measured kind: one focus, with one steady AM tone or none."""
    tacton = run.scene.tacton
    plain = len(tacton.foci) == 1 and not tacton.is_sampled and not tacton.envelope_frequency
    # Claims are about the first of two sinusoids, which must act alone.
    w1, w2 = tacton.superposition
    one = (w1 > 0 or not tacton.am_frequency) and not (w2 > 0 and tacton.second_am_frequency)
    return bool(plain and one and tacton.trajectory.shape != "recorded")


def is_resolved(run: NamedLines, claim: Claim) -> bool:
    """Whether the lines that a claim is about are resolved."""
    if claim.needs:
        return any(run.frequencies.keys() >= set(names) for names in claim.needs)
    return "f_AM" in run.frequencies and bool(rivals(run)) and not run.unresolved


def _single_line(runs: Sequence[NamedLines]) -> Assessment:
    worst = max(rival_levels(run).max() for run in runs)
    sentence = f"the strongest line other than f_AM is at {decibel(worst, signed=True)} dB re f_AM"
    return worst < LIMITS.absent, worst, LIMITS.absent, sentence


def _lowest_levels(runs: Sequence[NamedLines], first: str, second: str) -> tuple[float, float, str]:
    """Return the lowest levels of two lines, and both in words."""
    one, two = (min(_strongest(run, [name]) for run in runs) for name in (first, second))
    words = [name.replace("f", " f").strip() for name in (first, second)]
    return (
        one,
        two,
        (
            f"the lowest level of {words[0]} is {decibel(one, signed=True)} dB re f_AM, that of "
            f"{words[1]} {decibel(two, signed=True)} dB"
        ),
    )


def _am_harmonics(runs: Sequence[NamedLines]) -> Assessment:
    second, third, sentence = _lowest_levels(runs, "2f_AM", "3f_AM")
    weakest = min(second, third)
    return weakest > LIMITS.present, weakest, LIMITS.present, sentence


def _drawing_lines(runs: Sequence[NamedLines]) -> Assessment:
    offset = max(
        abs(_peak(run, f"{n}f_d".lstrip("1")) - n * run.scene.tacton.trajectory.drawing_frequency)
        for run in runs
        for n in (1, 2, 3)
    )
    return _on_bin(offset, f"the peaks at 1, 2 and 3 f_d deviate by {_bound(offset)}")


def _same_places(runs: Sequence[NamedLines]) -> Assessment:
    names = ("f_d", "2f_d", "3f_d")
    places = np.array([[_peak(run, name) for name in names] for run in runs])
    if not np.isfinite(places).all():
        return _on_bin(np.inf, "")
    drift = float(np.ptp(places, axis=0).max())
    first = 20 * np.log10([run.lines["f_d"].max() for run in runs])
    sentence = (
        f"the lines of {len(runs)} paths lie within {drift:.2f} Hz of each other; "
        f"their f_d amplitudes differ by {np.ptp(first):.1f} dB"
    )
    return _on_bin(drift, sentence)


def _pairs_only(runs: Sequence[NamedLines]) -> Assessment:
    drawn = max(_strongest(run, ["f_d", "2f_d", "3f_d"], "f_AM") for run in runs)
    weakest = min(min(_strongest(run, [name], "f_AM") for name in PAIRS) for run in runs)
    sentence = (
        f"the strongest line at n f_d is at {decibel(drawn, signed=True)} dB re f_AM, the weakest "
        f"of the pairs n f_d ± f_AM (n = 1, 2) at {decibel(weakest, signed=True)} dB"
    )
    return drawn < LIMITS.absent and weakest > LIMITS.present, drawn, LIMITS.absent, sentence


def _both_multiples(runs: Sequence[NamedLines]) -> Assessment:
    drawn, _, sentence = _lowest_levels(runs, "f_d", "2f_AM")
    return drawn > LIMITS.present, drawn, LIMITS.present, sentence


def _am_highest(runs: Sequence[NamedLines]) -> Assessment:
    worst = max(runs, key=lambda run: rival_levels(run).max())
    value = rival_levels(worst).max()
    name, probe = strongest_rival(worst)
    sentence = (
        f"the strongest rival of f_AM is {name} at {decibel(value, signed=True)} dB "
        f"({worst.tacton}, probe at {probe:g} mm)"
    )
    return value < 0, value, 0.0, sentence


def _am_highest_measured(runs: Sequence[NamedLines]) -> Assessment:
    holds, value, bar, sentence = _am_highest(runs)
    exceeded = [run.tacton for run in runs if rival_levels(run).max() >= 0]
    if exceeded:
        every = len(exceeded) == len(runs) > 1
        names = f"all {len(runs)} Tactons" if every else ", ".join(exceeded)
        sentence += f"; f_AM is exceeded in {names}"
    if runs[0].is_motion:  # a vibrometer reads velocity; the point kernel has no velocity
        velocity = max(rival_levels(run, velocity=True).max() for run in runs)
        sentence += f"; strongest rival in velocity: {decibel(velocity, signed=True)} dB"
        value = max(value, velocity)
    return holds and value < 0, value, bar, sentence


def _much_lower(runs: Sequence[NamedLines]) -> Assessment:
    levels = [multiple_levels(run).max() for run in runs]
    value, lower = max(levels), sum(bool(level < LIMITS.much_lower) for level in levels)
    sentence = (
        f"the strongest multiple of f_AM or f_d is at {decibel(value, signed=True)} dB re f_AM, "
        f"and below {LIMITS.much_lower:g} dB in {lower} of {plural(len(runs), 'Tacton')}"
    )
    if value < LIMITS.present:
        sentence += "; it is too weak to be visible"
    return bool(LIMITS.present <= value < LIMITS.much_lower), value, LIMITS.much_lower, sentence


def _exact_frequencies(runs: Sequence[NamedLines]) -> Assessment:
    offsets = [
        abs(_peak(run, name) - run.frequencies[name])
        for run in runs
        for name in (["f_AM"] if run.is_am else ["f_d"])
    ]
    worst = max(offsets)
    sentence = f"the spectral peaks deviate from the commanded f_AM and f_d by {_bound(worst)}"
    return _on_bin(worst, sentence)


def _on_bin(offset: float, sentence: str) -> Assessment:
    """Return whether an offset in Hz is at most a bin; without a peak the offset is infinite."""
    if not np.isfinite(offset):
        sentence = "a line that the claim is about has no spectral peak next to it"
    return offset <= LIMITS.on_bin, offset, LIMITS.on_bin, sentence


def _bound(offset: float) -> str:
    return "less than 0.01 Hz" if offset < 0.01 else f"at most {offset:.2f} Hz"


# Kinds of runs that claims are about: whether the amplitude is modulated, and the focus moves.
AM, STM, BOTH = (True, False), (False, True), (True, True)
CLAIMS: Mapping[str, Claim] = {
    claim.name: claim
    for claim in (
        Claim(name="S1", kinds=(AM,), assess=_single_line,
              text="Simulated, AM alone: a single line at f_AM."),
        Claim(name="S2", kinds=(STM,), assess=_drawing_lines,
              text="Simulated, STM alone: lines at multiples of f_d.",
              needs=(("f_d", "2f_d", "3f_d"),), is_of_peaks=True),
        Claim(name="S3", kinds=(BOTH,), assess=_pairs_only,
              text="Simulated, AM+STM: f_AM and the pairs n f_d ± f_AM, no line at n f_d.",
              needs=(("f_AM", "f_d", "2f_d", "3f_d", *PAIRS),), expects=PAIRS),
        Claim(name="S4", kinds=(BOTH,), assess=_am_highest,
              text="Simulated, AM+STM: f_AM is the highest line, whatever the path."),
        Claim(name="S5", kinds=(AM, STM), assess=_exact_frequencies,
              text="Both: lines exactly at the commanded f_AM and f_d.",
              needs=(("f_AM",), ("f_d",)), is_of_peaks=True),
        Claim(name="M1", kinds=(AM,), assess=_am_harmonics,
              text="Measured, AM alone: lines at multiples of f_AM.",
              needs=(("f_AM", "2f_AM", "3f_AM"),), expects=("2f_AM", "3f_AM")),
        Claim(name="M2", kinds=(STM,), assess=_same_places,
              text="Measured, STM alone: the same lines for every path with the same f_d.",
              needs=(("f_d", "2f_d", "3f_d"),), is_of_paths=True),
        Claim(name="M3", kinds=(BOTH,), assess=_both_multiples,
              text="Measured, AM+STM: lines at multiples of both f_AM and f_d.",
              needs=(("f_AM", "2f_AM", "f_d"),), expects=("f_d", "2f_AM")),
        Claim(name="M4", kinds=(BOTH,), assess=_am_highest_measured,
              text="Measured, AM+STM: f_AM is the highest line, whatever the path."),
        Claim(name="M5", kinds=(BOTH,), assess=_much_lower,
              text="Measured, AM+STM: the multiples of f_AM and f_d are much lower than f_AM."),
    )
}  # fmt: skip


def _probe_levels(
    run: NamedLines, names: Iterable[str], reference: str, velocity: bool = False
) -> Floats:
    """Return levels (line, probe) in dB re a reference line at the same probe."""
    names = list(names)
    weight = {name: run.frequencies[name] if velocity else 1.0 for name in [*names, reference]}
    base = np.maximum(run.lines[reference] * weight[reference], np.finfo(float).tiny)
    ratios = np.array([run.lines[name] * weight[name] for name in names]) / base
    return 20 * np.log10(np.maximum(ratios, 1e-15))


def rivals(run: NamedLines) -> list[str]:
    """Return the names of the lines that are resolved from f_AM."""
    f_am = run.frequencies["f_AM"]
    return [n for n, f in run.frequencies.items() if abs(f - f_am) > 2 * LIMITS.on_bin]


def rival_levels(run: NamedLines, velocity: bool = False) -> Floats:
    """Return the level of the strongest line other than f_AM at each probe, in dB re f_AM there."""
    return _probe_levels(run, rivals(run), "f_AM", velocity).max(axis=0)


def multiple_levels(run: NamedLines) -> Floats:
    """Return the level of the strongest multiple of f_AM or f_d other than f_AM at each probe, in
    dB re f_AM there. Sums and differences are not "these frequency harmonics".
    """
    names = [n for n in rivals(run) if not ("f_AM" in n and "f_d" in n)]
    return _probe_levels(run, names, "f_AM").max(axis=0, initial=-300.0)


def strongest_rival(run: NamedLines) -> tuple[str, float]:
    """Return the strongest line other than f_AM, and the radius in mm of its probe."""
    names = rivals(run)
    levels = _probe_levels(run, names, "f_AM")
    line, probe = np.unravel_index(np.argmax(levels), levels.shape)
    return names[line], 1e3 * float(np.hypot(*run.places[probe]))


def _strongest(run: NamedLines, names: list[str], reference: str = "f_AM") -> float:
    """Return the highest level of some lines at any probe, in dB re the reference there."""
    return float(_probe_levels(run, names, reference).max())


def _peak(run: NamedLines, line: str) -> float:
    """Return the frequency in Hz of the spectral peak next to a line at its strongest probe, from
    the logarithm between bins; inf without a peak.
    """
    f, amplitude = run.spectrum
    x = amplitude[:, int(np.argmax(run.lines[line]))]
    peak_reach = 6.0  # Hz from a line within which its spectral peak is searched
    near = np.flatnonzero(np.abs(f - run.frequencies[line]) <= peak_reach)
    if len(near) < 3:  # the Tacton is too short
        return np.inf
    top = near[np.argmax(x[near])]
    if top in (near[0], near[-1]) or x[top] <= 0:
        return np.inf
    left, centre, right = np.log(np.maximum(x[top - 1 : top + 2], np.finfo(float).tiny))
    return float(f[top] + (left - right) / (left - 2 * centre + right) / 2 * f[1])
