"""A Python script that plays a Tacton on AUTD3 devices by pyautd3's FociSTM.

The device steps through a list of foci at 40 kHz / N and begins anew at its end, so that it draws
at 40 kHz / (N points); the nearest such frequency is taken, and stated.
"""

from math import ceil

import numpy as np

from simple_model import MovingPressure
from skinwave.patterns.pattern import Options, aliased, loudness
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

TICK = 40_000.0  # Hz
MOST_PATTERNS = 8192  # of a FociSTM
MOST_SAMPLES = 32_768  # of a modulation
MOST_DIVISION = 65_535
MODULATION = 10  # ticks a sample: 4 kHz
RESOLUTION = 0.025  # mm, to which devices round


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """The script, and notes on what it can only come near to; raises a ValueError if the path is
    too slow or the load one that no sound makes.
    """
    pressure, path = scene.pressure, scene.tacton.trajectory
    foci, turns = len(scene.tacton.foci), scene.tacton.sharing == "time_multiplexed"
    count, division = steps(path.drawing_frequency, foci if turns else 1)
    places = _places(pressure, count, turns=turns and foci > 1)
    samples, ticks = _modulation(pressure, path.drawing_frequency)
    drawn = TICK / division / count if not path.is_static else 0.0
    notes = [
        f"{count} patterns of {places.shape[1]} foci, one each {division} ticks of 40 kHz",
        f"draws {drawn:.6g} Hz where {path.drawing_frequency:.6g} Hz was asked for",
        f"positions rounded to {RESOLUTION:g} mm by the device",
    ]
    if foci > 1:
        notes.append(f"{foci} foci {'in turn' if turns else 'at the same time'}")
    if len(samples) > 1:
        notes.append(f"modulation: {len(samples)} samples at {TICK / ticks:g} Hz in 255 steps")
    notes += aliased(scene.tacton, TICK / ticks)
    return _script(scene, places, division, samples, ticks, notes).encode(), tuple(notes)


def steps(frequency: float, multiple: int = 1) -> tuple[int, int]:
    """How many points to a period, a multiple, and ticks to a point come nearest to a drawing
    frequency in Hz; two points, the least that a FociSTM takes, for a focus that rests. No list is
    long enough for very slow ones: a ValueError.
    """
    if frequency == 0:
        return 2 * multiple, 1
    ticks = TICK / frequency
    most = MOST_PATTERNS // multiple * multiple
    division = max(1, ceil(ticks / most - 1e-9))
    if division > MOST_DIVISION:
        raise ValueError(f"{frequency:g} Hz is slower than a device's {TICK / 5.4e8:.2g} Hz; wait")
    count = max(multiple, round(ticks / division / multiple) * multiple)
    return min(count, most), division


def _places(pressure: MovingPressure, count: int, *, turns: bool) -> Floats:
    """Positions (patterns, foci, 2) in mm along one period."""
    path, ahead = pressure.tacton.trajectory, np.array(pressure.tacton.foci)
    phase = np.arange(count)[:, None] / count * (not path.is_static) + ahead
    if turns:
        phase = phase[np.arange(count), np.arange(count) % len(ahead)][:, None]
    return 1e3 * path.at_phase(np.mod(phase, 1.0))


def _modulation(pressure: MovingPressure, f_d: float) -> tuple[np.ndarray, int]:
    """Sound pressure as bytes (k,), and ticks to a sample; one byte if it stays the same."""
    tacton, path = pressure.tacton, pressure.tacton.trajectory
    ticks = max(MODULATION, ceil(tacton.duration * TICK / MOST_SAMPLES))
    t = np.arange(max(2, int(tacton.duration * TICK / ticks))) * (ticks / TICK)
    loud = loudness(pressure, t)
    if path.levels:
        loud = loud * np.sqrt(pressure.weight(path.phase(t)))
        if len(tacton.foci) > 1 and len(set(path.levels)) > 1:
            raise ValueError("foci with levels of their own share one modulation there; write .csv")
    found = np.round(255 * loud).astype(int)
    return (found[:1] if np.ptp(loud) < 1e-12 else found), ticks


def _script(
    scene: Scene, places: Floats, division: int, samples: np.ndarray, ticks: int, notes: list[str]
) -> str:
    points = ",\n".join(
        "    [" + ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in pattern) + "]" for pattern in places
    )
    name = scene.name.encode("unicode_escape").decode().replace('"', "'")
    said = "\n".join(f"# {note}." for note in notes)
    return f'''"""{name}: {scene.tacton.duration:g} s on AUTD3 devices, by pyautd3 38."""
{said}
# Open the link of your own devices in place of Nop.

import time

import numpy as np
from pyautd3 import AUTD3, ControlPoint, ControlPoints, Controller, FociSTM, Null
from pyautd3 import SamplingConfig, Silencer
from pyautd3.link.nop import Nop
from pyautd3.modulation import Custom

HEIGHT = {1e3 * scene.pressure.height!r}  # mm above the array
PLACES = [  # mm from the centre: patterns, foci, (x, y)
{points},
]
MODULATION = {samples.tolist() * (2 if len(samples) == 1 else 1)}  # of 255, full drive

with Controller.open([AUTD3(pos=[0.0, 0.0, 0.0], rot=[1, 0, 0, 0])], Nop()) as autd:
    centre = autd.center()
    foci = [
        ControlPoints([ControlPoint(centre + np.array([x, y, HEIGHT])) for x, y in pattern])
        for pattern in PLACES
    ]
    autd.send(Silencer.disable())
    modulation = Custom(np.array(MODULATION, dtype=np.uint8), SamplingConfig({ticks}))
    autd.send((modulation, FociSTM(foci, SamplingConfig({division}))))
    time.sleep({scene.tacton.duration!r})
    autd.send(Null())
'''
