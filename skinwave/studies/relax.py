"""Model hierarchy from the paper's model to the richest one: effect and cost of each assumption.

Each step of the hierarchy drops one more assumption; leave-one-out models, which drop all but one,
are run beside it. Each is computed in a process of its own, so that its memory is its own, and two
at once. A body that several steps share is meshed and reduced once, by the first of them; its
seconds and memory count in all of them.
"""

import time
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fem import NotReduced
from meshes.tetmesh import Floats
from simple_model import MovingPressure, Response, lines, resolved_lines, sensation_level
from simple_model.load.drive import beyond_published
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.planning.assessment import sentences
from skinwave.planning.simulate import compute
from skinwave.results.comparison import compare
from skinwave.results.run import ASSESSED
from skinwave.scene.scene import Body, Scene, check_motion
from skinwave.studies.assumptions import (
    DEVICE_RATES,
    can_be_alone,
    check_rate,
    droppable,
    held,
    relaxed,
    side_step,
)
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.processes import environment, side_by_side

HIGHEST, FAINTEST = 600.0, 0.01  # Hz of the lines that are followed; of the strongest at a probe
TINY = np.finfo(float).tiny
FIRST = "as published"  # by the model point-kernel-published
LARGER = 1.25  # times the default element size, for a third of the time
# With a tenth of the damping a body may take more moments than a reduced one has; in elements so
# much larger it takes as many, and that is known at a tenth of the cost.
ALMOST_UNDAMPED, COARSER = "all but: little loss", 3.0


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

    def pairs(self) -> list[tuple[HierarchyStep, HierarchyStep]]:
        """Each computed step, side steps included, after the one that it is compared with; a step
        after one that failed is left out, because it differs by two assumptions.
        """
        answered = [step for step in self.steps if step.response]
        found = [(a, b) for a, b in pairwise(self.steps) if a.response and b.response]
        for step in self.side_steps:
            kept = set(step.dropped) - {step.name}
            before = next((r for r in answered if set(r.dropped) == kept), None)
            if step.response and before:
                found.append((before, step))
        return found

    def effects(self) -> list[Effect]:
        """Effect of each assumption, the largest first; failed steps are left out."""
        answered = [step for step in self.steps if step.response]
        all_of_them = set(self.steps[-1].dropped)
        left = [(all_of_them.difference(r.dropped), r) for r in (*self.steps, *self.leave_one_out)]
        kept = {names.pop(): step for names, step in left if len(names) == 1}
        found = [
            effect(self.scene, before, step, answered[-1], kept.get(step.name))
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
    """Compute a scene at every step of the model hierarchy.

    Parameters
    ----------
    h : float, metre, element size of all steps; `LARGER` times the default of the scene's body if
        not given
    update_rate, points : float, Hz, and how many on the path: of the device, as `held` takes them

    Raises
    ------
    ValueError
        If the scene has no body, its probes read something else than the displacement of the
        surface, or the device cannot be.
    """
    check_motion(scene, "relax")
    names = droppable(scene)
    check_rate(update_rate)
    if "continuous path" in names:
        held(scene.tacton.trajectory, update_rate, points)  # refuses before anything is computed
    drawn = partial(relaxed, update_rate=update_rate, points=points)
    up = [(FIRST, ()), *((name, names[: k + 1]) for k, name in enumerate(names))]
    asked = {tuple(dropped) for _, dropped in up}
    aside = [(dropped[-1], dropped)] if (dropped := side_step(scene)) else []
    leave_one_out = [
        (f"all but: {name}", tuple(n for n in names if n != name))
        for name in names
        if tuple(n for n in names if n != name) not in asked and can_be_alone(name, names, scene)
    ]
    todo = [*up, *aside, *leave_one_out]
    with TemporaryDirectory(prefix="skinwave-") as cache:
        steps = _computed([_asked(drawn, scene, *each, h, cache) for each in todo], progress)
    first, second = len(up), len(up) + len(aside)
    return Hierarchy(
        scene=scene, steps=tuple(steps[:first]), side_steps=tuple(steps[first:second]),
        leave_one_out=tuple(steps[second:]),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Asked:
    """Step to be computed by a call, if there is any, and whether that reduces a whole body."""

    step: HierarchyStep
    call: Callable[[], tuple[Response, float, int]] | None = None
    reduces: bool = False

    def shares(self, others: Iterable[HierarchyStep]) -> bool:
        """Whether one of the others is by the same model of the same body."""
        own = (self.step.body, self.step.model)
        return any(own == (other.body, other.model) for other in others)


def _asked(
    drawn: Callable[[Scene, tuple[str, ...]], tuple[Scene, str]], scene: Scene, name: str,
    dropped: tuple[str, ...], h: float | None, cache: str,
) -> _Asked:  # fmt: skip
    step: dict[str, Any] = {"name": name, "dropped": dropped, "model": "none"}
    try:
        changed, model = drawn(scene, dropped)
        step |= {"model": model, "body": changed.body}
        is_reduced = named(model).is_reduced
        size = h or LARGER * default_size(scene.body) if is_reduced else h
    except (ValueError, ArithmeticError) as error:
        return _Asked(step=HierarchyStep(**step, error=str(error)))
    tried = COARSER * size if size and is_reduced and name == ALMOST_UNDAMPED else None
    return _Asked(
        step=HierarchyStep(**step),
        call=partial(_timed, changed, model, size, cache, tried=tried),
        reduces=is_reduced and tried is None,
    )


def _computed(asked: Sequence[_Asked], progress: Progress) -> list[HierarchyStep]:
    """Steps in order, two of them computed at once; bodies are reduced one after another, whose
    memory would not be small together, and as soon as they can be.
    """
    found = {k: each.step for k, each in enumerate(asked) if not each.call}
    computed: list[HierarchyStep] = []

    def is_large(k: int) -> bool:
        reduced = (step for step in computed if step.response)
        return asked[k].reduces and not asked[k].shares(reduced)

    def is_first(k: int) -> bool:
        return asked[k].reduces and not asked[k].shares(each.step for each in asked[:k])

    order = sorted((k for k, each in enumerate(asked) if each.call), key=lambda k: not is_first(k))

    def may_begin(number: int, running: Collection[int]) -> bool:
        return not (is_large(order[number]) and any(is_large(order[n]) for n in running))

    def begun(number: int) -> None:
        progress(asked[order[number]].step.name, len(computed) / len(order))

    calls = [call for k in order if (call := asked[k].call)]
    for number, future in side_by_side(calls, may_begin, begun):
        k = order[number]
        found[k] = _result(asked[k].step, future, computed)
        computed.append(found[k])
    return [found[k] for k in range(len(asked))]


def _result(
    step: HierarchyStep,
    future: Future[tuple[Response, float, int]],
    before: Sequence[HierarchyStep],
) -> HierarchyStep:
    """Step with its response, or with what it was refused for."""
    try:
        response, seconds, memory = future.result()
    except (ValueError, ArithmeticError, MemoryError, OSError, BrokenProcessPool) as error:
        return replace(step, error=str(error))
    return _whole(replace(step, response=response, seconds=seconds, memory=memory), before)


def _whole(step: HierarchyStep, before: Sequence[HierarchyStep]) -> HierarchyStep:
    """Step with the seconds and memory of what an earlier one on the same body did for it."""
    same = (s for s in before if s.response and (s.body, s.model) == (step.body, step.model))
    first = next(same, None)
    if not (step.response and first and first.response):
        return step
    own, shared = step.response.effort.seconds, first.response.effort.seconds
    missing = sum(spent for phase, spent in shared.items() if phase not in own)
    memory = max(step.memory, first.memory) if missing else step.memory
    return replace(step, seconds=step.seconds + missing, memory=memory)


def _tried(scene: Scene, model: str, h: float) -> None:
    """Refuse a body that cannot be reduced on a coarse mesh either, if it has one."""
    with suppress(ValueError):
        try:
            compute(scene, model, h=h)
        except NotReduced as error:
            raise ArithmeticError(str(error)) from None


def _timed(
    scene: Scene, model: str, h: float | None, cache: str, *, tried: float | None
) -> tuple[Response, float, int]:
    with environment({"SKINWAVE_CACHE": cache}):
        if tried:
            _tried(scene, model, tried)
    started = time.perf_counter()
    with environment({"SKINWAVE_CACHE": cache}):
        response = compute(scene, model, h=h)
    seconds, memory = time.perf_counter() - started, peak_memory()
    # The discretisation error is common to all steps and no part of their differences.
    effort = replace(response.effort, warnings=sentences(scene, response, h=h))
    return replace(response, effort=effort), seconds, memory


def effect(
    scene: Scene,
    before: HierarchyStep,
    after: HierarchyStep,
    richest: HierarchyStep,
    kept_alone: HierarchyStep | None,
) -> Effect:
    """Effect of the assumption that a step is named by."""
    assert before.response
    assert after.response
    changed, scale = _changes(after.response, before.response)
    most = int(np.argmax(changed))
    alone = None
    if kept_alone and kept_alone.response and richest.response:
        alone = float(_changes(richest.response, kept_alone.response)[0].max())
    level = None
    if scene.body.is_skin:
        of_both = [_level(scene, each) for each in (before.response, after.response)]
        level = of_both[1] - of_both[0] if np.isfinite(of_both).all() else None
    return Effect(
        name=after.name, waveform=float(changed[most]), where=scene.probes[most], level=level,
        decibel=line_changes(scene, before.response, after.response, scale), alone=alone,
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
    names = followed_lines(scene, response)
    if not names:
        return -np.inf
    f = np.array([*names.values()])
    unit = "m" if response.record.of_body else "Pa"
    return float(sensation_level(lines(response, f), f[:, None], unit=unit).max())


def followed_lines(scene: Scene, response: Response) -> dict[str, float]:
    """Names and frequencies in Hz of the lines that are followed, as far as a response resolves
    them: those of a drive that is not linear, which has all that a linear one has.
    """
    drive = beyond_published(scene.pressure.drive, MovingPressure.drive)
    pressure = replace(scene.pressure, drive=drive)
    return resolved_lines(pressure, response, candidates=ASSESSED, highest=HIGHEST)[0]


def line_changes(
    scene: Scene, before: Response, after: Response, scale: float = 1.0
) -> dict[str, float]:
    """By how many dB each line that counts grows, at the probe where it is strongest."""
    names = followed_lines(scene, after)
    if not names:
        return {}
    old, new = (lines(r, list(names.values())) for r in (before, after))
    old = abs(scale) * old
    least = FAINTEST * max(old.max(), new.max())
    changes = {}
    for k, name in enumerate(names):
        probe = int(np.argmax(np.maximum(old[k], new[k])))
        if max(old[k, probe], new[k, probe]) > least:
            floor = 1e-3 * least
            ratio = max(new[k, probe], floor) / max(old[k, probe], floor)
            changes[name] = float(20 * np.log10(ratio))
    return changes
