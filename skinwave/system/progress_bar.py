"""Progress: steps of a body's offline stage, the time left, and a bar that shows them."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from skinwave.system.effort import Progress, silent
from skinwave.system.plain_text import printable, say

# Steps in their order, each with its share of the time: between those of a sheet and of a palm.
PREPARING = {"mesh": 0.05, "assemble": 0.05, "factorise": 0.20, "reduce": 0.70}
SAME = {"march": "reduce"}  # what another model does at that step
LEAST = 0.2  # of all, after which the time that is left is shown: a sheet is meshed at once


@dataclass(frozen=True, kw_only=True)
class Step:
    """A `phase` as step `number` of `of`, both 0 of what is no step; the share `done` of all steps
    or of the phase, and the seconds `left`, None where that is not known yet.
    """

    phase: str
    number: int = 0
    of: int = 0
    done: float = 0.0
    left: float | None = None

    @property
    def name(self) -> str:
        """The phase with its number, such as "assemble (step 2 of 4)"."""
        return f"{self.phase} (step {self.number} of {self.of})" if self.number else self.phase

    @property
    def time_left(self) -> str:
        """The seconds left in words; nothing where they are not known."""
        if self.left is None:
            return ""
        to = 1 if self.left < 10 else 5
        return f"about {max(to, to * round(self.left / to))} s left"


def follower(
    steps: Mapping[str, float] = PREPARING, clock: Callable[[], float] = time.monotonic
) -> Callable[[str, float], Step]:
    """Function that makes a `Step` of each report of progress (phase, fraction of it done).

    The time left goes by what was done since these steps began, perhaps not with the first of them.
    """
    names, last = list(steps), Step(phase="")
    group, since, before = "", 0.0, 0.0  # what is followed, since when, and what was done then

    def follow(phase: str, fraction: float) -> Step:
        nonlocal last, group, since, before
        of, _, own = phase.rpartition(": ")
        own, share = SAME.get(own, own), min(max(fraction, 0.0), 1.0)
        number = names.index(own) + 1 if own in steps else 0
        done = sum(steps[name] for name in names[: number - 1]) if number else 0.0
        done += share * steps.get(own, 1.0)
        now, followed = clock(), f"{of}: steps" if number else phase
        if followed != group or done < last.done:
            group, since, before = followed, now, done
        gained = done - before
        left = (now - since) * (1 - done) / gained if gained > LEAST else None
        last = Step(phase=phase, number=number, of=len(names) * bool(number), done=done, left=left)
        return last

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
