"""Tables of runs for pages: lines, claims, agreement, effort."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from simple_model import Effort
from simple_model.numbers import FAINTEST, decibel, interval, percent, plural, significant
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report.figures import answered
from skinwave.report.levels import sensation_levels, strongest_probe
from skinwave.report.palette import label
from skinwave.results.claims import TEXTS, AssessedClaim
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.propagation import strongest_component
from skinwave.results.run import Run
from skinwave.system.document import Details, Markup, Part, Section
from skinwave.system.table import Column, Table
from skinwave.typing import Floats

SILENT = 0.01  # of the strongest probe: where the reference moves less, no misfit is given
ROUND_OFF = 1e-3  # of a millisecond, or of a misfit
TABLED = 12  # lines in the table
NEGLIGIBLE_LINE = 1e-9  # of the strongest line
LEVELS = (
    "Levels are relative to f_AM at the same probe, and those of the probe where that is largest, "
    "which may be one where f_AM is weak."
)
AGREEMENT = (
    "Tacton", "what changes", "from, to", "waveform misfit at the best scale",
    "misfit at the best gain and delay", "delay over the probes, ms",
    "phase delay of the strongest component, ms", "spread over the probes at -6 / -20 dB, mm",
)  # fmt: skip
EFFORT = (
    "body", "dofs", "reduced to", Column("estimated reduction error", digits=2),
    Column("relative energy imbalance", digits=1), "share of loss radiated", "solver",
    "time by phase", "peak memory so far, GiB",
)  # fmt: skip


def lines_table(runs: Sequence[Run]) -> list[Part]:
    """Lines of each model at the probe that moves most, the strongest of any first, each model's in
    the unit of its quantity.
    """
    probe = strongest_probe(runs)
    known = [name for name in runs[0].listed if all(name in run.listed for run in runs)]
    if not known and not any(run.unnamed for run in runs):
        return ["No line of the load is resolved: see above, or the pressure is constant."]
    share = {name: max(_share(run, name, probe) for run in runs) for name in known}
    names = sorted(share, key=lambda name: -share[name])[:TABLED]
    sensation = [sensation_levels(run, probe) for run in runs]
    rows = [
        [name, f"{runs[0].listed[name]:.2f}"]
        + [cell for run, levels in zip(runs, sensation, strict=True)
           for cell in _amplitude(run, name, probe, levels)]
        for name in names
    ]  # fmt: skip
    columns = ["line", "frequency, Hz"]
    for run in runs:
        columns += [f"{answered(run)}, {run.response.record.shown} peak"]
        columns += ["dB re threshold"] if run.is_skin else []
    x, y = 1e3 * runs[0].response.probes[probe]
    title = f"{runs[0].tacton}: lines at ({x:g}, {y:g}) mm"
    return [Section(title, [Table(columns, [*rows, *_unnamed_rows(runs, probe)])], level=3)]


def _share(run: Run, name: str, probe: int) -> float:
    """A line's amplitude over that of the strongest."""
    strongest = max(float(x[probe]) for x in run.table.amplitudes.values())
    return float(run.table.amplitudes[name][probe]) / strongest if strongest else 0.0


def _amplitude(run: Run, name: str, probe: int, levels: Mapping[str, float]) -> list[str]:
    """A line's amplitude and, of skin, its level above threshold; 0 if it is round-off."""
    if _share(run, name, probe) < NEGLIGIBLE_LINE:
        return ["0", ""] if run.is_skin else ["0"]
    size = significant(run.response.record.per_unit * float(run.table.amplitudes[name][probe]))
    if not run.is_skin:
        return [size]
    level = levels[name]
    return [size, f"{round(level):+d}" if level >= FAINTEST else decibel(level)]


def _unnamed_rows(runs: Sequence[Run], probe: int) -> Iterator[list[object]]:
    """A row for each peak that is no single line of the load, those of all runs together."""
    found = {(peak.kind, round(peak.frequency, 1)) for run in runs for peak in run.unnamed[:TABLED]}
    for kind, frequency in sorted(found):
        row: list[object] = [kind, f"{frequency:.1f}"]
        for run in runs:
            sizes: list[object] = [
                run.response.record.per_unit * float(peak.amplitudes[probe])
                for peak in run.unnamed[:TABLED]
                if (peak.kind, round(peak.frequency, 1)) == (kind, frequency)
            ]
            row += [*(sizes[:1] or [""]), *([""] if run.is_skin else [])]
        yield row


def claims_parts(assessed_claims: Sequence[AssessedClaim]) -> list[Part]:
    """Which of the paper's claims hold where: a grid of marks, and the numbers that decide."""
    if not assessed_claims:
        return []
    columns = list(dict.fromkeys(v.column for v in assessed_claims))
    found = {(v.claim, v.column): v for v in assessed_claims}
    claims = [claim for claim in TEXTS if any(claim == v.claim for v in assessed_claims)]
    marks, numbers = [], []
    for claim in claims:
        own = [found.get((claim, column)) for column in columns]
        marks.append([f"{claim}: {TEXTS[claim]}", *map(_mark, own)])
        numbers.append([claim, *(v.sentence if v else None for v in own)])
    names = list(map(label, columns))
    decide = [LEVELS, Table(["claim", *names], numbers), *_disagreements(assessed_claims)]
    return [
        Section("Claims of the paper", [
            Table(["claim (Lim, Seifi and Park, CHI EA '24)", *names], marks),
            Details("Numbers that decide", decide),
        ])
    ]  # fmt: skip


def _mark(assessed: AssessedClaim | None) -> Markup | None:
    if assessed is None:
        return None
    kind, mark = ("yes", "✓ holds") if assessed.holds else ("no", "✗ fails")
    return Markup('<span class="{}" title="{}">{}</span>').format(kind, assessed.sentence, mark)


def _disagreements(assessed_claims: Sequence[AssessedClaim]) -> list[Part]:
    """Claims measured on paper that a body contradicts, and whether propagation is the cause."""
    of_kernel = {v.claim: v for v in assessed_claims if v.model == SAME_LOAD.name}
    texts: list[Part] = []
    for assessed in assessed_claims:
        if assessed.body == "none" or not assessed.claim.startswith("M") or assessed.holds:
            continue
        text = (
            f"The {label(assessed.body)} contradicts {assessed.claim}, which was measured on "
            f"paper: {assessed.sentence}."
        )
        kernel = of_kernel.get(assessed.claim)
        if kernel is not None and assessed.claim != "M2":  # which is about places, in Hz
            same = "holds" if kernel.holds else "fails, too"
            text += (
                f" In the point kernel under the same load it {same}: "
                f"{decibel(kernel.value)} dB there, {decibel(assessed.value)} dB here. The "
                "difference is due to propagation."
            )
        texts.append(text)
    return texts


def agreement_table(runs: Mapping[str, Sequence[Run]]) -> Table:
    """Each Tacton's responses, in pairs between which one thing changes: drive law and focus
    from the published kernel to that under the same load, propagation from this to a body.
    """
    rows = [
        [name, changed, f"{label(a.column)} to {label(b.column)}", *_agreement(a, b)]
        for name, group in runs.items()
        for changed, a, b in _pairs(group)
    ]
    return Table(AGREEMENT, rows)


def _pairs(group: Iterable[Run]) -> list[tuple[str, Run, Run]]:
    """Name of the change, and the two runs between which it is made."""
    found = {run.column: run for run in group}
    kernel, published = found.get(SAME_LOAD.name), found.get(PUBLISHED.name)
    if kernel is None:
        return []
    first = [("drive law and focus", published, kernel)] if published else []
    return first + [("propagation", kernel, run) for run in found.values() if run.is_motion]


def _agreement(a: Run, b: Run) -> list[str]:
    strongest = strongest_component(b)
    found = compare(a.response, b.response, (strongest.frequency,) if strongest else ())
    delays = found.phase_delay[0] if strongest else np.array([np.nan])
    level = moving_rms(a.response)
    moves = level > SILENT * level.max()  # a misfit relative to nothing is none
    spreads = (found.spread_reference, found.spread_candidate)
    return [
        _between(found.relative_l2[moves]),
        _between(found.shape_misfit[moves]),
        _between(1e3 * found.delay[moves]),
        _between(1e3 * delays[np.isfinite(delays)]),
        " to ".join(f"{1e3 * each[-6]:g} / {1e3 * each[-20]:g}" for each in spreads),
    ]


def _between(values: Floats) -> str:
    """The least and the largest."""
    if not len(values):
        return "-"
    values = np.where(np.abs(values) < ROUND_OFF, 0.0, values) + 0.0
    low, high = float(values.min()), float(values.max())
    alike = significant(low, 2) == significant(high, 2)
    return significant(low, 2) if alike else interval(low, high)


def effort_table(
    efforts: Mapping[str, Effort], tactons: int, total: float | None = None
) -> list[Part]:
    """Seconds by phase, size and memory of each body, and of the whole."""
    rows = [
        [label(name), effort.dofs, effort.reduced_dofs or None, effort.estimate or None,
         effort.energy_imbalance or None,
         percent(effort.radiated) if effort.radiated else None, effort.solver,
         ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in effort.seconds.items()),
         effort.peak_memory / 2**30 or None]
        for name, effort in efforts.items()
    ]  # fmt: skip
    versions = next(iter(efforts.values())).versions if efforts else {}
    named = ", ".join(f"{name} {version}" for name, version in versions.items())
    peak = max((effort.peak_memory for effort in efforts.values()), default=0) / 2**30
    spent = sum(s for e in efforts.values() for s in e.seconds.values()) if total is None else total
    took = f"{plural(tactons, 'Tacton')} took {significant(spent, 2)} s in all"
    took += f", at most {peak:.2f} GiB in a process" * bool(peak)
    return [Table(EFFORT, rows), f"{took}. {named}"]
