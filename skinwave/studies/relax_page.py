"""Effects of dropping assumptions, as a page, a picture and tables."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from simple_model import Effort
from simple_model.numbers import decibel, significant
from skinwave.report.figures import png
from skinwave.report.palette import BLUE
from skinwave.results.comparison import compare
from skinwave.studies.assumptions import ASSUMPTIONS
from skinwave.studies.relax import Effect, Hierarchy, HierarchyStep, followed_lines
from skinwave.system.document import Part, Picture, Report, Section
from skinwave.system.table import Column, Table

LINE_COLUMNS = (
    "step", "model", "probe_x_mm", "probe_y_mm", "line", "frequency_hz", "from_step_before_db",
    "from_richest_db",
)  # fmt: skip
EFFECT_COLUMNS = (
    "assumption dropped", "waveform changes by, % of the strongest probe's", "at, mm",
    "sensation level changes by, dB", "waveform, if it is the only one made, %", "costs, s",
    "lines change by, dB",
)  # fmt: skip
STEP_COLUMNS = (
    "step", "model", "dofs", Column("seconds, all from the start", digits=2), "GiB", "why not",
)  # fmt: skip
INTRODUCTION = (
    "From the published model to the richest one that this scene has, one assumption after "
    "another. Waveforms are compared after the factor that fits best where one is a pressure and "
    "the other a displacement."
)
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
    lines = Table(LINE_COLUMNS, _line_rows(found))
    (folder / "relax.csv").write_bytes(lines.to_csv())
    answered = {step.name: step.response for step in found.every if step.response}
    arrays = {name: response.values for name, response in answered.items()}
    first = next(iter(answered.values()))
    arrays |= {"t": first.times, "probes": first.probes}
    np.savez(folder / "responses.npz", **arrays)  # type: ignore[arg-type]
    parts: list[Part] = [
        Section("What each assumption changes", list(map(sentence, effects))),
        Picture(png(figure(effects), dpi=130), BARS, "relax"),
        Table(EFFECT_COLUMNS, map(_effect_row, effects)),
        Section("Steps", [Table(STEP_COLUMNS, map(_step_row, found.every))]),
    ]
    title = f"{found.scene.name}: assumptions, one by one"
    Report(title, [INTRODUCTION], parts, efforts(found)).write(folder)


def efforts(found: Hierarchy) -> list[tuple[str, Effort]]:
    """Effort of each response, by the name of its step."""
    return [(step.name, step.response.effort) for step in found.every if step.response]


def figure(effects: list[Effect]) -> Figure:
    """A bar for each assumption, the greatest effect at the top."""
    drawn = Figure(figsize=(7, 1 + 0.32 * len(effects)), layout="constrained")
    axes = drawn.add_subplot()
    changes = [100 * e.waveform for e in effects]
    bars = axes.barh([e.name for e in effects], changes, color=BLUE, height=0.7)
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


def _effect_row(e: Effect) -> list[object]:
    return [
        e.name, 100 * e.waveform, f"({1e3 * e.where[0]:g}, {1e3 * e.where[1]:g})",
        None if e.level is None else decibel(e.level, signed=True),
        None if e.alone is None else 100 * e.alone, f"{e.seconds:+.1f}",
        ", ".join(f"{name} {decibel(x, signed=True)}" for name, x in e.decibel.items()),
    ]  # fmt: skip


def _step_row(step: HierarchyStep) -> list[object]:
    dofs, memory = (
        (step.response.effort.dofs, step.memory / 2**30) if step.response else 2 * (None,)
    )
    return [step.name, step.model, dofs, step.seconds, memory, step.error]


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
                changes = [f"{r[k, p]:.4g}" if np.isfinite(r[k, p]) else None for r in ratios]
                yield [step.name, step.model, 1e3 * x, 1e3 * y, name, f, *changes]


def _ratios(step: HierarchyStep, other: HierarchyStep, names: dict[str, float]) -> np.ndarray:
    assert step.response
    assert other.response
    found = compare(other.response, step.response, tuple(names.values()))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(found.line_ratios))
