"""Effects of dropping assumptions, as a page, a picture and tables."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from simple_model import Effort
from skinwave.report.figures import png
from skinwave.results.comparison import compare
from skinwave.studies.assumptions import ASSUMPTIONS
from skinwave.studies.relax import Effect, Hierarchy, HierarchyStep, followed_lines
from skinwave.system import document
from skinwave.system.numbers import decibel, significant
from skinwave.system.plain_text import csv_table

LINE_COLUMNS = (
    "step", "model", "probe_x_mm", "probe_y_mm", "line", "frequency_hz", "from_step_before_db",
    "from_richest_db",
)  # fmt: skip

BARS = "What dropping each assumption changes: the waveform, and the sensation level (SL)."


def sentence(e: Effect) -> str:
    """Sentence on the effect and the cost of dropping an assumption."""
    x, y = (1e3 * v for v in e.where)
    text = f"Dropping '{e.name}' ({ASSUMPTIONS[e.name]}) changes the waveform at "
    text += f"({x:g}, {y:g}) mm by {significant(100 * e.waveform)} % of the strongest probe's"
    if e.level is not None:
        text += f", the sensation level by {decibel(e.level, signed=True)} dB"
    if e.decibel:
        line = max(e.decibel, key=lambda name: abs(e.decibel[name]))
        text += f" and the {line} line by {decibel(e.decibel[line], signed=True)} dB"
    cost = f"costs {e.seconds:.1f} s more" if e.seconds > 0.05 else "costs nothing more"
    return f"{text}, and {cost}."


def write(folder: Path, found: Hierarchy) -> None:
    """index.html, relax.png, relax.csv, relax.json and the waveforms, responses.npz."""
    effects = found.effects()
    steps = [_record(step) for step in found.every]
    record = {"effects": [asdict(e) for e in effects], "steps": steps}
    (folder / "relax.json").write_text(json.dumps(record, indent=1), encoding="utf-8")
    (folder / "relax.csv").write_bytes(csv_table(LINE_COLUMNS, _line_rows(found)))
    answered = [r for r in found.every if r.response]
    arrays = {r.name: r.response.values for r in answered if r.response}
    first = next(r.response for r in answered if r.response)
    arrays |= {"t": first.times, "probes": first.probes}
    np.savez(folder / "responses.npz", **arrays)  # type: ignore[arg-type]
    drawn = png(figure(effects), dpi=130)
    (folder / "relax.png").write_bytes(drawn)
    said = map(document.paragraph, map(sentence, effects))
    parts = [
        document.warnings_banner(efforts(found)),
        document.paragraph(
            "From the published model to the richest one that this scene has, one assumption after "
            "another. Waveforms are compared after the factor that fits best where one is a "
            "pressure and the other a displacement."
        ),
        document.section("What each assumption changes", *said),
        document.picture(drawn, BARS, "effects"),
        document.table(*effect_table(effects)),
        document.section("Steps", document.table(*step_table(found))),
    ]
    title = f"{found.scene.name}: assumptions, one by one"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def efforts(found: Hierarchy) -> list[tuple[str, Effort]]:
    """Effort of each response, by the name of its step."""
    return [(step.name, step.response.effort) for step in found.every if step.response]


def effect_table(effects: Iterable[Effect]) -> tuple[list[str], list[list[str]]]:
    """Header and rows, the greatest effect first."""
    rows = [
        [
            e.name, significant(100 * e.waveform), f"({1e3 * e.where[0]:g}, {1e3 * e.where[1]:g})",
            "" if e.level is None else decibel(e.level, signed=True),
            "" if e.alone is None else significant(100 * e.alone), f"{e.seconds:+.1f}",
            ", ".join(f"{name} {decibel(x, signed=True)}" for name, x in e.decibel.items()),
        ]
        for e in effects
    ]  # fmt: skip
    header = ["assumption dropped", "waveform changes by, % of the strongest probe's", "at, mm"]
    header += ["sensation level changes by, dB", "waveform, if it is the only one made, %"]
    return [*header, "costs, s", "lines change by, dB"], rows


def step_table(found: Hierarchy) -> tuple[list[str], list[list[str]]]:
    """Header and rows of all steps, in the order of the model hierarchy."""
    rows = []
    for step in found.every:
        dofs = f"{step.response.effort.dofs:,}" if step.response else ""
        memory = f"{step.memory / 2**30:.2f}" if step.response else ""
        rows.append([step.name, step.model, dofs, f"{step.seconds:.1f}", memory, step.error])
    return ["step", "model", "dofs", "seconds, all from the start", "GiB", "why not"], rows


def figure(effects: list[Effect]) -> Figure:
    """A bar for each assumption, the greatest effect at the top."""
    drawn = Figure(figsize=(7, 1 + 0.32 * len(effects)), layout="constrained")
    axes = drawn.add_subplot()
    changes = [100 * e.waveform for e in effects]
    bars = axes.barh([e.name for e in effects], changes, color="#0072B2", height=0.7)
    texts = [
        f"{significant(change)} %"
        + ("" if e.level is None else f",  {decibel(e.level, signed=True)} dB SL")
        for e, change in zip(effects, changes, strict=True)
    ]
    axes.bar_label(bars, texts, padding=4, fontsize=9)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.3 * max(changes, default=1.0))
    axes.set_xlabel("change of the waveform, % of the strongest probe's")
    axes.spines[["top", "right"]].set_visible(False)
    return drawn


def _record(step: HierarchyStep) -> dict[str, object]:
    effort = asdict(step.response.effort) if step.response else {}
    kept = ("name", "dropped", "model", "seconds", "memory", "error")
    return {name: getattr(step, name) for name in kept} | {"effort": effort}


def _line_rows(found: Hierarchy) -> Iterator[list[object]]:
    """Every line's change at each probe, from the step before and from the richest."""
    richest = [r for r in found.steps if r.response][-1]
    for before, step in found.pairs():
        assert step.response
        names = followed_lines(found.scene, step.response)
        ratios = [_ratios(step, other, names) for other in (before, richest)]
        for k, (name, f) in enumerate(names.items()):
            for p, (x, y) in enumerate(found.scene.probes):
                changes = [f"{r[k, p]:.4g}" if np.isfinite(r[k, p]) else "" for r in ratios]
                yield [step.name, step.model, 1e3 * x, 1e3 * y, name, f"{f:.6g}", *changes]


def _ratios(step: HierarchyStep, other: HierarchyStep, names: dict[str, float]) -> np.ndarray:
    assert step.response
    assert other.response
    found = compare(other.response, step.response, tuple(names.values()))
    with np.errstate(divide="ignore", invalid="ignore"):
        decibel = 20 * np.log10(found.line_ratios)
    return np.asarray(decibel)
