"""Run by `subprocess_call`: a script that ends as soon as the process that started it is gone, and
that gets so many bytes of memory at most, where the platform knows such limits; 0 is no limit.

    python watched.py BYTES SCRIPT ARGUMENT...

That process holds the other end of this one's standard input and writes nothing to it.
"""

import contextlib
import os
import runpy
import signal
import sys
import threading


def main() -> None:
    """Watch, and run SCRIPT."""
    threading.Thread(target=_end_with_input, daemon=True).start()
    _end_with_parent()
    _limit_memory(int(sys.argv[1]))
    sys.argv = sys.argv[2:]
    if (home := os.path.dirname(os.path.dirname(os.path.abspath(__file__)))) not in sys.path:
        sys.path.insert(0, home)  # where these packages are, wherever it was started from
    runpy.run_path(sys.argv[0], run_name="__main__")


def _end_with_input() -> None:
    os.read(0, 1)
    os._exit(1)


def _end_with_parent() -> None:
    """End with the parent by Linux's kernel, also while compiled code blocks all other threads."""
    if sys.platform == "linux":
        import ctypes

        set_parent_death_signal = 1
        ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)


def _limit_memory(most: int) -> None:
    """Limit data, not address space: VTK maps more than a gigabyte that it never touches."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        if most:
            resource.setrlimit(resource.RLIMIT_DATA, (most, most))


if __name__ == "__main__":
    main()
