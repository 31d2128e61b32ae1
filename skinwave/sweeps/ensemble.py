"""Vibration of many samples of a scene's uncertain numbers.

The wavenumber integral gives the probes and a map in the steady state, where it is exact. A
reduced-order model shared by the bodies of samples gives the probes in the steady state. In other
cases the model of the scene computes each sample. Motion of a linear body is proportional to the
pressure, so that samples that differ only in pressure are solved once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model import named_lines, phasors, sensation_level
from simple_model.layers.flat_body import path_operator, steady_lines
from simple_model.line_table import lines_in_pulses
from simple_model.load.line_names import line_frequency
from simple_model.load.spectrum import synthesise
from simple_model.response import SETTLE
from skinwave.bodies.analytic import compliance
from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.covering import Covering, cached_shared_body, covering, try_shared_body
from skinwave.models.flat_body import HARMONIC
from skinwave.models.linear_elements import FEM
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.parametric import lines_of
from skinwave.models.reduced import components, reduce_scene
from skinwave.planning.simulate import compute
from skinwave.report.styles import SHOWN
from skinwave.results.comparison import steady_rms
from skinwave.results.surface import MAP, grid, has_wavenumber_integral
from skinwave.scene.distributions import Spread
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, spreads_of
from skinwave.scene.variation import with_values
from skinwave.sweeps import engine
from skinwave.sweeps.measures import plain, unit_of
from skinwave.sweeps.sampling import one_at_a_time, samples
from skinwave.system.effort import Progress, one_thread, silent
from skinwave.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """How samples are solved.

    `lines` are the names of the evaluated lines. If `mapped`, the wavenumber integral solves the
    samples, with a map of a `step` in m, and leaves out lines below `negligible_ratio` times the
    strongest line of the load; otherwise a model does, with the `options`. If `same_load`, the
    loads of samples differ only in pressure. Bodies of the `family` are reduced together, for the
    steady state.
    """

    lines: tuple[str, ...]
    options: SolveOptions
    mapped: bool = False
    same_load: bool = False
    family: Covering | None = None
    step: float = 0.004
    negligible_ratio: float = 1e-3

    @property
    def words(self) -> str:
        """The method, for the end of a sentence."""
        if self.mapped:
            return "by the wavenumber integral, in the steady state"
        together = ", mostly with one reduced-order model, in the steady state"
        return f"by {self.options.model}{together if self.family else ''}"

    def map_axes(self, scene: Scene) -> tuple[Floats, Floats]:
        """Return the coordinates (nx,) and (ny,) in m of the map."""
        return grid(scene, MAP.reach, self.step)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Vibration of one sample about its mean, in the unit of the response.

    Parameters
    ----------
    waveform : (t, p) float, the last `SHOWN` of a Tacton
    lines : (f, p) float, amplitudes of the named lines
    rms : (p,) float
    level : (p,) float, dB, highest sensation level while a pulse is on, as if on skin, at least
        `MAP.lowest_level`
    map_rms, map_level : (ny, nx) float, RMS and level on a map; empty without a map
    """

    waveform: Floats
    lines: Floats
    rms: Floats
    level: Floats
    map_rms: Floats
    map_level: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble(Solution):
    """Vibration of n samples of a scene: the arrays of `Solution`, with a first axis (n,).

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
        """Whether the probes read the displacement of skin, for which levels are defined."""
        return self.scene.reading.is_plain and self.scene.body.is_skin

    @property
    def strongest(self) -> int:
        """Index of the probe with the largest median RMS."""
        return int(np.argmax(np.median(self.rms, axis=0)))


def propagate(
    scene: Scene,
    n: int,
    *,
    model: str = HARMONIC.name,
    seed: int = 0,
    workers: int = 1,
    progress: Progress = silent,
    **options: Any,
) -> Ensemble:
    """Solve a scene at a Latin hypercube of n samples of its uncertain numbers.

    `model` and `options`, h and solver, are those of `SolveOptions`, used where the wavenumber
    integral is not exact. With several `workers` (processes), a script needs `if __name__ ==
    "__main__"`. Raises a ValueError if no number is uncertain or the model refuses a sample.
    """
    spreads = spreads_of(scene)
    values = samples(spreads, n, seed)
    method = method_of(scene, SolveOptions(model=model, **options))
    all_values = np.vstack([values, one_at_a_time(spreads)])
    method = replace(method, family=shared_family(scene, spreads, all_values, method, progress))
    return ensemble(scene, spreads, values, method, workers=workers, progress=progress)


def method_of(scene: Scene, options: SolveOptions) -> Method:
    """Return the method for the samples of a scene, with a body for each."""
    weakest_ratio, most_lines = 1e-2, 24  # to the strongest line of the load
    lines = tuple(named_lines(scene.pressure, weakest_ratio, most=most_lines))
    same = all(s.part == "material" or s.key == PRESSURE for s in spreads_of(scene))
    mapped = has_wavenumber_integral(scene) and scene.reading.is_plain
    return Method(lines=lines, options=options, mapped=mapped, same_load=same)


def shared_family(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    progress: Progress = silent,
    quantiles: tuple[float, float] = (0.01, 0.99),
) -> Covering | None:
    """Reduce the bodies of most samples (n, d) together, cached on disk. Return None if separate
    reductions cost less or a common one is not possible.

    The bodies have each number between its `quantiles`. A palm needs 785 vectors for those of a
    hundred samples, and more than one model can have for the farthest of 256.
    """
    free = {}
    for spread, column in zip(spreads, values.T, strict=True):
        if spread.key != PRESSURE:
            low, high = spread.at(quantiles)
            free[spread.key] = max(low, float(column.min())), min(high, float(column.max()))
    by_elements = method.options.model == FEM.name and method.same_load and not method.mapped
    if not (free and by_elements and scene.reading.is_plain and scene.pressure.peak_pressure):
        return None
    family = covering(scene, free, len(values), method.options.tolerance)
    size = method.options.h or default_size(scene.body)
    options = replace(method.options, h=size, progress=progress)
    return family if try_shared_body(family, options) else None


def ensemble(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    *,
    workers: int = 1,
    progress: Progress = silent,
) -> Ensemble:
    """Solve a scene at samples (n, d); the number of processes does not affect the result."""
    keys = tuple(spread.key for spread in spreads)
    different, factors = values.copy(), np.ones(len(values))
    is_proportional = method.mapped or is_linear(scene, method.options.model)
    if PRESSURE in keys and is_proportional:
        k = keys.index(PRESSURE)
        if (values[:, k] > 0).all():
            factors, different[:, k] = values[:, k], 1.0
    different, place = np.unique(different, axis=0, return_inverse=True)
    solved: dict[int, Solution] = {}

    def done(solutions: Mapping[int, Solution]) -> None:
        solved.update(solutions)
        progress("samples", len(solved) / len(different))

    progress("samples", 0.0)
    work = partial(_solve, scene, keys, method)
    few = 32  # samples up to which starting processes costs more than it saves
    if workers > 1 and len(different) > few:
        engine.run_all(work, list(different), "processes", workers, done)
    else:
        with one_thread():
            for k, sample in enumerate(different):
                done({k: work(sample)})
    if len(solved) < len(different):
        raise ValueError("workers were killed; provide more memory, or use fewer workers")
    arrays = {}
    for name in (field.name for field in fields(Solution)):
        own = np.stack([vars(solved[k])[name] for k in place.ravel().tolist()])
        columns = own.T + 20 * np.log10(factors) if "level" in name else own.T * factors
        arrays[name] = np.asarray(columns.T)  # levels are in dB
    return Ensemble(scene=scene, method=method, spreads=tuple(spreads), values=values, **arrays)


def is_linear(scene: Scene, name: str) -> bool:
    """Whether the vibration by a model is proportional to the pressure."""
    model = named(name)
    linear = (model.is_reduced or model.is_infinite or model.is_steady) and not model.is_nonlinear
    alone = not (scene.load.gravity or scene.load.support_motion)
    return scene.reading.is_plain and linear and alone


def _solve(scene: Scene, keys: tuple[str, ...], method: Method, values: Floats) -> Solution:
    """Solve one sample (d,) on a worker."""
    changed = dict(zip(keys, values.tolist(), strict=True))
    together = method.family is not None and method.family.has(changed)
    try:
        return solve_sample(with_values(scene, changed), method, together=together)
    except ValueError as error:
        sample = ", ".join(f"{key} = {x:.4g}" for key, x in changed.items())
        raise ValueError(
            f"the sample with {sample} cannot be computed ({error}); narrow its distribution, "
            "or give low and high"
        ) from None


def rows_of(found: Ensemble) -> list[dict[str, Any]]:
    """Return samples as rows of a sweep: their numbers, and columns at the probes."""
    scene, record = found.scene, found.scene.reading.record
    unit, scale, names = unit_of(record), record.per_unit, found.method.lines
    columns: dict[str, Floats] = {f"rms_{unit}": scale * found.rms}
    if found.is_skin:
        columns["level_db"] = found.level
        if found.has_map:
            x, y = found.method.map_axes(scene)
            cell = 1e4 * (x[1] - x[0]) * (y[1] - y[0])
            columns["above_threshold_cm2"] = cell * (found.map_level >= 0).sum(axis=(1, 2))
    columns |= {f"{name}_{unit}": scale * found.lines[:, k] for k, name in enumerate(names)}
    same: dict[str, Any] = {
        f"{name}_hz": line_frequency(scene.tacton, name) or 0.0 for name in names
    }
    same |= {f"probe_{axis}_mm": 1e3 * scene.probe_points[:, k] for k, axis in enumerate("xy")}
    keys = [spread.key for spread in found.spreads]
    return [
        dict(zip(keys, row, strict=True)) | plain(same | {n: x[i] for n, x in columns.items()})
        for i, row in enumerate(found.values.tolist())
    ]


def waveform_times(scene: Scene) -> Floats:
    """Return the times (t,) in s of the waveforms."""
    times = sample_times(scene)
    return times[times >= times[-1] - SHOWN]


def solve_sample(scene: Scene, method: Method, *, together: bool = True) -> Solution:
    """Solve one sample, with the reduced-order model of the family if the body belongs to it
    (`together`).

    Raises a ValueError if the model refuses the scene.
    """
    if not (method.mapped or method.family):
        return _compute(scene, method)
    f, a = _steady_lines(scene, method, together)
    in_pulses, steady = (f, a), scene.during_pulses
    if steady is not scene:
        in_pulses = _steady_lines(steady, method, together)
    p, (x, y) = len(scene.probes), method.map_axes(scene)
    shape = (len(y), len(x)) if method.mapped else (0, 0)
    rms, levels = np.sqrt((np.abs(a) ** 2).sum(axis=0) / 2), _highest_level(*in_pulses)
    return Solution(
        waveform=synthesise(f, a[:, :p], waveform_times(scene)),
        lines=_amplitudes_at(_frequencies(scene, method), f, np.abs(a[:, :p])),
        rms=rms[:p], level=levels[:p],
        map_rms=rms[p:].reshape(shape), map_level=levels[p:].reshape(shape),
    )  # fmt: skip


def _steady_lines(scene: Scene, method: Method, together: bool) -> tuple[Floats, Complex]:
    """Return the lines of a sample at the probes and, by the wavenumber integral, on the map."""
    how, family = method.options, method.family
    if method.mapped:
        f, a = _map_lines(scene, method)
    elif family and together:
        pressure = replace(scene.pressure, peak_pressure=family.scene.pressure.peak_pressure)
        family = replace(family, scene=replace(family.scene, pressure=pressure))
        size = how.h or default_size(family.scene.body)
        f, a = lines_of(cached_shared_body(family, size, how.tolerance, how.solver), scene.body)
        a = a * (scene.pressure.peak_pressure / pressure.peak_pressure)
    else:
        motion = components(reduce_scene(scene, how), *scene.loads)
        f, a = motion.frequencies, motion.lines
    return f[f > 0], a[f > 0]


def _map_lines(scene: Scene, method: Method) -> tuple[Floats, Complex]:
    """Return the lines by the wavenumber integral at probes and map."""
    grid_points = np.stack(np.meshgrid(*method.map_axes(scene)), axis=-1).reshape(-1, 2)
    points, waves = np.vstack([scene.probe_points, grid_points]), compliance(scene.body)
    threshold = method.negligible_ratio
    if method.same_load:
        places = tuple(map(tuple, points.tolist()))
        return _cached_operator(scene.pressure, places, threshold=threshold)(waves)
    return steady_lines(waves, scene.pressure, points, threshold=threshold)


_cached_operator = lru_cache(maxsize=2)(path_operator)


def _compute(scene: Scene, method: Method) -> Solution:
    """Solve one sample by a model, at the probes."""
    how = method.options
    response = compute(scene, how.model, tolerance=how.tolerance, h=how.h, solver=how.solver)
    settled = response.values[int(SETTLE * len(response.times)) :]
    motion = response.values[-len(waveform_times(scene)) :] - settled.mean(axis=0)
    frequencies, no_map = _frequencies(scene, method), np.zeros((0, 0))
    lines = np.abs(phasors(response, frequencies)) * (frequencies > 0)[:, None]
    level = _highest_level(frequencies, lines)
    if scene.tacton.rhythm:
        table = lines_in_pulses(scene.pressure, response)
        amplitudes = np.reshape([*table.amplitudes.values()], (-1, len(scene.probes)))
        level = _highest_level([*table.frequencies.values()], amplitudes)
    return Solution(
        waveform=motion, lines=lines, rms=steady_rms(response),
        level=level, map_rms=no_map, map_level=no_map,
    )  # fmt: skip


def _frequencies(scene: Scene, method: Method) -> Floats:
    """Return the frequencies (f,) in Hz of the named lines; 0 for a line that is absent."""
    return np.array([line_frequency(scene.tacton, name) or 0.0 for name in method.lines])


def _amplitudes_at(frequencies: Floats, f: Floats, amplitudes: Floats) -> Floats:
    """Return amplitudes (g, p) at frequencies (g,), from those of lines at f (f,); 0 elsewhere."""
    near = np.abs(f - frequencies[:, None]) < 1e-6 * np.maximum(frequencies, 1.0)[:, None]
    values = near @ amplitudes
    return np.where(values > 1e-12 * values.max(initial=0.0), values, 0.0)  # else round-off


def _highest_level(frequencies: ArrayLike, lines: Complex | Floats) -> Floats:
    """Return the highest sensation level (p,) in dB of lines (f, p)."""
    levels = sensation_level(np.abs(lines), np.asarray(frequencies)[:, None])
    return np.asarray(np.maximum(levels.max(axis=0, initial=-np.inf), MAP.lowest_level))
