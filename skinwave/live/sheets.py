"""Packs of sheets: modes of a thin plate by Ritz's method that focal spots move.

    (diag(squared) + c(w) B + i w diag(damping) - w^2) q = F

where B is the stiffness of bending between the modes and c its complex modulus over that of the
modes, minus 1. Air and edges damp each mode as they do at its own frequency. The fields of the
modes are given on a square grid. The force of a focal spot on a mode is the field of the mode,
smoothed by the spot.
"""

from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np

from simple_model import MovingPressure, Tacton
from simple_model.layers.prony import FIT_TOLERANCE
from simple_model.load.focus import spot_width
from simple_model.plates.free_modes import free_vibration, relaxing_stiffness
from simple_model.plates.modes import PlateModes
from skinwave.models.laws import relaxing
from skinwave.models.limits import takes
from skinwave.models.plate_modes import (
    STRETCHED,
    modes_of,
    plate_of,
    relative_modulus,
    thin_plate_part,
)
from skinwave.scene.scene import Body, Scene
from skinwave.system.arrays import pack, quantise
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats

STEP, SIDE = 3e-3, 37  # m between places of the grid of fields, and number of places along a side


@dataclass(frozen=True, kw_only=True)
class SheetAccuracy:
    """Limits and accuracy of the pack of a sheet."""

    lowest: float = 0.1  # m: lowest height of the focus
    error: float = 0.02  # relative, of lines above -40 dB; larger for several foci on a wide path
    thick: float = 0.05  # relative error of the thin plate, above which the page warns
    law_step: float = 2.5  # Hz between values of the modulus
    highest: float = 1000.0  # Hz: last value of the modulus
    band: float = 1300.0  # Hz: modes below are kept, modes above are combined
    coupled_band: float = 2600.0  # Hz: coupling by loss is included for modes below
    negligible: float = 0.005  # of the largest combination of modes above the band
    sampled: tuple[float, ...] = (0.0, 600.0, 1000.0)  # Hz, of these combinations


def grid_line() -> Floats:
    """Coordinates (SIDE,) in m of the grid of fields, along either side."""
    return np.asarray(STEP * (np.arange(SIDE) - (SIDE - 1) / 2))


def sheet_pack(
    body: Body, progress: Progress = silent, accuracy: SheetAccuracy = SheetAccuracy()
) -> dict[str, Any]:
    """Return the pack of a flat sheet with supports as a dict for JSON."""
    progress("modes of the sheet", 0.0)
    modes = modes_of(plate_of(body))
    middle, line = np.asarray(body.placement.offset), grid_line()
    limit = np.array([body.width, body.height]) / 2
    on = [np.abs(line - middle[axis]) <= limit[axis] + 1e-9 for axis in (0, 1)]
    inside = np.outer(on[1], on[0]).ravel()
    x, y = (np.clip(line - middle[axis], -limit[axis], limit[axis]) for axis in (0, 1))
    fields = modes.on_grid(x, y).reshape(SIDE, SIDE, -1).transpose(2, 1, 0).reshape(-1, SIDE**2)
    fields = fields * inside
    progress("combinations of high modes", 0.5)
    squared, bending, turn = combine_modes(modes, fields, accuracy)
    law_step = accuracy.law_step
    frequencies = np.arange(0.0, accuracy.highest + law_step / 2, law_step)
    relative = relative_modulus(body, 2 * np.pi * frequencies) - 1
    bent, stretched = np.diagonal(bending), modes.plate.tension_x or modes.plate.tension_y
    coupled = int(np.searchsorted(squared, (2 * np.pi * accuracy.coupled_band) ** 2))
    solid = relaxing(body, FIT_TOLERANCE).solid
    damping = modes.damping @ turn**2
    stiffness, times = relaxing_stiffness(squared - bent, bent, solid)
    stiffness[:, 1] += damping
    free = free_vibration(stiffness, times)
    thin = thin_plate_part(_typical(body))
    return {
        "kind": "modal", "error": hypot(accuracy.error, thin.error),
        "lowest_height_mm": 1e3 * accuracy.lowest,
        "warnings": [thin.warning(accuracy.thick)] if thin.error > accuracy.thick else [],
        "step": STEP, "side": SIDE,
        "squared": pack(squared), "diagonal": pack(bent.copy()), "damping": pack(damping),
        "between": quantise(bending[:coupled, :coupled]) if stretched else None,
        "law": pack(relative.astype(np.complex128)), "law_step": law_step,
        "V": quantise((turn.T @ fields)[:, inside]),
        "inside": "".join("01"[int(each)] for each in inside),
        "stretching": stretching_of(body, modes, turn),
        "kinds": free.poles.shape[1],
        "poles": pack(free.poles), "residues": pack(free.residues),
    }  # fmt: skip


def stretching_of(
    body: Body, modes: PlateModes, turn: Floats, *, places: int = 81
) -> dict[str, Any] | None:
    """Return what makes the tension of a stretched sheet, or None if its edges can move inwards.

    `slopes` (r,) in 1/kg are the integrals of the squared gradients of combinations (m, r) of
    modes, from `places` along each side. `tension` in N/m is that per integral of the squared
    gradient of the deflection. By Berger's approximation, stretching is the same everywhere
    (J Appl Mech 22:465, 1955).
    """
    if not takes(STRETCHED, _typical(body)):
        return None
    x, y = (np.linspace(-side / 2, side / 2, places) for side in (body.width, body.height))
    fields = (modes.on_grid(x, y) @ turn).reshape(places, places, -1)
    across, along = (np.asarray(np.gradient(fields, own, axis=k)) for k, own in enumerate((x, y)))
    slopes = (across**2 + along**2).mean(axis=(0, 1))
    area, plate = body.width * body.height, modes.plate
    membrane = 12 * np.sqrt(plate.d11 * plate.d22) / body.depth**2
    return {"slopes": pack(area * np.asarray(slopes)), "tension": membrane / (2 * area)}


def _typical(body: Body) -> Scene:
    """Return a Tacton at the middle of a sheet."""
    pressure = MovingPressure(tacton=Tacton(am_frequency=140.0, duration=0.1))
    x, y = body.placement.offset
    return Scene(pressure=pressure, body=body, probes=((float(x), float(y)),))


def combine_modes(
    modes: PlateModes, fields: Floats, accuracy: SheetAccuracy
) -> tuple[Floats, Floats, Floats]:
    """Return the modes below the band and the combinations of higher modes that focal spots move.

    The result is the squared frequencies (r,) in rad2/s2, ascending, the stiffness of bending
    (r, r) in 1/s2 between them, and the orthonormal combinations (m, r) of the modes.
    """
    squared = modes.squared
    low = squared < (2 * np.pi * accuracy.band) ** 2
    forces = spot_forces(fields[~low], spot_width(accuracy.lowest))
    motions = [forces / (squared[~low] - (2 * np.pi * f) ** 2)[:, None] for f in accuracy.sampled]
    squares, directions = np.linalg.eigh(sum(each @ each.T for each in motions))
    kept = directions[:, squares > accuracy.negligible**2 * squares.max(initial=0.0)]
    own, turned = np.linalg.eigh(kept.T @ (squared[~low][:, None] * kept))
    turn = np.zeros((len(squared), low.sum() + len(own)))
    turn[low, : low.sum()] = np.eye(low.sum())
    turn[~low, low.sum() :] = kept @ turned
    values = np.concatenate([squared[low], own])
    order = np.argsort(values)
    turn = turn[:, order]
    return values[order], _bending(modes, turn), turn


def _bending(modes: PlateModes, turn: Floats) -> Floats:
    """Stiffness of bending (r, r) in 1/s2 between combinations (m, r) of modes."""
    stiffness, first = np.zeros((turn.shape[1], turn.shape[1])), 0
    for family in modes.families:
        part = turn[first : (first := first + len(family.squared))]
        own = np.diag(family.squared) if family.bending is None else family.bending
        stiffness += part.T @ own @ part
    return stiffness


def spot_forces(fields: Floats, width: float) -> Floats:
    """Return the forces (m, SIDE^2) of a focal spot of 1 Pa and this width in m at each place of
    the grid. Sums over the places approximate integrals of smooth fields (m, SIDE^2).
    """
    distance = np.subtract.outer(grid_line(), grid_line())
    spot = STEP * np.exp(-(distance**2) / (2 * width**2))
    return np.asarray(spot @ fields.reshape(-1, SIDE, SIDE) @ spot).reshape(len(fields), -1)
