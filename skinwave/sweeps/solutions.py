"""Vibration of one sample of a scene: waveforms, lines, and RMS and sensation level on a map.

Where the wavenumber integral is exact it gives all of them, in the steady state; where bodies of
elements are reduced together, their model gives the probes, likewise; elsewhere the model that the
scene requires does. Motion of a linear body is in proportion to the
pressure, so that samples that differ by that alone are solved once.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure, phasors, sensation_level
from simple_model.layers.flat_body import PathOperator, path_operator, steady_lines
from simple_model.load.line_names import line_frequency
from simple_model.load.spectrum import synthesise
from simple_model.response import SETTLE
from simple_model.typing import Complex
from skinwave.bodies.analytic import compliance
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.options import sample_times
from skinwave.models.parametric import lines_of
from skinwave.models.prepared import components, prepare, reduction_tolerance
from skinwave.planning.simulate import compute
from skinwave.report.styles import SHOWN
from skinwave.results.surface import REACH, SILENT, grid, has_wavenumber_integral
from skinwave.scene.scene import Scene
from skinwave.sweeps.families import Family, reduced

STEP = 0.004  # m between places of a map
FAINT = 1e-3  # of the load's strongest line: lines that no sample has
ROUND_OFF = 1e-12  # of the largest line
KEPT = 4  # solutions that may differ by the pressure alone


@dataclass(frozen=True, kw_only=True)
class Method:
    """How samples are solved: names of the `lines` that are looked at, the `model` with its element
    size `h` in metre, its `solver` and its `tolerance`; whether it is `mapped`, by the wavenumber
    integral; whether all samples have one load, `same_load`, but for its pressure; the `family` of
    their bodies, if these are reduced together; and whether all are `steady`, as those then are.
    """

    lines: tuple[str, ...]
    model: str
    h: float | None = None
    solver: str = "auto"
    tolerance: float = 0.05
    mapped: bool = False
    same_load: bool = False
    family: Family | None = None
    steady: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Vibration about the mean of one sample.

    Parameters
    ----------
    waveform : (t, p) float, the last `SHOWN` of a Tacton
    lines : (f, p) float, amplitudes of the named lines
    rms : (p,) float, all in the unit of the response
    level : (p,) float, dB, the highest sensation level of its lines, were it skin; `SILENT` and
        less where nothing vibrates
    map_rms, map_level : (ny, nx) float, the same on a map; of no size without one
    """

    waveform: Floats
    lines: Floats
    rms: Floats
    level: Floats
    map_rms: Floats
    map_level: Floats


NO_MAP = np.zeros((0, 0))


def has_exact_map(scene: Scene) -> bool:
    """Whether the wavenumber integral of a scene's displacement stands for it, and has a map."""
    return has_wavenumber_integral(scene) and scene.reading.is_plain


def shown_times(scene: Scene) -> Floats:
    """Times (t,) in s of the waveforms that are shown."""
    times = sample_times(scene)
    return times[times >= times[-1] - SHOWN]


def map_axes(scene: Scene) -> tuple[Floats, Floats]:
    """Coordinates (nx,) and (ny,) in metre of the map."""
    return grid(scene, REACH, STEP)


def solve(scene: Scene, method: Method) -> Solution:
    """Solution of one sample.

    Parameters
    ----------
    scene : Scene
    method : Method

    Returns
    -------
    Solution

    Raises
    ------
    ValueError
        If the model refuses the scene.
    """
    peak = scene.pressure.peak_pressure
    if not (peak and isinstance(scene.pressure.profile, str) and _is_proportional(scene, method)):
        return _solved(scene, method)
    unit = replace(scene, pressure=replace(scene.pressure, peak_pressure=1.0), spreads=())
    return _scaled(_of_unit_pressure(unit, method), peak)


def _is_proportional(scene: Scene, method: Method) -> bool:
    """Whether the vibration is in proportion to the pressure."""
    return method.mapped or is_linear(scene, method.model)


def is_linear(scene: Scene, name: str) -> bool:
    """Whether the vibration by a model is in proportion to the pressure."""
    model = named(name)
    linear = (model.is_reduced or model.is_infinite or model.is_steady) and not model.is_nonlinear
    alone = not (scene.load.gravity or scene.load.support_motion)
    return scene.reading.is_plain and linear and alone


@lru_cache(maxsize=KEPT)
def _of_unit_pressure(scene: Scene, method: Method) -> Solution:
    return _solved(scene, method)


def _scaled(found: Solution, factor: float) -> Solution:
    raised = 20 * np.log10(factor)
    return Solution(
        waveform=factor * found.waveform, lines=factor * found.lines, rms=factor * found.rms,
        level=found.level + raised, map_rms=factor * found.map_rms,
        map_level=found.map_level + raised,
    )  # fmt: skip


def _solved(scene: Scene, method: Method) -> Solution:
    wanted = [line_frequency(scene.tacton, name) for name in method.lines]
    frequencies = np.array([f or 0.0 for f in wanted])
    if method.family:
        return _of_family(scene, method, method.family, frequencies)
    if method.steady:
        return _alone(scene, method, frequencies)
    return (_mapped if method.mapped else _computed)(scene, method, frequencies)


def _computed(scene: Scene, method: Method, frequencies: Floats) -> Solution:
    """Solution by a model, at the probes."""
    response = compute(
        scene, method.model, tolerance=method.tolerance, h=method.h, solver=method.solver
    )
    settled = response.values[int(SETTLE * len(response.times)) :]
    motion = response.values[-len(shown_times(scene)) :] - settled.mean(axis=0)
    lines = np.abs(phasors(response, frequencies)) * (frequencies > 0)[:, None]
    return Solution(
        waveform=motion, lines=lines, rms=settled.std(axis=0),
        level=_highest(frequencies, lines), map_rms=NO_MAP, map_level=NO_MAP,
    )  # fmt: skip


def _mapped(scene: Scene, method: Method, frequencies: Floats) -> Solution:
    """Solution by the wavenumber integral, at the probes and on the map."""
    x, y = map_axes(scene)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = np.vstack([scene.probe_points, places])
    f, a = _lines(scene, points, method)
    return _of_lines(scene, frequencies, f, a, (len(y), len(x)))


def _of_family(scene: Scene, method: Method, family: Family, frequencies: Floats) -> Solution:
    """Solution by the reduced-order model of all samples' bodies, at the probes."""
    size = method.h or default_size(family.scene.body)
    shared = reduced(family, size, method.tolerance, method.solver)
    f, a = lines_of(shared, scene.body)
    ratio = scene.pressure.peak_pressure / family.scene.pressure.peak_pressure
    return _of_lines(scene, frequencies, f, ratio * a, NO_MAP.shape)


def _alone(scene: Scene, method: Method, frequencies: Floats) -> Solution:
    """Solution in the steady state by a reduced-order model of one sample's body, at the probes."""
    prepared = prepare(
        scene.body, scene.probe_points, h=method.h, solver=method.solver,
        tolerance=reduction_tolerance(method.tolerance), reading=scene.reading, load=scene.load,
    )  # fmt: skip
    motion = components(prepared, *scene.loads)
    return _of_lines(scene, frequencies, motion.frequencies, motion.lines, NO_MAP.shape)


def _of_lines(
    scene: Scene, frequencies: Floats, f: Floats, a: Complex, of_map: tuple[int, ...]
) -> Solution:
    """Solution in the steady state, of lines (f, p + ny nx) at the probes and then on a map."""
    f, a = f[f > 0], a[f > 0]
    p = len(scene.probes)
    rms = np.sqrt((np.abs(a) ** 2).sum(axis=0) / 2)
    return Solution(
        waveform=synthesise(f, a[:, :p], shown_times(scene)),
        lines=_at(frequencies, f, np.abs(a[:, :p])),
        rms=rms[:p],
        level=_highest(f, np.abs(a[:, :p])),
        map_rms=rms[p:].reshape(of_map),
        map_level=_highest(f, np.abs(a[:, p:])).reshape(of_map),
    )


def _lines(scene: Scene, points: Floats, method: Method) -> tuple[Floats, Complex]:
    waves = compliance(scene.body)
    if not method.same_load:
        return steady_lines(waves, scene.pressure, points, threshold=FAINT)
    operator = _operator(scene.pressure, tuple(map(tuple, points.tolist())))
    return operator.steady_lines(waves)


@lru_cache(maxsize=2)
def _operator(pressure: MovingPressure, points: tuple[tuple[float, ...], ...]) -> PathOperator:
    return path_operator(pressure, points, threshold=FAINT)


def _at(frequencies: Floats, f: Floats, amplitudes: Floats) -> Floats:
    """Amplitudes (g, p) at frequencies (g,) of lines at f (f,), which are 0 where there is none."""
    found = np.zeros((len(frequencies), amplitudes.shape[1]))
    for row, frequency in zip(found, frequencies, strict=True):
        near = np.abs(f - frequency) < 1e-6 * max(frequency, 1.0)
        row[:] = amplitudes[near].sum(axis=0)
    return np.where(found > ROUND_OFF * found.max(initial=0.0), found, 0.0)


def _highest(frequencies: Floats, amplitudes: Floats) -> Floats:
    """The highest sensation level (p,) in dB of lines (f, p)."""
    levels = sensation_level(amplitudes, np.asarray(frequencies)[:, None])
    return np.asarray(np.maximum(levels.max(axis=0, initial=-np.inf), SILENT))
