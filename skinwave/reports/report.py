"""The page of a run: one HTML file with its pictures inside."""

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from string import Template

from simple_model import Effort
from skinwave.comparison import compare
from skinwave.pictures.figures import label
from skinwave.run import Run
from skinwave.studies.claims import TEXTS, Verdict

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1120px; margin: 2em auto; padding: 0 1em;
       color: #222; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2em; }
img { max-width: 100%; height: auto; } figure { margin: 1em 0 2em; }
figcaption { color: #555; font-size: 0.9em; }
table { border-collapse: collapse; font-size: 0.88em; } .wide { overflow-x: auto; }
td, th { border-bottom: 1px solid #ddd; padding: 0.3em 0.6em; text-align: left;
         vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.yes { color: #00684c; font-weight: 600; } .no { color: #a33c00; font-weight: 600; }
small { color: #555; } code { background: #f3f3f3; padding: 0 0.25em; }
iframe { border: 1px solid #ddd; width: 100%; height: 30em; } pre { white-space: pre-wrap; }
@page { size: A4; margin: 14mm; }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 11px; }
  figure, tr, pre { break-inside: avoid; } h2, h3 { break-after: avoid; } .screen { display: none; }
  .wide { overflow: visible; } table { font-size: 9px; width: 100%; } }
</style></head><body>
<h1>$title</h1>
$body
</body></html>
""")


def page(title: str, *parts: str) -> str:
    """A complete page of parts that are HTML already."""
    return _PAGE.substitute(title=escape(title), body="\n".join(parts))


def section(heading: str, *parts: str) -> str:
    """A headed part of the page."""
    return f"<h2>{escape(heading)}</h2>\n" + "\n".join(parts)


def paragraph(text: str) -> str:
    """Plain text as a paragraph."""
    return f"<p>{escape(text)}</p>"


def picture(drawn: bytes, caption: str, name: str = "", kind: str = "png") -> str:
    """A picture inside the page: PNG, or another kind that browsers know."""
    return (
        f'<figure id="{escape(name)}"><img alt="{escape(caption)}" '
        f'src="data:image/{kind};base64,{b64encode(drawn).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def inner_page(page: str, caption: str) -> str:
    """A page within the page, on screens only."""
    frame = f'<iframe title="{escape(caption)}" srcdoc="{escape(page)}"></iframe>'
    return f'<figure class="screen">{frame}<figcaption>{escape(caption)}</figcaption></figure>'


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table; cells that read as numbers are set to the right."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


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
                    [name, label(reference.body), label(candidate.body)]
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


def _cell(cell: str) -> str:
    if cell.startswith("<"):
        return f"<td>{cell}</td>"
    number = cell.replace(",", "").replace("+", "").replace("-", "").replace(".", "")
    kind = ' class="number"' if number.replace("e", "").isdigit() else ""
    return f"<td{kind}>{escape(cell)}</td>"


def _verdict(verdict: Verdict | None) -> str:
    if verdict is None:
        return "not judged"
    kind, word = ("yes", "holds") if verdict.holds else ("no", "fails")
    return f'<span class="{kind}">{word}</span><br><small>{escape(verdict.sentence)}</small>'
