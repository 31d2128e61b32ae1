"""Contents of a pattern file, and what a user may decide about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model import MovingPressure, Tacton
from simple_model.load.tacton import tones
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

ENGINE_RATE = 20_000.0  # Hz, of samples in AdapTics
STRAIGHT = 2e-5, 1e-3  # m and of full drive, within which straight lines stand for samples
MARGIN = 0.010  # m between a path and the edge of a body that is made for it


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """A Tacton from a file, the `pressure` keys that the file decides (height, drive), its name,
    and `notes` on what the file leaves open or what was changed.
    """

    tacton: Tacton
    pressure: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Options:
    """Choices that a file leaves open.

    Parameters
    ----------
    rate : Hz, of the samples of a CSV, read without times or written
    height : metre, of the focus, in place of the file's
    hold : whether a focal point stays until the next sample, rather than going there straight
    role : "modulation" or "envelope", what a WAV is
    scale : "full", "peak" or "rms": the samples of a WAV as they are, or their highest is 1, or
        their root mean square that of a full sine
    parameters : values of an AdapTics file's parameters, instead of their defaults
    resize : factor of all positions of the path, about the origin
    """

    rate: float | None = None
    height: float | None = None
    hold: bool = False
    role: str = "modulation"
    scale: str = "full"
    parameters: Mapping[str, float] = field(default_factory=dict)
    resize: float = 1.0


def onto(base: Scene, pattern: Pattern, name: str) -> Scene:
    """The base scene with the pattern in place of its Tacton."""
    pressure = replace(base.pressure, tacton=pattern.tacton, **pattern.pressure)
    named = (pattern.name or name).encode("utf-8", "replace").decode()  # half a letter is none
    return replace(base, name=named, pressure=pressure)


def resized(tacton: Tacton, factor: float) -> Tacton:
    """The Tacton with all positions times a factor, drawn at the same frequency."""
    if not (isfinite(factor) and factor > 0):
        raise ValueError(f"resize = {factor:g} must be a finite number above 0")
    path = tacton.trajectory
    points = tuple(map(tuple, (factor * np.reshape(path.points, (-1, 2))).tolist()))
    moved = replace(
        path, size=factor * path.size, speed=factor * path.speed, points=points,
        centre=(factor * path.centre[0], factor * path.centre[1]),
    )  # fmt: skip
    return replace(tacton, trajectory=moved)


def wide_enough(base: Scene, tacton: Tacton, notes: list[str]) -> Scene:
    """The base scene on a body that the path of a Tacton lies on, with a note if it is wider."""
    reach = 2 * (np.abs(tacton.trajectory.outline).max(axis=0) + MARGIN)
    width, height = np.maximum(reach, [base.body.width, base.body.height]).tolist()
    if (width, height) == (base.body.width, base.body.height):
        return base
    notes.append(
        f"the default slab is {1e3 * width:g} mm x {1e3 * height:g} mm, for the path to lie on it; "
        "--scene gives another body, --resize another path"
    )
    return replace(base, body=replace(base.body, width=width, height=height))


def aliased(tacton: Tacton, rate: float) -> list[str]:
    """A note on each tone of the modulation above half a rate in Hz, which samples at that rate
    cannot have.
    """
    return [
        f"AM of {f:g} Hz is above half the rate of samples, {rate / 2:g} Hz, and is played at "
        f"{abs(f - rate * round(f / rate)):g} Hz: lower the AM, or raise the rate if the device can"
        for f in sorted(set(tones(tacton)))
        if f > rate / 2
    ]


def one_height(z: Floats, options: Options, notes: list[str]) -> dict[str, float]:
    """The pressure key for a focus at heights (k,) in metre, which must be the same, a ValueError
    otherwise, unless another is given.
    """
    if options.height is not None:
        return {"height": options.height}
    if np.ptp(z) > 1e-9:
        raise ValueError(
            f"the focus moves from {1e3 * z.min():g} to {1e3 * z.max():g} mm above the array, "
            "which no flat surface follows; choose one height with --height"
        )
    if z[0] == 0:
        notes.append("the file says nothing of the height above the array: that of the scene")
        return {}
    return {"height": float(z[0])}


def thinned(t: Floats, places: Floats, levels: Floats) -> np.ndarray:
    """Indices (k,) of the samples that straight lines join within `STRAIGHT` of all places (t, 2)
    in metre and levels (t,) at times (t,).
    """
    values = np.column_stack([places / STRAIGHT[0], levels / STRAIGHT[1]])
    kept, before = np.arange(len(t)), 0
    while len(kept) != before:
        before = len(kept)
        fewer = np.append(kept[:-1:2], kept[-1])
        off = [np.abs(x - np.interp(t, t[fewer], x[fewer])) for x in values.T]
        worst = np.maximum.reduceat(np.max(off, axis=0), fewer[:-1])
        left = np.setdiff1d(kept, fewer)
        kept = np.union1d(fewer, left[worst[np.searchsorted(fewer, left) - 1] > 1])
    return kept


def loudness(pressure: MovingPressure, t: ArrayLike) -> Floats:
    """Sound pressure (...) of each focus at times (...) in s over that at full drive, 0..1: the
    root of the radiation pressure, without a recording's levels; a negative one is a ValueError.
    """
    full = replace(pressure, tacton=Tacton(foci=pressure.tacton.foci)).gain(np.zeros(1))
    relative = pressure.gain(t) / full if full else np.zeros(np.shape(t))
    if (relative < -1e-12).any():
        raise ValueError(
            f"drive '{pressure.drive}' has negative pressure half of the time, which no device can "
            "exert; take drive 'pressure_squared' or 'force_corrected'"
        )
    return np.sqrt(np.clip(relative, 0, 1))
