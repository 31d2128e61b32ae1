"""Progress on standard error: the steps of preparing a body, and a bar."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from skinwave.system.effort import Progress, silent
from skinwave.system.plain_text import printable, say

# Steps in their order, each with its share of the time: between those of a sheet and of a palm.
STEPS = {"mesh": 0.05, "assemble": 0.05, "factorise": 0.20, "reduce": 0.70}


def step_of(phase: str, fraction: float) -> tuple[str, float]:
    """Return the phase with the number of its step and the completed share of all steps; for other
    phases, the share of the phase.
    """
    names, done = list(STEPS), min(max(fraction, 0.0), 1.0)
    step = phase.rpartition(": ")[2]
    step = "reduce" if step == "march" else step
    if step not in STEPS:
        return phase, done
    number = names.index(step)
    done = sum(STEPS[name] for name in names[:number]) + done * STEPS[step]
    return f"{phase} (step {number + 1} of {len(names)})", done


@contextmanager
def progress_callback(progress: Progress | bool | None) -> Iterator[Progress]:
    """Yield a progress callback: a bar for True, none for False or None, or the given function."""
    if progress is True:
        with bar() as report:
            yield report
    else:
        yield progress or silent


@contextmanager
def bar() -> Iterator[Progress]:
    """Yield a callback that shows a bar on a terminal, and otherwise a line for each step."""
    last = ("", 0.0)
    if not sys.stderr.isatty():

        def log(phase: str, fraction: float) -> None:
            nonlocal last
            step = step_of(phase, fraction)
            if step[0] != last[0]:
                say(step[0], sys.stderr)
            last = step

        yield log
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description:<36}", markup=False),
        rich.BarColumn(),
        rich.TimeElapsedColumn(),
        rich.TimeRemainingColumn(),
    )
    with rich.Progress(*columns, console=Console(stderr=True)) as shown:
        task = shown.add_task("", total=1.0)

        def show(phase: str, fraction: float) -> None:
            nonlocal last
            step = step_of(phase, fraction)
            if step[1] < last[1]:  # the next body, or a phase after the steps
                shown.reset(task)
            shown.update(task, description=printable(step[0], ""), completed=step[1])
            last = step

        yield show
