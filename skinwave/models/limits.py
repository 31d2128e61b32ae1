"""Limits of models, changes of a scene that satisfy them, and refusals.

A model lists the `Limit`s that a scene exceeds. It takes the scene if there are none. A refusal
names only models that take the scene, and changes after which a model does.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from simple_model import MovingPressure
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.analytic import is_laterally_infinite
from skinwave.bodies.body import Body
from skinwave.models import Limit, Model, named, names
from skinwave.scene.load import PRESSURE
from skinwave.scene.scene import Scene

# Models in the order of advice: from rest first, then those of the steady state.
ADVISED = (
    "fem", "flat-body", "plate-modes-transient", "fem-transient", "fem-nonlinear",
    "plate-modes-nonlinear", "fem-nonlinear-transient", "fem-harmonic", "flat-body-harmonic",
    "plate-modes",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Cure:
    """Cure of a refusal: a `scene` that the `model` takes, and its change in words, or ""."""

    words: str
    scene: Scene
    model: str


class Refused(ValueError):
    """Raised for a scene that a model does not take; the message names the `cures`."""

    def __init__(self, message: str, cures: Sequence[Cure] = ()) -> None:
        super().__init__(message)
        self.cures = tuple(cures)


def beyond(model: Model, scene: Scene) -> list[Limit]:
    """Return the limits of a model that a scene exceeds."""
    if model.needs_body and not scene.body.of_kind.discretise:
        return [Limit(why="needs a body that moves, and the scene has none")]
    return [*(model.limits or plain_limits)(scene)]


def takes(model: Model, scene: Scene) -> bool:
    """Whether a model takes a scene: its body, its load, and the quantity of its probes."""
    return not beyond(model, scene)


def takers(scene: Scene) -> list[str]:
    """Return the names of the models that take a scene, the preferred ones first."""
    return [model.name for model in _candidates(scene) if takes(model, scene)]


def _candidates(scene: Scene) -> list[Model]:
    """Return the models for a scene's quantity that include any reflecting sides."""
    has_body = bool(scene.body.of_kind.discretise)
    bounded = has_body and not is_laterally_infinite(scene.body)
    every = (named(name) for name in dict.fromkeys((*ADVISED, *names())))
    return [
        model for model in every
        if not (model.quantity and has_body) and not (model.is_infinite and bounded)
    ]  # fmt: skip


def default_model(scene: Scene) -> str:
    """Return the name of the first model that takes a scene; raises `Refused` if none does."""
    if models := takers(scene):
        return models[0]
    cures = _any_cures(scene)
    nearest = [named(cure.model) for cure in cures] or _candidates(scene)[:1]
    reasons = ", and ".join(_reason(model, beyond(model, scene)) for model in nearest)
    raise _with_cures(f"no model takes this scene: {reasons}", cures, "auto")


def check_takes(model: Model, scene: Scene) -> None:
    """Raise `Refused` with limits and cures if a model does not take a scene."""
    if limits := beyond(model, scene):
        raise refusal(scene, model, limits)


def refusal(scene: Scene, model: Model, limits: Sequence[Limit], most_cures: int = 2) -> Refused:
    """Return the refusal of a scene for some limits of a model, with cures."""
    others = [name for name in takers(scene) if name != model.name][:most_cures]
    own = _changes(scene, model, limits)
    cures = [*own, *(Cure(words="", scene=scene, model=name) for name in others)]
    return _with_cures(_reason(model, limits), cures or _any_cures(scene, most_cures), model.name)


def cures_for(scene: Scene, model: Model) -> list[Cure]:
    """Return the changes after which a model takes a scene: an empty change if it already does, an
    empty list if none helps.
    """
    if takes(model, scene):
        return [Cure(words="", scene=scene, model=model.name)]
    return [*_changes(scene, model, beyond(model, scene))]


def in_words(cures: Sequence[Cure], requested: str) -> str:
    """Return cures in words, for a requested model, or "auto"."""
    unchanged = [cure.model for cure in cures if not cure.words]
    clauses = [
        cure.words + f" and use --model {cure.model}" * (requested not in (cure.model, "auto"))
        for cure in cures
        if cure.words
    ]
    clauses += [f"use --model {' or '.join(unchanged)}"] if unchanged else []
    *first, last = clauses
    return f"{', '.join(first)}, or {last}" if first else last


def _reason(model: Model, limits: Sequence[Limit]) -> str:
    return f"{model.name} {', and '.join(limit.why for limit in limits)}"


def _any_cures(scene: Scene, most: int = 2) -> list[Cure]:
    """Return changes of a scene after which some model takes it."""
    cures: dict[str, Cure] = {}
    for model in _candidates(scene):
        for cure in _changes(scene, model, beyond(model, scene)):
            cures.setdefault(cure.words, cure)
    return [*cures.values()][:most]


def _changes(scene: Scene, model: Model, limits: Sequence[Limit]) -> Iterator[Cure]:
    """Yield the change of a scene that satisfies all limits of a model, if there is one."""
    changed = scene
    try:
        for limit in limits:
            if limit.change is None:
                return
            changed = limit.change(changed)
        is_taken = takes(model, changed)
    except ValueError:  # the changes contradict the rest of the scene
        return
    if is_taken:
        words = " and ".join(dict.fromkeys(limit.cure for limit in limits))
        yield Cure(words=words, scene=changed, model=model.name)


def _with_cures(reason: str, cures: Sequence[Cure], requested: str) -> Refused:
    return Refused(f"{reason}; {in_words(cures, requested)}" if cures else reason, cures)


def of_body(**values: Any) -> Callable[[Scene], Scene]:
    """Return a function that changes attributes of a scene's body."""
    return lambda scene: replace(scene, body=replace(scene.body, **values))


def of_part(part: str, **values: Any) -> Callable[[Scene], Scene]:
    """Return a function that changes attributes of a scene's `solid`, mounting or placement."""
    name = "material" if part == "solid" else part
    return lambda scene: of_body(**{name: replace(getattr(scene.body, part), **values)})(scene)


def reading_limit(scene: Scene) -> Limit:
    """Return the limit of a model that does not compute the quantity of a scene's probes."""
    return Limit(
        why=f"does not compute {scene.reading.words}",
        cure="read the displacement at the surface",
        change=displacement_at_surface,
    )


def displacement_at_surface(scene: Scene) -> Scene:
    """Return the scene with probes that read the displacement at the surface."""
    return replace(scene, quantity=DISPLACEMENT.name, depth=0.0)


def load_limit(scene: Scene) -> Limit:
    """Return the limit of a model that takes only the pressure of a focus."""
    return Limit(
        why=f"needs the pressure of a focus alone, not {scene.load.words}",
        cure="remove [load]",
        change=_without_load,
    )


def _without_load(scene: Scene) -> Scene:
    """Return the scene without [load]; the Tacton stays, even if no device made the load."""
    is_of_device = scene.load.of_kind.is_of_device
    pressure = scene.pressure if is_of_device else MovingPressure(tacton=scene.tacton)
    return replace(scene, load=PRESSURE, pressure=pressure)


def plain_limits(scene: Scene) -> Iterator[Limit]:
    """Yield the limits of models that compute only the surface displacement under a focus."""
    yield from _reading_and_load_limits(scene, scene.reading.is_plain)


def surface_limits(scene: Scene) -> Iterator[Limit]:
    """Yield the limits of models of the surface displacement and its rates under a focus."""
    of_surface = scene.reading.record.is_normal and scene.reading.is_on_surface
    yield from _reading_and_load_limits(scene, of_surface)


def _reading_and_load_limits(scene: Scene, computes_reading: bool) -> Iterator[Limit]:
    if not computes_reading:
        yield reading_limit(scene)
    if not scene.load.is_plain:
        yield load_limit(scene)


def clamped_sheet_limits(body: Body) -> Iterator[Limit]:
    """Yield the limits of models of a flat sheet across the beam with clamped sides."""
    if body.sides != "clamped":
        yield Limit(
            why=f"needs a sheet with clamped sides, not with {body.sides} sides",
            cure='set sides = "clamped"', change=of_body(sides="clamped"),
        )  # fmt: skip
    if body.placement.is_tilted:
        yield Limit(
            why="needs a sheet across the beam, not a tilted one",
            cure="remove its tilt", change=of_part("placement", tilt_x=0.0, tilt_y=0.0),
        )  # fmt: skip
    yield from flat_sheet_limits(body)


def flat_sheet_limits(body: Body) -> Iterator[Limit]:
    """Yield the limit of models of a sheet that is flat at rest."""
    if body.mounting.is_curled:
        yield Limit(
            why="needs a flat sheet, not a curled one",
            cure="remove its curl", change=of_part("mounting", curl_x=0.0, curl_y=0.0),
        )  # fmt: skip


def isotropic_limits(body: Body) -> Iterator[Limit]:
    """Yield the limits of the wavenumber integral of a sheet, which must be isotropic."""
    held = body.mounting
    if body.solid.orthotropy is not None:
        yield Limit(
            why="needs an isotropic sheet, not an orthotropic one",
            cure="use an isotropic material", change=of_part("solid", orthotropy=None),
        )  # fmt: skip
    if held.tension_x != held.tension_y:
        mean = held.mean_tension
        yield Limit(
            why=f"needs equal tension along x and y, not {held.tension_x:g} and "
            f"{held.tension_y:g} N/m",
            cure="use equal tension",
            change=of_part("mounting", tension_x=mean, tension_y=mean),
        )  # fmt: skip
    yield from flat_sheet_limits(body)


def edge_and_air_limits(body: Body, *, held_air: bool) -> Iterator[Limit]:
    """Yield the limits of elements: no lossy edges, and no air or, with `held_air`, air only around
    a sheet that is held. Models with sparse matrices exclude air.
    """
    if body.mounting.edge_loss:
        yield Limit(
            why="does not include lossy edges",
            cure="set edge_loss = 0", change=of_part("mounting", edge_loss=0.0),
        )  # fmt: skip
    if body.air and not (held_air and body.sides == "clamped"):
        why = "does not include the air around a sheet"
        if held_air:
            why = f"includes air only around a held sheet, not with {body.sides} sides"
        yield Limit(why=why, cure="set air = false", change=of_body(air=False))
