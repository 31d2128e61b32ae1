"""Progress on standard error: the steps of preparing a body, and a bar."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from math import inf, isfinite

from skinwave.system.effort import Progress, silent
from skinwave.system.plain_text import printable, say


@dataclass(frozen=True)
class _Bar:
    """Progress callback of a bar, and the function that tells it the seconds of the next phase."""

    show: Progress
    expect: Callable[[float], None]

    def __call__(self, phase: str, fraction: float) -> None:
        self.show(phase, fraction)


@contextmanager
def expecting(progress: Progress, seconds: float | None) -> Iterator[None]:
    """Tell a bar the predicted seconds of the block, if known.

    The bar counts them down until a fraction above 0 is reported.
    """
    expect = progress.expect if isinstance(progress, _Bar) else lambda seconds: None
    expect(inf if seconds is None else seconds)
    yield
    expect(inf)


def announce(progress: Progress, phase: str, fraction: float = 0.0) -> None:
    """Show a phase on a bar only: on a pipe, a refusal of the input is the only line."""
    if isinstance(progress, _Bar):
        progress(phase, fraction)


def step_of(phase: str, fraction: float) -> tuple[str, float]:
    """Return a phase with the number of its step, and the completed share of all steps.

    If the phase is none of the steps, return it with its own completed share.
    """
    # Share of each step in the time, between those of a sheet and of a palm.
    shares = {"mesh": 0.05, "assemble": 0.05, "factorise": 0.20, "reduce": 0.70}
    names, done = list(shares), min(max(fraction, 0.0), 1.0)
    step = phase.rpartition(": ")[2].replace("march", "reduce")
    if step not in shares:
        return phase, done
    number = names.index(step)
    done = sum(shares[name] for name in names[:number]) + done * shares[step]
    return f"{phase} (step {number + 1} of {len(names)})", done


@contextmanager
def progress_callback(progress: Progress | bool | None) -> Iterator[Progress]:
    """Yield a progress callback: the given function, none for False or None, and for True a bar.

    If standard error is not a terminal, a line for each step replaces the bar.
    """
    last = ("", 0.0)
    if progress is not True:
        yield progress or silent
        return
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
    from rich.progress_bar import ProgressBar
    from rich.text import Text

    begun, end, is_expected = time.monotonic(), inf, False  # of the phase, in s

    class Fill(rich.BarColumn):
        """Completed share. A phase that reports none fills the bar by its expected seconds."""

        def render(self, task: rich.Task) -> ProgressBar:
            filled = super().render(task)
            if is_expected:
                filled.completed = min((time.monotonic() - begun) / (end - begun), 1.0)
            return filled

    class Remaining(rich.ProgressColumn):
        """Time until the end that is expected, or that the completed share suggests."""

        def render(self, task: rich.Task) -> Text:
            left = max(0.0, end - time.monotonic())
            text = str(timedelta(seconds=round(left))) if isfinite(left) else "-:--:--"
            return Text(text, style="progress.remaining")

    text = rich.TextColumn("{task.description:<36}", markup=False)
    columns = text, Fill(), rich.TimeElapsedColumn(), Remaining()
    with rich.Progress(*columns, console=Console(stderr=True)) as shown:
        task = shown.add_task("", total=1.0)

        def expect(seconds: float) -> None:
            nonlocal begun, end, is_expected
            is_expected = seconds < inf
            begun = time.monotonic()
            end = begun + seconds

        def show(phase: str, fraction: float) -> None:
            nonlocal last, end, is_expected
            name, done = step_of(phase, fraction)
            if done < last[1]:  # the next body, or a phase after the steps
                shown.reset(task)
            if done < last[1] or not (done or is_expected):
                expect(inf)
            if done and (fraction or not is_expected):
                now = time.monotonic()
                end, is_expected = now + (now - begun) * (1 - done) / done, False
            shown.update(task, description=printable(name, ""), completed=done)
            last = name, done

        yield _Bar(show, expect)
