"""Progress: steps of a body's preparation, the time left, and a bar that shows them."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from skinwave.system.effort import Progress, silent
from skinwave.system.plain_text import printable, say

# Steps in their order, each with its share of the time: between those of a sheet and of a palm.
STEPS = {"mesh": 0.05, "assemble": 0.05, "factorise": 0.20, "reduce": 0.70}
LEAST = 0.2  # of all, after which the time that is left is shown: a sheet is meshed at once


def follower(
    clock: Callable[[], float] = time.monotonic,
) -> Callable[[str, float], tuple[str, float, str]]:
    """Function of a phase and the fraction of it done: the phase with the number of its step, the
    share done of all steps or of the phase, and the time left in words, if it is known.
    """
    names, last = list(STEPS), 0.0
    group, since, before = "", 0.0, 0.0  # what is followed, since when, and what was done then

    def follow(phase: str, fraction: float) -> tuple[str, float, str]:
        nonlocal last, group, since, before
        of, _, own = phase.rpartition(": ")
        own = "reduce" if own == "march" else own
        name, followed, done = phase, phase, min(max(fraction, 0.0), 1.0)
        if own in STEPS:
            number = names.index(own)
            done = sum(STEPS[step] for step in names[:number]) + done * STEPS[own]
            name, followed = f"{phase} (step {number + 1} of {len(names)})", f"{of}: steps"
        now = clock()
        if followed != group or done < last:
            group, since, before = followed, now, done
        last, gained = done, done - before
        if gained <= LEAST:
            return name, done, ""
        left = (now - since) * (1 - done) / gained
        to = 1 if left < 10 else 5
        return name, done, f"about {max(to, to * round(left / to))} s left"

    return follow


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
    follow, last = follower(), ""
    if not sys.stderr.isatty():

        def log(phase: str, fraction: float) -> None:
            nonlocal last
            name = follow(phase, fraction)[0]
            if name != last:
                last = name
                say(name, sys.stderr)

        yield log
        return
    from rich import progress as rich
    from rich.console import Console

    name, left = (rich.TextColumn(f"{{task.{of}}}", markup=False)
                  for of in ("description:<36", "fields[left]"))  # fmt: skip
    columns = name, rich.BarColumn(), rich.TimeElapsedColumn(), left
    with rich.Progress(*columns, console=Console(stderr=True)) as shown:
        task = shown.add_task("", total=1.0, left="")

        def show(phase: str, fraction: float) -> None:
            step, done, in_words = follow(phase, fraction)
            shown.update(task, description=printable(step, ""), completed=done, left=in_words)

        yield show
