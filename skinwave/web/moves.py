"""Actions of a page on its session: controls, presets, undo, pinning, zooming, opening a scene.

`connect` binds each to a key of the state or to a trigger. Doing the same without a browser is
calling them, or setting a key, within `with session.state:`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from simple_model.choices import choose
from skinwave.scene_file import loads
from skinwave.web import controls, measured, model, scenes, shown
from skinwave.web.asked import numbers
from skinwave.web.controls import KEYS, NUMBERS, OWN_BODY, Values
from skinwave.web.downloads import offered
from skinwave.web.examples import EXAMPLES
from skinwave.web.history import History
from skinwave.web.layer_values import PARTS, text_of
from skinwave.web.level_view import LEVELS
from skinwave.web.paths import STARTS_AT, fitted
from skinwave.web.session import Session, draw, put, refresh, solid, take, vary

SHORTEST = 1e-4  # s that the commanded Tacton is zoomed to
LIKE = 20.0  # mm: paths of several foci begin no larger, to have place beside each other
LARGEST_FILE = 1_000_000  # bytes of a scene that a page sends


def connect(session: Session) -> None:
    """Have a page's session follow what is done on it, and compute its first response."""
    watched: tuple[tuple[Callable[[Session], None], tuple[str, ...]], ...] = (
        (controlled, KEYS), (hold, ("hold",)),
        (look, ("span", "highest", "third", "decibel", "against")),
        (solid, ("solid",)), (opened, ("opened",)),
        (published, ("published",)), (measurement, ("measured_file",)),
    )  # fmt: skip
    for answered, keys in watched:
        session.state.change(*keys)(_without_state(answered, session))
    for move in (
        entered, select, restart, zoom, follow, own_path, own_layer, preset, undo, redo, pin,
        exchange, cancel, highest_level, example,
    ):  # fmt: skip
        session.server.trigger(move.__name__)(partial(move, session))
    for name, made in offered(session).items():
        session.server.trigger(name)(made)
    refresh(session)


def controlled(session: Session) -> None:
    """A control has moved."""
    moved = {key for key in KEYS if session.state[key] != session.good[key]}
    if moved:
        turn(session, {key: session.state[key] for key in moved})


def turn(session: Session, given: Values, whole: bool = False) -> None:
    """Set controls; what is refused is marked at its field, which keeps what was typed, for it may
    be half of a number. A `whole` Tacton brings its own drawing frequency, constant from then.
    """
    state = session.state
    accepted, errors, typed = _checked(session, given)
    values = session.good | accepted
    if values["body"] != session.good["body"] and "layers" not in accepted:
        values["layers"] = ""  # those of the body before
    for key in ("foci", "paths"):
        if key in accepted:
            values = controls.with_its_paths(values, key)
    if values["paths"] != session.good["paths"]:  # what was typed of paths is not there any more
        errors.pop("paths", None)
        typed.pop("paths", None)
    moved = [key for key in ("shape", "size", "speed") if key in accepted]
    if state.hold and moved and not whole and not values["paths"]:
        try:
            values |= scenes.held(values, moved[-1], state.held_frequency)
            errors.pop("hold", None)
        except ValueError as error:
            errors["hold"] = f"the drawing frequency cannot be kept constant: {error}"
    state.update({"errors": errors, "typed": typed})
    put(session, values)
    session.history.push(values)
    if accepted:
        refresh(session)
    if whole:
        hold(session)


def _checked(session: Session, given: Values) -> tuple[Values, dict[str, str], dict[str, str]]:
    """Accepted values; errors and typed texts of each field, with those from before."""
    accepted: Values = {}
    errors, typed = dict(session.state.errors), dict(session.state.typed)
    for key, value in given.items():
        try:
            accepted[key] = controls.checked(key, value)
            errors.pop(key, None)
            typed.pop(key, None)
        except ValueError as error:
            errors[key], typed[key] = str(error), str(value)
    return accepted, errors, typed


def entered(session: Session, key: str, given: Any) -> None:
    """Set the control of a field in which something was typed."""
    turn(session, {choose("control", str(key), KEYS): given})


def follow(session: Session, own: str) -> None:
    """The foci follow paths of their "own", which begin like the one that they followed, or one."""
    values, text = session.good, ""
    if own == "own":
        size = 0.0 if values["shape"] == "point" else min(values["size"], LIKE)
        x, y = STARTS_AT[0]
        text = fitted(f"{values['shape']}/{size:g}/{x}/{y}", values["foci"])
    turn(session, {"paths": text})


def own_path(session: Session, which: int, part: int, given: str) -> None:
    """Set the shape, size, x or y (`part` 0 to 3) of one of the paths."""
    text = session.state.typed.get("paths", session.good["paths"])
    parts = [path.strip().split("/") for path in text.split(",") if path.strip()]
    which, part = map(int, numbers(which, part))
    if not (0 <= which < len(parts) and 0 <= part < len(parts[which])):
        return  # left out while the change was on its way
    parts[which][part] = str(given).strip().replace(",", ".").replace("/", "")
    turn(session, {"paths": ", ".join("/".join(path) for path in parts)})


def own_layer(session: Session, which: int, part: str, given: str) -> None:
    """Set the "thickness" in mm, shear "modulus" in kPa or "loss" factor of one of the body's
    layers.
    """
    rows, (which,) = session.state.body_layers, map(int, numbers(which))
    if not 0 <= which < len(rows):
        return  # of a body that is not shown any more
    part = choose("part of a layer", str(part), PARTS)
    values = [{name: row[name] for name in PARTS} for row in rows]
    values[which][part] = str(given).strip().replace(",", ".").replace("/", "")
    turn(session, {"layers": text_of([[row[name] for name in PARTS] for row in values])})


def select(session: Session, x: float, y: float) -> None:
    """Select the point of the area at x and y in mm."""
    limit = NUMBERS["x"].high
    x, y = numbers(x, y)
    at = {"x": round(x, 2), "y": round(y, 2)}
    turn(session, {key: min(max(value, -limit), limit) for key, value in at.items()})


def preset(session: Session, name: str) -> None:
    """Take one of the paper's Tactons."""
    known = controls.presets()
    turn(session, known[choose("preset", str(name), tuple(known))], whole=True)


def restart(session: Session, query: str = "") -> None:
    """Begin anew with what an address says."""
    values, refused = controls.from_query(str(query), session.own is not None)
    session.pinned, session.history = (), History(values)
    session.state.update({"hold": False, "pinned": False, "problem": ""})
    take(session, values)
    if refused and not session.state.problem:
        session.state.problem = "; ".join(refused)


def undo(session: Session) -> None:
    """Back to the values before the last move."""
    take(session, session.history.undo())


def redo(session: Session) -> None:
    """Forward again."""
    take(session, session.history.redo())


def pin(session: Session) -> None:
    """Keep what is shown, to compare with; or let go of what was kept."""
    session.pinned = () if session.pinned else session.answers
    if session.pinned:
        session.state.solid = False  # maps of both stand beside each other
        session.state.pinned_query = controls.to_query(session.values)
        session.state.pinned_path = session.state.path
    session.state.pinned = bool(session.pinned)
    draw(session)


def exchange(session: Session) -> None:
    """Go to what is pinned, and pin what was shown instead."""
    back, kept = session.state.pinned_query, controls.to_query(session.values)
    session.pinned = session.answers
    session.state.update({"pinned_query": kept, "pinned_path": session.state.path})
    take(session, controls.values_in(back))


def cancel(session: Session) -> None:
    """Stop computing waves, and show none."""
    session.worker.cancel()
    session.number += 1
    session.state.update({"busy": "", "body": "none"})
    turn(session, {"body": "none"})


def zoom(session: Session, start: float | None = None, end: float | None = None) -> None:
    """The commanded Tacton between two times in ms; without any, as it was."""
    if start is None or end is None:
        session.zoomed = None
    else:
        start, end = (given / 1e3 for given in numbers(start, end))
        last = session.scene.tacton.duration
        wide = min(max(end - start, SHORTEST), last)
        start = min(max(0.0, start), last - wide)
        session.zoomed = (start, start + wide)
    shown.commanded(session.state, session.scene, session.zoomed)


def hold(session: Session) -> None:
    """From now on the drawing frequency stays as it is, or does not."""
    state = session.state
    if state.hold and session.scene:
        state.held_frequency = session.scene.tacton.drawing_frequency
    elif not state.hold:
        state.errors = {key: said for key, said in state.errors.items() if key != "hold"}


def published(session: Session) -> None:
    """The kernel as published is to be seen beside the others, or is not."""
    wanted = session.state.published and session.scene
    session.published = model.as_published(session.scene) if wanted else None
    draw(session)


def look(session: Session) -> None:
    """Another view of the same response is to be seen."""
    session.zoomed = None
    if session.state.third != (session.levels.view if session.levels else ""):
        vary(session)
        if session.variants and session.scene.body.of_kind.discretise:
            session.ask()
    draw(session)


def highest_level(session: Session) -> None:
    """Set the control, over which levels are shown, to the value with the highest."""
    if session.levels is not None and session.levels.best is not None:
        key = LEVELS[session.levels.view][0]
        turn(session, {key: round(session.levels.best, 2)})


def example(session: Session, name: str) -> None:
    """Take a worked example, in the view that shows what it says; what is pinned stays."""
    one = EXAMPLES[choose("example", str(name), tuple(EXAMPLES))]
    session.state.update({"solid": one.solid, "layers_open": one.layers, "against": False})
    turn(session, controls.from_query(one.query)[0], whole=True)


def measurement(session: Session) -> None:
    """A file of a measurement was chosen or dropped: shown beside the models, or taken away."""
    given = session.state.measured_file
    if not given:
        if session.measured is not None and given is not None:
            session.measured = None
            draw(session)
        return
    try:
        session.measured = measured.read(*_sent(given))
    except ValueError as error:
        session.state.problem = f"the measurement cannot be read: {error}"
        return
    session.state.problem = ""
    draw(session)


def opened(session: Session) -> None:
    """A scene file was chosen on the page."""
    given = session.state.opened
    if not given:
        return
    session.state.opened = None
    _, content = _sent(given)
    if len(content) > LARGEST_FILE:
        session.state.problem = (
            f"the scene cannot be opened: a file of {len(content) / 1e6:.3g} MB exceeds "
            f"{LARGEST_FILE / 1e6:g} MB, far more than a scene needs"
        )
        return
    open_scene(session, content.decode("utf-8", "replace"))


def _sent(given: Any) -> tuple[str, bytes]:
    """Name and content of a file that a browser has sent."""
    one = given[0] if isinstance(given, list) else given
    content = one.get("content", b"")
    return str(one.get("name", "")), content if isinstance(content, bytes) else b"".join(content)


def open_scene(session: Session, text: str) -> None:
    """Take the scene of a TOML text; say why if it cannot be."""
    try:
        scene = loads(text)
        values = scenes.values_of(scene)
        if scene.body.file:
            raise ValueError("a body from a file cannot be opened in a page; name the scene "
                             "on the command line")  # fmt: skip
    except ValueError as error:
        session.state.problem = f"the scene cannot be opened: {error}"
        return
    session.own = scene.body if values["body"] == OWN_BODY else session.own
    session.spreads = scenes.spreads_in(scene, values)
    session.state.bodies = shown.bodies(session.own)
    turn(session, values, whole=True)


def _without_state(follow: Callable[[Session], None], session: Session) -> Callable[..., None]:
    """A follower of keys, which is handed the whole state and takes it from its session."""
    return lambda **_: follow(session)
