"""Standard output whose reader is gone or whose disk is full, and errors of the system in words."""

import errno
import functools
import os
import select
import sys
from collections.abc import Callable, Sequence
from typing import TextIO

CLOSED = 141  # 128 + SIGPIPE, as a shell has it of `yes | head -1`
CURES = {
    errno.ENOSPC: "make room there",
    errno.EDQUOT: "make room there",
    errno.EFBIG: "make room there",
    errno.EACCES: "check its permissions or choose another place",
    errno.EPERM: "check its permissions or choose another place",
    errno.EROFS: "choose another place",
}

Main = Callable[..., int]


def flushed(main: Main) -> Main:
    """A main function after which nothing is left to write; if that cannot be written, it ends
    quietly with 141 when nobody reads any more, and else with a sentence and 2.
    """

    @functools.wraps(main)
    def ended(arguments: Sequence[str] | None = None) -> int:
        try:
            code = main(arguments)
        except SystemExit as stop:
            if failed := _unwritten():
                raise SystemExit(failed) from None
            raise stop
        return _unwritten(said=code != 0) or code

    return ended


def reader_gone(error: BaseException) -> bool:
    """Whether an error says that nobody reads our standard output or our messages any more."""
    if not isinstance(error, BrokenPipeError):
        return False
    gone = [stream for stream in (sys.stdout, sys.stderr) if stream and _is_closed(stream)]
    for stream in gone:
        _drop(stream)
    return bool(gone)


def explained(error: OSError) -> str:
    """Message for an error of the system, with the place and a cure, which its own text lacks."""
    if not error.strerror:
        return str(error)
    place = error.filename if error.filename is not None else "standard output or a file"
    cure = CURES.get(error.errno or 0, "check its name and place")
    return f"{place} cannot be read or written ({error.strerror}); {cure}"


def _unwritten(said: bool = False) -> int:
    """Write what is left; an exit code if that fails, 0 if not. What was `said` is not repeated."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except BrokenPipeError:
        _drop(sys.stdout)
        return CLOSED
    except OSError as error:
        _drop(sys.stdout)
        if not said:
            sentence = (
                f"standard output cannot be written ({error.strerror}); make room or redirect it"
            )
            print(f"skinwave: {sentence}", file=sys.stderr)
        return 2
    return 0


def _is_closed(stream: TextIO) -> bool:
    try:
        stream.flush()
        number = stream.fileno()
    except BrokenPipeError:
        return True
    except (OSError, ValueError):  # not a stream of the system
        return False
    if not hasattr(select, "poll"):
        return False
    poll = select.poll()
    poll.register(number, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))


def _drop(stream: TextIO) -> None:
    """Let what is left of a stream go nowhere, when the interpreter flushes it at its end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
