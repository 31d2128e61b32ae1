"""Held sheets whose modes are computed rather than a reduced-order model of elements."""

from math import pi

from skinwave.bodies.sheet import bending_wavenumber
from skinwave.models.advice import takes
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.reduction import BAND
from skinwave.scene import Body, Scene

# Moments of a lightly damped sheet are 0.6 to 0.8 times its modes below `BAND` and at most 200, the
# cost goes with their square: 136 modes took a minute a mesh, Ritz's modes of that sheet a second.
MANY_MODES = 100


def modes_below(body: Body, frequency: float) -> float:
    """About how many modes a sheet has below a frequency in Hz, A k^2 / 4 pi with the wavenumber k
    of its bending waves; held edges make it fewer (Weyl's law: Lyon and DeJong, Theory and
    Application of Statistical Energy Analysis (1995), section 8.2).
    """
    return body.width * body.height * bending_wavenumber(body, frequency) ** 2 / (4 * pi)


def why_modes(scene: Scene) -> str:
    """Reason for the modes of a scene's sheet instead of elements; none if elements do."""
    body = scene.body
    if not takes(FROM_REST, scene):
        return ""
    if body.air and not body.mounting.is_frame:
        return f"elements have air around a sheet in a frame, not one {body.mounting.words}"
    if (count := modes_below(body, BAND)) > MANY_MODES:
        return (
            f"a thin sheet with about {count:.0f} modes below {BAND:.0f} Hz, more than a "
            "reduced-order model of elements is made for"
        )
    return ""
