"""The self-test of the page: random Tactons with their exact steady lines at a point."""

from collections.abc import Callable
from typing import Any

import numpy as np

from fem.load_and_probe import on_surface
from simple_model import SUPERPOSITIONS, MovingPressure, Tacton, Trajectory, even_phases
from simple_model.layers.flat_body import steady_lines
from skinwave.bodies.analytic import compliance
from skinwave.live.elements import BAND
from skinwave.live.packs import pack_method
from skinwave.live.radial import LOWEST
from skinwave.live.values import control_values
from skinwave.models.meshed import mesh_body
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduced import answer, components, reduce_scene
from skinwave.planning.simulate import compute
from skinwave.scene.scene import STILL, Body, Scene
from skinwave.system.effort import Clock, silent
from skinwave.typing import Complex, Floats

SEED = 15
# Compared lines: smallest amplitude relative to the largest at the point, highest frequency in Hz,
# and fewest of a Tacton. The pack of a body of elements is less accurate.
SMALLEST, HIGHEST, FEWEST = 0.01, 1000.0, 3
SMALLEST_OF_ELEMENTS, HIGHEST_OF_ELEMENTS, FEWEST_OF_ELEMENTS = 0.1, BAND, 1
SHAPES = ("point", "line", "circle", "triangle", "square")
DRIVES = ("pressure_squared", "force_corrected", "linear")
# Places in m at which the exact model of a body of elements is prepared.
PLACES = ((0.0, 0.0), (0.006, -0.002), (-0.011, 0.007), (0.004, 0.016), (0.02, -0.012))

FARTHEST = float(np.abs(PLACES).max())
WITHIN, SHARES = 0.3, (1.0, 0.5, 0.25, 0.1)  # of the side of a body; sizes to try on other bodies

Lines = Callable[[Scene], tuple[Floats, Complex]]
Waveform = Callable[[Scene], Floats]
Places = tuple[tuple[float, float], ...]


def selftest(
    body: Body, name: str, count: int, lowest: float, error: float
) -> list[dict[str, Any]]:
    """Return random Tactons on a body with their steady lines at a point, as records of the body's
    name, the values, the lines [{f in Hz, re, im in m}] and the largest relative error.
    """
    rng = np.random.default_rng(SEED)
    records: list[dict[str, Any]] = []
    lines_of, _, places = exact(body)
    smallest, highest, fewest = SMALLEST, HIGHEST, FEWEST
    if places:
        smallest, highest = SMALLEST_OF_ELEMENTS, HIGHEST_OF_ELEMENTS
        fewest = FEWEST_OF_ELEMENTS
    while len(records) < count:
        scene = random_scene(body, rng, lowest, places)
        f, amplitudes = lines_of(scene)
        size = np.abs(amplitudes)
        compared = (f > 0) & (f <= highest)
        compared &= size > smallest * size[(f > 0) & (f <= HIGHEST)].max(initial=0.0)
        if compared.sum() < fewest:  # such as a focus that neither moves nor is modulated
            continue
        lines = zip(f[compared].tolist(), amplitudes[compared].tolist(), strict=True)
        records.append({
            "body": name, "values": control_values(scene, name), "error": error,
            "lines": [{"f": at, "re": value.real, "im": value.imag} for at, value in lines],
        })  # fmt: skip
    return records


def exact(body: Body, h: float | None = None) -> tuple[Lines, Waveform, Places]:
    """Return a model of a body without its pack: two functions of a scene with one probe, for its
    lines, frequencies (f,) in Hz and amplitudes (f,) in m, and for its motion (t,) from rest; and
    the places (p, 2) in m where they are valid, () for any.
    """
    method = pack_method(body)
    if method != "poles":
        model = "flat-body" if method == "radial" else FROM_REST.name
        lines_of = _lines_of_layers if method == "radial" else _lines_of_sheet
        return lines_of, lambda scene: compute(scene, model).values[:, 0], ()
    size = SolveOptions(h=h or body.of_kind.interactive_size)
    places = _places_on(body)
    prepared = reduce_scene(Scene(pressure=STILL, body=body, probes=places), size)

    def index(scene: Scene) -> int:
        return int(np.linalg.norm(np.array(places) - scene.probes[0], axis=1).argmin())

    def lines(scene: Scene) -> tuple[Floats, Complex]:
        motion = components(prepared, *scene.loads)
        return motion.frequencies, motion.lines[:, index(scene)]

    return lines, lambda scene: answer(prepared, scene).values[:, index(scene)], places


def _places_on(body: Body) -> Places:
    """Return `PLACES`, nearer to the origin on a body that does not reach as far."""
    if body.of_kind.is_bounded:
        shares = [min(1.0, WITHIN * min(body.width, body.height) / FARTHEST)]
    else:
        mesh = mesh_body(body, body.of_kind.interactive_size, Clock(), silent).mesh
        shares = [s for s in SHARES if on_surface(mesh, s * np.array(PLACES)).all()]
    return tuple((shares[0] * x, shares[0] * y) for x, y in PLACES)


def _lines_of_layers(scene: Scene) -> tuple[Floats, Complex]:
    f, lines = steady_lines(
        compliance(scene.body), scene.pressure, scene.probe_points, threshold=1e-4
    )
    return f, lines[:, 0]


def _lines_of_sheet(scene: Scene) -> tuple[Floats, Complex]:
    f, amplitudes = plate_lines(scene, scene.probe_points)
    return f, amplitudes[:, 0]


def random_scene(
    body: Body, rng: np.random.Generator, lowest: float = LOWEST, places: Places = ()
) -> Scene:
    """Return a scene with a random Tacton that the controls can set. The height of the focus is at
    least `lowest` in m, and the probe is at one of the places, () for any.
    """
    bounded = body.of_kind.is_bounded
    sides = (body.width / 2, body.height / 2) if bounded else (float(np.abs(places).max()),)
    half = min(0.025, *sides)
    shape = str(rng.choice(SHAPES))
    size, path = round(float(rng.uniform(0.2, 1.0)) * half, 4), Trajectory(shape=shape)
    if shape != "point":
        path = Trajectory(shape=shape, size=size, speed=round(float(rng.uniform(2, 20)), 1))
    am = float(rng.integers(20, 300)) if shape == "point" or rng.random() < 0.6 else 0.0
    second = am > 0 and rng.random() < 0.3
    ratio = SUPERPOSITIONS[int(rng.integers(1, 4)) if second else 0]
    tacton = Tacton(
        amplitude=float(rng.integers(30, 101)) / 100, am_frequency=am, superposition=ratio,
        second_am_frequency=float(rng.integers(20, 300)) if second else 0.0,
        envelope_frequency=float(rng.integers(1, 20)) if rng.random() < 0.2 else 0.0,
        trajectory=path, foci=even_phases(int(rng.integers(1, 4))),
    )  # fmt: skip
    height = float(rng.integers(round(200 * lowest), 60)) / 200
    pressure = MovingPressure(tacton=tacton, drive=str(rng.choice(DRIVES)), height=height)
    x, y = np.round(rng.uniform(-0.8 * half, 0.8 * half, 2), 4).tolist()
    if places:
        x, y = places[int(rng.integers(len(places)))]
    return Scene(name="self-test", pressure=pressure, body=body, probes=((x, y),))
