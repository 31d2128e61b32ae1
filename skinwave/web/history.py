"""Undo and redo of the controls' values."""

import time

from skinwave.web.controls import Values

TOGETHER = 0.7  # s within which moves of the same controls are one
MOST = 200


class History:
    """Values before and after each move."""

    def __init__(self, values: Values) -> None:
        self._past: list[Values] = []
        self._now = dict(values)
        self._future: list[Values] = []
        self._last: tuple[frozenset[str], float] = (frozenset(), -TOGETHER)

    def push(self, values: Values) -> None:
        """The controls were moved; a slider that is still being drawn makes one step of it."""
        moved = frozenset(key for key in values if values[key] != self._now[key])
        if not moved:
            return
        before, when = self._last
        now = time.monotonic()
        if not (moved == before and now - when < TOGETHER and self._past):
            self._past = [*self._past, self._now][-MOST:]
        self._now, self._future, self._last = dict(values), [], (moved, now)

    def undo(self) -> Values | None:
        """The values before, or None at the beginning."""
        return self._step(self._past, self._future)

    def redo(self) -> Values | None:
        """The values that were undone last, or None."""
        return self._step(self._future, self._past)

    def _step(self, source: list[Values], other: list[Values]) -> Values | None:
        if not source:
            return None
        other.append(self._now)
        self._now, self._last = source.pop(), (frozenset(), 0.0)
        return dict(self._now)

    @property
    def undoable(self) -> bool:
        """Whether there is anything to undo."""
        return bool(self._past)

    @property
    def redoable(self) -> bool:
        """Whether there is anything to redo."""
        return bool(self._future)
