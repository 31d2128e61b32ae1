"""Random Tactons with exact steady lines at a point, with which the page tests itself."""

from collections.abc import Callable
from typing import Any

import numpy as np

from simple_model import SUPERPOSITIONS, MovingPressure, Tacton, Trajectory, even_phases
from simple_model.layers.flat_body import steady_lines
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.live.radial import LOWEST
from skinwave.live.values import values_of
from skinwave.models.limits import takes
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduced import answer, components, prepare
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Complex, Floats

SEED = 15
# Lines that are compared: of the strongest of a point, and up to a frequency in Hz; then those of
# bodies of elements, whose reduced model is known less exactly.
SHOWN, HIGHEST = 0.01, 1000.0
SHOWN_OF_ELEMENTS, HIGHEST_OF_ELEMENTS = 0.3, 200.0
SHAPES = ("point", "line", "circle", "triangle", "square")
DRIVES = ("pressure_squared", "force_corrected", "linear")
# m: where bodies of elements are read, for which the exact model is reduced.
PLACES = ((0.0, 0.0), (0.006, -0.002), (-0.011, 0.007), (0.004, 0.016), (0.02, -0.012))

Lines = Callable[[Scene], tuple[Floats, Complex]]
Waveform = Callable[[Scene], Floats]
Places = tuple[tuple[float, float], ...]


def selftest(body: Body, name: str, most: int, lowest: float, error: float) -> list[dict[str, Any]]:
    """Return random Tactons on a body with their steady lines at a point: records of the body's
    name, values, lines [{f in Hz, re, im in metre}] and the relative error that is allowed.
    """
    rng = np.random.default_rng(SEED)
    found: list[dict[str, Any]] = []
    lines_of, _, places = exact(body)
    least, highest = (SHOWN_OF_ELEMENTS, HIGHEST_OF_ELEMENTS) if places else (SHOWN, HIGHEST)
    while len(found) < most:
        scene = random_scene(body, rng, lowest, places)
        f, amplitudes = lines_of(scene)
        size = np.abs(amplitudes)
        kept = (f > 0) & (f <= highest)
        kept &= size > least * size[(f > 0) & (f <= HIGHEST)].max(initial=0.0)
        if not kept.any():  # such as that of a focus that neither moves nor is modulated
            continue
        lines = zip(f[kept].tolist(), amplitudes[kept].tolist(), strict=True)
        found.append({
            "body": name, "values": values_of(scene, name), "error": error,
            "lines": [{"f": at, "re": value.real, "im": value.imag} for at, value in lines],
        })  # fmt: skip
    return found


def exact(body: Body, h: float | None = None) -> tuple[Lines, Waveform, Places]:
    """Return an exact model of a body, which does not use its pack: functions of a scene of one
    probe to its lines, frequencies (f,) in Hz and amplitudes (f,) in metre, and to its motion (t,)
    from rest; and the only places (p, 2) in metre where it can be read, () if anywhere.
    """
    if is_laterally_infinite(body) and has_exact_waves(body):
        return (_lines_of_layers, lambda scene: compute(scene, "flat-body").values[:, 0], ())
    if _is_plate(body):
        return (_lines_of_sheet, lambda scene: compute(scene, FROM_REST.name).values[:, 0], ())
    prepared = prepare(body, np.array(PLACES), h=h or body.of_kind.interactive_size)

    def index(scene: Scene) -> int:
        return int(np.linalg.norm(np.array(PLACES) - scene.probes[0], axis=1).argmin())

    def lines(scene: Scene) -> tuple[Floats, Complex]:
        motion = components(prepared, *scene.loads)
        return motion.frequencies, motion.lines[:, index(scene)]

    return lines, lambda scene: answer(prepared, scene).values[:, index(scene)], PLACES


def has_exact_lines(scene: Scene) -> bool:
    """Whether a scene's body has an exact model that takes no elements."""
    body = scene.body
    return (is_laterally_infinite(body) and has_exact_waves(body)) or _is_plate(body)


def _is_plate(body: Body) -> bool:
    resting = Scene(pressure=MovingPressure(tacton=Tacton()), body=body, probes=((0.0, 0.0),))
    return takes(FROM_REST, resting)


def _lines_of_layers(scene: Scene) -> tuple[Floats, Complex]:
    answer = compliance(scene.body)
    f, lines = steady_lines(answer, scene.pressure, scene.probe_points, threshold=1e-4)
    return f, lines[:, 0]


def _lines_of_sheet(scene: Scene) -> tuple[Floats, Complex]:
    f, amplitudes = plate_lines(scene, scene.probe_points)
    return f, amplitudes[:, 0]


def random_scene(
    body: Body, rng: np.random.Generator, lowest: float = LOWEST, places: Places = ()
) -> Scene:
    """Return a scene of a random Tacton that the page's controls can set, at a height from `lowest`
    in metre on, with its probe at one of the places, () for any.
    """
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
        trajectory=Trajectory(shape=shape, **moving), foci=even_phases(int(rng.integers(1, 4))),
    )  # fmt: skip
    height = float(rng.integers(round(200 * lowest), 60)) / 200
    pressure = MovingPressure(tacton=tacton, drive=str(rng.choice(DRIVES)), height=height)
    x, y = np.round(rng.uniform(-0.8 * half, 0.8 * half, 2), 4).tolist()
    if places:
        x, y = places[int(rng.integers(len(places)))]
    return Scene(name="self-test", pressure=pressure, body=body, probes=((x, y),))
