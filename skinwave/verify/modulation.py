"""Harmonics of an amplitude-modulated radiation force in the motion of a body, by drive law."""

from dataclasses import dataclass

import numpy as np

from simple_model import DRIVES, MovingPressure, Response, Rhythm, Tacton
from simple_model.response import fit_lines
from simple_model.typing import Floats
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Scene
from skinwave.verify.published_waves import BODIES

SOURCE = "arXiv 1608.08389, radiation force of modulated ultrasound in a phantom"
FOUND = {
    "sine": "a second harmonic and little of a third",
    "square": "almost no second harmonic, but a third",
}
FREQUENCY, DURATION = 140.0, 0.2  # Hz, s; the abstract has no frequency
ORDERS = (1, 2, 3)
BODY = "palm"  # a half-space: the phantom's moduli are not known
ABSENT = 1e-3  # of the fundamental, -60 dB


@dataclass(frozen=True, kw_only=True, eq=False)
class Harmonics:
    """Amplitudes (3,) of the lines at f, 2f and 3f over that at f, of load and displacement, by a
    drive law under a sine or square modulation.
    """

    wave: str
    drive: str
    load: Floats
    motion: Floats

    @property
    def agrees(self) -> bool:
        """Whether the harmonic that was found is there in the motion, and the larger one."""
        second, third = self.motion[1:]
        larger, smaller = (second, third) if self.wave == "sine" else (third, second)
        return bool(larger > ABSENT and larger > smaller)

    @property
    def words(self) -> str:
        """Outcome in words."""
        if self.agrees:
            return "as published"
        absent = "second" if self.wave == "sine" else "third"
        return f"misses: no {absent} harmonic that is larger than the other"


def harmonics() -> list[Harmonics]:
    """Harmonics by each drive law, of sine and square AM."""
    return [_of(wave, drive) for wave in FOUND for drive in DRIVES]


def _tacton(wave: str) -> Tacton:
    if wave == "sine":
        return Tacton(am_frequency=FREQUENCY, duration=DURATION)
    half = 1 / FREQUENCY / 2
    return Tacton(rhythm=Rhythm(pulses=((half, half),)), duration=DURATION)


def _of(wave: str, drive: str) -> Harmonics:
    pressure = MovingPressure(tacton=_tacton(wave), drive=drive)
    scene = Scene(pressure=pressure, body=BODIES[BODY], probes=((0.0, 0.0),))
    moved = compute(scene, "flat-body-harmonic")
    t = moved.times
    load = Response(
        model="load", times=t, probes=moved.probes, values=pressure([[0.0, 0.0]], t),
        quantity="pressure", effort=moved.effort,
    )  # fmt: skip
    return Harmonics(wave=wave, drive=drive, load=_ratios(load), motion=_ratios(moved))


def _ratios(response: Response) -> Floats:
    lines, _ = fit_lines(response, FREQUENCY * np.array(ORDERS))
    return np.abs(lines[:, 0] / lines[0, 0])
