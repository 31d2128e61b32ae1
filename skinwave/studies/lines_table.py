"""Table of the lines of each model at one probe, every model's in the unit of its quantity."""

from collections.abc import Mapping, Sequence

from skinwave.report.figures import answered
from skinwave.report.levels import sensation_levels, strongest_probe
from skinwave.results.run import Run
from skinwave.studies import description
from skinwave.system import document
from skinwave.system.numbers import FAINTEST, decibel, significant

TABLED = 12  # lines in the table
ROUND_OFF = 1e-9  # of the strongest line


def lines_table(runs: Sequence[Run]) -> str:
    """Lines of each model at the probe that moves most, the strongest of any first."""
    probe = strongest_probe(runs)
    said = document.Markup().join(map(document.paragraph, description.unresolved(runs)))
    known = [name for name in runs[0].listed if all(name in run.listed for run in runs)]
    if not known and not any(run.unnamed for run in runs):
        return said or document.paragraph("A constant pressure on a focus at rest has no line.")
    share = {name: max(_share(run, name, probe) for run in runs) for name in known}
    names = sorted(share, key=lambda name: -share[name])[:TABLED]
    sensation = [sensation_levels(run, probe) for run in runs]
    rows = [
        [name, f"{runs[0].listed[name]:.2f}"]
        + [cell for run, levels in zip(runs, sensation, strict=True)
           for cell in _amplitude(run, name, probe, levels)]
        for name in names
    ]  # fmt: skip
    rows += _unnamed_rows(runs, probe)
    header = ["line", "frequency, Hz"]
    for run in runs:
        header += [f"{answered(run)}, {run.response.record.shown} peak"]
        header += ["dB re threshold"] if run.is_skin else []
    x, y = 1e3 * runs[0].response.probes[probe]
    heading = document.Markup("<h3>Lines at ({:g}, {:g}) mm</h3>").format(x, y)
    return heading + document.table(header, rows) + said


def _share(run: Run, name: str, probe: int) -> float:
    """A line's amplitude over that of the strongest."""
    strongest = max(float(x[probe]) for x in run.table.amplitudes.values())
    return float(run.table.amplitudes[name][probe]) / strongest if strongest else 0.0


def _amplitude(run: Run, name: str, probe: int, levels: Mapping[str, float]) -> list[str]:
    """A line's amplitude and, of skin, its level above threshold; 0 if it is round-off."""
    if _share(run, name, probe) < ROUND_OFF:
        return ["0", ""] if run.is_skin else ["0"]
    size = _size(run, float(run.table.amplitudes[name][probe]))
    return [size, _level(levels.get(name))] if run.is_skin else [size]


def _unnamed_rows(runs: Sequence[Run], probe: int) -> list[list[str]]:
    """A row for each peak that is no single line of the load, those of all runs together."""
    found = {(peak.kind, round(peak.frequency, 1)) for run in runs for peak in run.unnamed[:TABLED]}
    rows = []
    for kind, frequency in sorted(found):
        row = [kind, f"{frequency:.1f}"]
        for run in runs:
            sizes = [_size(run, float(peak.amplitudes[probe])) for peak in run.unnamed[:TABLED]
                     if (peak.kind, round(peak.frequency, 1)) == (kind, frequency)]  # fmt: skip
            row += [*(sizes[:1] or [""]), *([""] if run.is_skin else [])]
        rows.append(row)
    return rows


def _size(run: Run, amplitude: float) -> str:
    return significant(run.response.record.per_unit * amplitude)


def _level(level: float | None) -> str:
    if level is None:
        return ""
    return f"{round(level):+d}" if level >= FAINTEST else decibel(level)
