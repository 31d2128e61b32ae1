"""Point-kernel model of Lim, Seifi and Park (CHI EA '24), equation 2 with U(t) = 1.

Nothing propagates: the stimulation at a skin point is the moving pressure there at that time, the
pressure of the focus weighted by distance. As published, the load is the commanded signal itself
(drive law "linear") in a focal spot without side lobes ("main_lobe"). The same model applies to any
other load.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from simple_model.load.drive import PUBLISHED
from simple_model.load.pressure import MovingPressure
from simple_model.load.sampling import highest_line, low_pass, oversampling, step
from simple_model.quantities import PRESSURE
from simple_model.response import Effort, Response
from simple_model.typing import Floats


def published_load(pressure: MovingPressure) -> MovingPressure:
    """Return the same Tacton under the load of the paper: linear drive, main lobe, no mean."""
    return replace(pressure, drive=PUBLISHED, profile="main_lobe")


def point_kernel_published(pressure: MovingPressure, probes: ArrayLike, times: Floats) -> Response:
    """Compute the stimulation under the published load, for any given drive law and focus.

    Parameters, result and errors are those of `point_kernel`.
    """
    response = point_kernel(published_load(pressure), probes, times)
    return replace(response, model="point-kernel-published")


def point_kernel(pressure: MovingPressure, probes: ArrayLike, times: Floats) -> Response:
    """Compute the stimulation (t, p) in Pa of probes (p, 2) in m at equally spaced times (t,) in s.

    Lines above half the sampling rate are left out. Raises a ValueError for probes of another
    shape.

    >>> from simple_model import Tacton
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0), drive="linear")
    >>> response = point_kernel(load, [[0.0, 0.0], [0.01, 0.0]], np.arange(1000) / 1e4)
    >>> response.values.max(axis=0).round(1)  # Pa
    array([50. ,  3.6])
    """
    probes = np.array(probes, np.float64)
    if probes.ndim != 2 or probes.shape[1] != 2:
        raise ValueError(f"probes have shape {probes.shape}; give positions of shape (p, 2) in m")
    started = time.perf_counter()
    parts = oversampling(highest_line(pressure), step(times))
    stimulation = low_pass(partial(pressure, probes), times, parts)
    effort = Effort(seconds={"evaluate": time.perf_counter() - started}, steps=len(times))
    return Response(
        model="point-kernel", times=np.array(times), probes=probes, values=stimulation,
        quantity=PRESSURE.name, effort=effort, load=pressure,
    )  # fmt: skip
