"""The self-test of the page: random Tactons with their exact steady lines at a point."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.load_and_probe import on_surface
from simple_model import (
    SHAPES,
    SUPERPOSITIONS,
    MovingPressure,
    Tacton,
    Trajectory,
    even_phases,
)
from simple_model.layers.flat_body import steady_lines
from skinwave.bodies.analytic import compliance
from skinwave.live.elements import Training
from skinwave.live.packs import pack_method
from skinwave.live.values import control_values
from skinwave.models.meshed import mesh_body
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduced import components, reduce_scene
from skinwave.scene.scene import STILL, Body, Scene
from skinwave.system.effort import Clock, silent
from skinwave.typing import Complex, Floats

Lines = Callable[[Scene], tuple[Floats, Complex]]
Places = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Which lines of a Tacton the self-test compares, and how many it must have."""

    smallest: float = 0.01  # amplitude relative to the largest at the point
    highest: float = 1000.0  # Hz
    fewest: int = 3

    def strong(self, f: Floats, sizes: Floats) -> np.ndarray:
        """Whether each line (f,) at a frequency in Hz, with a size in m, is compared, (f,)."""
        known = (f > 0) & (f <= Compared.highest)
        largest = sizes[known].max(initial=0.0)
        return (f > 0) & (f <= self.highest) & (sizes > self.smallest * largest)


# The pack of a body of elements is less accurate.
OF_ELEMENTS = Compared(smallest=0.1, highest=Training.band, fewest=1)


def selftest(
    body: Body, name: str, count: int, lowest: float, error: float, *, seed: int = 15
) -> list[dict[str, Any]]:
    """Return random Tactons on a body with their steady lines at a point, as records for JSON.

    A record has the body's name, the values of the controls, the lines [{f in Hz, re, im in m}] and
    the largest relative error.
    """
    rng = np.random.default_rng(seed)
    records: list[dict[str, Any]] = []
    lines_of, places = exact_lines(body)
    limits = OF_ELEMENTS if places else Compared()
    while len(records) < count:
        scene = random_scene(body, rng, lowest, places)
        f, amplitudes = lines_of(scene)
        compared = limits.strong(f, np.abs(amplitudes))
        if compared.sum() < limits.fewest:  # such as a focus that neither moves nor is modulated
            continue
        lines = zip(f[compared].tolist(), amplitudes[compared].tolist(), strict=True)
        records.append({
            "body": name, "values": control_values(scene, name), "error": error,
            "lines": [{"f": at, "re": value.real, "im": value.imag} for at, value in lines],
        })  # fmt: skip
    return records


def exact_lines(body: Body, h: float | None = None) -> tuple[Lines, Places]:
    """Return a model of a body that does not use its pack: (lines, places).

    `lines(scene)` returns frequencies (f,) in Hz and amplitudes (f,) in m at the only probe of a
    scene. The probe must be one of `places` in m, () for any place.
    """
    if pack_method(body) != "poles":
        return _steady_lines, ()
    size, places = SolveOptions(h=h or body.of_kind.interactive_size), _places_on(body)
    prepared = reduce_scene(Scene(pressure=STILL, body=body, probes=places), size)

    def lines(scene: Scene) -> tuple[Floats, Complex]:
        motion = components(prepared, *scene.loads)
        return motion.frequencies, motion.lines[:, places.index(scene.probes[0])]

    return lines, places


def _places_on(body: Body) -> Places:
    """Return places in m at which the exact model of a body of elements is prepared.

    They are nearer to the origin on a small body: within 0.3 of its sides, or on its mesh.
    """
    places = np.array([(0, 0), (0.006, -0.002), (-0.011, 0.007), (0.004, 0.016), (0.02, -0.012)])
    if body.of_kind.is_bounded:
        shares = [min(1.0, 0.3 * min(body.width, body.height) / np.abs(places).max())]
    else:
        mesh = mesh_body(body, body.of_kind.interactive_size, Clock(), silent).mesh
        shares = [s for s in (1.0, 0.5, 0.25, 0.1) if on_surface(mesh, s * places).all()]
    return tuple((x, y) for x, y in (shares[0] * places).tolist())


def _steady_lines(scene: Scene) -> tuple[Floats, Complex]:
    """Return the lines of layers or a sheet at the only probe of a scene, as in `exact_lines`."""
    if pack_method(scene.body) == "modal":
        f, lines = plate_lines(scene, scene.probe_points)
    else:
        response, places = compliance(scene.body), scene.probe_points
        f, lines = steady_lines(response, scene.pressure, places, threshold=1e-4)
    return f, lines[:, 0]


def random_scene(body: Body, rng: np.random.Generator, lowest: float, places: Places = ()) -> Scene:
    """Return a scene with a random Tacton that the controls can set.

    The height of the focus is at least `lowest` in m. The probe is at one of the places, () for any
    place.
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
    drive = str(rng.choice(["pressure_squared", "force_corrected", "linear"]))
    pressure = MovingPressure(tacton=tacton, drive=drive, height=height)
    x, y = np.round(rng.uniform(-0.8 * half, 0.8 * half, 2), 4).tolist()
    if places:
        x, y = places[int(rng.integers(len(places)))]
    return Scene(name="self-test", pressure=pressure, body=body, probes=((x, y),))
