"""Between the values of the controls and a scene, either way."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simple_model import MovingPressure, Rhythm, Tacton, Trajectory, evenly, joined
from simple_model.trajectory import SHAPES
from skinwave.distributions import Distribution
from skinwave.scene import BODIES, Body, Scene, check_load
from skinwave.web.controls import (
    CHOICES,
    OWN_BODY,
    RATIOS,
    STARTS,
    Values,
    checked,
    phases_of,
    pulses_of,
)
from skinwave.web.layer_values import with_layers
from skinwave.web.paths import paths_in, paths_of, text_of

OF_BODY = "body."  # of keys


@dataclass(frozen=True, kw_only=True)
class FileSpreads:
    """Distributions of a scene file's numbers by key, and the name of its `body`, while which is
    chosen those of the body hold.
    """

    given: tuple[tuple[str, Distribution], ...] = ()
    body: str = ""

    def of(self, body: str) -> tuple[tuple[str, Distribution], ...]:
        """Those that hold with a body of this name."""
        return tuple(x for x in self.given if body == self.body or not x[0].startswith(OF_BODY))


NO_SPREADS = FileSpreads()


def spreads_in(scene: Scene, values: Mapping[str, Any]) -> FileSpreads:
    """Spreads of a scene whose values of the controls are these."""
    return FileSpreads(given=scene.spreads, body=values["body"])


def scene_of(
    values: Mapping[str, Any], own: Body | None = None, spreads: FileSpreads = NO_SPREADS
) -> Scene:
    """The scene that controls say, probed at the selected point.

    Parameters
    ----------
    values : of the controls
    own : a body from a file
    spreads : of a file

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If values are out of range together, such as a path beyond the body.
    """
    pulses = pulses_of(values["pulses"])
    trajectory, foci = _own_paths(values) if values["paths"] else _one_path(values)
    tacton = Tacton(
        amplitude=values["amplitude"] / 100,
        am_frequency=values["am"],
        second_am_frequency=values["am2"],
        superposition=RATIOS[values["ratio"]],
        envelope_frequency=values["envelope"],
        duration=values["duration"],
        trajectory=trajectory,
        foci=foci,
        sharing=values["sharing"],
        rhythm=Rhythm(pulses=pulses, ramp=values["ramp"] / 1e3) if pulses else None,
    )
    body = with_layers(body_of(values, own), values["layers"])
    pressure = MovingPressure(
        tacton=tacton,
        profile=values["profile"],
        drive=values["drive"],
        height=values["height"] / 1e3,
    )
    return Scene(
        name="skinwave web", pressure=pressure, body=body,
        probes=((values["x"] / 1e3, values["y"] / 1e3),), depth=values["depth"] / 1e3,
        quantity=values["quantity"], spreads=spreads.of(values["body"]),
    )  # fmt: skip


def body_of(values: Mapping[str, Any], own: Body | None = None) -> Body:
    """The body that is chosen, with layers of its own; `own` is one from a file."""
    return own if values["body"] == OWN_BODY and own else BODIES.get(values["body"], Body())


def _one_path(values: Mapping[str, Any]) -> tuple[Trajectory, tuple[float, ...]]:
    """The path that all foci follow, and their phases."""
    shape = values["shape"]
    moving = {} if shape == "point" else {"size": values["size"] / 1e3, "speed": values["speed"]}
    n, phases = int(values["foci"]), phases_of(values["phases"])
    if phases and len(phases) != n:
        raise ValueError(f"{len(phases)} phases of {n} foci; give one for each, or none")
    return Trajectory(shape=shape, **moving), phases or evenly(n)


def _own_paths(values: Mapping[str, Any]) -> tuple[Trajectory, tuple[float, ...]]:
    """The paths of all foci, one after the other, and their phases."""
    paths = paths_of(values["paths"])
    if len(paths) != values["foci"]:
        raise ValueError(f"{len(paths)} paths of {values['foci']} foci; give one for each")
    return joined(paths, values["drawn"]), evenly(len(paths))


def values_of(scene: Scene) -> Values:
    """The controls' values that give a scene, probed at its first probe; name and further probes
    are not asked for.

    Raises
    ------
    ValueError
        If it has what no control says.
    """
    check_load(scene, "the interactive tool")
    tacton, path, pressure = scene.tacton, scene.tacton.trajectory, scene.pressure
    known = {body: name for name, body in BODIES.items()}
    ratio = {weights: name for name, weights in RATIOS.items()}.get(tacton.superposition)
    even, own = evenly(len(tacton.foci)), paths_in(tacton)
    beyond = {
        "a path of its own points": path.shape not in SHAPES and not own,
        "a path that is moved or swept one way": any(path.centre) or path.sweep != "there_and_back",
        "a sampled signal": tacton.signal is not None,
        "a superposition that is none of the five": ratio is None,
        f"a peak_pressure_pa of {pressure.peak_pressure:g}": pressure.peak_pressure
        != MovingPressure.peak_pressure,
        f"a depth_of_modulation of {pressure.depth_of_modulation:g}": pressure.law.uses_depth
        and pressure.depth_of_modulation != MovingPressure.depth_of_modulation,
        f"drive law '{pressure.law}'": pressure.drive not in CHOICES["drive"],
        f"profile = {pressure.profile_name} of the focus": pressure.profile
        not in CHOICES["profile"],
    }
    if said := [what for what, holds in beyond.items() if holds]:
        raise ValueError(f"{' and '.join(said)} cannot be set here; use skinwave run")
    rhythm, (x, y) = tacton.rhythm, scene.probes[0]
    pulses = rhythm.pulses if rhythm else ()
    return STARTS | {
        "amplitude": 100 * tacton.amplitude,
        "am": tacton.am_frequency,
        "am2": tacton.second_am_frequency,
        "ratio": ratio,
        "envelope": tacton.envelope_frequency,
        "duration": tacton.duration,
        **(
            {"paths": text_of(own), "drawn": round(tacton.drawing_frequency, 6)}
            if own
            else {"shape": path.shape, "size": 1e3 * path.size, "speed": path.speed}
        ),
        "height": 1e3 * scene.pressure.height,
        "drive": scene.pressure.drive,
        "profile": scene.pressure.profile,
        "body": known.get(scene.body, OWN_BODY),
        "foci": len(tacton.foci),
        "sharing": tacton.sharing,
        "phases": ""
        if np.allclose(sorted(tacton.foci), even)
        else ", ".join(f"{100 * phase:g}" for phase in tacton.foci),
        "pulses": ", ".join(f"{1e3 * on:g}/{1e3 * gap:g}" for on, gap in pulses),
        "ramp": 1e3 * rhythm.ramp if rhythm else 0.0,
        "x": round(1e3 * x, 6),
        "y": round(1e3 * y, 6),
        "depth": round(1e3 * scene.depths[0], 6),
        "quantity": scene.quantity,
    }


def held(values: Mapping[str, Any], moved: str, frequency: float) -> Values:
    """Size or speed, whichever was not moved, so that the path is drawn `frequency` times a second
    (in Hz).

    Raises
    ------
    ValueError
        If that is out of the range of its control.
    """
    per_size = Trajectory(shape=values["shape"], size=1e-3).length  # metre per mm
    if not per_size or not frequency:
        return {}
    found = (
        ("speed", frequency * per_size * values["size"])
        if moved != "speed"
        else ("size", values["speed"] / (frequency * per_size))
    )
    return {found[0]: checked(found[0], round(found[1], 6))}
