"""The commanded signal, equation 1 of Lim, Seifi and Park, CHI EA '24:

    p(t) = A U(t) {w1 M1(t) + w2 M2(t)} E(t)

with the carrier U at 40 kHz, AM sinusoids M = sin(2 pi f_AM t) and the envelope
E = sin(2 pi f_e t). A frequency of 0 means a factor of exactly 1. A rhythm, and a signal that is
an envelope, are further factors of A; a signal that is a modulation is one of {...}.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers, check_range, choose
from simple_model.load.rhythm import Rhythm, Signal
from simple_model.load.trajectory import Trajectory
from simple_model.typing import Floats

CARRIER = 40e3  # Hz
LONGEST = 30.0  # s
MOST_FOCI = 8  # what devices make at a time
SHARINGS = ("simultaneous", "time_multiplexed")
SAME = 1e-9  # of a drawing period, within which phases are the same
COMMENSURATE = 1e-6  # relative: frequencies as near to whole multiples of a common one are these
RETURNED = 0.01  # of a turn: phases as near to where they began have returned
PATH_ORDERS, TONE_ORDERS = 5, 2  # of what is repeated, whose differences are slow beats
SUPERPOSITIONS = ((1.0, 0.0), (0.75, 0.25), (0.5, 0.5), (0.25, 0.75), (0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Tacton:
    """A mid-air tactile pattern.

    Parameters
    ----------
    amplitude : float, 0..1, of the device's full drive
    am_frequency, second_am_frequency : float, Hz, 0 = off
    superposition : (w1, w2), weights >= 0 of the two AM sinusoids, sum 1
    envelope_frequency : float, Hz, 0 = constant
    duration : float, s, above 0 and at most 30
    trajectory : Trajectory
    foci : (n,) phases, 0..1 of the drawing period, by which one to eight foci run ahead on the same
        path; for paths of their own see `simple_model.joined`
    sharing : how the array makes several foci, each with 1/n of the pressure of one alone:
        "simultaneous", each at 1/sqrt(n) of the sound pressure, without interference; or
        "time_multiplexed", in turn, faster than a body can follow. The load is the same.
    rhythm : Rhythm or None
    signal : Signal or None

    Raises a ValueError if a value is not finite or out of range, or a path with levels of its own
    is given a rhythm or a signal.
    """

    amplitude: float = 1.0
    am_frequency: float = 0.0
    second_am_frequency: float = 0.0
    superposition: tuple[float, float] = (1.0, 0.0)
    envelope_frequency: float = 0.0
    duration: float = 1.0
    trajectory: Trajectory = field(default_factory=Trajectory)
    foci: tuple[float, ...] = (0.0,)
    sharing: str = "simultaneous"
    rhythm: Rhythm | None = None
    signal: Signal | None = None

    def __post_init__(self) -> None:
        half = ", half the carrier"
        check_range("amplitude", 100 * self.amplitude, 0, 100, " %", "; 100 % is full drive")
        for name in ("am_frequency", "second_am_frequency", "envelope_frequency"):
            check_range(name, getattr(self, name), 0, CARRIER / 2, " Hz", f"{half}; 0 is off")
        check_numbers("a Tacton", self, "duration")
        check_range("duration", self.duration, 0, LONGEST, " s", ", the longest Tacton; shorten it")
        drawn = self.trajectory.drawing_frequency
        check_range("drawing frequency", drawn, 0, CARRIER / 2, " Hz", f"{half}; lower the speed")
        w1, w2 = self.superposition
        if not (w1 >= 0 and w2 >= 0 and abs(w1 + w2 - 1) <= 1e-9):
            raise ValueError(
                f"superposition = [{w1}, {w2}] must be two weights of 0 or above with sum 1, "
                "such as [0.75, 0.25]"
            )
        choose("sharing", self.sharing, SHARINGS)
        check_range("number of foci", len(self.foci), 1, MOST_FOCI, "", ", what devices make")
        for phase in self.foci:
            check_range("focus phase", phase, 0, 1, "", " of the drawing period")
        if self.is_sampled and self.trajectory.levels:
            raise ValueError(
                "a recorded path has levels of its own; put the rhythm or signal into them, or "
                "leave it out"
            )

    @property
    def is_sampled(self) -> bool:
        """Whether the amplitude follows more than sinusoids."""
        return self.rhythm is not None or self.signal is not None

    @property
    def n_paths(self) -> int:
        """How many paths there are: n of a recording that n foci share evenly, see `joined`."""
        n = len(self.foci)
        shared = self.trajectory.shape == "recorded" and all(
            abs(phase - k / n) < SAME for k, phase in enumerate(sorted(self.foci))
        )
        return n if shared else 1

    @property
    def drawing_frequency(self) -> float:
        """How many times a second each path is drawn, Hz; 0 where the foci do not move."""
        return self.n_paths * self.trajectory.drawing_frequency


def modulation(tacton: Tacton, t: ArrayLike) -> Floats:
    """Modulation {w1 M1 + w2 M2} E of the carrier, -1..1, at times (...) in s."""
    t = np.asarray(t, np.float64)
    sinusoids = modulation_at_phases(tacton, *(2 * np.pi * f * t for f in tones(tacton)))
    if tacton.signal and tacton.signal.role == "modulation":
        return sinusoids * tacton.signal.at(t)
    return sinusoids


def level(tacton: Tacton, t: ArrayLike) -> Floats | float:
    """Level: the factor of rhythm and envelope on the amplitude, 0..1, at times (...) in s."""
    found: Floats | float = 1.0
    if tacton.rhythm:
        found = tacton.rhythm.level(t)
    if tacton.signal and tacton.signal.role == "envelope":
        found = found * tacton.signal.at(t)
    return found


def modulation_at_phases(tacton: Tacton, first: Floats, second: Floats, envelope: Floats) -> Floats:
    """Modulation (...), -1..1, by the phases (...) in rad of its three sinusoids."""
    w1, w2 = tacton.superposition
    m1, m2, e = (
        np.sin(phase) if f > 0 else np.ones_like(phase)
        for f, phase in zip(tones(tacton), (first, second, envelope), strict=True)
    )
    return (w1 * m1 + w2 * m2) * e


def tones(tacton: Tacton) -> tuple[float, float, float]:
    """Frequencies in Hz of the two AM sinusoids and the envelope; 0 where one is off."""
    return tacton.am_frequency, tacton.second_am_frequency, tacton.envelope_frequency


def commanded_signal(tacton: Tacton, t: ArrayLike) -> Floats:
    """Commanded signal p(t) of equation 1 at times (...) in s, with its carrier, over full drive.

    Levels of a recorded path are not in it: each focus has its own.
    """
    carrier = np.sin(2 * np.pi * CARRIER * np.asarray(t, np.float64))
    return tacton.amplitude * level(tacton, t) * carrier * modulation(tacton, t)


def repetition_frequencies(tacton: Tacton) -> dict[str, float]:
    """Frequencies in Hz by name of all that a Tacton repeats; f_d is that of the foci together."""
    w1, w2 = tacton.superposition
    signal = tacton.signal
    found = {
        "f_AM": tacton.am_frequency * (w1 > 0),
        "f_AM2": tacton.second_am_frequency * (w2 > 0),
        "f_e": tacton.envelope_frequency,
        "f_d": _symmetry(tacton.foci) * tacton.trajectory.drawing_frequency,
        "f_r": 1 / tacton.rhythm.period if tacton.rhythm else 0.0,
        "f_s": signal.rate / len(signal.samples) if signal else 0.0,
    }
    return {name: f for name, f in found.items() if f > 0}


def pattern_period(tacton: Tacton) -> float:
    """Period in s of the whole pattern: the shortest time, at most the duration, after which AM,
    envelope, foci, rhythm and signal repeat together.

    Of incommensurate frequencies it is the shortest time, no shorter than the slowest beat between
    them, after which every phase is back within 1 % of a turn, or comes nearest to that: of f_d =
    190.986 Hz with f_AM = 140 Hz, 78.5 ms. It is the duration if nothing repeats within it.
    """
    found = repetition_frequencies(tacton)
    f = np.array(list(found.values()))
    if not len(f) or f.min() * tacton.duration < 1 - COMMENSURATE:
        return tacton.duration
    turns = np.outer(np.arange(1, int(f.min() * tacton.duration + COMMENSURATE) + 1), f / f.min())
    exact = (np.abs(turns - np.round(turns)) <= COMMENSURATE * turns).all(axis=1)
    if exact.any():
        return min(float((np.argmax(exact) + 1) / f.min()), tacton.duration)
    return _near_return(f, _slowest_beat(found, tacton.duration), tacton.duration)


def _symmetry(foci: tuple[float, ...]) -> int:
    """The largest n for which foci a period's n-th part later are the same foci."""
    phases = np.mod(foci, 1.0)

    def same(n: int) -> bool:
        away = (phases[:, None] + 1 / n - phases + 0.5) % 1 - 0.5
        return bool((np.abs(away) < SAME).any(axis=1).all())

    return next((n for n in range(len(foci), 1, -1) if same(n)), 1)


def _slowest_beat(found: dict[str, float], duration: float) -> float:
    """Period in s, at most the duration, of the slowest difference of low multiples."""
    orders = {name: PATH_ORDERS if name in ("f_d", "f_r", "f_s") else TONE_ORDERS for name in found}
    multiples = [f * np.arange(1, orders[name] + 1) for name, f in found.items()]
    beats = [np.abs(a[:, None] - b).ravel() for k, a in enumerate(multiples) for b in multiples[:k]]
    each = np.concatenate([*multiples, *beats])
    return min(float(1 / each[each * duration > RETURNED].min()), duration)


def _near_return(f: Floats, shortest: float, longest: float) -> float:
    """The time in s between two at which the phases of frequencies (k,) in Hz are back best."""
    t = np.unique(np.concatenate([np.arange(1, int(longest * each) + 1) / each for each in f]))
    counts = np.round(np.outer(t, f))
    t = counts @ f / (f @ f)  # the errors shared out
    error = np.abs(np.outer(t, f) - counts).max(axis=1)
    possible = (t >= shortest * (1 - RETURNED)) & (t <= longest)
    if not possible.any():
        return longest
    t, error = t[possible], error[possible]
    returned = error <= RETURNED
    return float(t[returned].min() if returned.any() else t[np.argmin(error)])
