"""Limits of models, the changes of a scene that bring it within them, and refusals.

A model lists its `Limit`s of a scene. It takes the scene if there are none. A refusal names only
models that take the scene, and changes after which a model takes it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from simple_model import MovingPressure
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.analytic import is_laterally_infinite
from skinwave.bodies.body import Body
from skinwave.bodies.sheet import open_air
from skinwave.models import Limit, Model, named, names
from skinwave.scene.load import PRESSURE
from skinwave.scene.scene import Scene

# Models in the order in which advice names them: from rest first, then those of the steady state.
ADVISED = (
    "fem", "flat-body", "plate-modes-transient", "fem-transient", "fem-nonlinear",
    "plate-modes-nonlinear", "fem-nonlinear-transient", "fem-harmonic", "flat-body-harmonic",
    "plate-modes",
)  # fmt: skip
MOST_CURES = 2  # in one sentence


@dataclass(frozen=True, kw_only=True, eq=False)
class Cure:
    """Cure of a refusal: the `scene` that the `model` takes, and how to change it in words; "" for
    the scene as it is.
    """

    words: str
    scene: Scene
    model: str


class Refused(ValueError):
    """A scene that a model does not take; `cures` are those that the message names."""

    def __init__(self, message: str, cures: Sequence[Cure] = ()) -> None:
        super().__init__(message)
        self.cures = tuple(cures)


def beyond(model: Model, scene: Scene) -> list[Limit]:
    """Limits of a model that a scene is beyond."""
    if model.needs_body and not scene.body.of_kind.discretise:
        return [Limit(why="moves a body, and this scene has none")]
    return [*(model.limits or plain_only)(scene)]


def takes(model: Model, scene: Scene) -> bool:
    """Whether a model takes a scene: its body, its load, and the quantity that its probes read."""
    return not beyond(model, scene)


def takers(scene: Scene) -> list[str]:
    """Names of the models that take a scene, the preferred first."""
    return [model.name for model in _meant_for(scene) if takes(model, scene)]


def _meant_for(scene: Scene) -> list[Model]:
    """Models of what a scene's probes read. None leaves out the sides of a body if they reflect."""
    has_body = bool(scene.body.of_kind.discretise)
    bounded = has_body and not is_laterally_infinite(scene.body)
    known = (named(name) for name in (*ADVISED, *(n for n in names() if n not in ADVISED)))
    return [
        model for model in known
        if not (model.quantity and has_body) and not (model.is_infinite and bounded)
    ]  # fmt: skip


def default_model(scene: Scene) -> str:
    """The first model that takes a scene; raises `Refused` if none does."""
    if found := takers(scene):
        return found[0]
    raise no_model(scene)


def check_taken(model: Model, scene: Scene) -> None:
    """Raise `Refused` with limits and cures for a scene that a model does not take."""
    if found := beyond(model, scene):
        raise refusal(scene, model, found)


def refusal(scene: Scene, model: Model, found: Sequence[Limit]) -> Refused:
    """Refusal of a scene by a model, for the limits that it is beyond, with what helps."""
    others = [name for name in takers(scene) if name != model.name][:MOST_CURES]
    own = _changed(scene, model, found)
    cures = [*own, *(Cure(words="", scene=scene, model=name) for name in others)]
    return _with_cures(_why(model, found), cures or _of_any(scene), model.name)


def no_model(scene: Scene) -> Refused:
    """Refusal of a scene that no model takes, with the changes after which one does."""
    cures = _of_any(scene)
    near = [named(cure.model) for cure in cures] or _meant_for(scene)[:1]
    whys = ", and ".join(_why(model, beyond(model, scene)) for model in near)
    return _with_cures(f"no model takes this scene: {whys}", cures, "auto")


def cures_for(scene: Scene, model: Model) -> list[Cure]:
    """How to have a scene computed by a model: as it is, or after a change if there is one."""
    if takes(model, scene):
        return [Cure(words="", scene=scene, model=model.name)]
    return [*_changed(scene, model, beyond(model, scene))]


def in_words(cures: Sequence[Cure], asked: str) -> str:
    """Cures in words, for a model that was asked for, or "auto"."""
    plain = [cure.model for cure in cures if not cure.words]
    changes = [
        cure.words + f" and use --model {cure.model}" * (asked not in (cure.model, "auto"))
        for cure in cures
        if cure.words
    ]
    use = [f"use --model {' or '.join(plain)}"] if plain else []
    *first, last = *changes, *use
    return f"{', '.join(first)}, or {last}" if first else last


def _why(model: Model, found: Sequence[Limit]) -> str:
    return f"{model.name} {', and '.join(limit.why for limit in found)}"


def _of_any(scene: Scene) -> list[Cure]:
    """Changes of a scene after which one of the models takes it."""
    found: dict[str, Cure] = {}
    for model in _meant_for(scene):
        for cure in _changed(scene, model, beyond(model, scene)):
            found.setdefault(cure.words, cure)
    return [*found.values()][:MOST_CURES]


def _changed(scene: Scene, model: Model, found: Sequence[Limit]) -> Iterator[Cure]:
    """The change of a scene that brings it within all limits of a model, if there is one."""
    changed = scene
    try:
        for limit in found:
            if limit.change is None:
                return
            changed = limit.change(changed)
        taken = takes(model, changed)
    except ValueError:  # changes that contradict what else the scene has
        return
    if taken:
        words = " and ".join(dict.fromkeys(limit.cure for limit in found))
        yield Cure(words=words, scene=changed, model=model.name)


def _with_cures(why: str, cures: Sequence[Cure], asked: str) -> Refused:
    return Refused(f"{why}; {in_words(cures, asked)}" if cures else why, cures)


def of_body(**values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of a scene's body."""
    return lambda scene: replace(scene, body=replace(scene.body, **values))


def of_part(part: str, **values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of the `solid`, the mounting or the placement of a scene's body."""
    name = "material" if part == "solid" else part
    return lambda scene: of_body(**{name: replace(getattr(scene.body, part), **values)})(scene)


def reading_limit(scene: Scene) -> Limit:
    """Limit of a model that has not what a scene's probes read."""
    return Limit(
        why=f"has no {scene.reading.words}",
        cure="ask for the displacement at the surface",
        change=read_at_surface,
    )


def read_at_surface(scene: Scene) -> Scene:
    """The scene whose probes read the displacement at the surface."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0)


def load_limit(scene: Scene) -> Limit:
    """Limit of a model that takes the pressure of a focus alone."""
    return Limit(
        why=f"takes the pressure of a focus alone, not {scene.load.words}",
        cure="leave out [load]",
        change=_under_pressure,
    )


def _under_pressure(scene: Scene) -> Scene:
    """The scene without [load]: a load that no device makes leaves its Tacton."""
    made = scene.load.of_kind.is_of_device
    pressure = scene.pressure if made else MovingPressure(tacton=scene.tacton)
    return replace(scene, load=PRESSURE, pressure=pressure)


def plain_only(scene: Scene) -> Iterator[Limit]:
    """Limits of a model of the displacement of the surface under the pressure of a focus."""
    if not scene.reading.is_plain:
        yield reading_limit(scene)
    if not scene.load.is_plain:
        yield load_limit(scene)


def surface_motion(scene: Scene) -> Iterator[Limit]:
    """The same of a model that has the rates of that displacement, too."""
    if not (scene.reading.record.is_normal and scene.reading.is_on_surface):
        yield reading_limit(scene)
    if not scene.load.is_plain:
        yield load_limit(scene)


def of_held_sheet(body: Body) -> Iterator[Limit]:
    """Limits of a model of a flat sheet that is held at its edges and lies across the beam."""
    if body.sides != "clamped":
        yield Limit(
            why=f"takes a sheet that is held, not one with {body.sides} sides",
            cure='take sides = "clamped"', change=of_body(sides="clamped"),
        )  # fmt: skip
    if body.placement.is_tilted:
        yield Limit(
            why="takes a sheet across the beam, not a tilted one",
            cure="leave out its tilt", change=of_part("placement", tilt_x=0.0, tilt_y=0.0),
        )  # fmt: skip
    yield from of_flat_sheet(body)


def of_flat_sheet(body: Body) -> Iterator[Limit]:
    """Limit of a model of a sheet that is flat at rest."""
    if body.mounting.is_curled:
        yield Limit(
            why="takes a flat sheet, not a curled one",
            cure="leave out its curl", change=of_part("mounting", curl_x=0.0, curl_y=0.0),
        )  # fmt: skip


def of_alike_directions(body: Body) -> Iterator[Limit]:
    """Limits of the wavenumber integral, whose waves are alike in all directions of a sheet."""
    held = body.mounting
    if body.solid.orthotropy is not None:
        yield Limit(
            why="takes a sheet alike in all directions, not an orthotropic one",
            cure="take an isotropic material", change=of_part("solid", orthotropy=None),
        )  # fmt: skip
    if held.tension_x != held.tension_y:
        mean = held.mean_tension
        yield Limit(
            why="takes a sheet alike in all directions, not one stretched by "
            f"{held.tension_x:g} and {held.tension_y:g} N/m along x and y",
            cure="stretch it alike along both",
            change=of_part("mounting", tension_x=mean, tension_y=mean),
        )  # fmt: skip
    yield from of_flat_sheet(body)


def of_vacuum(body: Body) -> Iterator[Limit]:
    """Limit of a model of sparse equations, which the added mass of air does not have."""
    if body.air:
        yield _without_air("has no air around a sheet")


def of_air_in_a_frame(body: Body) -> Iterator[Limit]:
    """Limit of elements: they have no air that flows around a free edge."""
    if how := open_air(body):
        yield _without_air(f"has air around a sheet in a frame, not around one {how}")


def _without_air(why: str) -> Limit:
    return Limit(why=why, cure="leave out its air", change=of_body(air=False))
