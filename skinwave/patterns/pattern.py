"""Contents of a pattern file, and options for reading and writing."""

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
STRAIGHT = 2e-5, 1e-3  # m and of full drive, tolerances of straight lines between samples


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Contents of a file."""

    tacton: Tacton
    pressure: Mapping[str, Any] = field(default_factory=dict)  # fields that it sets, as "drive"
    name: str = ""
    notes: tuple[str, ...] = ()  # on assumptions and changes


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options for a pattern file.

    Parameters
    ----------
    rate : Hz, sampling rate of a CSV that is read without times, or written
    height : m, of the focus, replaces that of the file
    hold : whether a focal point stays until the next sample; otherwise it moves straight
    role : "modulation" or "envelope", the meaning of a WAV
    scale : "full", "peak" or "rms": samples of a WAV as stored, scaled to a peak of 1, or scaled to
        the root mean square of a full sine
    parameters : values of parameters of an AdapTics file, replace their defaults
    resize : factor of all positions of the path, about the origin
    package : "pyautd3" or "autd3", which plays a script
    """

    rate: float | None = None
    height: float | None = None
    hold: bool = False
    role: str = "modulation"
    scale: str = "full"
    parameters: Mapping[str, float] = field(default_factory=dict)
    resize: float = 1.0
    package: str = "pyautd3"


def onto(base: Scene, pattern: Pattern, name: str) -> Scene:
    """Return the base scene with the pattern as its Tacton."""
    pressure = replace(base.pressure, tacton=pattern.tacton, **pattern.pressure)
    clean = (pattern.name or name).encode("utf-8", "replace").decode()  # without lone surrogates
    return replace(base, name=clean, pressure=pressure)


def resize(tacton: Tacton, factor: float) -> Tacton:
    """Multiply all positions of a Tacton by a factor; its drawing frequency stays the same."""
    if not (isfinite(factor) and factor > 0):
        raise ValueError(f"--resize is {factor:g}; give a finite number above 0")
    path = tacton.trajectory
    points = tuple(map(tuple, (factor * np.reshape(path.points, (-1, 2))).tolist()))
    moved = replace(
        path, size=factor * path.size, speed=factor * path.speed, points=points,
        centre=(factor * path.centre[0], factor * path.centre[1]),
    )  # fmt: skip
    return replace(tacton, trajectory=moved)


def wide_enough(base: Scene, tacton: Tacton, notes: list[str]) -> Scene:
    """Widen the body of the base scene if the path of a Tacton needs it, and add a note."""
    margin = 0.010  # m between path and edge
    reach = 2 * (np.abs(tacton.trajectory.outline).max(axis=0) + margin)
    width, height = np.maximum(reach, [base.body.width, base.body.height]).tolist()
    if (width, height) == (base.body.width, base.body.height):
        return base
    notes.append(
        f"the default slab is {1e3 * width:g} mm x {1e3 * height:g} mm, to contain the path; "
        "--scene sets another body, --resize scales the path"
    )
    return replace(base, body=replace(base.body, width=width, height=height))


def aliasing_notes(tacton: Tacton, rate: float) -> list[str]:
    """Return a note on each tone of the modulation above half a sampling rate in Hz."""
    return [
        f"AM of {f:g} Hz is above half the sample rate, {rate / 2:g} Hz, and becomes "
        f"{abs(f - rate * round(f / rate)):g} Hz; lower the AM, or raise the rate"
        for f in sorted(set(tones(tacton)))
        if f > rate / 2
    ]


def one_height(z: Floats, options: Options, notes: list[str]) -> dict[str, float]:
    """Return the height in m by its key: that of the options, or that of all foci z (k,).

    Raises a ValueError if the foci differ in height.
    """
    if options.height is not None:
        return {"height": options.height}
    if np.ptp(z) > 1e-9:
        raise ValueError(
            f"the focus moves from {1e3 * z.min():g} to {1e3 * z.max():g} mm above the array, but "
            "a scene has one height; give it with --height"
        )
    if z[0] == 0:
        notes.append("the file gives no height above the array; that of the scene is used")
        return {}
    return {"height": float(z[0])}


def thin(t: Floats, places: Floats, levels: Floats) -> np.ndarray:
    """Return indices (k,) of enough samples at times (t,) for straight lines between them.

    These are within `STRAIGHT` of all places (t, 2) in m and levels (t,).
    """
    values = np.column_stack([places / STRAIGHT[0], levels / STRAIGHT[1]])
    kept, before = np.arange(len(t)), 0
    while len(kept) != before:
        before = len(kept)
        fewer = np.append(kept[:-1:2], kept[-1])
        errors = [np.abs(x - np.interp(t, t[fewer], x[fewer])) for x in values.T]
        worst = np.maximum.reduceat(np.max(errors, axis=0), fewer[:-1])
        dropped = np.setdiff1d(kept, fewer)
        kept = np.union1d(fewer, dropped[worst[np.searchsorted(fewer, dropped) - 1] > 1])
    return kept


def loudness(pressure: MovingPressure, t: ArrayLike) -> Floats:
    """Return the sound pressure (...) of each focus at times (...) in s relative to full drive.

    It is the square root of the relative radiation pressure, without the levels of a recording.

    Raises a ValueError if the radiation pressure is negative.
    """
    full = replace(pressure, tacton=Tacton(foci=pressure.tacton.foci)).gain(np.zeros(1))
    relative = pressure.gain(t) / full if full else np.zeros(np.shape(t))
    if (relative < -1e-12).any():
        raise ValueError(
            f"the drive '{pressure.drive}' has negative pressure half of the time, which no device "
            "can exert; use the drive 'pressure_squared' or 'force_corrected'"
        )
    return np.sqrt(np.clip(relative, 0, 1))
