"""Tables of a run for its page: claims, agreement, cost."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Effort
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report.palette import label
from skinwave.results.claims import TEXTS, AssessedClaim
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.propagation import strongest_component
from skinwave.results.run import Run
from skinwave.system.document import Markup, paragraph, table
from skinwave.system.numbers import significant

SILENT = 0.01  # of the strongest probe: where the reference moves less, no misfit is given
ROUND_OFF = 1e-3  # of a millisecond, or of a misfit


def claims_table(assessed_claims: list[AssessedClaim]) -> Markup:
    """Claims down, kernels and bodies across: holds or fails, and the number that decides."""
    columns = list(dict.fromkeys(v.column for v in assessed_claims))
    found = {(v.claim, v.column): v for v in assessed_claims}
    rows = [
        [f"{claim}: {TEXTS[claim]}", *(_assessed(found.get((claim, c))) for c in columns)]
        for claim in TEXTS
        if any(claim == assessed.claim for assessed in assessed_claims)
    ]
    return table(["claim", *map(label, columns)], rows)


def agreement_table(runs: Mapping[str, Sequence[Run]]) -> Markup:
    """Each Tacton's responses, in pairs between which one thing changes: drive law and focus
    from the published kernel to that under the same load, propagation from this to a body.
    """
    rows = [
        [name, changed, f"{label(a.column)} to {label(b.column)}", *_agreement(a, b)]
        for name, group in runs.items()
        for changed, a, b in pairs(group)
    ]
    header = ["Tacton", "what changes", "from, to", "waveform misfit at the best scale"]
    header += ["misfit at the best gain and delay", "delay over the probes, ms"]
    header += ["phase delay of the strongest component, ms"]
    return table([*header, "spread over the probes at -6 / -20 dB, mm"], rows)


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


def effort_table(efforts: dict[str, Effort], tactons: int, total: float | None = None) -> Markup:
    """Seconds by phase, size and memory of each reduced body, and of the whole."""
    rows = []
    for name, effort in efforts.items():
        phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in effort.seconds.items())
        rows.append(
            [label(name), f"{effort.dofs:,}", f"{effort.reduced_dofs}", f"{effort.estimate:.1e}"]
            + [f"{effort.energy_imbalance:.0e}", f"{100 * effort.radiated:.0f} %"]
            + [effort.solver, phases, f"{effort.peak_memory / 2**30:.2f}"]
        )
    header = ["body", "dofs", "reduced to", "estimated reduction error"]
    header += ["relative energy imbalance", "share of loss radiated", "solver"]
    header += ["time by phase", "peak memory so far, GiB"]
    versions = next(iter(efforts.values())).versions if efforts else {}
    named = ", ".join(f"{name} {version}" for name, version in versions.items())
    peak = max((effort.peak_memory for effort in efforts.values()), default=0) / 2**30
    spent = sum(s for e in efforts.values() for s in e.seconds.values()) if total is None else total
    counted = f"{tactons} Tacton{'s' * (tactons != 1)}"
    summary = f"{counted} took {spent:.0f} s in all, at most {peak:.2f} GiB in a process. {named}"
    return table(header, rows) + paragraph(summary)


def _spread(spread: dict[int, float]) -> str:
    return f"{1e3 * spread[-6]:g} / {1e3 * spread[-20]:g}"


def _assessed(assessed: AssessedClaim | None) -> str:
    if assessed is None:
        return "not assessed"
    kind, word = ("yes", "holds") if assessed.holds else ("no", "fails")
    template = Markup('<span class="{}">{}</span><br><small>{}</small>')
    return template.format(kind, word, assessed.sentence)
