"""Sensitivity of a scene's response to its body's natural frequencies, found on a coarse mesh.

Discretisation in space and time gives every natural frequency a small error. Near a resonance that
changes the waveform many times as much as elsewhere, so that no a-priori error law holds for all
scenes; but the poles of a coarse reduced model, shifted by a thousandth, give the sensitivity.
"""

from dataclasses import dataclass, replace

import numpy as np

import fem
from meshes.tetmesh import Floats
from skinwave.bodies.coat import coarsest_size
from skinwave.bodies.sizes import default_size
from skinwave.models.prepared import Prepared, prepare
from skinwave.models.reduction import reduced_forces
from skinwave.scene.scene import SAMPLE_RATE as RATE
from skinwave.scene.scene import Scene

COARSENING = 2.0  # of the default element size
DETUNING = 0.010  # natural frequencies of the coarse mesh are too high by this: corrected first
MOVED = 1e-3
LONGEST = 1.0  # s of the responses that are compared


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Sensitivity of a response. `value`: relative change of the worst probe's waveform per
    relative change of all natural frequencies; `frequency` in Hz: that of the motion, root mean
    square.
    """

    value: float
    frequency: float


def sensitivity(scene: Scene, prepared: Prepared | None = None) -> Sensitivity:
    """Sensitivity from two responses of a reduced body: one that is at hand, or that of a coarse
    mesh, seconds once per body.
    """
    h = min(COARSENING * default_size(scene.body), coarsest_size(scene.body))
    coarse = prepared or prepare(scene.body, scene.probe_points, h=h, load=scene.load.moving)
    values = coarse.body.poles.values * (1 - DETUNING)
    frequencies, forces = reduced_forces(coarse.body, *scene.loads)
    times = np.arange(max(2, round(min(scene.tacton.duration, LONGEST) * RATE))) / RATE

    def waveforms(moved: float) -> Floats:
        """Waveforms (t, p) where all natural frequencies are higher by so much."""
        higher = np.asarray(values * (1 + moved), np.complex128)
        poles = replace(coarse.body.poles, values=higher)
        lines, start = (x @ coarse.read.T for x in fem.line_response(poles, forces, frequencies))
        rates = np.concatenate([2j * np.pi * frequencies, higher])
        return fem.exponential_sum(rates, np.vstack([lines, start]), times)

    whole = waveforms(0.0)
    moving = whole - whole.mean(axis=0)
    speed = float(np.linalg.norm(np.diff(moving, axis=0))) * RATE
    return Sensitivity(
        value=_share(waveforms(MOVED) - whole, whole) / MOVED,
        frequency=speed / max(float(np.linalg.norm(moving)), 1e-300) / (2 * np.pi),
    )


def _share(part: Floats, whole: Floats) -> float:
    size = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
    return float((np.linalg.norm(part, axis=0) / size).max())
