"""Memory of the processes behind a page: kept between moves, given back once there are none.

A page that is new to a process costs more than what is computed in it, so that the allocator is
told to keep what is freed (`KEEPING`); and what is kept is no growth only if it is given back.
"""

import contextlib
import ctypes

REST = 5.0  # s without a move after which memory is given back
# For glibc: arrays above 8 MiB go back to the system when they are freed. By itself it raises that
# limit to what was freed once, and the heap of a process that runs for hours is fragmented. All
# threads share one heap, for one computes at a time.
KEEPING = {
    "MALLOC_MMAP_THRESHOLD_": str(2**23), "MALLOC_TRIM_THRESHOLD_": str(2**26),
    "MALLOC_ARENA_MAX": "1",
}  # fmt: skip


def give_back() -> None:
    """Give what is freed back to the system, where its C library can."""
    with contextlib.suppress(AttributeError, OSError, TypeError):  # not glibc; Windows
        ctypes.CDLL(None).malloc_trim(0)
