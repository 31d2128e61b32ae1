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
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model import Effort, MovingPressure, Response, lines, resolved_lines, sensation_level
from simple_model.line_table import lines_in_pulses
from simple_model.load.drive import usual_drive
from simple_model.load.spot_map import SpotMap
from simple_model.numbers import decibel, share_of, significant
from simple_model.point_kernel import published_load
from skinwave.models import named
from skinwave.models.limits import takes
from skinwave.models.point_kernel import PUBLISHED
from skinwave.planning.assessment import all_warnings
from skinwave.planning.simulate import compute
from skinwave.report.figures import png
from skinwave.report.palette import BLUE
from skinwave.results.comparison import compare
from skinwave.results.files import write_responses
from skinwave.results.propagation import Reach
from skinwave.results.run import ASSESSED
from skinwave.scene.scene import Body, Scene, check_motion
from skinwave.studies import assumptions
from skinwave.studies.outward import Outward, outward
from skinwave.system.document import Details, Part, Picture, Report, warnings_banner
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.failures import REASONS, failure_text, reason
from skinwave.system.processes import pool
from skinwave.system.progress_bar import announce
from skinwave.system.table import Column, Table
from skinwave.typing import Floats

HIGHEST = 600.0  # Hz, of the lines that are compared


@dataclass(frozen=True, kw_only=True, eq=False)
class HierarchyStep:
    """Step of the model hierarchy: dropped assumptions, model, scene, and response or `error`.

    On skin, `level` is the highest sensation level in dB at a probe, and `reach` the distance from
    the path up to which it is above 0 on the line of `outward`, or None.
    """

    name: str
    dropped: tuple[str, ...]
    model: str
    scene: Scene | None = None
    response: Response | None = None
    level: float | None = None
    reach: Reach | None = None
    seconds: float = 0.0
    memory: int = 0
    error: str = ""

    @property
    def body(self) -> Body | None:
        """Body of its scene."""
        return self.scene.body if self.scene else None


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of dropping one assumption.

    `waveform` is the largest change of a waveform, relative to the strongest probe, and `where` the
    probe (x, y) in m with this change. `level` and `decibel` are increases in dB of the sensation
    level and of lines, `reach` is that above threshold with and without the assumption. `alone` is
    the change of the waveform if only this assumption is made, `seconds` the additional time.
    """

    name: str
    waveform: float
    where: tuple[float, float]
    level: float | None
    decibel: dict[str, float]
    reach: tuple[Reach | None, Reach | None]
    alone: float | None
    seconds: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Hierarchy:
    """Model hierarchy: steps from the published to the richest model, side steps and leave-one-out
    models. A side step drops one more assumption than the step where it branches off.
    """

    scene: Scene
    steps: tuple[HierarchyStep, ...]
    side_steps: tuple[HierarchyStep, ...]
    leave_one_out: tuple[HierarchyStep, ...]
    towards: str = ""  # of the line on which reaches are read, such as "+x"

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
        made = {step.dropped: step for step in self.steps if step.response}
        later = [step for step in (*self.steps[1:], *self.side_steps) if step.response]
        return [(made[s.dropped[:-1]], s) for s in later if s.dropped[:-1] in made]

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
    update_rate: float = assumptions.DEVICE_RATES[0],
    points: int | None = None,
) -> Hierarchy:
    """Compute a scene at every step of the model hierarchy.

    Elements have the size h in m, by default that of `element_size`. `update_rate` and `points` are
    those of `device_path`. Raises a ValueError if the scene has no body, if its probes do not read
    the displacement of the surface, or if no such device exists.
    """
    check_motion(scene, "relax")
    if isinstance(scene.pressure.profile, SpotMap):
        raise ValueError(
            "relax compares focal spots of the array, not a map; remove file, unit and profile of "
            "[focus], or use skinwave compare"
        )
    announce(progress, "choose models")
    names = assumptions.droppable(scene)
    assumptions.check_rate(update_rate)
    path = scene.tacton.trajectory
    if "continuous path" in names:
        path = assumptions.device_path(path, update_rate, points)
    up = [("as published", ()), *((name, names[: k + 1]) for k, name in enumerate(names))]
    side = [(dropped[-1], dropped)] if (dropped := assumptions.side_step(scene)) else []
    leave_one_out = [  # except the last, which is a step
        (f"all but: {name}", tuple(n for n in names if n != name))
        for name in names[:-1] if assumptions.can_be_alone(name, names, scene, h)
    ]  # fmt: skip

    def step_of(name: str, dropped: tuple[str, ...]) -> HierarchyStep:
        step = HierarchyStep(name=name, dropped=dropped, model="none")
        try:
            changed, model = assumptions.without(scene, dropped, path=path, h=h)
            return replace(step, model=named(model).name, scene=changed)
        except REASONS as error:
            return replace(step, error=reason(error))

    steps = [step_of(name, dropped) for name, dropped in (*up, *side, *leave_one_out)]
    steps = _with_shared_models(steps, len(up))
    body = steps[len(up) - 1].body or scene.body
    line = _outward(scene, body, assumptions.element_size(scene, h))
    more = tuple(map(tuple, line.probes.tolist())) if line else ()
    submitted: dict[int, Future[tuple[Response, float, int]]] = {}
    with (
        TemporaryDirectory(prefix="skinwave-") as cache,
        pool(1, renewed=True) as large, pool(1, renewed=True) as small,
    ):  # fmt: skip
        for k, step in enumerate(steps):
            if step.scene:
                is_reduced, size = named(step.model).is_reduced, h
                if is_reduced and not h:
                    size = min(map(assumptions.element_size, (scene, step.scene)))
                workers = large if is_reduced else small
                submitted[k] = workers.submit(_time, step.scene, more, step.model, size, cache)
        for k, future in submitted.items():
            progress(steps[k].name, k / len(steps))
            steps[k] = _compute(scene, steps[k], future, steps[:k], line)
    first, second = len(up), len(up) + len(side)
    found = Hierarchy(
        scene=scene, steps=tuple(steps[:first]), side_steps=tuple(steps[first:second]),
        leave_one_out=tuple(steps[second:]), towards=line.towards if line else "",
    )  # fmt: skip
    if not found.efforts:
        raise ValueError(failure_text(found.failures))
    return found


def _with_shared_models(steps: Sequence[HierarchyStep], count: int) -> list[HierarchyStep]:
    """Return the steps with one model for each solid, where it takes the load.

    It is the model of the last of the first `count` steps on this body. Both responses whose
    difference is the effect of a load then have the error of elements.
    """
    solids = [s for s in steps if s.body and s.body.is_solid and named(s.model).needs_body]
    last = {step.body: step.model for step in steps[:count] if step in solids}

    def model(step: HierarchyStep) -> str:
        shared = last.get(step.body, step.model)
        is_taken = step in solids and step.scene and takes(named(shared), step.scene)
        return shared if is_taken else step.model

    return [replace(step, model=model(step)) for step in steps]


def _outward(scene: Scene, body: Body, h: float) -> Outward | None:
    """Return the line on which the reach is read on skin; None if there is no such line."""
    try:
        return outward(scene, body, h) if body.is_skin else None
    except REASONS:  # which the steps on this body have, too
        return None


def _time(
    scene: Scene, more: tuple[tuple[float, float], ...], model: str, h: float | None, cache: str
) -> tuple[Response, float, int]:
    """Return a response at the scene's probes and at `more`, its seconds, and the peak memory."""
    os.environ["SKINWAVE_CACHE"] = cache
    started = time.perf_counter()
    response = compute(replace(scene, probes=(*scene.probes, *more)), model, h=h)
    seconds, memory = time.perf_counter() - started, peak_memory()
    # All steps have the same discretisation error, which does not affect their differences.
    own = _at_first(response, len(scene.probes))
    effort = replace(response.effort, warnings=all_warnings(scene, own, h=h))
    return replace(response, effort=effort), seconds, memory


def _at_first(response: Response, count: int) -> Response:
    """Return a response at its first probes."""
    return replace(response, probes=response.probes[:count], values=response.values[:, :count])


def _compute(
    scene: Scene,
    step: HierarchyStep,
    future: Future[tuple[Response, float, int]],
    before: Sequence[HierarchyStep],
    line: Outward | None,
) -> HierarchyStep:
    """Return a step with its response at the probes of the scene and its levels, or its error.

    Seconds and memory include those of an earlier step for the same body.
    """
    try:
        whole, seconds, memory = future.result()
    except REASONS as error:
        return replace(step, error=reason(error))
    count = len(scene.probes)
    response = _at_first(whole, count)
    if scene.body.is_skin:
        levels = levels_at_probes(scene, whole)
        step = replace(
            step,
            level=float(levels[:count].max()),
            reach=line.reach(levels[count:]) if line else None,
        )
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
    levels = [-np.inf if step.level is None else step.level for step in (before, after)]
    level = levels[1] - levels[0] if np.isfinite(levels).all() else None
    return Effect(
        name=after.name, waveform=float(changes[most]), where=scene.probes[most], level=level,
        reach=(before.reach, after.reach),
        decibel=line_changes(scene, before.response, after.response, scale),
        alone=float(_changes(richest, alone)[0].max()) if alone else None,
        seconds=after.seconds - before.seconds,
    )  # fmt: skip


def _changes(reference: Response, candidate: Response) -> tuple[Floats, float]:
    """Return changes (p,) relative to the strongest probe, and the factor of the candidate."""
    agreement = compare(reference, candidate)
    sizes = np.linalg.norm(reference.values, axis=0)
    tiny = np.finfo(float).tiny
    return np.asarray(agreement.relative_l2 * sizes / max(sizes.max(), tiny)), agreement.scale


def levels_at_probes(scene: Scene, response: Response) -> Floats:
    """Return the highest sensation level in dB of a line at each probe (p,), or minus infinity."""
    unit, pressure = "m" if response.record.of_body else "Pa", scene.pressure
    acting = published_load(pressure) if response.model == PUBLISHED.name else pressure
    table = lines_in_pulses(acting, response, candidates=ASSESSED)
    levels = [
        sensation_level(table.amplitudes[name], f, unit=unit)
        for name, f in table.frequencies.items() if f < HIGHEST
    ]  # fmt: skip
    silent = np.full((1, len(response.probes)), -np.inf)
    return np.asarray(np.vstack([silent, *levels]).max(axis=0))


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
    weakest_ratio = 0.01  # to the strongest line at a probe
    least = weakest_ratio * max(old.max(), new.max())
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
    share = share_of(e.waveform, "the motion of the strongest probe")
    changes = [f"the waveform at {_place(e)} mm changes by {share}"]
    if e.level is not None:
        changes.append(f"the sensation level by {decibel(e.level, signed=True)} dB")
    with_it, without_it = map(_reach_text, e.reach)
    if with_it != without_it:
        changes.append(f"the reach above threshold from {with_it} to {without_it} mm")
    time = f"{e.seconds:.1f} s more" if e.seconds > 0.05 else "no extra time"  # which rounds to 0
    *first, last = changes
    text = f"{', '.join(first)}, and {last}" if first else last
    return f"{text}. In its place, {assumptions.ASSUMPTIONS[e.name]}. This takes {time}."


def _place(e: Effect) -> str:
    x, y = e.where
    return f"({1e3 * x:g}, {1e3 * y:g})"


def _reach_text(reach: Reach | None) -> str:
    """Return a reach in mm, 0 if nothing is above threshold on the line."""
    return "over " * reach.beyond + significant(1e3 * reach.metre, 2) if reach else "0"


def _line_change(changes: dict[str, float]) -> str | None:
    """Return the line that changes most, and its change."""
    if not changes:
        return None
    line = max(changes, key=lambda name: abs(changes[name]))
    out_of_nothing = 60.0  # dB: a line that changes by more appears or vanishes
    if abs(changes[line]) > out_of_nothing:
        return f"{line} {'appears' if changes[line] > 0 else 'vanishes'}"
    return f"{line} {decibel(changes[line], signed=True)} dB"


def write(folder: Path, hierarchy: Hierarchy) -> None:
    """Write index.html, relax.png, relax.csv, effects.csv, steps.csv and responses.npz."""
    effects = hierarchy.effects()
    line_columns = (
        "step", "model", "probe_x_mm", "probe_y_mm", "line", "frequency_hz", "from_step_before_db",
        "from_richest_db",
    )  # fmt: skip
    (folder / "relax.csv").write_bytes(Table(line_columns, _line_rows(hierarchy)).to_csv())
    responses = {step.name: step.response for step in hierarchy.every if step.response}
    write_responses(folder / "responses.npz", responses)
    verdict = "No two steps can be compared, because too many failed."
    if effects:
        unknown = unknown_text(hierarchy, effects)
        verdict = f"{unknown} Of the others, " if unknown else "Of the assumptions, "
        verdict += (
            f"'{effects[0].name}' has the largest effect: without it, {_change_text(effects[0])}"
        )
    effect_columns = (
        Column("assumption", "dropped assumption"),
        Column("waveform_percent", "change of the waveform", "%", 2), Column("at_mm", "at", "mm"),
        Column("level_db", "change of the sensation level", "dB", 2),
        Column("reach_with_mm", "reach above threshold with it", "mm"),
        Column("reach_without_mm", "reach without it", "mm"),
        Column("alone_percent", "change if only this assumption is made", "%", 2),
        Column("costs_s", "extra time", "s", 2), Column("line", "largest change of a line"),
        "lines_db",
    )  # fmt: skip
    table = Table(effect_columns, map(_effect_row, effects))
    (folder / "effects.csv").write_bytes(table.to_csv())
    step_columns = (
        "step", "model", Column("dofs", "degrees of freedom"),
        Column("seconds", "time", "s", digits=2), Column("memory_gib", "memory", "GiB", digits=2),
        Column("error", "reason of failure"),
    )  # fmt: skip
    steps = Table(step_columns, map(_step_row, hierarchy.every), "steps")
    introduction = (
        "The steps lead from the published model to the richest one of this scene, one assumption "
        "after another. Before a pressure is compared with a displacement, it is scaled by the "
        "best-fitting factor."
    )
    bars = (
        "What changes if each assumption is dropped. The change of the waveform is relative to "
        "the motion of the strongest probe. On skin, the other two panels show the highest "
        "sensation level at a probe, and the distance from the path up to which a line exceeds "
        "the detection threshold."
    )
    parts: list[Part] = [
        Picture(png(_figure(effects, hierarchy.towards), dpi=130), bars, "relax"),
        table.only(*(column.name for column in table.columns if column.name != "lines_db")),
        Details("Steps and their warnings", [
            introduction, steps, warnings_banner(hierarchy.efforts),
        ]),
    ]  # fmt: skip
    richest = [effort for effort in hierarchy.efforts if effort[0] == hierarchy.steps[-1].name]
    title = f"{hierarchy.scene.name}: assumptions, one by one"
    Report(title, [verdict], parts, richest, failures=hierarchy.failures).write(folder)


def _figure(effects: list[Effect], towards: str) -> Figure:
    """Draw the changes by each assumption, the largest at the top: waveform, level and reach."""
    is_skin = any(e.level is not None for e in effects)
    has_reach = any(any(e.reach) for e in effects)
    panels = 1 + is_skin + has_reach
    figure = Figure(figsize=(4 + 3 * panels, 1.2 + 0.34 * len(effects)), layout="constrained")
    first, *others = figure.subplots(1, panels, sharey=True, squeeze=False)[0]
    rows = np.arange(len(effects))

    def draw_bars(axes: Axes, lengths: Sequence[float], texts: Sequence[str]) -> None:
        bars = axes.barh(rows, lengths, color=BLUE, height=0.7)
        axes.bar_label(bars, texts, padding=4, fontsize=9)

    changes = [e.waveform for e in effects]
    draw_bars(first, changes, [significant(x, 2) for x in changes])
    first.set_yticks(rows, [e.name.replace("^2", "²") for e in effects])
    first.invert_yaxis()
    first.set_xlim(0, 1.2 * max(changes, default=0.0) or 1.0)
    first.set_xlabel("change of the waveform, relative\nto the motion of the strongest probe")
    if is_skin:
        axes, levels = others[0], [e.level or 0.0 for e in effects]
        texts = ["" if e.level is None else decibel(e.level, signed=True) for e in effects]
        draw_bars(axes, levels, texts)
        axes.axvline(0, color="black", linewidth=0.8)
        axes.margins(x=0.3)
        axes.set_xlabel("change of the\nsensation level, dB")
    if has_reach:
        axes = others[-1]
        ends = np.array([[1e3 * r.metre if r else 0.0 for r in e.reach] for e in effects])
        axes.hlines(rows, *ends.T, color=BLUE, linewidth=2)
        axes.plot(ends[:, 0], rows, "o", color=BLUE, mfc="white", label="with the assumption")
        axes.plot(ends[:, 1], rows, "o", color=BLUE, label="without it")
        for row, effect in enumerate(effects):
            axes.annotate(
                " to ".join(map(_reach_text, effect.reach)), (ends[row].max(), row), (8, 0),
                textcoords="offset points", va="center", fontsize=9,
            )  # fmt: skip
        axes.set_xlim(-0.05 * ends.max(), 1.6 * ends.max())
        axes.set_xlabel(f"reach above threshold from the path\nalong {towards}, mm")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    for axes in (first, *others):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _effect_row(e: Effect) -> list[object]:
    return [
        e.name, 100 * e.waveform, _place(e), e.level,
        *(_reach_text(r) if any(e.reach) else None for r in e.reach),
        None if e.alone is None else 100 * e.alone, e.seconds, _line_change(e.decibel),
        ", ".join(f"{name} {decibel(x, signed=True)}" for name, x in e.decibel.items()),
    ]  # fmt: skip


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
