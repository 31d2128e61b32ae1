"""Focus that draws a zigzag along a hand and back: velocity along its path, predicted and measured.

The drawing is that of Reardon et al., Sci. Adv. 9, eadf2037 (2023), doi 10.1126/sciadv.adf2037:
longitudinal speed 1 to 11 m/s, transverse speed 2.5 m/s either way, path 20 mm wide. Its length
differs with the hand.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simple_model import MovingPressure, Tacton, Trajectory, flat_body
from simple_model.typing import Floats
from skinwave.bodies.analytic import compliance
from skinwave.measure import Measurement
from skinwave.measure.reading import completing, read_alone
from skinwave.verify.published_waves import BODIES

SPEEDS = (1.0, 2.0, 4.0, 7.0, 11.0)  # m/s, along the hand
ACROSS, WIDTH = 2.5, 0.020  # m/s, m
LENGTH = 0.170  # m, from the wrist to the tip of digit II; assumed
RATE = 5000.0  # Hz
PLACES = np.linspace(-0.080, 0.080, 17)  # m, along the hand from the middle of the path
BODIES_SHOWN = ("palm", "palm-layers")


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """RMS velocity (p,) in m/s normal to the skin at places (p,) in m along the path, over the time
    in which it is drawn, or over a whole recording; `speed` in m/s.
    """

    name: str
    speed: float
    places: Floats
    rms: Floats

    @property
    def middle(self) -> float:
        """Median of the places, m/s."""
        return float(np.median(self.rms))


def path(speed: float) -> Trajectory:
    """The zigzag at a longitudinal speed in m/s: from one end to the other and back."""
    half = LENGTH / speed
    turns = np.arange(0.0, 2 * half, WIDTH / ACROSS)
    t = np.unique(np.concatenate([turns, [half, 2 * half]]))
    x = LENGTH * (0.5 - np.abs(t / half - 1))
    period = 2 * WIDTH / ACROSS
    y = WIDTH * (np.abs(2 * np.mod(t / period, 1) - 1) - 0.5)
    points = tuple(map(tuple, np.stack([x, y], axis=1).tolist()))
    return Trajectory(shape="recorded", points=points, times=tuple(t.tolist()))


def predicted(body: str, speed: float) -> Profile:
    """RMS velocity along the middle of the path, from rest, of one of `waves.BODIES`."""
    drawn = path(speed)
    pressure = MovingPressure(tacton=Tacton(trajectory=drawn, duration=drawn.times[-1]))
    times = np.arange(0.0, drawn.times[-1], 1 / RATE)
    probes = np.stack([PLACES, np.zeros_like(PLACES)], axis=1)
    moved = flat_body(compliance(BODIES[body]), pressure, probes, times).values
    velocity = np.diff(moved, axis=0) * RATE
    return Profile(name=body, speed=speed, places=PLACES, rms=_rms(velocity))


def measured(file: Path, speed: float) -> Profile:
    """RMS velocity along the hand of a vibrometer's recording: mean square over repetitions, of
    places as far along the direction in which they extend furthest.

    Raises
    ------
    ValueError
        If the file cannot be read, has no velocity or no places.
    """
    found = read_alone(file)
    if found.quantity != "velocity" or found.is_spectrum:
        raise ValueError(
            f"{file} holds no waveforms of velocity, which the zigzag is compared by; give one of "
            "the set's .mat files"
        )
    known = np.asarray(np.isfinite(found.places).all(axis=1))
    if known.sum() < 2:
        raise ValueError(
            f"{file} holds no places of its {len(known)} points; give its point map, x and y of "
            f"each, by --places: {completing(file)}"
        )
    along, rms = _along(found, known)
    return Profile(name=f"measured, {file.name}", speed=speed, places=along, rms=rms)


def _along(found: Measurement, known: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Places along the principal axis, from their middle, rising, and RMS there."""
    places = found.places[known]
    centred = places - (places.max(axis=0) + places.min(axis=0)) / 2
    axis = np.linalg.svd(centred - centred.mean(axis=0), full_matrices=False)[2][0]
    along = centred @ (axis * np.sign(axis[np.argmax(np.abs(axis))]))
    values = found.values[:, :, known]
    order = np.argsort(along)
    centred_values = values - values.mean(axis=1, keepdims=True)
    rms = np.sqrt(np.mean(centred_values**2, axis=(0, 1)))
    return along[order], rms[order]


def _rms(velocity: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(velocity**2, axis=0)))


def binned(profile: Profile, places: Floats = PLACES) -> Floats:
    """Root mean square (p,) of the RMS of all places nearest to each of these; nan without any."""
    nearest = np.abs(profile.places[:, None] - places).argmin(axis=1)
    step = places[1] - places[0]
    near = np.abs(profile.places - places[nearest]) <= step / 2 + 1e-12
    out = np.full(len(places), np.nan)
    for k in np.unique(nearest[near]):
        out[k] = np.sqrt(np.mean(profile.rms[near & (nearest == k)] ** 2))
    return out
