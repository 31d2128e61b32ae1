"""Process that samples the uncertain numbers of a page's scene: after the waves are shown, at the
lowest priority, and only as long as nothing is changed.
"""

import contextlib
import os
import threading
from functools import partial
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

from skinwave.processes import end_group
from skinwave.web.memory import give_back
from skinwave.web.worker import Told, end_with_parent, one_sentence, started

LEAST_PRIORITY = 15
REST = 2.0  # s without a change after which samples are begun: they take a core for seconds
BANDS, FAILED = "bands", "no bands"  # what is told
END = object()  # of what is asked


def sample_forever(pipe: Connection, samples: int) -> None:
    """So many samples of requests (number, scene, response), the newest alone, until the other end
    is closed; None cancels. What is said to it ends what it is at after the sample at hand.

    Sends ("bands", number, Bands), or ("no bands", number, sentence).
    """
    from skinwave.web.bands import Sampler

    end_with_parent()
    with contextlib.suppress(AttributeError, OSError):
        os.nice(LEAST_PRIORITY)
    sampler = Sampler(samples)
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            asked = pipe.recv()
            while pipe.poll(REST):
                asked = pipe.recv()
            if asked is not None:
                _sample(sampler, pipe, *asked)
                give_back()


def _sample(sampler: Any, pipe: Connection, number: int, scene: Any, response: Any) -> None:
    """Bands of one request, until there is another."""
    try:
        for found in sampler(scene, response):
            if pipe.poll():
                return
            if found is not None:
                pipe.send((BANDS, number, found))
    except (ValueError, ArithmeticError, MemoryError) as error:
        pipe.send((FAILED, number, f"no bands: {one_sentence(error) or 'not enough memory'}"))


class BandWorker:
    """The process, begun when it is first asked; `told` is called from a thread of this process
    with what the other one tells.
    """

    def __init__(self, told: Told, samples: int) -> None:
        self._told, self._samples = told, samples
        self._process: Any = None
        self._asked: SimpleQueue[Any] = SimpleQueue()

    def ask(self, number: int, scene: Any, response: Any) -> None:
        """Request bands of a scene about the response of its central values, in place of all that
        was requested before.
        """
        if self._process is None or not self._process.is_alive():
            self._process, pipe = started(partial(sample_forever, samples=self._samples), threads=1)
            self._asked = SimpleQueue()
            for work in (self._listen, self._send):
                threading.Thread(target=work, args=(pipe, self._asked), daemon=True).start()
        self._asked.put((number, scene, response))

    def cancel(self) -> None:
        """Forget what was requested."""
        if self._process is not None:
            self._asked.put(None)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            end_group(self._process.pid)
            self._process.join(5)
        self._process = None

    def _listen(self, pipe: Connection, asked: "SimpleQueue[Any]") -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                self._told(*pipe.recv())
        asked.put(END)

    def _send(self, pipe: Connection, asked: "SimpleQueue[Any]") -> None:
        """Send requests, aside: a pipe takes a response when the other end has read what was
        before it, which may be in the middle of a sample.
        """
        with contextlib.suppress(OSError):
            while (content := asked.get()) is not END:
                pipe.send(content)
