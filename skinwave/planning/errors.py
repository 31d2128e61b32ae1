"""Expected error of a response: its parts, their total, and the resulting warnings."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from skinwave.models import Model, named
from skinwave.models.laws import own_laws, series_tolerance
from skinwave.models.limits import takes
from skinwave.models.plate_modes import STRETCHED
from skinwave.models.reduced import BAND, ReducedBody
from skinwave.models.relative_change import change_text
from skinwave.planning.estimates import spot_scale
from skinwave.planning.left_out import series_error, stretching_error
from skinwave.planning.plan_warnings import ERROR_UNKNOWN, rigid_body_drift, under_resolved
from skinwave.planning.refinement import enough
from skinwave.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class ErrorPart:
    """One cause of error: its `source` as a noun phrase, the relative `error` of the worst probe's
    waveform, and the `cure` of a warning in the imperative.
    """

    source: str
    error: float
    cure: str = ""


def total_error(parts: Iterable[ErrorPart], *, independent: bool = False) -> float:
    """Return the sum of the parts, or the root of the sum of squares if they are independent."""
    errors = [part.error for part in parts]
    return float(np.linalg.norm(errors) if independent else sum(errors))


def part_warnings(parts: Iterable[ErrorPart], tolerance: float) -> tuple[str, ...]:
    """Return a warning for each part above the tolerance."""
    return tuple(
        f"{part.source}: expected error {change_text(part.error)}, tolerance "
        f"{100 * tolerance:g} %; {part.cure}"
        for part in parts
        if part.error > tolerance
    )


def total_warning(parts: Sequence[ErrorPart], error: float, tolerance: float) -> tuple[str, ...]:
    """Return a warning if the total error is above the tolerance, but none of its parts is."""
    if not error > tolerance or any(part.error > tolerance for part in parts):
        return ()
    cure = max(parts, key=lambda part: part.error).cure
    return part_warnings(
        [ErrorPart(source="all errors together", error=error, cure=cure)], tolerance
    )


def stretching_part(scene: Scene, model: Model, tolerance: float) -> ErrorPart:
    """Return the part due to stretching, which a linear model of a sheet leaves out."""
    cure = "use a thicker sheet or a lower pressure"
    return ErrorPart(
        source=f"stretching, which {model.name} leaves out",
        error=stretching_error(scene, model, tolerance),
        cure=f"use --model {STRETCHED.name}" if takes(STRETCHED, scene) else cure,
    )


def element_parts(
    scene: Scene, tolerance: float, h: float, *,
    mesh: float, reduction: float, absorbing: float, above_band: float,
) -> list[ErrorPart]:  # fmt: skip
    """Return the parts of linear elements of h in m, from the relative error of each cause."""
    size = 1e3 * enough(scene.body, h, mesh, tolerance)
    return [
        ErrorPart(source=f"elements of {1e3 * h:.3g} mm", error=mesh,
                  cure=f"use elements of about {size:.2g} mm"),
        ErrorPart(source="the reduced-order model", error=reduction, cure="lower the tolerance"),
        ErrorPart(source="the absorbing layer", error=absorbing, cure="use a larger body"),
        band_part(scene, BAND, above_band),
    ]  # fmt: skip


def element_warnings(scene: Scene, h: float, mesh: float) -> tuple[str, ...]:
    """Return other warnings of elements of h in m, whose relative error is `mesh` or nan."""
    return (
        *(() if isfinite(mesh) else (ERROR_UNKNOWN,)),
        *rigid_body_drift(scene),
        *under_resolved(h, spot_scale(scene.pressure)),
    )


def band_part(scene: Scene, band: float, error: float) -> ErrorPart:
    """Return the part due to motion above the band of a response in Hz."""
    cure = "use a load that begins smoothly"
    if scene.reading.record.rate:
        cure = f"read the displacement, or {cure}"
    return ErrorPart(source=f"the {scene.quantity} above {band:g} Hz", error=error, cure=cure)


def start_part(model: Model, error: float) -> ErrorPart:
    """Return the part due to the start from rest, which a model of the steady state leaves out."""
    return ErrorPart(
        source=f"the initial transient, which {model.name} leaves out", error=error,
        cure=f"use --model {model.from_rest}",
    )  # fmt: skip


def series_part(
    scene: Scene, model: str, tolerance: float, prepared: ReducedBody | None = None
) -> ErrorPart | None:
    """Return the part due to Prony series that replace the modulus laws of a body; None if the
    model uses none. A `prepared` body on any mesh saves the reduction of a coarse one.
    """
    laws = own_laws(scene.body)
    if not laws or not named(model).takes_series(scene.body):
        return None
    return ErrorPart(
        source=f"the {laws[0].series(series_tolerance(tolerance)).words}",
        error=series_error(scene, model, tolerance, prepared),
        cure="use --model flat-body-harmonic or fem-harmonic, which take the law itself",
    )
