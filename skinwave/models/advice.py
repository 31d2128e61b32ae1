"""Advice of a refusal: other models, or a change of the scene.

A model lists its `Limit`s of a scene. It takes the scene if there are none. The advice of a refusal
names only models that take the scene, and changes after which a model takes it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from skinwave.models import Model, named, names
from skinwave.models.limits import Limit

if TYPE_CHECKING:
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
    scene: "Scene"
    model: str


class Refused(ValueError):
    """A scene that a model does not take; `cures` are those that the message names."""

    def __init__(self, message: str, cures: Sequence[Cure] = ()) -> None:
        super().__init__(message)
        self.cures = tuple(cures)


def takes(model: Model, scene: "Scene") -> bool:
    """Whether a model takes a scene: its body, its load, and the quantity that its probes read."""
    return not beyond(model, scene)


def beyond(model: Model, scene: "Scene") -> list[Limit]:
    """Limits of a model that a scene is beyond."""
    if model.needs_body and not scene.body.of_kind.discretise:
        return [Limit(why="moves a body, and this scene has none")]
    return [*model.limits(scene)]


def takers(scene: "Scene") -> list[str]:
    """Names of the models that take a scene and compute what its probes read, those that advice
    prefers first; without a body, of the point kernels.
    """
    return [model.name for model in _meant_for(scene) if takes(model, scene)]


def _meant_for(scene: "Scene") -> list[Model]:
    """Models of what a scene's probes read. None leaves out the sides of a body if they reflect."""
    from skinwave.bodies.analytic import is_laterally_infinite

    has_body = bool(scene.body.of_kind.discretise)
    bounded = has_body and not is_laterally_infinite(scene.body)
    known = (named(name) for name in (*ADVISED, *(n for n in names() if n not in ADVISED)))
    return [
        model for model in known
        if not (model.quantity and has_body) and not (model.is_infinite and bounded)
    ]  # fmt: skip


def default_model(scene: "Scene") -> str:
    """The model of a scene that is computed unless another is cheaper: `fem`, or the first that
    takes the scene. Raises `Refused` if none does.
    """
    if found := takers(scene):
        return found[0]
    raise no_model(scene)


def check_taken(model: Model, scene: "Scene") -> None:
    """Raise `Refused` with limits and cures for a scene that a model does not take."""
    if found := beyond(model, scene):
        raise refusal(scene, model, found)


def refusal(scene: "Scene", model: Model, found: Sequence[Limit]) -> Refused:
    """Refusal of a scene by a model, for the limits that it is beyond, with what helps."""
    others = [name for name in takers(scene) if name != model.name][:MOST_CURES]
    own = _changed(scene, model, found)
    cures = [*own, *(Cure(words="", scene=scene, model=name) for name in others)]
    return _with_cures(_why(model, found), cures or _of_any(scene), model.name)


def no_model(scene: "Scene") -> Refused:
    """Refusal of a scene that no model takes, with the changes after which one does."""
    cures = _of_any(scene)
    near = [named(cure.model) for cure in cures] or _meant_for(scene)[:1]
    whys = ", and ".join(_why(model, beyond(model, scene)) for model in near)
    return _with_cures(f"no model takes this scene: {whys}", cures, "auto")


def cures_for(scene: "Scene", model: Model) -> list[Cure]:
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


def _of_any(scene: "Scene") -> list[Cure]:
    """Changes of a scene after which one of the models takes it."""
    found: dict[str, Cure] = {}
    for model in _meant_for(scene):
        for cure in _changed(scene, model, beyond(model, scene)):
            found.setdefault(cure.words, cure)
    return [*found.values()][:MOST_CURES]


def _changed(scene: "Scene", model: Model, found: Sequence[Limit]) -> Iterator[Cure]:
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
