"""Files .stroke of a drawing program: corners in mm, and the speed of the focus in mm/s."""

import json

from simple_model import Tacton, Trajectory
from skinwave import Scene
from skinwave.patterns import Options, Pattern
from skinwave.system.formats import PATTERN_READERS, PATTERN_WRITERS, register


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """Return the path of a file."""
    try:
        stroke = json.loads(content)
        points = tuple((1e-3 * x, 1e-3 * y) for x, y in stroke["corners_mm"])
        speed = 1e-3 * stroke["speed_mm_per_s"]
    except (KeyError, TypeError) as error:
        raise ValueError(f"the stroke is not complete ({error!r}); save it again") from None
    path = Trajectory(shape="polyline", points=points, speed=speed)
    return Pattern(tacton=Tacton(trajectory=path, duration=base.tacton.duration))


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return the file of a path."""
    path = scene.tacton.trajectory
    if path.shape != "polyline" or scene.tacton.am_frequency:
        raise ValueError("a stroke is a polyline without AM; write .csv instead")
    stroke = {"corners_mm": [(1e3 * x, 1e3 * y) for x, y in path.points]}
    return json.dumps(stroke | {"speed_mm_per_s": 1e3 * path.speed}).encode(), ()


register(PATTERN_READERS, ".stroke", function=read)
register(PATTERN_WRITERS, ".stroke", function=write)
