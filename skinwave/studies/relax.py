"""Model hierarchy from the paper's model to the richest one: effect and cost of each assumption.

Each step of the hierarchy drops one more assumption; leave-one-out models, which drop all but one,
are run beside it. Each is computed in a process of its own, so that its memory is its own, and two
at once, of which one at most reduces a body. A body that several steps share is meshed and reduced
once, by the first of them; its seconds and memory count in all of them.
"""

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from fem import NotReduced
from simple_model import Effort, MovingPressure, Response, lines, resolved_lines, sensation_level
from simple_model.load.drive import usual_drive
from simple_model.numbers import decibel, significant
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.planning.assessment import all_warnings
from skinwave.planning.simulate import compute
from skinwave.report.figures import png
from skinwave.report.palette import BLUE
from skinwave.results.comparison import compare
from skinwave.results.run import ASSESSED
from skinwave.scene.scene import Body, Scene, check_motion
from skinwave.studies.assumptions import (
    ASSUMPTIONS,
    DEVICE_RATES,
    can_be_alone,
    check_rate,
    droppable,
    held,
    relaxed,
    side_step,
)
from skinwave.system.document import Details, Part, Picture, Report
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.processes import pool
from skinwave.system.table import Column, Table
from skinwave.typing import Floats

HIGHEST, FAINTEST = 600.0, 0.01  # Hz of the lines that are followed; of the strongest at a probe
TINY = np.finfo(float).tiny
FIRST = "as published"  # by the model point-kernel-published
LARGER = 1.25  # times the default element size, for a third of the time
# With a tenth of the damping a body may take more moments than a reduced one has; in elements so
# much larger it takes as many, and that is known at a tenth of the cost.
ALMOST_UNDAMPED, COARSER = "all but: little loss", 3.0
LINE_COLUMNS = (
    "step", "model", "probe_x_mm", "probe_y_mm", "line", "frequency_hz", "from_step_before_db",
    "from_richest_db",
)  # fmt: skip
EFFECT_COLUMNS = (
    Column("assumption", "assumption dropped"),
    Column("waveform_percent", "waveform changes by", "% of the strongest probe's"),
    Column("at_mm", "at", "mm"), Column("level_db", "sensation level changes by", "dB"),
    Column("alone_percent", "waveform, if it is the only one made", "%"),
    Column("costs_s", "costs", "s", digits=2), Column("lines_db", "lines change by", "dB"),
)  # fmt: skip
STEP_COLUMNS = (
    "step", "model", "dofs", Column("seconds", "all from the start", "s", digits=2),
    Column("memory_gib", "memory", "GiB"), Column("error", "why not"),
)  # fmt: skip
INTRODUCTION = (
    "From the published model to the richest one that this scene has, one assumption after "
    "another. Waveforms are compared after the factor that fits best where one is a pressure and "
    "the other a displacement."
)
BARS = "What dropping each assumption changes: the waveform, and the sensation level (SL)."


@dataclass(frozen=True, kw_only=True, eq=False)
class HierarchyStep:
    """Step of the model hierarchy: dropped assumptions, the `model` and `body` that are left, and
    the response or the `error` instead.
    """

    name: str
    dropped: tuple[str, ...]
    model: str
    body: Body | None = None
    response: Response | None = None
    seconds: float = 0.0
    memory: int = 0
    error: str = ""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of dropping one assumption, of the step without it against the step with it.

    `waveform` change in L2 at probe `where` (x, y) in metre, where it is largest, relative to the
    probe that moves most (after the factor that fits best where units differ); `level` in dB, by
    which the sensation level grows, None of what is not skin; `decibel` by line; `alone` the
    waveform's change if it is the only assumption made; `seconds` that dropping costs.
    """

    name: str
    waveform: float
    where: tuple[float, float]
    level: float | None
    decibel: dict[str, float]
    alone: float | None
    seconds: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Hierarchy:
    """Model hierarchy: steps in order, the first as published and the last the richest; side
    steps, which drop one more assumption than the step they branch off; and leave-one-out models.
    """

    scene: Scene
    steps: tuple[HierarchyStep, ...]
    side_steps: tuple[HierarchyStep, ...]
    leave_one_out: tuple[HierarchyStep, ...]

    @property
    def every(self) -> tuple[HierarchyStep, ...]:
        """All steps, in the order of the tables."""
        return (*self.steps, *self.side_steps, *self.leave_one_out)

    @property
    def efforts(self) -> list[tuple[str, Effort]]:
        """Effort of each response, by the name of its step."""
        return [(step.name, step.response.effort) for step in self.every if step.response]

    def pairs(self) -> list[tuple[HierarchyStep, HierarchyStep]]:
        """Each computed step, side steps included, after the one that it is compared with; a step
        after one that failed is left out, because it differs by two assumptions.
        """
        found = [(a, b) for a, b in pairwise(self.steps) if a.response and b.response]
        for step in self.side_steps:
            kept = set(step.dropped) - {step.name}
            before = next((r for r in self.steps if r.response and set(r.dropped) == kept), None)
            if step.response and before:
                found.append((before, step))
        return found

    def effects(self) -> list[Effect]:
        """Effect of each assumption, the largest first; failed steps are left out."""
        all_of_them = set(self.steps[-1].dropped)
        left = [(all_of_them.difference(r.dropped), r) for r in (*self.steps, *self.leave_one_out)]
        kept = {names.pop(): step.response for names, step in left if len(names) == 1}
        richest = [step.response for step in self.steps if step.response][-1:]
        found = [
            _effect(self.scene, before, step, kept.get(step.name), *richest)
            for before, step in self.pairs()
        ]
        return sorted(found, key=lambda e: -e.waveform)


def hierarchy_of(
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    update_rate: float = DEVICE_RATES[0],
    points: int | None = None,
) -> Hierarchy:
    """Compute a scene at every step of the model hierarchy, with elements of h in metre (`LARGER`
    times the default of the body if not given) and the update rate and points of a device as `held`
    takes them. A ValueError if the scene has no body, its probes read something else than the
    displacement of the surface, or the device cannot be.
    """
    check_motion(scene, "relax")
    names = droppable(scene)
    check_rate(update_rate)
    if "continuous path" in names:
        held(scene.tacton.trajectory, update_rate, points)  # refuses before anything is computed
    up = [(FIRST, ()), *((name, names[: k + 1]) for k, name in enumerate(names))]
    aside = [(dropped[-1], dropped)] if (dropped := side_step(scene)) else []
    others = [(name, tuple(n for n in names if n != name)) for name in names]
    leave_one_out = [
        (f"all but: {name}", kept)
        for name, kept in others
        if kept not in [dropped for _, dropped in up] and can_be_alone(name, names, scene)
    ]
    steps: list[HierarchyStep] = []
    begun: list[Future[tuple[Response, float, int]] | None] = []
    with (
        TemporaryDirectory(prefix="skinwave-") as cache,
        pool(1, renewed=True) as large, pool(1, renewed=True) as small,
    ):  # fmt: skip
        for name, dropped in (*up, *aside, *leave_one_out):
            step = HierarchyStep(name=name, dropped=dropped, model="none")
            try:
                changed, model = relaxed(scene, dropped, update_rate=update_rate, points=points)
                step = replace(step, model=model, body=changed.body)
                is_reduced = named(model).is_reduced
                size = h or LARGER * default_size(scene.body) if is_reduced else h
            except (ValueError, ArithmeticError) as error:
                steps.append(replace(step, error=str(error)))
                begun.append(None)
                continue
            tried = is_reduced and name == ALMOST_UNDAMPED
            steps.append(step)
            workers = large if is_reduced else small
            begun.append(workers.submit(_timed, changed, model, size, cache, tried=tried))
        for k, future in enumerate(begun):
            progress(steps[k].name, k / len(steps))
            if future:
                steps[k] = _computed(steps[k], future, steps[:k])
    first, second = len(up), len(up) + len(aside)
    return Hierarchy(
        scene=scene, steps=tuple(steps[:first]), side_steps=tuple(steps[first:second]),
        leave_one_out=tuple(steps[second:]),
    )  # fmt: skip


def _timed(
    scene: Scene, model: str, h: float | None, cache: str, *, tried: bool
) -> tuple[Response, float, int]:
    """A response with its seconds and the peak memory of its process; `tried` first on coarse
    elements, on which a body that cannot be reduced is refused.
    """
    os.environ["SKINWAVE_CACHE"] = cache
    if tried and h:
        with suppress(ValueError):
            try:
                compute(scene, model, h=COARSER * h)
            except NotReduced as error:
                raise ArithmeticError(str(error)) from None
    started = time.perf_counter()
    response = compute(scene, model, h=h)
    seconds, memory = time.perf_counter() - started, peak_memory()
    # The discretisation error is common to all steps and no part of their differences.
    effort = replace(response.effort, warnings=all_warnings(scene, response, h=h))
    return replace(response, effort=effort), seconds, memory


def _computed(
    step: HierarchyStep,
    future: Future[tuple[Response, float, int]],
    before: Sequence[HierarchyStep],
) -> HierarchyStep:
    """Step with its response, and with the seconds and memory of what an earlier one on the same
    body did for it; or with what it was refused for.
    """
    try:
        response, seconds, memory = future.result()
    except (ValueError, ArithmeticError, MemoryError, OSError, BrokenProcessPool) as error:
        return replace(step, error=str(error))
    same = (s for s in before if s.response and (s.body, s.model) == (step.body, step.model))
    if (first := next(same, None)) and first.response:
        spent = first.response.effort.seconds.items()
        missing = [own for phase, own in spent if phase not in response.effort.seconds]
        seconds += sum(missing)
        memory = max(memory, first.memory) if missing else memory
    return replace(step, response=response, seconds=seconds, memory=memory)


def _effect(
    scene: Scene, before: HierarchyStep, after: HierarchyStep, alone: Response | None,
    richest: Response,
) -> Effect:  # fmt: skip
    """Effect of the assumption that a step is named by; `alone` is the only one in a response."""
    assert before.response
    assert after.response
    changed, scale = _changes(after.response, before.response)
    most = int(np.argmax(changed))
    level = None
    if scene.body.is_skin:
        of_both = [_level(scene, each) for each in (before.response, after.response)]
        level = of_both[1] - of_both[0] if np.isfinite(of_both).all() else None
    return Effect(
        name=after.name, waveform=float(changed[most]), where=scene.probes[most], level=level,
        decibel=line_changes(scene, before.response, after.response, scale),
        alone=float(_changes(richest, alone)[0].max()) if alone else None,
        seconds=after.seconds - before.seconds,
    )  # fmt: skip


def _changes(reference: Response, candidate: Response) -> tuple[Floats, float]:
    """Change (p,) of waveforms relative to that of the probe that moves most, and the factor of the
    candidate.
    """
    change = compare(reference, candidate)
    sizes = np.linalg.norm(reference.values, axis=0)
    return np.asarray(change.relative_l2 * sizes / max(sizes.max(), TINY)), change.scale


def _level(scene: Scene, response: Response) -> float:
    """Highest sensation level in dB of a line at any probe; minus infinity without one."""
    if not (names := followed_lines(scene, response)):
        return -np.inf
    f = np.array([*names.values()])
    unit = "m" if response.record.of_body else "Pa"
    return float(sensation_level(lines(response, f), f[:, None], unit=unit).max())


def followed_lines(scene: Scene, response: Response) -> dict[str, float]:
    """Names and frequencies in Hz of the lines that are followed, as far as a response resolves
    them: those of a drive that is not linear, which has all that a linear one has.
    """
    drive = usual_drive(scene.pressure.drive, MovingPressure.drive)
    pressure = replace(scene.pressure, drive=drive)
    return resolved_lines(pressure, response, candidates=ASSESSED, highest=HIGHEST)[0]


def line_changes(
    scene: Scene, before: Response, after: Response, scale: float = 1.0
) -> dict[str, float]:
    """By how many dB each line that counts grows, at the probe where it is strongest."""
    if not (names := followed_lines(scene, after)):
        return {}
    old, new = (lines(r, list(names.values())) for r in (before, after))
    old = abs(scale) * old
    least = FAINTEST * max(old.max(), new.max())
    changes = {}
    for k, name in enumerate(names):
        probe = int(np.argmax(np.maximum(old[k], new[k])))
        if max(old[k, probe], new[k, probe]) > least:
            ratio = np.maximum(new[k, probe], 1e-3 * least) / max(old[k, probe], 1e-3 * least)
            changes[name] = float(20 * np.log10(ratio))
    return changes


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
    """index.html, relax.png, relax.csv, effects.csv, steps.csv and responses.npz."""
    effects = found.effects()
    (folder / "relax.csv").write_bytes(Table(LINE_COLUMNS, _line_rows(found)).to_csv())
    answered = {step.name: step.response for step in found.every if step.response}
    arrays = {name: response.values for name, response in answered.items()}
    first = next(iter(answered.values()))
    arrays |= {"t": first.times, "probes": first.probes}
    np.savez(folder / "responses.npz", **arrays)  # type: ignore[arg-type]
    verdict = [sentence(effects[0])] if effects else ["No two steps could be compared."]
    parts: list[Part] = [
        Picture(png(_figure(effects), dpi=130), BARS, "relax"),
        Table(EFFECT_COLUMNS, map(_effect_row, effects), "effects"),
        Details("Steps", [INTRODUCTION, Table(STEP_COLUMNS, map(_step_row, found.every), "steps")]),
    ]
    title = f"{found.scene.name}: assumptions, one by one"
    Report(title, verdict, parts, found.efforts).write(folder)


def _figure(effects: list[Effect]) -> Figure:
    """A bar for each assumption, the greatest effect at the top."""
    drawn = Figure(figsize=(7, 1 + 0.32 * len(effects)), layout="constrained")
    axes = drawn.add_subplot()
    changes = [100 * e.waveform for e in effects]
    bars = axes.barh([e.name.replace("^2", "²") for e in effects], changes, color=BLUE, height=0.7)
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
        e.name, 100 * e.waveform, f"({1e3 * e.where[0]:g}, {1e3 * e.where[1]:g})", e.level,
        None if e.alone is None else 100 * e.alone, e.seconds,
        ", ".join(f"{name} {decibel(x, signed=True)}" for name, x in e.decibel.items()),
    ]  # fmt: skip


def _step_row(step: HierarchyStep) -> list[object]:
    dofs = step.response.effort.dofs if step.response else None
    return [step.name, step.model, dofs, step.seconds, step.memory / 2**30 or None, step.error]


def _line_rows(found: Hierarchy) -> Iterator[list[object]]:
    """Every line's change at each probe, from the step before and from the richest."""
    richest = [r.response for r in found.steps if r.response][-1]
    for before, step in found.pairs():
        assert before.response
        assert step.response
        names = followed_lines(found.scene, step.response)
        ratios = [_ratios(step.response, other, names) for other in (before.response, richest)]
        for k, (name, f) in enumerate(names.items()):
            for p, (x, y) in enumerate(found.scene.probes):
                changes = [f"{r[k, p]:.4g}" if np.isfinite(r[k, p]) else None for r in ratios]
                yield [step.name, step.model, 1e3 * x, 1e3 * y, name, f, *changes]


def _ratios(response: Response, other: Response, names: dict[str, float]) -> Floats:
    """Lines (f, p) of a response over those of another, dB."""
    found = compare(other, response, tuple(names.values()))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(found.line_ratios))
