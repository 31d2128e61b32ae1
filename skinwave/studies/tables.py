"""Tables of runs for pages: lines, claims, agreement, cost."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Effort
from simple_model.numbers import FAINTEST, counted, decibel, significant
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report import description
from skinwave.report.figures import answered
from skinwave.report.levels import sensation_levels, strongest_probe
from skinwave.report.palette import label
from skinwave.results.claims import TEXTS, AssessedClaim
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.propagation import strongest_component
from skinwave.results.run import Run
from skinwave.system.document import Markup, Part, Section
from skinwave.system.table import Column, Table

SILENT = 0.01  # of the strongest probe: where the reference moves less, no misfit is given
ROUND_OFF = 1e-3  # of a millisecond, or of a misfit
TABLED = 12  # lines in the table
NEGLIGIBLE_LINE = 1e-9  # of the strongest line


def lines_table(runs: Sequence[Run]) -> list[Part]:
    """Lines of each model at the probe that moves most, the strongest of any first, each model's in
    the unit of its quantity.
    """
    probe, said = strongest_probe(runs), description.unresolved(runs)
    known = [name for name in runs[0].listed if all(name in run.listed for run in runs)]
    if not known and not any(run.unnamed for run in runs):
        return [*(said or ["A constant pressure on a focus at rest has no line."])]
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
    table = Table(columns, [*rows, *_unnamed_rows(runs, probe)])
    return [Section(f"Lines at ({x:g}, {y:g}) mm", [table, *said], level=3)]


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
            sizes: list[object] = [run.response.record.per_unit * float(peak.amplitudes[probe])
                     for peak in run.unnamed[:TABLED]
                     if (peak.kind, round(peak.frequency, 1)) == (kind, frequency)]  # fmt: skip
            row += [*(sizes[:1] or [""]), *([""] if run.is_skin else [])]
        yield row


def claims_table(assessed_claims: Sequence[AssessedClaim]) -> Table:
    """Claims down, kernels and bodies across: holds or fails, and the number that decides."""
    columns = list(dict.fromkeys(v.column for v in assessed_claims))
    found = {(v.claim, v.column): v for v in assessed_claims}
    rows = [
        [f"{claim}: {TEXTS[claim]}", *(_assessed(found.get((claim, c))) for c in columns)]
        for claim in TEXTS
        if any(claim == assessed.claim for assessed in assessed_claims)
    ]
    return Table(["claim", *map(label, columns)], rows)


def _assessed(assessed: AssessedClaim | None) -> str:
    if assessed is None:
        return "not assessed"
    kind, word = ("yes", "holds") if assessed.holds else ("no", "fails")
    template = Markup('<span class="{}">{}</span><br><small>{}</small>')
    return template.format(kind, word, assessed.sentence)


def agreement_table(runs: Mapping[str, Sequence[Run]]) -> Table:
    """Each Tacton's responses, in pairs between which one thing changes: drive law and focus
    from the published kernel to that under the same load, propagation from this to a body.
    """
    rows = [
        [name, changed, f"{label(a.column)} to {label(b.column)}", *_agreement(a, b)]
        for name, group in runs.items()
        for changed, a, b in pairs(group)
    ]
    columns = ["Tacton", "what changes", "from, to", "waveform misfit at the best scale"]
    columns += ["misfit at the best gain and delay", "delay over the probes, ms"]
    columns += ["phase delay of the strongest component, ms"]
    return Table([*columns, "spread over the probes at -6 / -20 dB, mm"], rows)


def pairs(group: Iterable[Run]) -> list[tuple[str, Run, Run]]:
    """Name of the change, and the two runs between which it is made."""
    found = {run.column: run for run in group}
    kernel, published = found.get(SAME_LOAD.name), found.get(PUBLISHED.name)
    if kernel is None:
        return []
    bodies = [run for run in found.values() if run.is_motion]
    first = [("drive law and focus", published, kernel)] if published else []
    return first + [("propagation", kernel, run) for run in bodies]


def _agreement(a: Run, b: Run) -> list[str]:
    strongest = strongest_component(b)
    found = compare(a.response, b.response, (strongest.frequency,) if strongest else ())
    delays = found.phase_delay[0] if strongest else np.array([np.nan])
    level = moving_rms(a.response)
    heard = level > SILENT * level.max()  # a misfit relative to nothing is none
    return [
        _between(found.relative_l2[heard]),
        _between(found.shape_misfit[heard]),
        _between(1e3 * found.delay[heard]),
        _between(1e3 * delays[np.isfinite(delays)]),
        f"{_spread(found.spread_reference)} to {_spread(found.spread_candidate)}",
    ]


def _between(values: Floats) -> str:
    """The least and the largest."""
    if not len(values):
        return "-"
    values = np.where(np.abs(values) < ROUND_OFF, 0.0, values)
    low, high = (significant(float(v) + 0.0, 2) for v in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def _spread(spread: dict[int, float]) -> str:
    return f"{1e3 * spread[-6]:g} / {1e3 * spread[-20]:g}"


EFFORT_COLUMNS = (
    "body", "dofs", "reduced to", Column("estimated reduction error", digits=2),
    Column("relative energy imbalance", digits=1), "share of loss radiated", "solver",
    "time by phase", "peak memory so far, GiB",
)  # fmt: skip


def effort_table(
    efforts: Mapping[str, Effort], tactons: int, total: float | None = None
) -> list[Part]:
    """Seconds by phase, size and memory of each reduced body, and of the whole."""
    rows = [
        [label(name), effort.dofs, effort.reduced_dofs, effort.estimate, effort.energy_imbalance,
         f"{100 * effort.radiated:.0f} %", effort.solver,
         ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in effort.seconds.items()),
         effort.peak_memory / 2**30]
        for name, effort in efforts.items()
    ]  # fmt: skip
    versions = next(iter(efforts.values())).versions if efforts else {}
    named = ", ".join(f"{name} {version}" for name, version in versions.items())
    peak = max((effort.peak_memory for effort in efforts.values()), default=0) / 2**30
    spent = sum(s for e in efforts.values() for s in e.seconds.values()) if total is None else total
    took = f"{counted(tactons, 'Tacton')} took {spent:.0f} s in all"
    return [Table(EFFORT_COLUMNS, rows), f"{took}, at most {peak:.2f} GiB in a process. {named}"]
