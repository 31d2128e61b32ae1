"""Lines and waveforms of a laterally infinite body under any load, by wavenumber integrals."""

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure
from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.layers.flat_quantities import from_rest, steady, surface_field
from simple_model.layers.wavenumber_integral import Field
from simple_model.load.spectrum import merge_lines
from simple_model.typing import Complex
from skinwave.bodies.analytic import compliance
from skinwave.models.flat_body import fields_read
from skinwave.scene.scene import Scene

THRESHOLD = 1e-5  # of the strongest line of the load: weaker ones are left out of a prediction
SETTLED = 1e-4  # of the largest motion: what is left of the transient where it is left out
PARTS = (1 / 12, 1 / 4)  # of a record, after which it may have decayed
BEFORE_END = 0.9  # of such a part: its last samples see it end


def flat_lines(scene: Scene) -> tuple[Floats, Complex]:
    """Lines of what a scene's probes read: frequencies (f,) in Hz, amplitudes (f, p), SI.

    Parameters
    ----------
    scene : Scene, of a quantity of normal motion at the surface
    """
    points = scene.probe_points
    if scene.load.is_plain:
        body = compliance(scene.body)
        f, a = steady_lines(body, scene.pressure, points, threshold=THRESHOLD)
        return f, a * scene.reading.asked.factor(2j * np.pi * f)[:, None]
    each = [field_lines(*part, points, threshold=THRESHOLD) for part in _parts(scene)]
    frequencies, amplitudes = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(amplitudes)[..., 0])


def flat_history(scene: Scene, times: Floats) -> Floats:
    """Waveforms (t, p) of what a scene's probes read, SI: from rest until that is the steady state.

    Parameters
    ----------
    scene : as for `flat_lines`
    times : (t,) float, s, equally spaced from 0
    """
    parts, asked, points = _parts(scene), scene.reading.asked, scene.probe_points

    def begun(until: Floats) -> Floats:
        each = (from_rest(field, asked, load, points, until) for field, load in parts)
        return np.asarray(sum(each), np.float64)

    if scene.tacton.trajectory.shape == "recorded":
        return begun(times)
    later = np.asarray(sum(steady(field, asked, load, points, times) for field, load in parts))
    for part in PARTS:
        n = int(part * len(times))
        first = begun(times[:n])[: int(BEFORE_END * n)]
        left = np.abs(first - later[: len(first)])[2 * n // 3 :].max()
        if left <= SETTLED * np.abs(later).max():
            return np.concatenate([first, later[len(first) :]])
    return begun(times)


def _parts(scene: Scene) -> list[tuple[Field, MovingPressure]]:
    """Field of each component of the load, and that."""
    if scene.load.is_plain:
        body = compliance(scene.body)
        return [(surface_field(scene.reading.asked, body), scene.pressure)]
    return list(zip(fields_read(scene, 0.0), scene.loads, strict=True))
