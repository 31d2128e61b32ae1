"""Uncertain numbers of a scene carried to its vibration: an ensemble of solutions.

Where the wavenumber integral is exact it gives probes and a map, in the steady state; where the
bodies of samples share a reduced-order model, that gives the probes, likewise; elsewhere the model
that the scene requires does. Motion of a linear body is in proportion to the pressure, so that
samples that differ by that alone are solved once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure, named_lines, phasors, sensation_level
from simple_model.layers.flat_body import PathOperator, path_operator, steady_lines
from simple_model.load.line_names import line_frequency
from simple_model.load.spectrum import synthesise
from simple_model.response import SETTLE
from simple_model.typing import Complex
from skinwave.bodies.analytic import compliance
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.covering import Covering, covering, kept_together, tried_together
from skinwave.models.flat_body import HARMONIC
from skinwave.models.linear_elements import FEM
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.parametric import lines_of
from skinwave.models.reduced import components, prepare, reduction_tolerance
from skinwave.planning.simulate import compute
from skinwave.report.styles import SHOWN
from skinwave.results.surface import REACH, SILENT, grid, has_wavenumber_integral
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of, with_values
from skinwave.sweeps import engine
from skinwave.sweeps.sampling import one_at_a_time, samples
from skinwave.system.effort import Progress, one_thread, silent

WEAKEST, MOST = 1e-2, 24  # of the strongest line of the load, and lines, that are looked at
BATCH = 16  # samples that are handed out together
ALONE = 2 * BATCH  # samples up to which no other process is worth its start
STEP = 0.004  # m between places of a map
FAINT = 1e-3  # of the load's strongest line: lines that no sample has
ROUND_OFF = 1e-12  # of the largest line
KEPT = 4  # solutions that may differ by the pressure alone
# Quantiles of each number between which bodies are reduced together: a palm takes 785 vectors for
# those of a hundred samples, and more than one model has for the farthest of 256.
SHARED = (0.01, 0.99)
HIGHEST_LEVEL = "highest sensation level at a probe, dB"  # an output
NO_MAP = np.zeros((0, 0))


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
    family: Covering | None = None
    steady: bool = False

    @property
    def words(self) -> str:
        """The method, as a sentence ends with it."""
        if self.mapped:
            return "by the wavenumber integral, in the steady state"
        together = ", nearly all of one reduced-order model, in the steady state"
        return f"by {self.model}{together if self.family else ''}"


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble(Solution):
    """Solutions of n samples of a scene, whose arrays have n for their first axis.

    Parameters
    ----------
    scene : Scene, with the central values
    method : Method
    spreads : (d,) Spread, the uncertain numbers
    values : (n, d) float, in the units of their keys
    """

    scene: Scene
    method: Method
    spreads: tuple[Spread, ...]
    values: Floats

    @property
    def has_map(self) -> bool:
        """Whether the solutions have a map."""
        return bool(self.map_rms.size)

    @property
    def is_skin(self) -> bool:
        """Whether it is skin whose displacement is read, so that levels have a meaning."""
        return self.scene.reading.is_plain and self.scene.body.is_skin

    @property
    def area(self) -> Floats:
        """Area (n,) in m2 of the map that is above the threshold of detection."""
        x, y = map_axes(self.scene)
        place = (x[1] - x[0]) * (y[1] - y[0])
        return np.asarray((self.map_level >= 0).sum(axis=(1, 2)) * place)


def propagate(
    scene: Scene,
    n: int,
    *,
    model: str = HARMONIC.name,
    h: float | None = None,
    solver: str = "auto",
    seed: int = 0,
    workers: int = 1,
    progress: Progress = silent,
) -> Ensemble:
    """Ensemble of a scene under a Latin hypercube of its uncertain numbers.

    Parameters
    ----------
    scene : Scene
    n : samples
    model : of the response where the wavenumber integral is not exact
    h : metre, its element size
    solver : a backend of `fem.linear_solver`
    seed : of the samples
    workers : processes; with several, a script needs `if __name__ == "__main__"`
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Ensemble

    Raises
    ------
    ValueError
        If nothing is uncertain, or a sample makes no scene or is refused by the model.
    """
    spreads = spreads_of(scene)
    values = samples(spreads, n, seed)
    method = method_of(scene, model, h=h, solver=solver)
    family = shared_body(
        scene, spreads, np.vstack([values, one_at_a_time(spreads)]), method, progress
    )
    method = replace(method, family=family, steady=family is not None)
    return ensemble(scene, spreads, values, method, workers=workers, progress=progress)


def method_of(scene: Scene, model: str, *, h: float | None = None, solver: str = "auto") -> Method:
    """Method that samples of a scene are solved by; `model`, `h` and `solver` where the wavenumber
    integral is not exact.
    """
    lines = tuple(named_lines(scene.pressure, WEAKEST, most=MOST))
    same = all(s.part == "material" or s.key == PRESSURE for s in spreads_of(scene))
    mapped = has_wavenumber_integral(scene) and scene.reading.is_plain
    return Method(lines=lines, model=model, h=h, solver=solver, mapped=mapped, same_load=same)


def shared_body(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    progress: Progress = silent,
) -> Covering | None:
    """One reduction for the bodies of nearly all samples (n, d), cached on disk; None if bodies of
    their own cost less, or no reduction serves them.
    """
    free = {
        spread.key: _range(spread, column)
        for spread, column in zip(spreads, values.T, strict=True)
        if spread.key != PRESSURE
    }
    of_elements = method.model == FEM.name and method.same_load and not method.mapped
    if not (free and of_elements and scene.reading.is_plain and scene.pressure.peak_pressure):
        return None
    found = covering(scene, free, len(values), method.tolerance)
    options = SolveOptions(
        h=method.h or default_size(scene.body), tolerance=method.tolerance, solver=method.solver,
        progress=progress,
    )  # fmt: skip
    return found if tried_together(found, options) else None


def _range(spread: Spread, values: Floats) -> tuple[float, float]:
    """Range of values (n,) of a number without its ends, which few of them are in."""
    low, high = spread.distribution.quantile(spread.value, np.array(SHARED)).tolist()
    return max(low, float(values.min())), min(high, float(values.max()))


def ensemble(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    *,
    workers: int = 1,
    progress: Progress = silent,
) -> Ensemble:
    """Ensemble of given samples (n, d) of a scene, the same whatever the number of processes.

    Raises
    ------
    ValueError
        If a sample makes no scene, or is refused by the model.
    """
    keys = tuple(spread.key for spread in spreads)
    batches = np.split(values, range(BATCH, len(values), BATCH))
    solved: dict[int, list[Solution]] = {}

    def done(k: int, found: list[Solution]) -> None:
        solved[k] = found
        progress("samples", len(solved) / len(batches))

    work = partial(_batch, scene, keys, method)
    if workers > 1 and len(values) > ALONE:
        engine.run_all(work, batches, "processes", workers, done)
    else:
        with one_thread():
            for k, batch in enumerate(batches):
                done(k, work(batch))
    if len(solved) < len(batches):
        raise ValueError("workers were killed; give them more memory, or take fewer of them")
    every = [solution for k in range(len(batches)) for solution in solved[k]]
    arrays = {f.name: np.stack([getattr(s, f.name) for s in every]) for f in fields(Solution)}
    return Ensemble(scene=scene, method=method, spreads=tuple(spreads), values=values, **arrays)


def _batch(scene: Scene, keys: tuple[str, ...], method: Method, values: Floats) -> list[Solution]:
    """Solutions of some samples (b, d), on a worker."""
    found = []
    for row in values:
        changed = dict(zip(keys, map(float, row), strict=True))
        own = method
        if method.family and not method.family.has(changed):
            own = replace(method, family=None)
        try:
            found.append(solve(with_values(scene, changed), own))
        except ValueError as error:
            said = ", ".join(f"{key} = {x:.4g}" for key, x in changed.items())
            raise ValueError(
                f"a sample with {said} cannot be computed ({error}); narrow its distribution, or "
                "give low and high"
            ) from None
    return found


def outputs(found: Ensemble) -> dict[str, Floats]:
    """Scalar outputs (n,) of an ensemble by name, with the unit of each."""
    asked = found.scene.reading.asked
    per = asked.per_unit
    named = {
        f"RMS at ({1e3 * x:g}, {1e3 * y:g}) mm, {asked.shown}": per * found.rms[:, p]
        for p, (x, y) in enumerate(found.scene.probes)
    }
    if found.is_skin:
        named[HIGHEST_LEVEL] = found.level.max(axis=1)
        if found.has_map:
            named["area above threshold, cm²"] = 1e4 * found.area
    return named


def shown_times(scene: Scene) -> Floats:
    """Times (t,) in s of the waveforms that are shown."""
    times = sample_times(scene)
    return times[times >= times[-1] - SHOWN]


def map_axes(scene: Scene) -> tuple[Floats, Floats]:
    """Coordinates (nx,) and (ny,) in metre of the map."""
    return grid(scene, REACH, STEP)


def solve(scene: Scene, method: Method) -> Solution:
    """Solution of one sample; raises a ValueError if the model refuses the scene."""
    peak = scene.pressure.peak_pressure
    in_proportion = method.mapped or is_linear(scene, method.model)
    if not (peak and isinstance(scene.pressure.profile, str) and in_proportion):
        return _solved(scene, method)
    unit = replace(scene, pressure=replace(scene.pressure, peak_pressure=1.0), spreads=())
    found, raised = _of_unit_pressure(unit, method), 20 * np.log10(peak)
    return Solution(
        waveform=peak * found.waveform, lines=peak * found.lines, rms=peak * found.rms,
        level=found.level + raised, map_rms=peak * found.map_rms,
        map_level=found.map_level + raised,
    )  # fmt: skip


def is_linear(scene: Scene, name: str) -> bool:
    """Whether the vibration by a model is in proportion to the pressure."""
    model = named(name)
    linear = (model.is_reduced or model.is_infinite or model.is_steady) and not model.is_nonlinear
    alone = not (scene.load.gravity or scene.load.support_motion)
    return scene.reading.is_plain and linear and alone


@lru_cache(maxsize=KEPT)
def _of_unit_pressure(scene: Scene, method: Method) -> Solution:
    return _solved(scene, method)


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
    points, waves = np.vstack([scene.probe_points, places]), compliance(scene.body)
    if method.same_load:
        operator = _operator(scene.pressure, tuple(map(tuple, points.tolist())))
        f, a = operator.steady_lines(waves)
    else:
        f, a = steady_lines(waves, scene.pressure, points, threshold=FAINT)
    return _of_lines(scene, frequencies, f, a, (len(y), len(x)))


@lru_cache(maxsize=2)
def _operator(pressure: MovingPressure, points: tuple[tuple[float, ...], ...]) -> PathOperator:
    return path_operator(pressure, points, threshold=FAINT)


def _of_family(scene: Scene, method: Method, family: Covering, frequencies: Floats) -> Solution:
    """Solution by the reduced-order model of all samples' bodies, at the probes."""
    size = method.h or default_size(family.scene.body)
    shared = kept_together(family, size, method.tolerance, method.solver)
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
