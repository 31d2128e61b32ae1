"""Reach above the detection threshold, read on one line from the path outwards."""

from dataclasses import dataclass

import numpy as np

from fem.load_and_probe import on_surface
from skinwave.bodies.flattened import build_without_layers
from skinwave.results.propagation import Reach
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Outward:
    """Probes (k, 2) in m on a line that leaves the path `towards` +x, -x, +y or -y, and their
    `distances` (k,) in m from the path.
    """

    probes: Floats
    towards: str
    distances: Floats

    def reach(self, levels: Floats) -> Reach | None:
        """Return how far levels (k,) in dB at the probes are above 0; None if not at the path."""
        lowest = -100.0  # dB, of what does not vibrate
        level = np.maximum(levels, lowest)
        below = np.flatnonzero(level <= 0)
        if not len(below):
            return Reach(metre=float(self.distances[-1]), beyond=True)
        if not (k := int(below[0])):
            return None
        share = level[k - 1] / (level[k - 1] - level[k])
        near, far = self.distances[k - 1 : k + 1]
        return Reach(metre=float(near + (far - near) * share))


def outward(scene: Scene, body: Body, h: float) -> Outward | None:
    """Return probes from the path towards the outermost probe, or None if the path is at the edge
    of the body. A curved surface is meshed with elements of h in m.

    The line begins at the outermost point of the path, so that the distance along it is that from
    the path.
    """
    path, probes = scene.tacton.trajectory.outline, scene.probe_points
    axes = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}
    beyond = {name: (probes @ axis).max() - (path @ axis).max() for name, axis in axes.items()}
    towards = max(axes, key=lambda name: round(beyond[name], 9))
    axis = np.array(axes[towards])
    same = 1e-6  # m
    outermost = path[path @ axis > (path @ axis).max() - same]
    start = outermost[np.argmin(np.linalg.norm(outermost, axis=1))]
    farthest, step = 40e-3, 0.5e-3  # m: longest line, and resolution of its end on a body
    steps = np.arange(round(farthest / step) + 1) * step
    off = np.flatnonzero(~_on_body(body, start + steps[:, None] * axis, h))
    steps = steps[: off[0]] if len(off) else steps
    # Distances of probes before the end, in units of the smaller of 5 mm and a quarter of the line.
    unit, placed = 5e-3, np.array([0, 1, 2, 3, 4, 6])
    if len(steps) <= len(placed):
        return None
    inner = 0.9  # of the way to the edge of the body, where its surface slopes
    end = inner * steps[-1] if len(off) else farthest
    distances = min(unit, end / 4) * placed
    distances = np.append(distances[distances < 0.9 * end], end)
    return Outward(probes=start + distances[:, None] * axis, towards=towards, distances=distances)


def _on_body(body: Body, places: Floats, h: float) -> np.ndarray:
    """Mask (k,) of the places (k, 2) in m on the surface of a body."""
    if body.of_kind.is_plate or body.of_kind.is_layer:
        half = np.array([body.width, body.height]) / 2
        about = np.maximum(np.abs(places), np.abs(places - body.placement.offset))
        return np.asarray((about < half).all(axis=1))
    return on_surface(build_without_layers(body, h).mesh, places)
