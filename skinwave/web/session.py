"""One page: the record of what it shows, and what follows when the controls' values change.

Keys of the state are those of `controls`, and what plots, maps and fields show. Nothing here needs
a browser. What a page can do beside turning controls is in `moves`, what it looks like in `layout`.
"""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from skinwave.measurements import Measurement
from skinwave.scene import Body, Scene
from skinwave.web import controls, level_view, model, plots, scenes, shown
from skinwave.web.band_worker import BANDS, FAILED, BandWorker
from skinwave.web.bands import Bands
from skinwave.web.controls import KEYS, STARTS, Values
from skinwave.web.history import History
from skinwave.web.layer_values import rows, with_own_materials
from skinwave.web.levels import Levels
from skinwave.web.memory import REST, give_back
from skinwave.web.model import Answer
from skinwave.web.worker import LEVELS, Worker

SENT = 0.01  # s in which curves are on their way to the page


class Session:
    """Record of what one page shows.

    `good` are the values that the controls had last without a mistake, `number` counts the
    requests to the process that computes the response of a body, `own` is a body from a file,
    `spreads` are those of a file, `samples` how many bands are of, `levels` those over one of the
    controls with its `variants`, if they are shown, and `zoomed` is the part in s of the commanded
    Tacton, if it is not the one that is chosen.
    """

    def __init__(
        self,
        server: Any,
        values: Values | None = None,
        own: Body | None = None,
        spreads: scenes.FileSpreads = scenes.NO_SPREADS,
        samples: int = 0,
    ) -> None:
        self.server, self.state, self.own = server, server.state, own
        self.good = dict(values or STARTS)
        self.history = History(self.good)
        self.spreads = spreads
        self.worker = Worker(self._told_elsewhere)
        self.samples = samples
        self.sampler = BandWorker(self._told_elsewhere, samples)
        self.scene: Any = None
        self.kernel: Answer | None = None
        self.waves: Answer | None = None
        self.published: Answer | None = None
        self.bands: Bands | None = None
        self.pinned: tuple[Answer, ...] = ()
        self.levels: Levels | None = None
        self.variants: tuple[Scene, ...] = ()
        self.measured: Measurement | None = None
        self.number = 0
        self.zoomed: tuple[float, float] | None = None
        self._loop: Any = None
        self._beside: asyncio.TimerHandle | None = None
        self._resting: asyncio.TimerHandle | None = None
        self.state.update({**self.good, **shown.first(own)})
        self.state.client_only("draft", "helped", "hue", "phase")

    @property
    def values(self) -> Values:
        """Values of the controls."""
        return {key: self.state[key] for key in KEYS}

    @property
    def pinned_body(self) -> str:
        """Name of the body that is pinned."""
        return shown.body_named(controls.values_in(self.state.pinned_query)["body"])

    @property
    def answers(self) -> tuple[Answer, ...]:
        """The point kernel's response and, if it is that of the controls, the body's."""
        current = None if self.state.waves_stale else self.waves
        return tuple(answer for answer in (self.kernel, current) if answer)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """From now on tell a page, served by this loop, what the other process tells."""
        self._loop = loop
        if self.scene and self.scene.body.of_kind.discretise:
            self.ask()
        elif self.scene:
            self.ask_bands()

    def ask(self) -> None:
        """Have the other process compute the body's response, if there is a page to tell."""
        if self._loop:
            base = with_own_materials(scenes.body_of(self.good, self.own), self.good["layers"])
            moving = bool(self.state.solid)
            self.worker.ask(self.number, self.scene, moving, self.variants, base)

    def ask_bands(self) -> None:
        """Have the bands of what is shown computed, in a process that comes after all others."""
        if self._loop and self.samples and not self.state.stale:
            self.sampler.ask(self.number, self.scene, self.answers[-1].response)

    def after_curves(self, drawn: Callable[[], None]) -> None:
        """Draw what is beside the curves: once a page has been sent these, unless it is sent
        others before; at once if there is no page.
        """
        if self._beside is not None:
            self._beside.cancel()

        def later() -> None:
            with self.state:
                drawn()

        if self._loop is None:
            drawn()
        else:
            self._beside = self._loop.call_later(SENT, later)

    def rest(self) -> None:
        """Give back the memory of moves unless another one comes."""
        if self._resting is not None:
            self._resting.cancel()
        self._resting = self._loop.call_later(REST, give_back) if self._loop else None

    def _told_elsewhere(self, what: str, number: int, content: Any) -> None:
        """Messages of the other process, brought to where the page is served."""
        if self._loop is None:
            return

        def here() -> None:
            with self.state:
                told(self, what, number, content)

        self._loop.call_soon_threadsafe(here)


def take(session: Session, values: Values | None) -> None:
    """Show other values, all of which are right; nothing happens if there are none."""
    if values is not None:
        put(session, values)
        session.state.update({"errors": {}, "typed": {}})
        refresh(session)


def put(session: Session, values: Values) -> None:
    """Set the controls, without computing a response."""
    session.good = {key: values[key] for key in KEYS}
    session.state.update(session.good)


def refresh(session: Session) -> None:
    """Compute the response to the controls: the point kernel at once, a body in its process."""
    state = session.state
    try:
        session.scene = scenes.scene_of(session.good, session.own, session.spreads)
        session.kernel = model.kernel(session.scene)
        session.published = model.as_published(session.scene) if state.published else None
    except ValueError as error:
        state.update({"problem": str(error), "stale": True})
        return
    session.number += 1
    session.bands = None
    session.sampler.cancel()
    waiting = session.scene.body.of_kind.discretise is not None
    if not waiting:
        session.worker.cancel()
        session.waves = None
    state.update({
        "problem": "", "stale": False, "waves_stale": waiting,
        "query": controls.to_query(session.good),
        "drawing_frequency": session.scene.tacton.drawing_frequency,
        "undoable": session.history.undoable, "redoable": session.history.redoable,
        "busy": (state.busy or ("" if session.waves else "starting")) if waiting else "",
        "left": state.left if waiting and state.busy else "",
    })  # fmt: skip
    state.body_layers = rows(scenes.body_of(session.good, session.own), session.good["layers"])
    vary(session)
    if waiting:
        session.ask()  # the other process computes while this one draws
    draw(session)
    if not waiting:
        session.ask_bands()


def vary(session: Session) -> None:
    """Levels of the kernel over a control, if that is what the third plot shows."""
    session.levels, session.variants = None, ()
    if (view := session.state.third) in level_view.LEVELS:
        given = session.good, session.own, session.spreads
        session.levels, session.variants = level_view.variants(view, *given)


def told(session: Session, what: str, number: int, content: Any) -> None:
    """Take a message of a process that computes the response of a body, or its bands."""
    state = session.state
    if what == "progress":
        if session.good["body"] != "none":  # else told before it was cancelled
            state.update({"busy": content.name, "done": round(100 * content.done),
                          "left": content.time_left})  # fmt: skip
    elif number != session.number:
        return  # an older request's
    elif what == "failed":
        session.waves = None
        state.update({"busy": "", "problem": content, "waves_stale": False})
        draw(session)
    elif what == "answer":
        session.waves = content
        state.update({"busy": "", "waves_stale": False})
        if len(session.pinned) == 1 and state.pinned_query == state.query:
            session.pinned = session.answers  # it was pinned before its waves were there
        draw(session)
        solid(session)  # which may have been asked for in the meantime
        if session.bands is None:
            session.ask_bands()
    elif what == LEVELS and session.levels and len(content) == len(session.levels.at):
        session.levels = replace(session.levels, waves=np.array(content))
        draw(session)
    elif what == BANDS:
        session.bands = content
        draw(session)
    elif what == FAILED:
        state.uncertainty = [content]


def solid(session: Session) -> None:
    """Have the motion of the whole body computed, too, if it is to be seen and is not there."""
    if session.state.solid and session.waves is not None and session.waves.moving is None:
        session.ask()


def draw(session: Session) -> None:
    """Draw all that is seen, from the responses there are: curves first, and what is beside them
    once they are on their way.
    """
    session.rest()
    if session.kernel is not None:
        curves = plots.Curves(
            kernel=session.kernel, waves=session.waves, published=session.published,
            pinned=session.pinned, bands=session.bands, stale=bool(session.state.waves_stale),
            levels=session.levels, measured=session.measured,
            body=shown.body_named(session.good["body"]), pinned_body=session.pinned_body,
        )  # fmt: skip
        shown.commanded(session.state, session.scene, session.zoomed)
        shown.plotted(session.state, session.scene, curves)
        session.after_curves(partial(_beside, session, curves))


def _beside(session: Session, curves: plots.Curves) -> None:
    """Maps, table and sentences beside the curves."""
    shown.answers(session.state, session.scene, curves)
    session.state.differs = (
        shown.differs(controls.values_in(session.state.pinned_query), session.good)
        if session.pinned
        else []
    )
