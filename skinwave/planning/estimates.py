"""How wrong an answer will be, estimated before it is computed."""

from dataclasses import replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Trajectory
from simple_model.flat_body import point_response, steady_lines
from simple_model.focus import spot_width
from simple_model.steady import load_lines, summed
from simple_model.trajectory import BY_POINTS
from skinwave.models.bodies import compliance, has_exact_waves
from skinwave.scene import Scene

REFLECTED = 0.03  # of a wave that meets an absorbing side and the layer around it
FAR = 0.25  # m, beyond which waves are not followed


def motion_lines(scene: Scene, tolerance: float) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz of the lines that move the probes, and each one's share (f, p) of
    the motion's power; by exact waves of the endless body, or as the load has them.
    """
    body = scene.body
    if scene.tacton.trajectory.shape == "recorded":
        lines = load_lines(scene.pressure, tolerance / 100)
        f, a = summed(lines.frequencies, lines.strengths[:, None].astype(complex))
    elif body.kind != "sheet" and (body.kind != "slab" or body.base != "clamped"):
        lines = load_lines(scene.pressure, tolerance / 100)
        f, a = summed(lines.frequencies, lines.coefficients[:, None])
    else:
        pressure = scene.pressure
        if pressure.focus != "gaussian":  # of the same width; only which lines matter is asked
            pressure = replace(pressure, focus="gaussian")
        f, a = steady_lines(
            compliance(body), pressure, scene.probe_points, threshold=tolerance / 100
        )
    power = np.abs(a) ** 2 * np.where(f > 0, 0.5, 1.0)[:, None]
    return f, power / np.maximum(power.sum(axis=0), 1e-300)


def highest_line(frequencies: Floats, shares: Floats, tolerance: float) -> float:
    """The line above which the motion of every probe is negligible, in Hz."""
    above = np.cumsum(shares[::-1], axis=0)[::-1].max(axis=1)
    return float(frequencies[np.flatnonzero(np.sqrt(above) > tolerance / 3).max(initial=0)])


def is_flat(scene: Scene) -> bool:
    """Whether there are exact waves for the scene, but for what its sides send back."""
    return has_exact_waves(scene.body) and scene.pressure.focus == "gaussian"


def start_share(scene: Scene) -> float:
    """The share of an endless slab's waveforms that is not their steady state, at most 1.

    What the start leaves is taken for as large as the steady state, at the cut-off of shear waves
    across the depth, w = pi c / 2 H: the lowest there is, which viscosity damps least.
    """
    solid, tacton = scene.body.solid, scene.tacton
    if tacton.is_sampled or tacton.trajectory.shape == "recorded":
        return 1.0
    w = np.pi * solid.shear_speed / (2 * scene.body.depth)
    modulus = solid.complex_modulus(w)
    decayed = w * tacton.duration * modulus.imag / modulus.real
    return float(1 / np.sqrt(max(decayed, 1.0)))


def waves_returned(
    scene: Scene, half: Floats, highest: float, reflected: float | None = None
) -> float:
    """Motion that sides `half` (2,) metre away send back to the probes, over their own; at most 1.

    By mirror images of the focus in the four sides and the exact waves of the endless body, for
    the lines that the load is made of. Waves that have no time to come back do not count, nor,
    unless `reflected` says how much they send back, do sides that absorb.
    """
    body, width = scene.body, spot_width(scene.pressure.height)
    if reflected is None:
        reflected = 0.0 if body.sides == "absorbing" else 1.0
    path, probes = _along(scene.tacton.trajectory), scene.probe_points
    edge = (half - np.abs(np.vstack([path, probes])).max(axis=0)).min()
    if not reflected:
        return 0.0
    if edge < 2 * width:
        return 1.0
    foci = [path] + [
        np.where(np.arange(2) == axis, 2 * sign * half - path, path)
        for axis in (0, 1)
        for sign in (-1, 1)
    ]
    distances = np.linalg.norm(probes[:, None] - np.array(foci)[:, None], axis=-1)  # (5, p, k)
    stiffest = 1 + body.solid.relaxing_modulus / body.solid.shear_modulus
    fastest = body.solid.shear_speed * stiffest**0.5
    if distances[1:].min() > 1.5 * fastest * scene.tacton.duration:
        return 0.0
    lines = load_lines(replace(scene.pressure, focus="gaussian"), 1e-2)
    kept = lines.frequencies <= max(highest, 1.0)
    frequencies, which = np.unique(lines.frequencies[kept], return_inverse=True)
    strength = np.bincount(which, np.abs(lines.coefficients[kept]) ** 2)
    table = np.arange(0.0, FAR, width / 2)
    g = point_response(compliance(body), table, 2 * np.pi * frequencies, width)
    power = np.interp(distances, table, strength @ np.abs(g) ** 2).mean(axis=2)
    share = power[1:].sum(axis=0) / np.maximum(power[0], 1e-300)
    return min(1.0, reflected * float(np.sqrt(share.max())))


def _along(path: Trajectory) -> Floats:
    """Some positions (k, 2) in metre of the focus."""
    if path.shape in BY_POINTS:
        return path.outline[:: max(1, len(path.points) // 24)]
    return path.at_phase(np.arange(24) / 24)


def mean_gain(scene: Scene) -> float:
    """Pa of all foci together, on average over a Tacton."""
    gain: Floats = scene.pressure.gain(np.arange(2000) / 2000 * scene.tacton.duration)
    return float(abs(gain.mean())) * len(scene.tacton.foci)
