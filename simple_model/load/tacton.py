"""The commanded signal, equation 1 of Lim, Seifi and Park, CHI EA '24:

    p(t) = A U(t) {w1 M1(t) + w2 M2(t)} E(t)

with the carrier U at 40 kHz, AM sinusoids M = sin(2 pi f_AM t) and the envelope E = sin(2 pi f_e
t). A frequency of 0 means a factor of 1. A rhythm, or a signal with the role "envelope", is another
factor of A; a signal with the role "modulation" is another factor of {...}.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers, check_range, choose
from simple_model.load.rhythm import Rhythm, Signal
from simple_model.load.trajectory import SAME_PHASE, Trajectory
from simple_model.typing import Floats

CARRIER = 40e3  # Hz
LONGEST = 30.0  # s
MOST_FOCI = 8  # that devices make at a time
SHARINGS = ("simultaneous", "time_multiplexed")
COMMENSURATE = 1e-6  # largest relative distance from a whole multiple of a common frequency
RETURN_TOLERANCE = 0.01  # of a turn
SUPERPOSITIONS = ((1.0, 0.0), (0.75, 0.25), (0.5, 0.5), (0.25, 0.75), (0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Tacton:
    """A mid-air tactile pattern.

    Parameters
    ----------
    amplitude : float, 0 to 1, share of the full drive of the device
    am_frequency, second_am_frequency : float, Hz, 0 = off
    superposition : (w1, w2), weights >= 0 of the two AM sinusoids, sum 1
    envelope_frequency : float, Hz, 0 = constant
    duration : float, s, above 0 and at most 30
    trajectory : Trajectory
    foci : (n,) phases, 0 to 1 of the drawing period, by which one to eight foci run ahead on the
        same path; see `simple_model.joined` for paths of their own
    sharing : how the array makes several foci, each with 1/n of the pressure of one:
        "simultaneous", each at 1/sqrt(n) of the sound pressure, without interference; or
        "time_multiplexed", in turn, faster than a body can follow. The load is the same.
    rhythm : Rhythm or None
    signal : Signal or None

    Raises a ValueError if a value is not finite or out of range, or if a path with levels is
    combined with a rhythm or a signal.

    >>> circle = Trajectory(shape="circle", size=0.02, speed=12.0)
    >>> tacton = Tacton(am_frequency=140.0, duration=0.5, trajectory=circle)
    >>> round(tacton.drawing_frequency, 1)  # Hz
    191.0
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
                "a recorded path with levels takes no rhythm or signal; include it in the levels, "
                "or leave it out"
            )

    @property
    def is_sampled(self) -> bool:
        """Whether a rhythm or a signal modulates the amplitude."""
        return self.rhythm is not None or self.signal is not None

    @property
    def n_paths(self) -> int:
        """Number of paths: n for a recording that n foci share evenly, see `joined`, else 1."""
        n = len(self.foci)
        shared = self.trajectory.shape == "recorded" and all(
            abs(phase - k / n) < SAME_PHASE for k, phase in enumerate(sorted(self.foci))
        )
        return n if shared else 1

    @property
    def drawing_frequency(self) -> float:
        """How many times a second each path is drawn, Hz; 0 if the foci do not move."""
        return self.n_paths * self.trajectory.drawing_frequency


def modulation(tacton: Tacton, t: ArrayLike) -> Floats:
    """Modulation {w1 M1 + w2 M2} E of the carrier, -1 to 1, at times (...) in s.

    >>> modulation(Tacton(am_frequency=140.0), [0.0, 1 / 560]).round(6)
    array([0., 1.])
    """
    t = np.asarray(t, np.float64)
    sinusoids = modulation_at_phases(tacton, *(2 * np.pi * f * t for f in tones(tacton)))
    if tacton.signal and tacton.signal.role == "modulation":
        return sinusoids * tacton.signal.at(t)
    return sinusoids


def level(tacton: Tacton, t: ArrayLike) -> Floats | float:
    """Factor of rhythm and envelope signal on the amplitude, 0 to 1, at times (...) in s."""
    factor: Floats | float = tacton.rhythm.level(t) if tacton.rhythm else 1.0
    if tacton.signal and tacton.signal.role == "envelope":
        factor = factor * tacton.signal.at(t)
    return factor


def modulation_at_phases(tacton: Tacton, first: Floats, second: Floats, envelope: Floats) -> Floats:
    """Modulation (...), -1 to 1, for phases (...) in rad of its three sinusoids."""
    w1, w2 = tacton.superposition
    m1, m2, e = (
        np.sin(phase) if f > 0 else np.ones_like(phase)
        for f, phase in zip(tones(tacton), (first, second, envelope), strict=True)
    )
    return (w1 * m1 + w2 * m2) * e


def tones(tacton: Tacton) -> tuple[float, float, float]:
    """Frequencies in Hz of the two AM sinusoids and the envelope; 0 if off."""
    return tacton.am_frequency, tacton.second_am_frequency, tacton.envelope_frequency


def commanded_signal(tacton: Tacton, t: ArrayLike) -> Floats:
    """Commanded signal p(t) of equation 1 at times (...) in s, with its carrier, over full drive.

    It excludes the levels of a recorded path, which differ between foci.
    """
    carrier = np.sin(2 * np.pi * CARRIER * np.asarray(t, np.float64))
    return tacton.amplitude * level(tacton, t) * carrier * modulation(tacton, t)


def repetition_frequencies(tacton: Tacton) -> dict[str, float]:
    """Frequencies in Hz of all repeating parts of a Tacton, by name; f_d is that of all foci."""
    w1, w2 = tacton.superposition
    signal = tacton.signal
    frequencies = {
        "f_AM": tacton.am_frequency * (w1 > 0),
        "f_AM2": tacton.second_am_frequency * (w2 > 0),
        "f_e": tacton.envelope_frequency,
        "f_d": _symmetry(tacton.foci) * tacton.trajectory.drawing_frequency,
        "f_r": 1 / tacton.rhythm.period if tacton.rhythm else 0.0,
        "f_s": signal.rate / len(signal.samples) if signal else 0.0,
    }
    return {name: f for name, f in frequencies.items() if f > 0}


def pattern_period(tacton: Tacton) -> float:
    """Return the period in s of the whole pattern.

    It is the shortest time, at most the duration, after which AM, envelope, foci, rhythm and signal
    repeat together. Incommensurate frequencies do not repeat exactly: then every phase returns
    within 1 % of a turn, or as closely as possible, after no less than the period of their slowest
    beat. For f_d = 190.986 Hz and f_AM = 140 Hz this takes 78.5 ms. If nothing repeats, it is the
    duration.

    >>> round(pattern_period(Tacton(am_frequency=100.0, envelope_frequency=40.0)), 6)
    0.05
    """
    by_name = repetition_frequencies(tacton)
    f = np.array(list(by_name.values()))
    if not len(f) or f.min() * tacton.duration < 1 - COMMENSURATE:
        return tacton.duration
    if exact := exact_period(tacton, tacton.duration):
        return min(exact, tacton.duration)
    return _near_return(f, _slowest_beat(by_name, tacton.duration), tacton.duration)


def exact_period(tacton: Tacton, longest: float = LONGEST) -> float:
    """Return the period in s after which all parts of a Tacton repeat exactly; 0 if it exceeds
    `longest` in s.

    >>> exact_period(Tacton(am_frequency=140.0, rhythm=Rhythm(pulses=((0.05, 0.03),))))
    0.4
    """
    f = np.array(list(repetition_frequencies(tacton).values()))
    if not len(f):
        return 0.0
    turns = np.outer(np.arange(1, int(f.min() * longest + COMMENSURATE) + 1), f / f.min())
    exact = (np.abs(turns - np.round(turns)) <= COMMENSURATE * turns).all(axis=1)
    return float((np.argmax(exact) + 1) / f.min()) if exact.any() else 0.0


def _symmetry(foci: tuple[float, ...]) -> int:
    """The largest n for which a shift by an n-th of the period leaves the set of foci unchanged."""
    phases = np.mod(foci, 1.0)

    def same(n: int) -> bool:
        away = (phases[:, None] + 1 / n - phases + 0.5) % 1 - 0.5
        return bool((np.abs(away) < SAME_PHASE).any(axis=1).all())

    return next((n for n in range(len(foci), 1, -1) if same(n)), 1)


def _slowest_beat(by_name: dict[str, float], duration: float) -> float:
    """Period in s, at most the duration, of the slowest difference of low multiples: up to 5 of a
    path, a rhythm or a signal, and up to 2 of a sinusoid.
    """
    orders = {name: 5 if name in ("f_d", "f_r", "f_s") else 2 for name in by_name}
    multiples = [f * np.arange(1, orders[name] + 1) for name, f in by_name.items()]
    beats = [np.abs(a[:, None] - b).ravel() for k, a in enumerate(multiples) for b in multiples[:k]]
    each = np.concatenate([*multiples, *beats])
    return min(float(1 / each[each * duration > RETURN_TOLERANCE].min()), duration)


def _near_return(f: Floats, shortest: float, longest: float) -> float:
    """Time in s within limits at which the phases of frequencies (k,) in Hz return best."""
    t = np.unique(np.concatenate([np.arange(1, int(longest * each) + 1) / each for each in f]))
    counts = np.round(np.outer(t, f))
    t = counts @ f / (f @ f)  # the errors shared out
    error = np.abs(np.outer(t, f) - counts).max(axis=1)
    possible = (t >= shortest * (1 - RETURN_TOLERANCE)) & (t <= longest)
    if not possible.any():
        return longest
    t, error = t[possible], error[possible]
    returned = error <= RETURN_TOLERANCE
    return float(t[returned].min() if returned.any() else t[np.argmin(error)])
