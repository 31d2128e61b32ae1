"""The stated error of a response: its parts, and the response with the statement and warnings.

A model yields the parts of its own error. Plans and assessments add parts due to what the model
leaves out of the scene. `simple_model.statement` has the rule by which they add.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, pi

from simple_model import ErrorPart, Response, Statement
from simple_model.load.spot_map import SpotMap
from skinwave.models import Model
from skinwave.models.laws import own_laws, series_tolerance
from skinwave.models.limits import takers, takes
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.plate_modes import STRETCHED, thick_mesh_part
from skinwave.models.reduced import ReducedBody
from skinwave.planning.deflection import stretching_error
from skinwave.planning.left_out import sensitivity, series_error
from skinwave.planning.plan_warnings import response_warnings, rigid_body_drift, under_resolved
from skinwave.planning.refinement import enough
from skinwave.scene.scene import Scene


def with_statement(
    scene: Scene, response: Response, statement: Statement, cautions: Iterable[str] = ()
) -> Response:
    """Return a response with the statement of its error, and with its warnings and `cautions`."""
    warnings = (*statement.warnings, *cautions, *response_warnings(scene, response))
    effort = replace(response.effort, errors=statement, warnings=warnings)
    return replace(response, load=scene.pressure, effort=effort)


def own_parts(model: Model, scene: Scene, options: SolveOptions = DEFAULT) -> tuple[ErrorPart, ...]:
    """Return the parts of a model itself; one of unknown size if it does not estimate its error."""
    if model.parts:
        return tuple(model.parts(scene, options))
    source = f"{model.name}, which does not estimate its error"
    cure = "compare its response with that of another model"
    return (ErrorPart(name="model", source=source, error=inf, cure=cure),)


def left_out_parts(
    scene: Scene, model: Model, tolerance: float, prepared: ReducedBody | None = None
) -> Iterator[ErrorPart]:
    """Yield the parts due to stretching, which a linear model of a sheet leaves out, to Prony
    series that replace modulus laws, and to the focus. A `prepared` body on any mesh saves the
    reduction of a coarse one.
    """
    yield from focus_parts(scene)
    if error := stretching_error(scene, model, tolerance):
        cure = "use a thicker sheet or a lower pressure"
        if takes(STRETCHED, scene):
            cure = f"use --model {STRETCHED.name}"
        source = f"stretching, which {model.name} leaves out"
        yield ErrorPart(name="stretching", source=source, error=error, cure=cure)
    if (laws := own_laws(scene.body)) and model.takes_series(scene.body):
        yield ErrorPart(
            name="series",
            source=f"the {laws[0].series(series_tolerance(tolerance)).words}",
            error=series_error(scene, model.name, tolerance, prepared),
            cure="use --model flat-body-harmonic or fem-harmonic, which take the law itself",
        )


def focus_parts(scene: Scene) -> Iterator[ErrorPart]:
    """Yield the part due to the interpolation of a focus between the samples of its map."""
    if isinstance(spot := scene.pressure.profile, SpotMap):
        source, cure = "the map of the focus", "use a map with more samples"
        yield ErrorPart(name="focus", source=source, error=spot.error, cure=cure)


def element_parts(
    scene: Scene, tolerance: float, h: float, *,
    mesh: float, reduction: float, absorbing: float, above_band: float, band: float = DEFAULT.band,
) -> list[ErrorPart]:  # fmt: skip
    """Return the parts of linear elements of h in m, from the relative error of each cause; that of
    the `mesh` is inf if it is unknown, and `above_band` that of motion above a `band` in Hz.
    """
    elements, cure = f"elements of {1e3 * h:.3g} mm", "use smaller elements"
    if tolerance < mesh < inf:
        cure = f"use elements of about {1e3 * enough(scene, h, mesh, tolerance):.2g} mm"
    if mesh == inf:
        elements += ", of which the file has only one mesh"
        cure = "provide a finer mesh and compare the results"
    return [
        ErrorPart(name="mesh", source=elements, error=mesh, cure=cure),
        reduction_part(reduction),
        ErrorPart(name="absorbing layer", source="the absorbing layer", error=absorbing,
                  cure="use a larger body"),
        band_part(scene, band, above_band),
        *thick_mesh_part(scene),
    ]  # fmt: skip


def reduction_part(error: float) -> ErrorPart:
    """Return the part due to the reduction of a body."""
    source = "the reduced-order model"
    return ErrorPart(name="reduction", source=source, error=error, cure="lower the tolerance")


def element_warnings(scene: Scene, h: float) -> tuple[str, ...]:
    """Return the warnings of elements of h in m apart from their error."""
    return (*rigid_body_drift(scene), *under_resolved(h, scene.pressure.spot_scale))


def band_part(scene: Scene, band: float, error: float) -> ErrorPart:
    """Return the part due to motion above the band of a response in Hz."""
    cure = "use a load that begins smoothly"
    if scene.reading.record.rate:
        cure = f"read the displacement, or {cure}"
    source = f"the {scene.quantity} above {band:g} Hz"
    return ErrorPart(name="band", source=source, error=error, cure=cure)


def sides_parts(
    scene: Scene, model: Model, reflections: float, tolerance: float
) -> Iterator[ErrorPart]:
    """Yield the part due to reflections from the sides that a model leaves out."""
    others = takers(scene) if 4 * reflections > tolerance else []  # may cure the total
    source = f"reflections from the sides, which {model.name} leaves out"
    cure = f"use --model {others[0]}" if others else "use absorbing sides"
    yield ErrorPart(name="sides", source=source, error=reflections, cure=cure)


def step_part(scene: Scene, dt: float) -> ErrorPart:
    """Return the part due to time steps of dt in s of average acceleration."""
    value, frequency = sensitivity(scene)
    # Frequencies are lower by (w dt)^2 / 12 (Hughes 1987, chapter 9).
    error = min(1.0, value * (2 * pi * frequency * dt) ** 2 / 12)
    source = f"a time step of {1e3 * dt:.3g} ms"
    return ErrorPart(name="steps", source=source, error=error, cure="use a smaller time step")


def start_parts(model: Model, error: float) -> Iterator[ErrorPart]:
    """Yield the part due to the start from rest, if a model of the steady state leaves it out."""
    if model.is_steady:
        source = f"the initial transient, which {model.name} leaves out"
        cure = f"use --model {model.from_rest}"
        yield ErrorPart(name="start", source=source, error=error, cure=cure)
