"""Tables of a run for its page: statements, agreement, cost."""

from html import escape

from simple_model import Effort
from skinwave.comparison import compare
from skinwave.document import paragraph, table
from skinwave.pictures.figures import label
from skinwave.run import Run
from skinwave.studies.claims import TEXTS, Verdict


def claims_table(verdicts: list[Verdict]) -> str:
    """Statements that were judged down, bodies across: holds or fails, and what decides."""
    bodies = list(dict.fromkeys(v.body for v in verdicts))
    found = {(v.claim, v.body): v for v in verdicts}
    rows = [
        [f"{claim}: {TEXTS[claim]}", *(_verdict(found.get((claim, body))) for body in bodies)]
        for claim in TEXTS
        if any(claim == verdict.claim for verdict in verdicts)
    ]
    return table(["statement", *map(label, bodies)], rows)


def agreement_table(runs: dict[str, list[Run]]) -> str:
    """How each pair of models agrees on each Tacton, over all probes."""
    rows = []
    for name, group in runs.items():
        for i, reference in enumerate(group):
            for candidate in group[i + 1 :]:
                a = compare(reference.response, candidate.response)
                rows.append(
                    [name, label(reference.column), label(candidate.column)]
                    + [f"{min(a.relative_l2):.2f} to {max(a.relative_l2):.2f}"]
                    + [f"{1e3 * a.lag[0]:+.1f}"]
                    + [_spread(s) for s in (a.spread_reference, a.spread_candidate)]
                )  # fmt: skip
    header = ["Tacton", "reference", "candidate", "waveform misfit (best scale if units differ)"]
    header += ["lag at first probe, ms", "spread of reference, mm at -6 / -20 dB"]
    return table([*header, "of candidate"], rows)


def effort_table(efforts: dict[str, Effort], tactons: int, total: float | None = None) -> str:
    """Seconds by phase, size and memory of each prepared body, and of the whole."""
    rows = []
    for name, effort in efforts.items():
        phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in effort.seconds.items())
        rows.append(
            [label(name), f"{effort.dofs:,}", f"{effort.reduced_dofs}", f"{effort.estimate:.1e}"]
            + [f"{effort.energy_imbalance:.0e}", f"{100 * effort.radiated:.0f} %"]
            + [effort.solver, phases, f"{effort.peak_memory / 2**30:.2f}"]
        )
    header = ["body", "unknowns", "reduced to", "estimated reduction error"]
    header += ["energy balance off by", "of the lost, radiated", "solver"]
    header += ["preparation", "peak memory so far, GiB"]
    versions = next(iter(efforts.values())).versions if efforts else {}
    named = ", ".join(f"{name} {version}" for name, version in versions.items())
    peak = max((effort.peak_memory for effort in efforts.values()), default=0) / 2**30
    spent = sum(s for e in efforts.values() for s in e.seconds.values()) if total is None else total
    counted = f"{tactons} Tacton{'s' * (tactons != 1)}"
    summary = f"{counted} took {spent:.0f} s in all, peak memory {peak:.2f} GiB. {named}"
    return table(header, rows) + paragraph(summary)


def _spread(spread: dict[int, float]) -> str:
    return f"{1e3 * spread[-6]:g} / {1e3 * spread[-20]:g}"


def _verdict(verdict: Verdict | None) -> str:
    if verdict is None:
        return "not judged"
    kind, word = ("yes", "holds") if verdict.holds else ("no", "fails")
    return f'<span class="{kind}">{word}</span><br><small>{escape(verdict.sentence)}</small>'
