"""Skin velocity under a focus that draws a zigzag along the hand, by a scanning laser vibrometer.

Reardon et al., Sci. Adv. 9, eadf2037 (2023), doi 10.1126/sciadv.adf2037; data by the record
10.5281/zenodo.7686560: a .mat file a speed and direction, raw output of the vibrometer, whose
variable y (N, M, 2) is the velocity along the laser in m/s at N places, M times, 2 repetitions.
Places are measured one after the other, and the reference signal r tells when each began.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from simple_model.typing import Floats
from skinwave.measure import named
from skinwave.measure.recording import Given, Recording, nowhere
from skinwave.measure.references import aligned

SOURCE = "https://zenodo.org/records/7686560"
LARGEST_HAND = 3.0  # of the spread of places: beyond it these are in mm, not in m


def fits(arrays: Mapping[str, Any]) -> bool:
    """Whether arrays by name are of this set: y (N, M, 2) and a reference r."""
    y = arrays.get("y")
    return y is not None and np.ndim(y) == 3 and np.shape(y)[2] == 2 and "r" in arrays


def recording(arrays: Mapping[str, Any], given: Given) -> Recording:
    """The recording, its places aligned in time by the reference where each has its own.

    Raises
    ------
    ValueError
        If y holds no real numbers, or several arrays may be the places and none are given.
    """
    y, r = np.asarray(arrays["y"]), np.asarray(arrays["r"])
    if y.dtype.kind not in "fiu" or not y.size:
        raise ValueError(f"y holds no real numbers; download the file anew from {SOURCE}")
    values = np.transpose(y, (2, 1, 0)).astype(np.float64)
    drive, said = np.empty(0), "places are as the file has them, not aligned in time"
    if r.dtype.kind in "fiu" and r.shape in (y.shape, y.shape[:2]):
        each = r if r.ndim == 3 else np.repeat(r[..., None], 2, axis=2)
        values, drive, said = aligned(values, np.transpose(each, (2, 1, 0)).astype(np.float64))
    elif r.dtype.kind in "fiu" and r.size == y.shape[1]:
        drive = r.ravel().astype(np.float64)
    times = named.vector(arrays, named.TIMES)
    rate = named.rate(arrays)
    if np.isnan(rate) and len(times) > 1:
        rate = (len(times) - 1) / float(np.ptp(times))
    places = nowhere(len(y)) if given.places is not None else _places(arrays, len(y))
    return Recording(
        values=values, rate=rate, quantity="velocity", unit="m/s", places=places, drive=drive,
        remarks=("velocity along the laser, taken as normal to the skin", said),
    )  # fmt: skip


def _places(arrays: Mapping[str, Any], count: int) -> Floats:
    """Places (p, 2) in metre of the point map: an array of places by its name, else the only one of
    fractions; nan where there is none.
    """
    maps = {name: np.asarray(one) for name, one in arrays.items() if name not in ("y", "r")}
    maps = {name: one for name, one in maps.items() if _may_be_places(one, count)}
    by_name = {n: one for n, one in maps.items() if _last(n) in (*named.PLACES, *named.MILLIMETRES)}
    found = by_name or {name: one for name, one in maps.items() if one.dtype.kind == "f"}
    every = [_in_metre(_last(name), one, count) for name, one in found.items()]
    if not every:
        return nowhere(count)
    if not all(np.allclose(every[0], one, equal_nan=True) for one in every):
        raise ValueError(f"the places may be {' or '.join(found)}; give --places, in mm")
    return every[0]


def _last(name: str) -> str:
    """Name of an array in lower case, without that of its structure."""
    return name.rpartition(".")[2].lower()


def _may_be_places(points: np.ndarray, count: int) -> bool:
    """Whether an array has two or three real coordinates for each place."""
    sizes = (2, 3)
    return (
        points.dtype.kind in "fiu" and points.ndim == 2
        and ((points.shape[0] == count and points.shape[1] in sizes)
             or (points.shape[1] == count and points.shape[0] in sizes))
    )  # fmt: skip


def _in_metre(name: str, points: np.ndarray, count: int) -> Floats:
    points = points if points.shape[0] == count and points.shape[1] in (2, 3) else points.T
    spread = float(np.nanmax(np.ptp(points, axis=0), initial=0.0))
    in_mm = name in named.MILLIMETRES or spread > LARGEST_HAND
    return np.asarray(points[:, :2] / (1e3 if in_mm else 1.0), np.float64)
