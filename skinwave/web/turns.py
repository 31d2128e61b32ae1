"""Whose turn it is to open: a limited number of pages at a time, a few of them opened at once.

A page asks again every second until it is its turn. One that does not ask any more has been closed,
and leaves the line.
"""

import time

# Pages at a time: 0.28 GB each with the skin slab (0.1 GB, 0.06 GB of the process that computes
# waves and 0.13 GB of that which samples them), measured as what they do not share;
# finite-element bodies take more.
MOST = 12
AT_ONCE = 2  # pages that are opened at a time: more of them wait for each other's imports
FORGOTTEN = 5.0  # s after which a page that does not ask any more has left the line
LONGEST_LINE = 1000
FULL = (
    f"{MOST} pages are open, as many as skinwave allows at a time; this one opens as soon as "
    "another is closed"
)
BUSY = f"Other pages are being opened, {AT_ONCE} at a time; this one opens when it is its turn"


class Turns:
    """Pages that wait, in the order in which they came, that are being opened, and that are there.

    `there` counts those that are being opened, too.
    """

    def __init__(self) -> None:
        self.there = 0
        self.opening = 0
        self._line: dict[str, float] = {}  # when each asked last

    def wait(self, page: str) -> str:
        """Why a page has to wait, in a sentence; nothing if it is its turn."""
        now = time.monotonic()
        self._line = {
            name: asked
            for name, asked in self._line.items()
            if name == page or now - asked < FORGOTTEN
        }
        if page in self._line or len(self._line) < LONGEST_LINE:
            self._line[page] = now
        before = list(self._line).index(page) if page in self._line else LONGEST_LINE
        if before < min(MOST - self.there, AT_ONCE - self.opening):
            return ""
        return f"{FULL if self.there >= MOST else BUSY}{_said(before)}."

    def begin(self, page: str) -> None:
        """A page that has its turn is being opened from now on."""
        self._line.pop(page, None)
        self.there += 1
        self.opening += 1


def _said(before: int) -> str:
    return f" ({before} before it)" if before else ""
