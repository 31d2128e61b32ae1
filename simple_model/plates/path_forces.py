"""Forces of a moving pressure on the modes of a plate."""

from collections.abc import Sequence

import numpy as np

from simple_model.load.focus import spot_detail, spot_reach
from simple_model.load.path_cells import path_samples
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import path_forces
from simple_model.plates.modes import PlateModes
from simple_model.plates.polynomials import gauss_points
from simple_model.typing import Complex, Floats


def modal_path_forces(
    modes: PlateModes, pressure: MovingPressure, middle: Sequence[float] = (0.0, 0.0)
) -> Complex:
    """Modal forces (n, m) in N kg^-1/2 of unit pressure on the path, by harmonic of the path;
    `middle` (2,) in m is the centre of the plate.
    """
    knots, reach = path_samples(pressure), spot_reach(pressure.height, pressure.profile)
    detail = spot_detail(pressure.height, pressure.profile)
    sizes = modes.plate.size_x, modes.plate.size_y
    (x, of_x), (y, of_y) = (
        _gauss(max(low - reach, at - size / 2), min(high + reach, at + size / 2), detail)
        for low, high, at, size in zip(
            knots.min(axis=0), knots.max(axis=0), middle, sizes, strict=True)
    )  # fmt: skip
    shapes = modes.on_grid(x - middle[0], y - middle[1])
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return path_forces(pressure, points, shapes * np.outer(of_x, of_y).reshape(-1, 1))


def _gauss(low: float, high: float, detail: float, spacing: float = 0.9) -> tuple[Floats, Floats]:
    """Gauss points and weights (k,) in m between two places, at a `spacing` over a detail in m."""
    high = max(low, high)
    count = int(np.ceil(np.pi / 2 * (high - low) / (spacing * detail))) + 8
    return gauss_points(np.array([low, high]), [count])
