"""Process that computes responses of bodies while a page stays live: newest request first."""

import contextlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import Any

from skinwave.effort import THREADS
from skinwave.processes import end_group, environment, when_parent_ends
from skinwave.steps import Step, follower
from skinwave.web.memory import REST, give_back

Told = Callable[[str, int, Any], None]  # what, number of the request, content
LEAST_STEP = 0.02  # of progress that is told
LEVELS = "levels"  # what is told after a response


def answer_forever(pipe: Connection) -> None:
    """Compute requests (number, scene, moving, variants, base) until the other end is closed.

    Sends ("progress", number, Step), then the response with its number or ("failed", number,
    sentence); and after a response ("levels", number, values) of the variants of its scene, if
    there is no other request before it has them.
    """
    from skinwave.web.waves import BodyResponses

    end_with_parent()
    with contextlib.suppress(AttributeError, OSError):
        os.nice(5)  # the page comes first
    waves = BodyResponses()
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            if not pipe.poll(REST):
                give_back()
            number, scene, moving, variants, base = pipe.recv()
            try:
                found = waves(scene, _teller(pipe, number), moving, base)
            except MemoryError as error:
                pipe.send(
                    ("failed", number, one_sentence(error) or "not enough memory for this body")
                )
            except (ValueError, ArithmeticError, OSError) as error:  # a full disk, say
                pipe.send(("failed", number, one_sentence(error) or type(error).__name__))
            else:
                pipe.send(("answer", number, found))
                _levels(waves, pipe, number, variants)


def _levels(waves: Any, pipe: Connection, number: int, variants: Sequence[Any]) -> None:
    """Sensation levels of the variants of a scene, until there is another request."""
    found = []
    for scene in variants:
        if pipe.poll():
            return
        found.append(waves.level(scene))
    if found:
        pipe.send((LEVELS, number, found))


def idle_cores() -> int:
    """How many cores other work leaves, at least one. More threads than these wait for each other:
    on two cores at a load of 7 a sheet takes 47 s with two threads, and 20 s with one.
    """
    cores = os.cpu_count() or 1
    return max(1, cores - int(os.getloadavg()[0])) if hasattr(os, "getloadavg") else cores


def limits(threads: int) -> dict[str, str]:
    """Environment variables of so many threads; those that the user has set stay. numpy has one:
    products of a move are small, and OpenBLAS keeps cores busy while its threads wait for work. On
    two cores that others use, too, waves of a slab take 110 ms with one thread, 540 ms with two.
    """
    counts = dict.fromkeys(THREADS, str(threads)) | {"OPENBLAS_NUM_THREADS": "1"}
    return {name: count for name, count in counts.items() if name not in os.environ}


def one_sentence(error: Exception) -> str:
    """Words of an error, in one line."""
    return " ".join(str(error).split())


def started(target: Callable[[Connection], None], threads: int) -> tuple[Any, Connection]:
    """A process of a function of a pipe, on so many threads, and this end of the pipe."""
    context = multiprocessing.get_context("spawn")
    pipe, other = context.Pipe()
    process = context.Process(target=target, args=(other,), daemon=True)
    with environment(limits(threads)):
        process.start()
    other.close()
    return process, pipe


def end_with_parent() -> None:
    """In a group of its own, which ends as soon as the page's process does: a mesher that this
    process waits for ends, too.
    """
    with contextlib.suppress(AttributeError, OSError):
        os.setsid()
    when_parent_ends(lambda: end_group(os.getpid()))


def _teller(pipe: Connection, number: int) -> Callable[[str, float], None]:
    from skinwave.web.waves import STEPS

    follow, last = follower(STEPS), Step(phase="")

    def tell(phase: str, fraction: float) -> None:
        nonlocal last
        step = follow(phase, fraction)
        if phase != last.phase or abs(step.done - last.done) > LEAST_STEP:
            last = step
            pipe.send(("progress", number, step))

    return tell


class Worker:
    """The process and the one request that it is at; of those that wait only the newest counts.

    `told` is called from a thread of this process with everything that the other one tells.
    """

    def __init__(self, told: Told) -> None:
        self._told = told
        self._process: Any = None
        self._pipe: Any = None
        self._lock = threading.Lock()
        self._at: int | None = None
        self._waiting: tuple[int, Any, bool, Sequence[Any], Any] | None = None

    def ask(
        self,
        number: int,
        scene: Any,
        moving: bool = False,
        variants: Sequence[Any] = (),
        base: Any = None,
    ) -> None:
        """Request a scene's response; an older request that still waits is forgotten.

        Parameters
        ----------
        number : of the request
        scene : Scene
        moving : whether with the motion of the whole body
        variants : scenes whose sensation levels are computed after it
        base : its body before sliders of its materials were moved, if any were
        """
        with self._lock:
            if self._at is not None:
                self._waiting = (number, scene, moving, variants, base)
                return
            self._start()
            self._send(number, scene, moving, variants, base)

    def cancel(self) -> None:
        """Forget all requests, and end the process if it is at one."""
        with self._lock:
            self._waiting = None
            if self._at is not None:
                self._at = None
                self._end()

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._waiting = self._at = None
            self._end()

    def _start(self) -> None:
        if self._process is not None and self._process.is_alive():
            return
        self._process, self._pipe = started(answer_forever, idle_cores())
        threading.Thread(target=self._listen, args=(self._pipe,), daemon=True).start()

    def _send(self, number: int, *asked: Any) -> None:
        self._at = number
        with contextlib.suppress(OSError):  # it has ended: `_listen` is about to tell
            self._pipe.send((number, *asked))

    def _end(self) -> None:
        if self._process is not None:
            end_group(self._process.pid)
            self._process.join(5)
        self._process = self._pipe = None

    def _listen(self, pipe: Connection) -> None:
        while True:
            try:
                what, number, content = pipe.recv()
            except (EOFError, OSError):
                break
            self._told(what, number, content)
            if what not in ("progress", LEVELS):
                self._next(number)
        with self._lock:
            lost = None
            if pipe is self._pipe:
                lost = self._waiting[0] if self._waiting else self._at
                self._at = self._waiting = self._process = self._pipe = None
        if lost is not None:  # the newest: of an older one nothing is awaited any more
            self._told("failed", lost, "the computing process has ended; choose the body again")

    def _next(self, number: int) -> None:
        with self._lock:
            if self._at != number:
                return
            self._at = None
            if self._waiting is not None:
                waiting, self._waiting = self._waiting, None
                self._send(*waiting)
