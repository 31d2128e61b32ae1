"""Model hierarchy from the paper's model to the richest one: effect and cost of each assumption.

Each step of the hierarchy drops one more assumption; leave-one-out models drop all but one. Each
model runs in a process of its own, which measures its memory. At most two run at once, of which one
may reduce a body. A body shared by several steps is meshed and reduced once; its seconds and memory
count in all of them.
"""

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from fem import NotReduced
from simple_model import Effort, MovingPressure, Response, lines, resolved_lines, sensation_level
from simple_model.line_table import lines_in_pulses
from simple_model.load.drive import usual_drive
from simple_model.numbers import decibel, share_of, significant
from simple_model.point_kernel import published_load
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.point_kernel import PUBLISHED
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
    device_path,
    droppable,
    side_step,
    without,
)
from skinwave.system.document import Details, Part, Picture, Report, warnings_banner
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.failures import REASONS, failure_text, reason
from skinwave.system.processes import pool
from skinwave.system.table import Column, Table
from skinwave.typing import Floats

HIGHEST = 600.0  # Hz, of the lines that are compared
WEAKEST_RATIO = 0.01  # to the strongest line at a probe
TINY = np.finfo(float).tiny
FIRST = "as published"  # step of the model point-kernel-published
LARGER = 1.25  # element size over the default one, at a third of the time
# With a tenth of the damping a reduction may need more moments than allowed. Larger elements need
# as many, which shows this at a tenth of the cost.
ALMOST_UNDAMPED, COARSER = "all but: little loss", 3.0
LINE_COLUMNS = (
    "step", "model", "probe_x_mm", "probe_y_mm", "line", "frequency_hz", "from_step_before_db",
    "from_richest_db",
)  # fmt: skip
EFFECT_COLUMNS = (
    "assumption", "waveform_percent", "at_mm", "level_db", "alone_percent", "costs_s", "lines_db",
)  # fmt: skip
STEP_COLUMNS = (
    "step", "model", Column("dofs", "degrees of freedom"),
    Column("seconds", "time", "s", digits=2), Column("memory_gib", "memory", "GiB", digits=2),
    Column("error", "reason of failure"),
)  # fmt: skip
INTRODUCTION = (
    "The steps lead from the published model to the richest one of this scene, one assumption "
    "after another. A pressure and a displacement are compared after the best-fitting factor."
)
BARS = (
    "Change of the waveform by dropping each assumption, over the motion of the strongest probe; "
    "with the change of the sensation level (SL) on skin."
)
PAGE_COLUMNS = (
    "dropped assumption", Column("change of the waveform", digits=2), "at, mm",
    Column("change of the sensation level", unit="dB", digits=2),
    Column("change if no other assumption is made", digits=2), "largest change of a line",
    Column("extra time", unit="s", digits=2),
)  # fmt: skip
OUT_OF_NOTHING = 60.0  # dB: a line that changes by more appears or vanishes
NEGLIGIBLE_TIME = 0.05  # s


@dataclass(frozen=True, kw_only=True, eq=False)
class HierarchyStep:
    """Step of the model hierarchy: dropped assumptions, model, body, and response or `error`."""

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
    """Effect of dropping one assumption: largest change of a waveform relative to the strongest
    probe, its probe (x, y) in m, increase of sensation level and lines in dB, change of the
    waveform if only this assumption is made, and additional seconds.
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
    """Model hierarchy: steps from the published to the richest model, side steps, which drop one
    more assumption than the step where they branch off, and leave-one-out models.
    """

    scene: Scene
    steps: tuple[HierarchyStep, ...]
    side_steps: tuple[HierarchyStep, ...]
    leave_one_out: tuple[HierarchyStep, ...]

    @property
    def every(self) -> tuple[HierarchyStep, ...]:
        """All steps in the order of the tables."""
        return (*self.steps, *self.side_steps, *self.leave_one_out)

    @property
    def efforts(self) -> list[tuple[str, Effort]]:
        """Effort of each response by step."""
        return [(step.name, step.response.effort) for step in self.every if step.response]

    @property
    def failures(self) -> dict[str, str]:
        """Reason of failure of each step without a response."""
        return {step.name: step.error for step in self.every if step.error}

    def pairs(self) -> list[tuple[HierarchyStep, HierarchyStep]]:
        """Return pairs of computed steps that differ by one assumption."""
        pairs = [(a, b) for a, b in pairwise(self.steps) if a.response and b.response]
        for step in self.side_steps:
            fewer = set(step.dropped) - {step.name}
            before = next((r for r in self.steps if r.response and set(r.dropped) == fewer), None)
            if step.response and before:
                pairs.append((before, step))
        return pairs

    def effects(self) -> list[Effect]:
        """Return the effect of each assumption, the largest first, without failed steps."""
        every = set(self.steps[-1].dropped)
        made = [(every.difference(r.dropped), r) for r in (*self.steps, *self.leave_one_out)]
        alone = {names.pop(): step.response for names, step in made if len(names) == 1}
        richest = [step.response for step in self.steps if step.response][-1:]
        effects = [
            _effect(self.scene, before, step, alone.get(step.name), *richest)
            for before, step in self.pairs()
        ]
        return sorted(effects, key=lambda e: -e.waveform)


def hierarchy_of(
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    update_rate: float = DEVICE_RATES[0],
    points: int | None = None,
) -> Hierarchy:
    """Compute a scene at every step of the model hierarchy.

    Elements have the size h in m, by default `LARGER` times that of the body. `update_rate` and
    `points` are those of `device_path`. Raises a ValueError if the scene has no body, its probes do
    not read the displacement of the surface, or no such device exists.
    """
    check_motion(scene, "relax")
    names = droppable(scene)
    check_rate(update_rate)
    if "continuous path" in names:
        device_path(scene.tacton.trajectory, update_rate, points)  # raises before computing
    up = [(FIRST, ()), *((name, names[: k + 1]) for k, name in enumerate(names))]
    side = [(dropped[-1], dropped)] if (dropped := side_step(scene)) else []
    others = [(name, tuple(n for n in names if n != name)) for name in names]
    leave_one_out = [
        (f"all but: {name}", dropped)
        for name, dropped in others
        if dropped not in [each for _, each in up] and can_be_alone(name, names, scene)
    ]
    steps: list[HierarchyStep] = []
    submitted: list[Future[tuple[Response, float, int]] | None] = []
    with (
        TemporaryDirectory(prefix="skinwave-") as cache,
        pool(1, renewed=True) as large, pool(1, renewed=True) as small,
    ):  # fmt: skip
        for name, dropped in (*up, *side, *leave_one_out):
            step = HierarchyStep(name=name, dropped=dropped, model="none")
            try:
                changed, model = without(scene, dropped, update_rate=update_rate, points=points)
                step = replace(step, model=model, body=changed.body)
                is_reduced = named(model).is_reduced
                size = h or LARGER * default_size(scene.body) if is_reduced else h
            except REASONS as error:
                steps.append(replace(step, error=reason(error)))
                submitted.append(None)
                continue
            coarse_first = is_reduced and name == ALMOST_UNDAMPED
            steps.append(step)
            workers = large if is_reduced else small
            submitted.append(workers.submit(_time, changed, model, size, cache, coarse_first))
        for k, future in enumerate(submitted):
            progress(steps[k].name, k / len(steps))
            if future:
                steps[k] = _compute(steps[k], future, steps[:k])
    first, second = len(up), len(up) + len(side)
    found = Hierarchy(
        scene=scene, steps=tuple(steps[:first]), side_steps=tuple(steps[first:second]),
        leave_one_out=tuple(steps[second:]),
    )  # fmt: skip
    if not found.efforts:
        raise ValueError(failure_text(found.failures))
    return found


def _time(
    scene: Scene, model: str, h: float | None, cache: str, coarse_first: bool
) -> tuple[Response, float, int]:
    """Return a response, its seconds and the peak memory of its process.

    With `coarse_first`, coarse elements are reduced first, to refuse a body at little cost.
    """
    os.environ["SKINWAVE_CACHE"] = cache
    if coarse_first and h:
        with suppress(ValueError):
            try:
                compute(scene, model, h=COARSER * h)
            except NotReduced as error:
                raise ArithmeticError(str(error)) from None
    started = time.perf_counter()
    response = compute(scene, model, h=h)
    seconds, memory = time.perf_counter() - started, peak_memory()
    # All steps have the same discretisation error, which does not affect their differences.
    effort = replace(response.effort, warnings=all_warnings(scene, response, h=h))
    return replace(response, effort=effort), seconds, memory


def _compute(
    step: HierarchyStep,
    future: Future[tuple[Response, float, int]],
    before: Sequence[HierarchyStep],
) -> HierarchyStep:
    """Return a step with its response or its error.

    Seconds and memory include those of an earlier step for the same body.
    """
    try:
        response, seconds, memory = future.result()
    except REASONS as error:
        return replace(step, error=reason(error))
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
    """Return the effect of a step's assumption, the only one in `alone`."""
    assert before.response
    assert after.response
    changes, scale = _changes(after.response, before.response)
    most = int(np.argmax(changes))
    level = None
    if scene.body.is_skin:
        levels = [_level(scene, each) for each in (before.response, after.response)]
        level = levels[1] - levels[0] if np.isfinite(levels).all() else None
    return Effect(
        name=after.name, waveform=float(changes[most]), where=scene.probes[most], level=level,
        decibel=line_changes(scene, before.response, after.response, scale),
        alone=float(_changes(richest, alone)[0].max()) if alone else None,
        seconds=after.seconds - before.seconds,
    )  # fmt: skip


def _changes(reference: Response, candidate: Response) -> tuple[Floats, float]:
    """Return changes (p,) relative to the strongest probe, and the factor of the candidate."""
    agreement = compare(reference, candidate)
    sizes = np.linalg.norm(reference.values, axis=0)
    return np.asarray(agreement.relative_l2 * sizes / max(sizes.max(), TINY)), agreement.scale


def _level(scene: Scene, response: Response) -> float:
    """Return the highest sensation level in dB of a line at any probe, or minus infinity."""
    unit, pressure = "m" if response.record.of_body else "Pa", scene.pressure
    acting = published_load(pressure) if response.model == PUBLISHED.name else pressure
    table = lines_in_pulses(acting, response, candidates=ASSESSED)
    levels = [
        sensation_level(table.amplitudes[name], f, unit=unit).max()
        for name, f in table.frequencies.items() if f < HIGHEST
    ]  # fmt: skip
    return float(max(levels, default=-np.inf))


def compared_lines(scene: Scene, response: Response) -> dict[str, float]:
    """Return the frequencies in Hz of resolved lines by name.

    These are the lines of a nonlinear drive, which include all lines of a linear one.
    """
    drive = usual_drive(scene.pressure.drive, MovingPressure.drive)
    pressure = replace(scene.pressure, drive=drive)
    return resolved_lines(pressure, response, candidates=ASSESSED, highest=HIGHEST)[0]


def line_changes(
    scene: Scene, before: Response, after: Response, scale: float = 1.0
) -> dict[str, float]:
    """Return the increase in dB of each strong line, at the probe where it is strongest."""
    if not (names := compared_lines(scene, after)):
        return {}
    old, new = (lines(r, list(names.values())) for r in (before, after))
    old = abs(scale) * old
    least = WEAKEST_RATIO * max(old.max(), new.max())
    changes = {}
    for k, name in enumerate(names):
        probe = int(np.argmax(np.maximum(old[k], new[k])))
        if max(old[k, probe], new[k, probe]) > least:
            ratio = np.maximum(new[k, probe], 1e-3 * least) / max(old[k, probe], 1e-3 * least)
            changes[name] = float(20 * np.log10(ratio))
    return changes


def unknown_text(hierarchy: Hierarchy, effects: Sequence[Effect]) -> str:
    """Return a sentence on the assumptions that cannot be ranked; "" if all are."""
    dropped = (step.name for step in (*hierarchy.steps[1:], *hierarchy.side_steps))
    unknown = [f"'{name}'" for name in dropped if name not in {e.name for e in effects}]
    return f"Not compared, because steps failed: {', '.join(unknown)}." * bool(unknown)


def sentence(e: Effect) -> str:
    """Return sentences on the effect and the cost of dropping an assumption."""
    return f"Without the assumption '{e.name}', {_change_text(e)}"


def _change_text(e: Effect) -> str:
    x, y = (1e3 * v for v in e.where)
    level = (
        "" if e.level is None else f", the sensation level by {decibel(e.level, signed=True)} dB"
    )
    time = "no extra time" if e.seconds <= NEGLIGIBLE_TIME else f"{e.seconds:.1f} s more"
    return (
        f"the waveform at ({x:g}, {y:g}) mm changes by "
        f"{share_of(e.waveform, 'the motion of the strongest probe')}{level}. Then "
        f"{ASSUMPTIONS[e.name]}, which takes {time}."
    )


def _line_change(changes: dict[str, float]) -> str | None:
    """Return the line that changes most, and its change."""
    if not changes:
        return None
    line = max(changes, key=lambda name: abs(changes[name]))
    if abs(changes[line]) > OUT_OF_NOTHING:
        return f"{line} {'appears' if changes[line] > 0 else 'vanishes'}"
    return f"{line} {decibel(changes[line], signed=True)} dB"


def write(folder: Path, hierarchy: Hierarchy) -> None:
    """Write index.html, relax.png, relax.csv, effects.csv, steps.csv and responses.npz."""
    effects = hierarchy.effects()
    (folder / "relax.csv").write_bytes(Table(LINE_COLUMNS, _line_rows(hierarchy)).to_csv())
    responses = {step.name: step.response for step in hierarchy.every if step.response}
    arrays = {name: response.values for name, response in responses.items()}
    first = next(iter(responses.values()))
    arrays |= {"t": first.times, "probes": first.probes}
    np.savez(folder / "responses.npz", **arrays)  # type: ignore[arg-type]
    verdict = "No two steps can be compared, because too many failed."
    if effects:
        unknown = unknown_text(hierarchy, effects)
        verdict = f"{unknown} Of the others, " if unknown else "Of the assumptions, "
        verdict += (
            f"'{effects[0].name}' has the largest effect: without it, {_change_text(effects[0])}"
        )
    (folder / "effects.csv").write_bytes(Table(EFFECT_COLUMNS, map(_effect_row, effects)).to_csv())
    steps = Table(STEP_COLUMNS, map(_step_row, hierarchy.every), "steps")
    parts: list[Part] = [
        Picture(png(_figure(effects), dpi=130), BARS, "relax"),
        Table(PAGE_COLUMNS, map(_page_row, effects)),
        Details("Steps and their warnings", [
            INTRODUCTION, steps, warnings_banner(hierarchy.efforts),
        ]),
    ]  # fmt: skip
    richest = [effort for effort in hierarchy.efforts if effort[0] == hierarchy.steps[-1].name]
    title = f"{hierarchy.scene.name}: assumptions, one by one"
    Report(title, [verdict], parts, richest, failures=hierarchy.failures).write(folder)


def _figure(effects: list[Effect]) -> Figure:
    """Draw a bar for each assumption, the largest effect at the top."""
    figure = Figure(figsize=(7, 1 + 0.32 * len(effects)), layout="constrained")
    axes = figure.add_subplot()
    changes = [e.waveform for e in effects]
    bars = axes.barh([e.name.replace("^2", "²") for e in effects], changes, color=BLUE, height=0.7)
    texts = [
        significant(e.waveform, 2)
        + ("" if e.level is None else f",  {decibel(e.level, signed=True)} dB SL")
        for e in effects
    ]
    axes.bar_label(bars, texts, padding=4, fontsize=9)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.3 * max(changes, default=1.0))
    axes.set_xlabel("change of the waveform over the motion of the strongest probe")
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _effect_row(e: Effect) -> list[object]:
    return [
        e.name, 100 * e.waveform, f"({1e3 * e.where[0]:g}, {1e3 * e.where[1]:g})", e.level,
        None if e.alone is None else 100 * e.alone, e.seconds,
        ", ".join(f"{name} {decibel(x, signed=True)}" for name, x in e.decibel.items()),
    ]  # fmt: skip


def _page_row(e: Effect) -> list[object]:
    where = f"({1e3 * e.where[0]:g}, {1e3 * e.where[1]:g})"
    seconds = e.seconds if e.seconds > NEGLIGIBLE_TIME else None
    return [e.name, e.waveform, where, e.level, e.alone, _line_change(e.decibel), seconds]


def _step_row(step: HierarchyStep) -> list[object]:
    dofs = step.response.effort.dofs if step.response else None
    return [step.name, step.model, dofs, step.seconds, step.memory / 2**30 or None, step.error]


def _line_rows(hierarchy: Hierarchy) -> Iterator[list[object]]:
    """Yield the change of every line at each probe, from the previous and the richest step."""
    richest = [r.response for r in hierarchy.steps if r.response][-1]
    for before, step in hierarchy.pairs():
        assert before.response
        assert step.response
        names = compared_lines(hierarchy.scene, step.response)
        ratios = [_ratios(step.response, other, names) for other in (before.response, richest)]
        for k, (name, f) in enumerate(names.items()):
            for p, (x, y) in enumerate(hierarchy.scene.probes):
                changes = [f"{r[k, p]:.4g}" if np.isfinite(r[k, p]) else None for r in ratios]
                yield [step.name, step.model, 1e3 * x, 1e3 * y, name, f, *changes]


def _ratios(response: Response, other: Response, names: dict[str, float]) -> Floats:
    """Return lines (f, p) of a response in dB re those of another."""
    agreement = compare(other, response, tuple(names.values()))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(agreement.line_ratios))
