"""Design of the inference: everything about the sheet and its measurement that is not published.

A candidate is a value of each parameter; from it follow the plate, the load and the probes.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model import DRIVES, MovingPressure, Tacton
from simple_model.plates.modes import Plate
from skinwave.inference import drive_laws
from skinwave.scene.variation import Variation, combinations

Candidate = Mapping[str, Any]

SHEET, MEASUREMENT = "the sheet", "the measurement"
SIDES = {  # mm
    "A3": (420, 297), "A4": (297, 210), "A5": (210, 148), "A6": (148, 105)
}  # fmt: skip
SQUARE = "square"
DENSITY, POISSON = 780.0, 0.3  # kg/m3 of office paper; nu_xy
CLIP_RADIUS = 0.005  # m
KEPT_CLEAR = 0.030  # m from an edge, which the middle of the path keeps
POINTS, SPACING = 5, 0.005  # of the measurement; m


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter that is not published: its key, what it is called, whose it is, and its `values`
    or the `bounds` of them.
    """

    key: str
    words: str
    of: str
    values: tuple[str, ...] = ()
    bounds: tuple[float, float] | None = None
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class Support:
    """Supports of the edges at both ends of x and at both ends of y, and whether there are clips in
    the corners at the back, and in those at the front.
    """

    words: str
    along: str = "free"
    across: str = "free"
    back_clips: bool = False
    front_clips: bool = False


SUPPORTS = {
    "clamped": Support(words="all edges clamped in a frame", along="clamped", across="clamped"),
    "simply": Support(words="all edges on a frame, simply supported", along="simply",
                      across="simply"),
    "two_edges": Support(words="two short edges clamped", along="clamped"),
    "two_clips": Support(words="hung from two clips", back_clips=True),
    "corners": Support(words="four corners in clips", back_clips=True, front_clips=True),
}  # fmt: skip
PARAMETERS = (
    Parameter(key="size", words="size", of=SHEET, values=(*SIDES, SQUARE)),
    Parameter(key="side_mm", words="side of a square", of=SHEET, bounds=(60, 300), unit="mm"),
    Parameter(key="support", words="support", of=SHEET, values=tuple(SUPPORTS)),
    Parameter(key="tension_x_n_per_m", words="tension along", of=SHEET, bounds=(0, 50), unit="N/m"),
    Parameter(
        key="tension_y_n_per_m", words="tension across", of=SHEET, bounds=(0, 50), unit="N/m"
    ),
    Parameter(key="grammage_g_m2", words="grammage", of=SHEET, bounds=(60, 120), unit="g/m²"),
    Parameter(key="young_x_gpa", words="Young's modulus along", of=SHEET, bounds=(4, 9),
              unit="GPa"),
    Parameter(key="young_ratio", words="modulus across over along", of=SHEET, bounds=(0.3, 0.7)),
    Parameter(key="loss_factor", words="loss factor", of=SHEET, bounds=(0.01, 0.06)),
    Parameter(key="off_middle", words="focus off the middle of the sheet", of=MEASUREMENT,
              bounds=(0.0, 0.5)),
    Parameter(key="start_mm", words="first point along the radius", of=MEASUREMENT,
              bounds=(-5, 5), unit="mm"),
    Parameter(key="beside_mm", words="points beside the radius", of=MEASUREMENT, bounds=(0, 10),
              unit="mm"),
    Parameter(key="quantity", words="quantity that was read", of=MEASUREMENT,
              values=("displacement", "velocity")),
    Parameter(key="drive", words="drive law", of=MEASUREMENT,
              values=("linear", "force_corrected", "pressure_squared",
                      drive_laws.COMPRESSED.name, drive_laws.CLIPPED.name)),
    Parameter(key="depth_of_modulation", words="depth of modulation", of=MEASUREMENT,
              bounds=(0.5, 1.0)),
    Parameter(key="height_mm", words="height above the device", of=MEASUREMENT,
              bounds=(150, 250), unit="mm"),
)  # fmt: skip


def hypercube(samples: int, seed: int = 0) -> list[Candidate]:
    """Candidates of a Latin hypercube, the same for the same seed."""
    varied = [Variation(key=p.key, values=p.values, bounds=p.bounds) for p in PARAMETERS]
    return list(combinations(varied, "lhs", samples, seed))


def name(candidate: Candidate, release: str) -> str:
    """A hash of a candidate and of the version that computes it."""
    said = repr((release, [candidate[p.key] for p in PARAMETERS]))
    return hashlib.sha256(said.encode()).hexdigest()[:24]


def thickness(candidate: Candidate) -> float:
    """Thickness of the sheet, metre."""
    return float(candidate["grammage_g_m2"]) / 1e3 / DENSITY


def sizes(candidate: Candidate) -> tuple[float, float]:
    """Sides of the sheet along x, the longer, and y, metre."""
    side = candidate["side_mm"]
    x, y = SIDES.get(candidate["size"], (side, side))
    return x / 1e3, y / 1e3


def tensions(candidate: Candidate) -> tuple[float, float]:
    """Tension along x and y in N/m: none between free edges."""
    support = SUPPORTS[candidate["support"]]
    asked = candidate["tension_x_n_per_m"], candidate["tension_y_n_per_m"]
    ends = support.along, support.across
    return tuple(0.0 if end == "free" else t for t, end in zip(asked, ends, strict=True))  # type: ignore[return-value]


def clips(candidate: Candidate) -> tuple[tuple[float, float], ...]:
    """Middles of the clips, metre; they end at the edges."""
    support = SUPPORTS[candidate["support"]]
    x, y = (size / 2 - CLIP_RADIUS for size in sizes(candidate))
    rows = [y] * support.back_clips + [-y] * support.front_clips
    return tuple((side, row) for row in rows for side in (-x, x))


def plate(candidate: Candidate) -> Plate:
    """The plate of a candidate."""
    support = SUPPORTS[candidate["support"]]
    size_x, size_y = sizes(candidate)
    tension_x, tension_y = tensions(candidate)
    d11, d22, d12, d66 = stiffnesses(candidate)
    return Plate(
        size_x=size_x, size_y=size_y, d11=d11, d22=d22, d12=d12, d66=d66,
        mass_per_area=candidate["grammage_g_m2"] / 1e3, tension_x=tension_x, tension_y=tension_y,
        left=support.along, right=support.along, front=support.across, back=support.across,
        clips=clips(candidate), clip_radius=CLIP_RADIUS,
    )  # fmt: skip


def stiffnesses(candidate: Candidate) -> tuple[float, float, float, float]:
    """Bending stiffnesses D11, D22, D12, D66 in N m of an orthotropic sheet whose shear modulus is
    sqrt(E1 E2) / (2 (1 + sqrt(nu12 nu21))), as of a paper whose shear is not measured.
    """
    young_x = 1e9 * candidate["young_x_gpa"]
    young_y = candidate["young_ratio"] * young_x
    across = POISSON * young_y / young_x
    shear = sqrt(young_x * young_y) / (2 * (1 + sqrt(POISSON * across)))
    per_modulus = thickness(candidate) ** 3 / 12
    d11, d22 = (per_modulus * e / (1 - POISSON * across) for e in (young_x, young_y))
    return d11, d22, across * d11, per_modulus * shear


def middle(candidate: Candidate) -> tuple[float, float]:
    """Middle of the sheet in the scene, metre: the path is off it along x."""
    room = max(0.0, sizes(candidate)[0] / 2 - KEPT_CLEAR)
    return -candidate["off_middle"] * room, 0.0


def probes(candidate: Candidate) -> Floats:
    """Points (5, 2) of the measurement, metre."""
    x = candidate["start_mm"] / 1e3 + SPACING * np.arange(POINTS)
    return np.column_stack([x, np.full(POINTS, candidate["beside_mm"] / 1e3)])


def pressure(candidate: Candidate, tacton: Tacton) -> MovingPressure:
    """The load of a Tacton."""
    return MovingPressure(
        tacton=tacton, drive=(DRIVES | drive_laws.LAWS)[candidate["drive"]],
        depth_of_modulation=candidate["depth_of_modulation"], height=candidate["height_mm"] / 1e3,
    )  # fmt: skip


def used(candidate: Candidate) -> set[str]:
    """Keys of the parameters that make a difference to a candidate."""
    support = SUPPORTS[candidate["support"]]
    idle = {
        "side_mm": candidate["size"] != SQUARE,
        "tension_x_n_per_m": support.along == "free",
        "tension_y_n_per_m": support.across == "free",
        "depth_of_modulation": candidate["drive"] == "linear",
    }
    return {p.key for p in PARAMETERS if not idle.get(p.key)}
