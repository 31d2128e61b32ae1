"""Decay along a finger: of a hand in finite elements, and of SkinSource's impulse responses."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import fem
from simple_model import MovingPressure, Tacton
from simple_model.typing import Floats
from skinwave.bodies import Body
from skinwave.bodies.build import Build, build, operators
from skinwave.measure import Measurement
from skinwave.measure.reading import read
from skinwave.models.loads import surface_load, surface_motion
from skinwave.system.effort import Progress
from skinwave.verify.compared import Compared, compared
from skinwave.verify.published import SKINSOURCE, Published

EXAMPLE = Path(__file__).parents[2] / "examples/hand/generic-hand-right.glb"
UP = "-x"  # of the example, its palm
SIZE = 6.5e-3  # m, of elements; see `page.FINGER` for what it costs
FREQUENCIES = (200.0, 300.0, 400.0)  # Hz
FINGER_LENGTH = 0.070  # m
LOADED = 0.010  # m from the tip, where the focus is
PLACES = np.arange(0.020, 0.171, 0.010)  # m from the tip, those of SkinSource's sensors
TIP = 8  # of SkinSource's locations, force normal to the skin at the tip of digit III
SENSORS = (19, 20, 21, 22, 24, 23, 26, 25, 27)  # from digit III to the wrist, dorsal, from 1
FINGER = (19, 20, 21, 22, 24)  # of these, on the finger itself
PEOPLE = (1, 2, 3, 4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Decay:
    """Amplitude (f, p) of the normal motion of a hand or person over the largest, at frequencies
    (f,) in Hz and distances (p,) in m: of a hand from the finger's tip, of a person from the first
    sensor. Of a hand also the mean edge of the finger's elements in m, and its dofs.
    """

    name: str
    frequencies: Floats
    distances: Floats
    amplitudes: Floats
    dofs: int = 0
    edge: float = 0.0

    @property
    def lengths(self) -> Floats:
        """1/e lengths (f,) in m, fitted to the logarithm; above 0 where it decays."""
        slopes = np.polyfit(self.distances, np.log(self.amplitudes).T, 1)[0]
        return np.asarray(-1 / slopes)


def check_hand(file: Path) -> None:
    """Refuse a hand that is not there, before any work.

    Raises
    ------
    ValueError
        If it is so.
    """
    if not file.is_file():
        raise ValueError(
            f"{file} is not there, and the example hand is in the repository only; give a file of "
            "a hand, --hand FILE, or leave it out"
        )


def of_hand(file: Path, report: Progress, frequencies: tuple[float, ...] = FREQUENCIES) -> Decay:
    """Decay along the finger that reaches furthest from the palm's middle, by finite elements.

    Parameters
    ----------
    file : of a hand, its palm in the direction `UP`
    report : called with the name of the phase and the fraction done
    frequencies : Hz

    Returns
    -------
    Decay, on the palmar side

    Raises
    ------
    ValueError
        If it is no body.
    """
    report("mesh the hand", 0.0)
    body = Body(kind="mesh", file=str(file), up=UP)
    made = build(body, SIZE)
    tip = _tip(made)
    inwards = -tip / np.linalg.norm(tip)
    distances = PLACES[np.linalg.norm(tip) + 0.04 > PLACES]
    report("assemble", 0.1)
    matrices = operators(made)
    P, points = surface_load(made)
    load = MovingPressure(tacton=Tacton(), peak_pressure=1.0)(
        points - [*(tip + LOADED * inwards), 0.0], 0.0
    )
    S = surface_motion(body, made, tip + distances[:, None] * inwards)
    found = []
    for k, f in enumerate(frequencies):
        report(f"solve {f:g} Hz", 0.2 + 0.8 * k / len(frequencies))
        found.append(np.abs(S @ fem.harmonic(matrices, P @ load, [f])[0]))
    return Decay(
        name="the hand, finite elements", frequencies=np.array(frequencies), distances=distances,
        amplitudes=_relative(np.array(found)), dofs=len(matrices.free),
        edge=_edge(made, tip),
    )  # fmt: skip


def _tip(made: Build) -> Floats:
    """Point (2,) of the upper surface that is furthest from the middle and no part of the wrist:
    the wrist is on the other side of the middle than the most points are.
    """
    seen = made.mesh.points[np.unique(made.mesh.facets["top"])][:, :2]
    axis = np.linalg.svd(seen - seen.mean(axis=0), full_matrices=False)[2][0]
    along = seen @ axis
    return seen[np.argmax(along if along.max() > -along.min() else -along)]


def _edge(made: Build, tip: Floats) -> float:
    """Mean edge in m of the elements between the tip and the knuckle."""
    corners = made.mesh.points[made.mesh.tets[:, :4]]
    towards = tip / np.linalg.norm(tip)
    along = corners.mean(axis=1)[:, :2] @ towards
    own = corners[along > np.linalg.norm(tip) - FINGER_LENGTH]
    first, second = np.triu_indices(4, 1)
    return float(np.linalg.norm(own[:, first] - own[:, second], axis=2).mean())


def of_skinsource(folder: Path, sensors: tuple[int, ...] = SENSORS) -> list[Decay]:
    """Decay of each person along the dorsal line from the tip of digit III.

    Parameters
    ----------
    folder : with model-{1..4}-location-08.f32, in SkinSource's own folders, whose drawing tells the
        places of its sensors
    sensors : numbers, from 1

    Returns
    -------
    Decay of each person whose file is there

    Raises
    ------
    ValueError
        If none is there, or the drawing is not.
    """
    files = [folder / f"model-{k}-location-{TIP:02d}.f32" for k in PEOPLE]
    files = [file for file in files if file.is_file()]
    if not files:
        raise ValueError(
            f"{folder} has none of model-1-location-{TIP:02d}.f32 to "
            f"model-4-location-{TIP:02d}.f32; give SkinSource's folder impulse-responses"
        )
    return [_person(read(file), sensors) for file in files]


def _person(found: Measurement, sensors: tuple[int, ...]) -> Decay:
    chosen = np.array(sensors) - 1
    places = found.places[chosen]
    if not np.isfinite(places).all():
        raise ValueError(
            f"{found.source or found.name} has no places of its sensors; download "
            "visualization.json of SkinSource, too, and keep its folders as they are"
        )
    along = places[:, 1] if np.ptp(places[:, 1]) > np.ptp(places[:, 0]) else places[:, 0]
    distances = np.abs(along - along[0])
    f = np.array(SKINSOURCE.frequencies)
    turns = np.exp(-2j * np.pi * f[:, None] * found.times)
    moved = np.abs(turns @ found.values.mean(axis=0)[:, chosen])
    return Decay(
        name=found.name, frequencies=f, distances=distances, amplitudes=_relative(moved)
    )  # fmt: skip


def _relative(amplitudes: Floats) -> Floats:
    return np.asarray(amplitudes / amplitudes.max(axis=1, keepdims=True))


def from_files(people: list[Decay]) -> Published:
    """SkinSource's set as its files give it, of those that are there."""
    lengths = 1 / np.array([person.lengths for person in people])  # decays, 1/m
    lows, highs = 1 / lengths.max(axis=0), 1 / lengths.min(axis=0)
    return replace(
        SKINSOURCE, name="SkinSource: 1/e length, from its files",
        lows=tuple(lows.tolist()), highs=tuple(highs.tolist()),
        conditions=f"{SKINSOURCE.conditions.partition(';')[0]}; {len(people)} people, sensors "
        + ", ".join(map(str, SENSORS)),
    )  # fmt: skip


def compare_hand(hand: Decay, published: Published = SKINSOURCE) -> list[Compared]:
    """Rows of the hand beside the set, at the frequencies that both have."""
    shared = [k for k, f in enumerate(published.frequencies) if f in hand.frequencies]
    here = replace(
        published, frequencies=tuple(published.frequencies[k] for k in shared),
        values=tuple(published.values[k] for k in shared),
        lows=tuple(published.lows[k] for k in shared),
        highs=tuple(published.highs[k] for k in shared),
    )  # fmt: skip
    return compared(here, hand.name, np.interp(here.frequencies, hand.frequencies, hand.lengths))
