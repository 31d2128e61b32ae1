"""Scene file of a candidate, under one of the Tactons that were measured."""

from dataclasses import replace
from typing import Any

import tomli_w

from simple_model import Tacton
from skinwave.inference import drive_laws
from skinwave.inference.design import (
    CLIP_RADIUS,
    DENSITY,
    POISSON,
    SUPPORTS,
    Candidate,
    clips,
    middle,
    pressure,
    probes,
    sizes,
    tensions,
    thickness,
)
from skinwave.scene.file import from_table
from skinwave.scene.scene import Scene

EXTENSION = "skinwave.inference.registered_laws"
TACTON = {"am_frequency_hz": 140.0, "shape": "circle", "size_mm": 20.0, "speed_m_per_s": 12.0}


def scene_text(candidate: Candidate) -> str:
    """The scene file of a candidate under AM 140 Hz on the circle of 20 mm."""
    focus = {
        "height_mm": candidate["height_mm"], "drive": candidate["drive"],
        "depth_of_modulation": candidate["depth_of_modulation"],
    }  # fmt: skip
    name = "a candidate of the sheet that was measured"
    table = {"name": name, "tacton": TACTON, "focus": focus, **_measured(candidate)}
    table["probes"]["quantity"] = candidate["quantity"]
    note = ""
    if candidate["drive"] in drive_laws.LAWS:
        note = f"# Read with SKINWAVE_EXTENSIONS={EXTENSION} in the environment.\n"
    return note + tomli_w.dumps(table)


def scene_of(candidate: Candidate, tacton: Tacton) -> Scene:
    """The scene of a candidate under a Tacton, read as displacement; its drive law need not be
    registered.
    """
    return replace(from_table(_measured(candidate)), pressure=pressure(candidate, tacton))


def _measured(candidate: Candidate) -> dict[str, Any]:
    """Tables of the sheet, where it lies, and where it is measured."""
    return {
        "body": _body(candidate),
        "placement": {"offset_mm": _mm(middle(candidate))},
        "probes": {"points_mm": [_mm(point) for point in probes(candidate)]},
    }


def _body(candidate: Candidate) -> dict[str, Any]:
    size_x, size_y = _mm(sizes(candidate))
    young_x = 1e9 * candidate["young_x_gpa"]
    return {
        "kind": "sheet", "size_x_mm": size_x, "size_y_mm": size_y,
        "thickness_mm": 1e3 * thickness(candidate), "sides": "clamped", "air": True,
        "material": {
            "density_kg_m3": DENSITY, "young_x_pa": young_x,
            "young_y_pa": young_x * candidate["young_ratio"], "poisson_xy": POISSON,
            "loss_factor": candidate["loss_factor"],
        },
        "mounting": _mounting(candidate),
    }  # fmt: skip


def _mounting(candidate: Candidate) -> dict[str, Any]:
    support = SUPPORTS[candidate["support"]]
    ends = {"left": support.along, "right": support.along,
            "front": support.across, "back": support.across}  # fmt: skip
    held = [edge for edge, end in ends.items() if end != "free"]
    tension_x, tension_y = tensions(candidate)
    found: dict[str, Any] = {
        "edges": held, "tension_x_n_per_m": tension_x, "tension_y_n_per_m": tension_y
    }  # fmt: skip
    if held:
        found["support"] = ends[held[0]]
    if points := clips(candidate):
        found |= {"clips_mm": [_mm(point) for point in points],
                  "clip_radius_mm": 1e3 * CLIP_RADIUS}  # fmt: skip
    return found


def _mm(values: Any) -> list[float]:
    """Lengths in metre as mm, to a millionth."""
    return [round(1e3 * float(value), 6) for value in values]
