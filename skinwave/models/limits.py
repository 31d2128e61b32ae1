"""Limits of models, of sheets above all, and the changes of a scene that bring it within them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from simple_model import MovingPressure
from simple_model.quantities import DISPLACEMENT
from skinwave.bodies.body import Body
from skinwave.bodies.sheet import open_air
from skinwave.scene.load import PRESSURE
from skinwave.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limit of a model that a scene is beyond.

    Parameters
    ----------
    why : str, what the model takes, and not what the scene has: "takes a flat sheet, not a curled
        one"
    cure : str, how to change the scene, in the imperative; "" if no change of it would help
    change : the scene -> the scene so changed
    """

    why: str
    cure: str = ""
    change: Callable[[Scene], Scene] | None = None


def of_body(**values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of a scene's body."""
    return lambda scene: replace(scene, body=replace(scene.body, **values))


def of_material(**values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of the material of a scene's body."""
    return lambda scene: of_body(material=replace(scene.body.solid, **values))(scene)


def of_mounting(**values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of the mounting of a scene's sheet."""
    return lambda scene: of_body(mounting=replace(scene.body.mounting, **values))(scene)


def of_placement(**values: Any) -> Callable[[Scene], Scene]:
    """Change of attributes of the placement of a scene's body."""
    return lambda scene: of_body(placement=replace(scene.body.placement, **values))(scene)


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
    if not (scene.reading.asked.is_normal and scene.reading.is_on_surface):
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
            cure="leave out its tilt", change=of_placement(tilt_x=0.0, tilt_y=0.0),
        )  # fmt: skip
    yield from of_flat_sheet(body)


def of_flat_sheet(body: Body) -> Iterator[Limit]:
    """Limit of a model of a sheet that is flat at rest."""
    if body.mounting.is_curled:
        yield Limit(
            why="takes a flat sheet, not a curled one",
            cure="leave out its curl", change=of_mounting(curl_x=0.0, curl_y=0.0),
        )  # fmt: skip


def of_alike_directions(body: Body) -> Iterator[Limit]:
    """Limits of the wavenumber integral, whose waves are alike in all directions of a sheet."""
    held = body.mounting
    if body.solid.orthotropy is not None:
        yield Limit(
            why="takes a sheet alike in all directions, not an orthotropic one",
            cure="take an isotropic material", change=of_material(orthotropy=None),
        )  # fmt: skip
    if held.tension_x != held.tension_y:
        mean = held.mean_tension
        yield Limit(
            why="takes a sheet alike in all directions, not one stretched by "
            f"{held.tension_x:g} and {held.tension_y:g} N/m along x and y",
            cure="stretch it alike along both", change=of_mounting(tension_x=mean, tension_y=mean),
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
