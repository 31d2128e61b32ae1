"""Limits of models of sheets: supports, shapes and air."""

from collections.abc import Iterator

from skinwave.bodies.body import Body
from skinwave.bodies.sheet import open_air
from skinwave.models.limits import Limit, of_body, of_material, of_mounting, of_placement


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
