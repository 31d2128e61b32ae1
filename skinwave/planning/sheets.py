"""Held sheets, whose modes are computed rather than elements."""

from math import pi

from skinwave.bodies.sheet import bending_wavenumber
from skinwave.models.advice import takes
from skinwave.models.plate_modes import ERROR, FROM_REST
from skinwave.scene.scene import Body, Scene


def modes_below(body: Body, frequency: float) -> float:
    """About how many modes a sheet has below a frequency in Hz, A k^2 / 4 pi with the wavenumber k
    of its bending waves; held edges make it fewer (Weyl's law: Lyon and DeJong, Theory and
    Application of Statistical Energy Analysis (1995), section 8.2).
    """
    return body.width * body.height * bending_wavenumber(body, frequency) ** 2 / (4 * pi)


def why_modes(scene: Scene, tolerance: float) -> str:
    """Reason for the modes of a scene's sheet instead of elements; none if elements do."""
    body = scene.body
    if not takes(FROM_REST, scene) or tolerance < ERROR:
        return ""
    if body.air and not body.mounting.is_frame:
        return f"elements have air around a sheet in a frame, not one {body.mounting.words}"
    return "a flat sheet that is held: modes of a thin plate need no mesh"
