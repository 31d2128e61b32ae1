"""Progress as a bar, with the step named and the time left; on a pipe a line per step."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from skinwave.system.effort import Progress, silent
from skinwave.system.plain_text import printable, say
from skinwave.system.steps import follower


@contextmanager
def reported(progress: Progress | bool | None) -> Iterator[Progress]:
    """Where progress goes: a bar of True, nowhere of False or None, or the function itself."""
    if progress is True:
        with bar() as shown:
            yield shown
    else:
        yield progress or silent


@contextmanager
def bar() -> Iterator[Progress]:
    """A bar where standard error is a terminal, and lines elsewhere, as in a notebook."""
    follow = follower()
    if not sys.stderr.isatty():
        phases: list[str] = []

        def log(phase: str, fraction: float) -> None:
            name = follow(phase, fraction).name
            if name not in phases[-1:]:
                phases.append(name)
                say(name, sys.stderr)

        yield log
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.TextColumn("{task.description:<36}", markup=False),
               rich.BarColumn(), rich.TimeElapsedColumn())  # fmt: skip
    left = rich.TextColumn("{task.fields[left]}", markup=False)
    with rich.Progress(*columns, left, console=Console(stderr=True)) as shown:
        task = shown.add_task("", total=1.0, left="")

        def show(phase: str, fraction: float) -> None:
            step = follow(phase, fraction)
            shown.update(
                task, description=printable(step.name, ""), completed=step.done, left=step.time_left
            )

        yield show
