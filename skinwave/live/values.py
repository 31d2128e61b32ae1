"""Values of the page's controls for scenes, for the paper's Tactons and for worked examples.

Keys and units are those of `static/values.js`. A control without a value does not change.
"""

from typing import Any

import numpy as np

from simple_model import DRIVES, SHAPES, SUPERPOSITIONS, Tacton, Trajectory, even_phases, joined
from simple_model.load.trajectory import CORNERS_OF_CIRCLE, split_recording
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import Scene, check_load

Values = dict[str, Any]

RATIOS = {f"{w1:g}:{w2:g}": (w1, w2) for w1, w2 in SUPERPOSITIONS}
PLAIN = {"am2": 0, "ratio": "1:0", "envelope": 0, "foci": 1, "pulses": "", "phases": "",
         "paths": "", "polyline": "", "ramp": 0}  # fmt: skip

EXAMPLES = {
    "Motion beyond the path": {"shape": "point", "size": 0, "am": 200, "x": 15, "y": 0},
    "Faster than its waves": {
        "shape": "circle", "am": 0, "size": 40, "speed": 9, "x": 20, "y": 0,
    },
    "The best drawing speed": {
        "shape": "circle", "am": 0, "size": 20, "speed": 12, "x": 10, "y": 0,
    },
    "Two foci, two paths": {
        "am": 140, "foci": 2, "paths": "circle/10/-20/0, circle/10/20/0", "drawn": 100,
    },
}  # fmt: skip


def presets() -> list[dict[str, Any]]:
    """Return the paper's 15 Tactons and the examples as records of title and values."""
    paper = {tacton_title(tacton): tacton_values(tacton) for _, tacton in tactons()}
    examples = {title: PLAIN | values for title, values in EXAMPLES.items()}
    return [{"title": title, "values": own} for title, own in (paper | examples).items()]


def tacton_title(tacton: Tacton) -> str:
    """Return a title such as "AM 140 Hz + circle 20 mm at 12 m/s"."""
    path, am = tacton.trajectory, tacton.am_frequency
    parts = [f"AM {am:g} Hz"] if am else []
    if path.size:
        parts.append(f"{path.shape} {1e3 * path.size:g} mm at {path.speed:g} m/s")
    words = " + ".join(parts) or "constant focus"
    return words[:1].upper() + words[1:]


def control_values(scene: Scene, body: str) -> Values:
    """Return the values of the controls for a scene at its first probe.

    `body` is the name of its body on the page. Raises ValueError if the scene has something that no
    control sets.
    """
    check_load(scene, "the live page")
    tacton, path, pressure = scene.tacton, scene.tacton.trajectory, scene.pressure
    beyond = {
        "a recorded path": path.shape == "recorded" and not _own_paths(tacton),
        "several foci on a path that is not centred": any(path.centre) and not _is_movable(tacton),
        "a sampled signal": tacton.signal is not None,
        "this superposition": tacton.superposition not in RATIOS.values(),
        f"the drive law '{pressure.law}'": pressure.drive not in DRIVES,
        f"the focus profile '{pressure.profile_name}'": pressure.profile
        not in ("gaussian", "main_lobe"),
        "a probe below the surface": not scene.reading.is_on_surface,
        f"the quantity {scene.quantity}": (
            scene.quantity not in ("displacement", "velocity", "acceleration")
        ),
    }
    if missing := [feature for feature, is_used in beyond.items() if is_used]:
        raise ValueError(
            f"The live page has no control for {' or '.join(missing)}. Use skinwave run."
        )
    x, y = (_round(1e3 * value) for value in scene.probes[0])
    return tacton_values(tacton) | {
        "body": body, "height": _round(1e3 * pressure.height), "drive": str(pressure.drive),
        "profile": pressure.profile, "peak": _round(pressure.peak_pressure),
        "modulation": _round(100 * pressure.depth_of_modulation),
        "x": x, "y": y, "quantity": scene.quantity,
    }  # fmt: skip


def tacton_values(tacton: Tacton) -> Values:
    """Return the values of the controls of a Tacton, without those of its focus and point."""
    path, rhythm = tacton.trajectory, tacton.rhythm
    even = np.allclose(sorted(tacton.foci), even_phases(len(tacton.foci)))
    phases = "" if even else ", ".join(f"{100 * phase:g}" for phase in tacton.foci)
    pulses = rhythm.pulses if rhythm else ()
    return PLAIN | {
        "amplitude": _round(100 * tacton.amplitude), "am": tacton.am_frequency,
        "am2": tacton.second_am_frequency,
        "ratio": next(k for k, weights in RATIOS.items() if weights == tacton.superposition),
        "envelope": tacton.envelope_frequency, "duration": tacton.duration,
        "foci": len(tacton.foci), "sharing": tacton.sharing, "phases": phases,
        "pulses": ", ".join(f"{1e3 * on:g}/{1e3 * gap:g}" for on, gap in pulses),
        "ramp": _round(1e3 * rhythm.ramp) if rhythm else 0,
    } | _path_values(tacton, path)  # fmt: skip


def _path_values(tacton: Tacton, path: Trajectory) -> Values:
    if path.shape == "recorded" or any(path.centre):
        own = _own_paths(tacton) if path.shape == "recorded" else (path,)
        return {
            "paths": ", ".join(map(_path_text, own)),
            "drawn": _round(tacton.drawing_frequency),
        }
    if path.shape == "polyline":
        points = (f"{1e3 * x:.10g}/{1e3 * y:.10g}" for x, y in path.points)
        return {"shape": "polyline", "polyline": ", ".join(points), "speed": path.speed,
                "sweep": path.sweep}  # fmt: skip
    return {"shape": path.shape if path.size else "point", "size": _round(1e3 * path.size),
            "speed": path.speed, "sweep": path.sweep}  # fmt: skip


def _is_movable(tacton: Tacton) -> bool:
    """Whether a path off the centre can be the path of a single focus."""
    path = tacton.trajectory
    swept = path.shape == "line" and path.sweep != "there_and_back"
    return len(tacton.foci) == 1 and path.shape in SHAPES and path.size > 0 and not swept


def _path_text(path: Trajectory) -> str:
    numbers = (round(1e3 * value, 6) + 0.0 for value in (path.size, *path.centre))
    return "/".join([path.shape, *(f"{value:.10g}" for value in numbers)])


def _own_paths(tacton: Tacton, *, tolerance: float = 1e-8) -> tuple[Trajectory, ...]:
    """Return the named shapes, one for each focus, that make a recorded path; () if none do.

    The path may differ from the shapes by a tolerance in m, and by the same share of its period.
    """
    path, n = tacton.trajectory, tacton.n_paths
    if path.shape != "recorded" or path.levels or path.hold or n != len(tacton.foci):
        return ()
    try:
        paths = tuple(map(_shape_of, split_recording(path, n)))
        same = joined(paths, tacton.drawing_frequency)
    except (KeyError, ValueError):  # another number of corners, or no shape
        return ()
    is_same = len(same.times) == len(path.times) and (
        np.allclose(same.outline, path.outline, rtol=0, atol=tolerance)
        and np.allclose(same.times, path.times, rtol=0, atol=tolerance * path.times[-1])
    )
    return paths if is_same else ()


def _shape_of(corners: np.ndarray) -> Trajectory:
    """Return the shape with corners (k, 2) in m. The last corner repeats the first."""
    sides = {1: "point", 2: "line", 3: "triangle", 4: "square", CORNERS_OF_CIRCLE: "circle"}
    shape = sides[len(corners) - 1]
    x, y = corners[:-1].mean(axis=0)
    side = float(np.linalg.norm(corners[1] - corners[0]))
    sizes = {"point": 0.0, "circle": 2 * float(np.hypot(*(corners[0] - [x, y])))}
    centre = (round(float(x), 9), round(float(y), 9))
    return Trajectory(shape=shape, size=round(sizes.get(shape, side), 9), centre=centre)


def _round(value: float) -> float:
    return round(float(value), 6)
