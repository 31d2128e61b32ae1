"""Work of responses: what the predicted costs of models share.

Each model counts its work and multiplies it by the seconds of one unit, measured on one core of
2.6 GHz with AVX-512. Costs agree within a factor of 2 with `python -m bench.costs`.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import load_lines
from skinwave.models.options import SolveOptions, sample_grid
from skinwave.scene.scene import Scene
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Units:
    """Seconds and bytes of units of work that models share."""

    start: float = 0.01  # s of any response
    process: float = 1.4e8  # bytes of a process with all libraries
    line: tuple[float, float] = (1.5e-8, 64)  # s and bytes of one line at one sample
    exponential: float = 2e-9  # s of an exponential at a sample and an output
    # For n degrees of freedom: s of mesh and matrices over n, of a factorisation over n^1.5, of a
    # solution over n^(4/3), and of products with the matrices over n.
    build: float = 3e-5
    factor: float = 1e-7
    solution: float = 3e-8
    product: float = 6e-7


UNITS = Units()


class Cheaper(StrEnum):
    """Changes that make parts of a response cheaper."""

    DURATION = "use a shorter duration_s in [tacton]"
    PROBES = "use fewer probes, or a shorter duration_s in [tacton]"
    LINES = "use a tacton with fewer lines: no rhythm, a slower path or a larger focus"
    REDUCED = "use --model fem, which reduces the body once"
    MODES = "use --model fem-nonlinear, which computes in modes of the sheet"
    MESH = "use larger elements: a larger --tolerance, or --element-size"
    LOSS = "use a material with more loss"


def computed_times(scene: Scene, options: SolveOptions) -> Floats:
    """Return the times (t,) in s at which a model computes a response."""
    return sample_grid(scene, options.times)[0]


def lines_below(scene: Scene, times: Floats, threshold: float = 1e-6) -> int:
    """Return the number of lines of a load that drive a body, above a share of the strongest."""
    f = load_lines(scene.pressure, threshold).frequencies
    return len(np.unique(np.round(f[f < highest_driving(scene.pressure, times)], 9)))


def synthesis(scene: Scene, times: Floats) -> tuple[float, float]:
    """Return the seconds and bytes of the waveforms of the lines below half the sampling rate."""
    f = load_lines(scene.pressure).frequencies
    work = len(times) * len(np.unique(np.round(f[below_half_the_rate(f, times)], 9)))
    return UNITS.line[0] * work, UNITS.line[1] * work
