"""Speed of a circling focus at which a body deflects most."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from simple_model import MovingPressure, Tacton, Trajectory, steady_state
from simple_model.typing import Floats
from skinwave.bodies import Body
from skinwave.bodies.analytic import compliance
from skinwave.verify.compared import Compared, compared
from skinwave.verify.published import OPTIMUM

SPEEDS = np.arange(1.0, 16.1, 0.5)  # m/s
PERIMETERS = (0.100, 0.060)  # m: whether it is a speed or a frequency that matters
SAMPLES = 256  # of a turn


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """Deflection on the path (v,) in m/Pa at speeds of the focus (v,) in m/s, largest and peak to
    peak, for a perimeter in m.
    """

    perimeter: float
    speeds: Floats
    largest: Floats
    peak_to_peak: Floats

    @property
    def optimum(self) -> float:
        """Speed in m/s of the largest deflection."""
        return top(self.speeds, self.largest)

    @property
    def optimum_peak_to_peak(self) -> float:
        """Speed in m/s of the largest deflection peak to peak, all that a vibrometer sees."""
        return top(self.speeds, self.peak_to_peak)


def sweep(body: Body, perimeter: float) -> Sweep:
    """Steady deflection of the path under a focus that runs a circle at each of `SPEEDS`."""
    found = np.array([_deflection(body, perimeter, v) for v in SPEEDS])
    return Sweep(
        perimeter=perimeter, speeds=SPEEDS, largest=found.max(axis=1),
        peak_to_peak=np.ptp(found, axis=1),
    )  # fmt: skip


def _deflection(body: Body, perimeter: float, speed: float) -> Floats:
    """Deflection (t,) in m/Pa of a point of the path over a turn at a constant pressure."""
    circle = Trajectory(shape="circle", size=perimeter / np.pi, speed=speed)
    turn = 1 / circle.drawing_frequency
    pressure = MovingPressure(tacton=Tacton(trajectory=circle), peak_pressure=1.0)
    times = np.arange(SAMPLES) * turn / SAMPLES
    probe = [[perimeter / (2 * np.pi), 0.0]]
    return steady_state(compliance(body), pressure, probe, times).values[:, 0]


def top(x: Floats, y: Floats) -> float:
    """Top of the parabola through the highest point and its neighbours; nan at an end."""
    k = int(np.argmax(y))
    if not 0 < k < len(x) - 1:
        return float("nan")
    before, here, after = y[k - 1 : k + 2]
    step = (x[k + 1] - x[k - 1]) / 2
    return float(x[k] + step * (before - after) / (before - 2 * here + after) / 2)


def compare_sweeps(sweeps: Mapping[str, tuple[Sweep, ...]]) -> list[Compared]:
    """Rows of the optimum: of the largest deflection and peak to peak, of each perimeter.

    Parameters
    ----------
    sweeps : by the names of `waves.BODIES`

    Returns
    -------
    Rows, by perimeter and body
    """
    rows = []
    for name, of_body in sweeps.items():
        for each in of_body:
            size = f"{1e3 * each.perimeter:g} mm around"
            for what, optimum in (
                ("largest", each.optimum),
                ("peak to peak", each.optimum_peak_to_peak),
            ):
                here = replace(OPTIMUM, name=f"{OPTIMUM.name}, {what}, {size}")
                rows += compared(here, name, [optimum])
    return rows
