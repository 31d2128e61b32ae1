"""The paper's model, equation 2 with U(t) = 1: the pressure of the focus, weighted by distance.

Nothing propagates: a skin point feels the moving pressure where it is, when it is there.
"""

import time
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from simple_model.pressure import MovingPressure
from simple_model.response import Effort, Response
from simple_model.sampling import fold_parts, low_passed
from simple_model.trajectory import Floats


def point_kernel(pressure: MovingPressure, probes: ArrayLike, times: Floats) -> Response:
    """Stimulation in Pa at probes (p, 2) in metre and equally spaced times (t,) in s.

    Where the focus is so fast, or modulated so fast, that samples would show its lines elsewhere,
    those above half the sampling rate are left out.

    Raises
    ------
    ValueError
        If probes do not have two coordinates.
    """
    probes = np.array(probes, np.float64)
    if probes.ndim != 2 or probes.shape[1] != 2:
        raise ValueError(f"probes have shape {probes.shape}; give (p, 2) positions in metre")
    started = time.perf_counter()
    stimulation = low_passed(partial(pressure, probes), times, fold_parts(pressure, times))
    effort = Effort(seconds={"evaluate": time.perf_counter() - started}, steps=len(times))
    return Response(
        model="point-kernel",
        times=np.array(times),
        probes=probes,
        displacement=stimulation,
        unit="Pa",
        effort=effort,
    )
