"""Held sheets, whose modes are computed rather than elements."""

from skinwave.models.advice import takes
from skinwave.models.plate_modes import ERROR, FROM_REST
from skinwave.scene.scene import Scene


def why_modes(scene: Scene, tolerance: float) -> str:
    """Reason for the modes of a scene's sheet instead of elements; none if elements do."""
    body = scene.body
    if not takes(FROM_REST, scene) or tolerance < ERROR:
        return ""
    if body.air and not body.mounting.is_frame:
        return f"elements have air around a sheet in a frame, not one {body.mounting.words}"
    return "a flat sheet that is held: modes of a thin plate need no mesh"
