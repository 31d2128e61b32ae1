"""One page: its state, and what happens when a control moves. The layout is in `layout`.

Keys of the state are those of `controls`, and what plots, maps and fields show. Nothing here needs
a browser: setting a key within `with session.state:` does what a page would.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from skinwave.scene import Body
from skinwave.scene_file import loads
from skinwave.web import controls, model, scenes, shown
from skinwave.web.controls import KEYS, NUMBERS, OWN_BODY, STARTS, Values
from skinwave.web.downloads import offered
from skinwave.web.history import History
from skinwave.web.model import Answer
from skinwave.web.worker import Worker

PLOTTED = ("span", "highest")
SHORTEST = 1e-4  # s that the commanded Tacton is zoomed to
LARGEST_FILE = 1_000_000  # bytes of a scene that a page sends


class Session:
    """What one page shows."""

    def __init__(self, server: Any, values: Values | None = None, own: Body | None = None) -> None:
        self.server, self.state, self.own = server, server.state, own
        self.history = History(values or STARTS)
        self.worker = Worker(self._told_elsewhere)
        self.kernel: Answer | None = None
        self.waves: Answer | None = None
        self.pinned: tuple[Answer, ...] = ()
        self.scene: Any = None
        self._number = 0
        self._good = dict(values or STARTS)
        self._zoom: tuple[float, float] | None = None
        self._loop: Any = None
        self.state.update({**STARTS, **(values or {}), **shown.first(own)})
        self.state.change(*KEYS)(self.on_control)
        self.state.change("hold")(self.on_hold)
        self.state.change(*PLOTTED)(self.on_look)
        self.state.change("phase")(self.on_phase)
        self.state.change("solid")(self.on_solid)
        self.state.change("opened")(self.on_file)
        for name in ("select", "restart", "zoom"):
            server.trigger(name)(getattr(self, name))
        for name, made in offered(self).items():
            server.trigger(name)(made)
        self.refresh()

    @property
    def values(self) -> Values:
        """What the controls say."""
        return {key: self.state[key] for key in KEYS}

    # What a page does

    def on_control(self, **_: Any) -> None:
        """A control has moved."""
        moved = {key for key in KEYS if self.state[key] != self._good[key]}
        if moved:
            self.turn({key: self.state[key] for key in moved})

    def turn(self, given: Values, whole: bool = False) -> None:
        """Set controls; what is refused is marked at its field, which keeps what was typed, for it
        may be half of a number. A `whole` Tacton brings its own drawing frequency, held from then.
        """
        errors, typed, accepted = dict(self.state.errors), dict(self.state.typed), {}
        for key, value in given.items():
            try:
                accepted[key] = controls.checked(key, value)
                errors.pop(key, None)
                typed.pop(key, None)
            except ValueError as error:
                errors[key], typed[key] = str(error), str(value)
        values = self._good | accepted
        moved = [key for key in ("shape", "size", "speed") if key in accepted]
        if self.state.hold and moved and not whole:
            try:
                values |= scenes.held(values, moved[-1], self.state.held_frequency)
                errors.pop("hold", None)
            except ValueError as error:
                errors["hold"] = f"the drawing frequency cannot be held: {error}"
        self.state.update({"errors": errors, "typed": typed})
        self._set(values)
        self.history.push(values)
        if accepted:
            self.refresh()
        if whole:
            self.on_hold(self.state.hold)

    def select(self, x: float, y: float) -> None:
        """Select the point of the area at x and y in mm."""
        limit = NUMBERS["x"].high
        at = {"x": round(float(x), 2), "y": round(float(y), 2)}
        self.turn({key: min(max(value, -limit), limit) for key, value in at.items()})

    def preset(self, name: str) -> None:
        """Take one of the paper's Tactons."""
        self.turn(controls.presets()[name], whole=True)

    def restart(self, query: str = "") -> None:
        """Begin anew with what an address says."""
        values, refused = controls.from_query(query, self.own is not None)
        self.pinned, self.history = (), History(values)
        self.state.update({"hold": False, "pinned": False, "problem": ""})
        self._take(values)
        if refused and not self.state.problem:
            self.state.problem = "; ".join(refused)

    def undo(self) -> None:
        """Back to the values before the last move."""
        self._take(self.history.undo())

    def redo(self) -> None:
        """Forward again."""
        self._take(self.history.redo())

    def pin(self) -> None:
        """Keep what is shown, to compare with; or let go of what was kept."""
        self.pinned = (
            () if self.pinned else tuple(a for a in (self.kernel, self.current_waves) if a)
        )
        if self.pinned:
            self.state.pinned_query = controls.to_query(self.values)
        self.state.pinned = bool(self.pinned)
        self.draw()

    def take_pinned(self) -> None:
        """Go to what is pinned, and pin what was shown instead."""
        back, kept = self.state.pinned_query, controls.to_query(self.values)
        self.pinned = tuple(a for a in (self.kernel, self.current_waves) if a)
        self.state.pinned_query = kept
        self._take(controls.from_query(back, self.own is not None)[0])

    def cancel(self) -> None:
        """Stop computing waves, and show none."""
        self.worker.cancel()
        self._number += 1
        self.state.update({"busy": "", "body": "none"})
        self.turn({"body": "none"})

    def zoom(self, start: float | None = None, end: float | None = None) -> None:
        """The commanded Tacton between two times in ms; without any, as it was."""
        if start is None or end is None:
            self._zoom = None
        else:
            last = self.scene.tacton.duration
            start = min(max(0.0, start / 1e3), last - SHORTEST)
            self._zoom = (start, min(max(end / 1e3, start + SHORTEST), last))
        shown.commanded(self.state, self.scene, self._zoom)

    def on_hold(self, hold: bool, **_: Any) -> None:
        """From now on the drawing frequency stays as it is."""
        if hold and self.scene:
            self.state.held_frequency = self.scene.tacton.trajectory.drawing_frequency
        elif not hold:
            self.state.errors = {k: v for k, v in self.state.errors.items() if k != "hold"}

    def on_phase(self, **_: Any) -> None:
        """The foci are to be seen elsewhere on their path."""
        shown.foci(self.state, self.scene)

    def on_look(self, **_: Any) -> None:
        """Something else is to be seen of the same answer."""
        self._zoom = None
        self.draw()

    def on_solid(self, solid: bool, **_: Any) -> None:
        """The body is to be seen moving: only then is its motion computed."""
        if solid and self.waves is not None and self.waves.moving is None:
            self._ask()

    def on_file(self, opened: Any = None, **_: Any) -> None:
        """A scene file was chosen on the page."""
        if not opened:
            return
        one = opened[0] if isinstance(opened, list) else opened
        content = one.get("content", b"")
        content = content if isinstance(content, bytes) else b"".join(content)
        self.state.opened = None
        if len(content) > LARGEST_FILE:
            self.state.problem = (
                f"the scene cannot be opened: a file of {len(content) / 1e6:.3g} MB exceeds "
                f"{LARGEST_FILE / 1e6:g} MB, far more than a scene needs"
            )
            return
        self.open_scene(content.decode("utf-8", "replace"))

    def open_scene(self, text: str) -> None:
        """Take the scene of a TOML text; say why if it cannot be."""
        try:
            scene = loads(text)
            values = scenes.values_of(scene)
            if scene.body.file:
                raise ValueError("a body from a file cannot be opened in a page; name the scene "
                                 "on the command line")  # fmt: skip
        except ValueError as error:
            self.state.problem = f"the scene cannot be opened: {error}"
            return
        self.own = scene.body if values["body"] == OWN_BODY else self.own
        self.state.bodies = shown.bodies(self.own)
        self.turn(values, whole=True)

    # What follows from a move

    def refresh(self) -> None:
        """Answer the controls: the point kernel at once, a body when its process has."""
        try:
            self.scene = scenes.scene_of(self._good, self.own)
            self.kernel = model.kernel(self.scene)
        except ValueError as error:
            self.state.update({"problem": str(error), "stale": True})
            return
        self._number += 1
        query = controls.to_query(self._good)
        waiting = self.scene.body.kind != "none"
        if not waiting:
            self.worker.cancel()
            self.waves = None
        self.state.update({
            "problem": "", "stale": False, "waves_stale": waiting, "query": query,
            "drawing_frequency": self.scene.tacton.trajectory.drawing_frequency,
            "undoable": self.history.undoable, "redoable": self.history.redoable,
            "busy": (self.state.busy or ("" if self.waves else "starting")) if waiting else "",
        })  # fmt: skip
        self.draw()
        if waiting:
            self._ask()

    def told(self, what: str, number: int, content: Any) -> None:
        """The process that answers with a body has something to tell."""
        newest = number == self._number
        if what == "progress":
            if self._good["body"] == "none":
                return  # told before it was cancelled
            phase, done = content
            self.state.update({"busy": phase, "done": round(100 * max(0.0, min(1.0, done)))})
        elif what == "failed" and newest:
            self.waves = None
            self.state.update({"busy": "", "problem": content, "waves_stale": False})
            self.draw()
        elif what == "answer" and newest:
            self.waves = content
            self.state.update({"busy": "", "waves_stale": False})
            self.draw()
            self.on_solid(self.state.solid)  # which may have been asked for in the meantime

    def draw(self) -> None:
        """All that is seen, from the answers there are."""
        if self.kernel is not None:
            shown.commanded(self.state, self.scene, self._zoom)
            shown.foci(self.state, self.scene)
            shown.answers(self.state, self.scene, self.kernel, self.waves, self.pinned)

    @property
    def current_waves(self) -> Answer | None:
        """The body's answer, if it is that of the controls."""
        return None if self.state.waves_stale else self.waves

    def _take(self, values: Values | None) -> None:
        if values is not None:
            self._set(values)
            self.state.update({"errors": {}, "typed": {}})
            self.refresh()

    def _set(self, values: Values) -> None:
        self._good = {key: values[key] for key in KEYS}
        self.state.update(self._good)

    def _told_elsewhere(self, what: str, number: int, content: Any) -> None:
        """What the other process tells, brought to where the page is served."""
        if self._loop is None:
            return

        def here() -> None:
            with self.state:
                self.told(what, number, content)

        self._loop.call_soon_threadsafe(here)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """From now on tell a page, served by this loop, what the other process tells."""
        self._loop = loop
        if self.scene and self.scene.body.kind != "none":
            self._ask()

    def _ask(self) -> None:
        if self._loop:
            self.worker.ask(self._number, self.scene, bool(self.state.solid))


def setter(session: Session, key: str) -> Callable[[Any], None]:
    """What a field of a control calls with what was typed."""
    return lambda given: session.turn({key: given})
