"""Tables of runs for pages: lines, claims, agreement and effort."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from simple_model import Effort
from simple_model.numbers import FAINTEST, decibel, interval, percent, plural, significant
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report.figures import run_label
from skinwave.report.palette import label
from skinwave.report.spectra import sensation_levels, strongest_probe
from skinwave.results.claims import CLAIMS, AssessedClaim
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.propagation import strongest_component
from skinwave.results.run import Run
from skinwave.system.document import Details, Markup, Part, Section
from skinwave.system.table import Column, Table
from skinwave.typing import Floats


def lines_table(runs: Sequence[Run], most: int = 12) -> list[Part]:
    """Return a table of the lines of each model at the probe that moves most, strongest first, and
    of as many other peaks.
    """
    probe = strongest_probe(runs)
    common = [name for name in runs[0].line_hz if all(name in run.line_hz for run in runs)]
    if not common and not any(run.unnamed for run in runs):
        return ["The load has no resolved line: the Tacton is too short or the pressure constant."]
    share = {name: max(_share(run, name, probe) for run in runs) for name in common}
    names = sorted(share, key=lambda name: -share[name])[:most]
    sensation = [sensation_levels(run, probe) for run in runs]
    rows = [
        [name, f"{runs[0].line_hz[name]:.1f}"]
        + [cell for run, levels in zip(runs, sensation, strict=True)
           for cell in _amplitude(run, name, probe, levels)]
        for name in names
    ]  # fmt: skip
    columns = ["line", "frequency, Hz"]
    for run in runs:
        columns += [f"{run_label(run)}, {run.response.record.shown} peak"]
        columns += ["dB re threshold"] if run.is_skin else []
    x, y = 1e3 * runs[0].response.probes[probe]
    title = f"{runs[0].tacton}: lines at ({x:g}, {y:g}) mm"
    return [Section(title, [Table(columns, [*rows, *_unnamed_rows(runs, probe, most)])], level=3)]


def _share(run: Run, name: str, probe: int) -> float:
    """Return a line's amplitude over that of the strongest line."""
    strongest = max(float(x[probe]) for x in run.table.amplitudes.values())
    return float(run.table.amplitudes[name][probe]) / strongest if strongest else 0.0


def _amplitude(run: Run, name: str, probe: int, levels: Mapping[str, float]) -> list[str]:
    """Return a line's amplitude, 0 if round-off, and for skin its level above threshold."""
    negligible_line_ratio = 1e-9  # to the strongest line
    if _share(run, name, probe) < negligible_line_ratio:
        return ["0", ""] if run.is_skin else ["0"]
    size = significant(run.response.record.per_unit * float(run.table.amplitudes[name][probe]))
    if not run.is_skin:
        return [size]
    if (level := levels.get(name)) is None:
        return [size, ""]
    if level < FAINTEST:
        return [size, decibel(level)]
    return [size, f"{round(level):+d}" if round(level) else "0"]


def _unnamed_rows(runs: Sequence[Run], probe: int, most: int) -> Iterator[list[object]]:
    """Yield a row for each peak that is not a line of the load."""
    by_run = [
        {(peak.kind, round(peak.frequency, 1)): peak.amplitudes[probe]
         for peak in reversed(run.unnamed[:most])}
        for run in runs
    ]  # fmt: skip
    for kind, frequency in sorted({key for peaks in by_run for key in peaks}):
        row: list[object] = [kind, f"{frequency:.1f}"]
        for run, peaks in zip(runs, by_run, strict=True):
            size = peaks.get((kind, frequency))
            row += ["" if size is None else run.response.record.per_unit * float(size)]
            row += [""] * run.is_skin
        yield row


def claims_parts(assessed_claims: Sequence[AssessedClaim]) -> list[Part]:
    """Return a table of claims: where they hold, and the deciding numbers."""
    if not assessed_claims:
        return []
    columns = list(dict.fromkeys(v.column for v in assessed_claims))
    by_cell = {(v.claim, v.column): v for v in assessed_claims}
    claims = [claim for claim in CLAIMS if any(claim == v.claim for v in assessed_claims)]
    marks, numbers = [], []
    for claim in claims:
        own = [by_cell.get((claim, column)) for column in columns]
        marks.append([f"{claim}: {CLAIMS[claim].text}", *map(_mark, own)])
        numbers.append([claim, *(v.sentence if v else None for v in own)])
    names = list(map(label, columns))
    levels = (
        "Levels are relative to f_AM at the same probe, where it may be weak: the highest over the "
        "probes, the lowest over the Tactons."
    )
    decide = [levels, Table(["claim", *names], numbers), *_disagreements(assessed_claims)]
    return [
        Section("Claims of the paper", [
            Table(["claim (Lim, Seifi and Park, CHI EA '24)", *names], marks),
            Details("Deciding numbers", decide),
        ])
    ]  # fmt: skip


def _mark(assessed: AssessedClaim | None) -> Markup | None:
    if assessed is None:
        return None
    kind, mark = ("yes", "✓ holds") if assessed.holds else ("no", "✗ fails")
    return Markup('<span class="{}" title="{}">{}</span>').format(kind, assessed.sentence, mark)


def _disagreements(assessed_claims: Sequence[AssessedClaim]) -> list[Part]:
    """Return sentences on claims measured on paper that a body contradicts."""
    of_kernel = {v.claim: v.holds for v in assessed_claims if v.model == SAME_LOAD.name}
    groups: dict[tuple[str, bool | None], list[str]] = {}
    for each in assessed_claims:
        if each.body != "none" and each.claim.startswith("M") and not each.holds:
            groups.setdefault((each.body, of_kernel.get(each.claim)), []).append(each.claim)
    cause = {
        True: " The point kernel under the same load does not, so the body is the cause.",
        False: " So does the point kernel under the same load.",
        None: "",
    }
    return [
        f"The {label(body)} contradicts {', '.join(claims)}, measured on paper.{cause[holds]}"
        for (body, holds), claims in groups.items()
    ]


def agreement_parts(runs: Mapping[str, Sequence[Run]], checks: Mapping[str, Run]) -> list[Part]:
    """Return a table that compares pairs of responses, and a paragraph on the flat slabs.

    One thing changes in a pair: drive law and focus between the two kernels, propagation between
    kernel and body, shape and support between a body and the flat slab in `checks`, by column.
    """
    rows = [
        [name, changed, f"{label(a.column)} → {label(b.column)}", *_agreement(a, b)]
        for name, group in runs.items()
        for changed, a, b in _pairs(group, checks)
    ]
    agreement = (
        "Tacton", "what changes", "models", "waveform misfit at the best scale",
        "misfit at the best gain and delay", "delay at the probes, ms",
        "phase delay of the strongest component, ms", "spread over the probes at -6 / -20 dB, mm",
    )  # fmt: skip
    checked = (
        "The flat slab has the layers of the body under the focus and no sides. It is computed by "
        "the wavenumber integral, independently of the elements; both agree on a slab "
        "(docs/accuracy.md). What differs is due to the curved surface, the sides and the support "
        "of the body."
    )
    return [Table(agreement, rows), *[checked] * bool(checks)]


def _pairs(group: Iterable[Run], checks: Mapping[str, Run]) -> list[tuple[str, Run, Run]]:
    """Return names of changes, each with the two runs before and after it."""
    runs = {run.column: run for run in group}
    kernel, published = runs.get(SAME_LOAD.name), runs.get(PUBLISHED.name)
    if kernel is None:
        return []
    pairs = [("drive law and focus", published, kernel)] if published else []
    pairs += [("propagation", kernel, run) for run in runs.values() if run.is_motion]
    return pairs + [
        ("shape and support", flat, run)
        for column, flat in checks.items()
        if (run := runs.get(column)) and run.tacton == flat.tacton
    ]


def _agreement(a: Run, b: Run) -> list[str]:
    strongest = strongest_component(b)
    agreement = compare(a.response, b.response, (strongest.frequency,) if strongest else ())
    delays = agreement.phase_delay[0] if strongest else np.array([np.nan])
    level = moving_rms(a.response)
    still_ratio = 0.01  # to the strongest probe: a misfit is given where the reference moves more
    moves = level > still_ratio * level.max()
    spreads = (agreement.spread_reference, agreement.spread_candidate)
    return [
        _range(agreement.relative_l2[moves]),
        _range(agreement.shape_misfit[moves]),
        _range(1e3 * agreement.delay[moves]),
        _range(1e3 * delays[np.isfinite(delays)]),
        " → ".join(f"{1e3 * each[-6]:g} / {1e3 * each[-20]:g}" for each in spreads),
    ]


def _range(values: Floats) -> str:
    """Return the range of values."""
    if not len(values):
        return "-"
    round_off = 1e-3  # ms, or of a misfit
    values = np.where(np.abs(values) < round_off, 0.0, values) + 0.0
    return interval(float(values.min()), float(values.max()))


def effort_table(
    efforts: Mapping[str, Effort], tactons: int, total: float | None = None
) -> list[Part]:
    """Return tables of the expected errors and of time, size and memory, and the totals."""
    errors = [
        [label(name), effort.errors.words, effort.errors.cure]
        for name, effort in efforts.items() if effort.errors.parts
    ]  # fmt: skip
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
    text = f"{plural(tactons, 'Tacton')}: {significant(spent, 2)} s"
    text += f", at most {peak:.2f} GiB in one process" * bool(peak)
    error_rule = "The squares of the parts add, because their causes are independent."
    expected = "expected error of the waveform at the worst probe"
    table = Table(["body", expected, "cure of the largest part"], errors)
    parts: list[Part] = [table, error_rule] if errors else []
    effort_columns = (
        "body", "degrees of freedom", "reduced to", Column("estimated reduction error", digits=2),
        Column("relative energy imbalance", digits=1), "radiated share of loss", "solver",
        "time by phase", "peak memory, GiB",
    )  # fmt: skip
    return [*parts, Table(effort_columns, rows), f"{text}. {named}"]
