"""Random Tactons with exact steady lines at a point, with which the page tests itself."""

from typing import Any

import numpy as np

from fem import Complex
from meshes.tetmesh import Floats
from simple_model import MovingPressure, Tacton, Trajectory, evenly
from simple_model.flat_body import steady_lines
from simple_model.tacton import SUPERPOSITIONS
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.live.values import values_of
from skinwave.models.advice import takes
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.scene import Body, Scene

SEED = 15
SHOWN = 0.01  # of the strongest line of a point: -40 dB, down to which lines are compared
HIGHEST = 1000.0  # Hz
ERROR = 0.01  # relative, of a line, that the test allows
SHAPES = ("point", "line", "circle", "triangle", "square")
DRIVES = ("pressure_squared", "force_corrected", "linear")


def selftest(body: Body, name: str, most: int) -> list[dict[str, Any]]:
    """Return random Tactons on a body with their steady lines at a point.

    Parameters
    ----------
    body : Body
    name : of its record
    most : how many

    Returns
    -------
    records of body, values, lines [{f in Hz, re, im in metre}] and the error that is allowed; []
    of a body without an exact model
    """
    rng, found = np.random.default_rng(SEED), []
    for _ in range(most):
        scene = random_scene(body, rng)
        if not has_exact_lines(scene):
            return []
        f, amplitudes = exact_lines(scene)
        size = np.abs(amplitudes)
        kept = (f > 0) & (f <= HIGHEST)
        kept &= size > SHOWN * size[kept].max(initial=0.0)
        lines = zip(f[kept].tolist(), amplitudes[kept].tolist(), strict=True)
        found.append({
            "body": name, "values": values_of(scene, name), "error": ERROR,
            "lines": [{"f": at, "re": value.real, "im": value.imag} for at, value in lines],
        })  # fmt: skip
    return found


def has_exact_lines(scene: Scene) -> bool:
    """Whether `exact_lines` takes a scene: of infinite layers, or of a thin plate in its modes."""
    return _is_infinite(scene.body) or takes(FROM_REST, scene)


def exact_lines(scene: Scene) -> tuple[Floats, Complex]:
    """Return frequencies (f,) in Hz and complex amplitudes (f,) in metre at a scene's probe, by a
    model that does not use the pack.
    """
    body, places = scene.body, scene.probe_points
    if _is_infinite(body):
        f, amplitudes = steady_lines(compliance(body), scene.pressure, places, threshold=1e-4)
    else:
        f, amplitudes = plate_lines(scene, places)
    return f, amplitudes[:, 0]


def _is_infinite(body: Body) -> bool:
    return is_laterally_infinite(body) and has_exact_waves(body)


def random_scene(body: Body, rng: np.random.Generator) -> Scene:
    """Return a scene of a random Tacton that the page's controls can set, on a body."""
    bounded = body.of_kind.is_bounded
    half = min(0.025, *((body.width / 2, body.height / 2) if bounded else ()))
    shape = str(rng.choice(SHAPES))
    size = round(float(rng.uniform(0.2, 1.0)) * half, 4)
    moving = (
        {"size": size, "speed": round(float(rng.uniform(2, 20)), 1)} if shape != "point" else {}
    )
    am = float(rng.integers(20, 300)) if shape == "point" or rng.random() < 0.6 else 0.0
    second = am > 0 and rng.random() < 0.3
    ratio = SUPERPOSITIONS[int(rng.integers(1, 4)) if second else 0]
    tacton = Tacton(
        amplitude=float(rng.integers(30, 101)) / 100, am_frequency=am, superposition=ratio,
        second_am_frequency=float(rng.integers(20, 300)) if second else 0.0,
        envelope_frequency=float(rng.integers(1, 20)) if rng.random() < 0.2 else 0.0,
        trajectory=Trajectory(shape=shape, **moving), foci=evenly(int(rng.integers(1, 4))),
    )  # fmt: skip
    pressure = MovingPressure(
        tacton=tacton, drive=str(rng.choice(DRIVES)), height=float(rng.integers(24, 60)) / 200
    )
    x, y = np.round(rng.uniform(-0.8 * half, 0.8 * half, 2), 4).tolist()
    return Scene(name="self-test", pressure=pressure, body=body, probes=((x, y),))
