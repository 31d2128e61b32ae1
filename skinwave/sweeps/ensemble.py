"""Uncertain numbers of a scene carried to its vibration: an ensemble of solutions.

Where the wavenumber integral is exact it gives probes and a map, in the steady state; where the
bodies of samples share a reduced-order model, that gives the probes, likewise; elsewhere the model
that the scene requires does. Motion of a linear body is in proportion to the pressure, so that
samples that differ by that alone are solved once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from simple_model import MovingPressure, named_lines, phasors, sensation_level
from simple_model.layers.compliance import Compliance
from simple_model.layers.flat_body import path_operator, steady_lines
from simple_model.load.line_names import line_frequency
from simple_model.load.spectrum import synthesise
from simple_model.response import SETTLE
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
from skinwave.scene.distributions import Spread
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, spreads_of
from skinwave.scene.variation import with_values
from skinwave.sweeps import engine
from skinwave.sweeps.measures import plain, unit_of
from skinwave.sweeps.sampling import one_at_a_time, samples
from skinwave.system.effort import Progress, one_thread, silent
from skinwave.typing import Complex, Floats

WEAKEST, MOST = 1e-2, 24  # of the strongest line of the load, and lines, that are looked at
BATCH = 16  # samples that are handed out together
ALONE = 2 * BATCH  # samples up to which no other process is worth its start
STEP = 0.004  # m between places of a map
FAINT = 1e-3  # of the load's strongest line: lines that no sample has
ROUND_OFF = 1e-12  # of the largest line
# Quantiles of each number between which bodies are reduced together: a palm takes 785 vectors for
# those of a hundred samples, and more than one model has for the farthest of 256.
SHARED = (0.01, 0.99)


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """How samples are solved: names of the `lines` that are looked at, and the `options` where it
    is not `mapped`, by the wavenumber integral; whether all samples have one load, `same_load`,
    but for its pressure; and the `family` of their bodies, if these are reduced together, for the
    steady state.
    """

    lines: tuple[str, ...]
    options: SolveOptions
    mapped: bool = False
    same_load: bool = False
    family: Covering | None = None

    @property
    def words(self) -> str:
        """The method, as a sentence ends with it."""
        if self.mapped:
            return "by the wavenumber integral, in the steady state"
        together = ", nearly all of one reduced-order model, in the steady state"
        return f"by {self.options.model}{together if self.family else ''}"


class Solution(NamedTuple):
    """Vibration of one sample about its mean, as of `Ensemble`."""

    waveform: Floats
    lines: Floats
    rms: Floats
    level: Floats
    map_rms: Floats
    map_level: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble:
    """Vibration of n samples of a scene about their means, in the unit of the response.

    Parameters
    ----------
    scene : Scene, with the central values
    method : Method
    spreads : (d,) Spread, the uncertain numbers
    values : (n, d) float, in the units of their keys
    waveform : (n, t, p) float, the last `SHOWN` of a Tacton
    lines : (n, f, p) float, amplitudes of the named lines
    rms : (n, p) float
    level : (n, p) float, dB, the highest sensation level of its lines, were it skin; `SILENT` and
        less where nothing vibrates
    map_rms, map_level : (n, ny, nx) float, the same on a map; of no size without one
    """

    scene: Scene
    method: Method
    spreads: tuple[Spread, ...]
    values: Floats
    waveform: Floats
    lines: Floats
    rms: Floats
    level: Floats
    map_rms: Floats
    map_level: Floats

    @property
    def has_map(self) -> bool:
        """Whether the solutions have a map."""
        return bool(self.map_rms.size)

    @property
    def is_skin(self) -> bool:
        """Whether it is skin whose displacement is read, so that levels have a meaning."""
        return self.scene.reading.is_plain and self.scene.body.is_skin

    @property
    def strongest(self) -> int:
        """The probe of largest median RMS."""
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
    """Ensemble of a scene under a Latin hypercube of n samples of its uncertain numbers.

    The model and the `options`, h and solver, are those of `SolveOptions`, where the wavenumber
    integral is not exact. With several `workers`, processes, a script needs
    `if __name__ == "__main__"`. Raises a ValueError if nothing is uncertain, or a sample makes no
    scene or is refused by the model.
    """
    spreads = spreads_of(scene)
    values = samples(spreads, n, seed)
    method = method_of(scene, SolveOptions(model=model, **options))
    every = np.vstack([values, one_at_a_time(spreads)])
    method = replace(method, family=shared_body(scene, spreads, every, method, progress))
    return ensemble(scene, spreads, values, method, workers=workers, progress=progress)


def method_of(scene: Scene, options: SolveOptions) -> Method:
    """Method that samples of a scene are solved by, each with a body of its own."""
    lines = tuple(named_lines(scene.pressure, WEAKEST, most=MOST))
    same = all(s.part == "material" or s.key == PRESSURE for s in spreads_of(scene))
    mapped = has_wavenumber_integral(scene) and scene.reading.is_plain
    return Method(lines=lines, options=options, mapped=mapped, same_load=same)


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
    free = {}
    for spread, column in zip(spreads, values.T, strict=True):
        if spread.key != PRESSURE:
            low, high = spread.at(SHARED)
            free[spread.key] = max(low, float(column.min())), min(high, float(column.max()))
    of_elements = method.options.model == FEM.name and method.same_load and not method.mapped
    if not (free and of_elements and scene.reading.is_plain and scene.pressure.peak_pressure):
        return None
    found = covering(scene, free, len(values), method.options.tolerance)
    size = method.options.h or default_size(scene.body)
    asked = replace(method.options, h=size, progress=progress)
    return found if tried_together(found, asked) else None


def ensemble(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    *,
    workers: int = 1,
    progress: Progress = silent,
) -> Ensemble:
    """Ensemble of given samples (n, d) of a scene, the same whatever the number of processes."""
    keys = tuple(spread.key for spread in spreads)
    alike, peaks = values.copy(), np.ones(len(values))
    if PRESSURE in keys and _goes_with_pressure(scene, method):
        k = keys.index(PRESSURE)
        if (values[:, k] > 0).all():
            peaks, alike[:, k] = values[:, k], 1.0
    alike, place = np.unique(alike, axis=0, return_inverse=True)
    batches = np.split(alike, range(BATCH, len(alike), BATCH))
    solved: dict[int, list[Solution]] = {}

    def done(k: int, found: list[Solution]) -> None:
        solved[k] = found
        progress("samples", len(solved) / len(batches))

    work = partial(_batch, scene, keys, method)
    if workers > 1 and len(alike) > ALONE:
        engine.run_all(work, batches, "processes", workers, done)
    else:
        with one_thread():
            for k, batch in enumerate(batches):
                done(k, work(batch))
    if len(solved) < len(batches):
        raise ValueError("workers were killed; give them more memory, or take fewer of them")
    every = [solution for k in range(len(batches)) for solution in solved[k]]
    found = Solution(*(np.stack(each)[place.ravel()] for each in zip(*every, strict=True)))
    return Ensemble(
        scene=scene, method=method, spreads=tuple(spreads), values=values,
        **_raised(found, peaks)._asdict(),
    )  # fmt: skip


def _goes_with_pressure(scene: Scene, method: Method) -> bool:
    return isinstance(scene.pressure.profile, str) and (
        method.mapped or is_linear(scene, method.options.model)
    )


def is_linear(scene: Scene, name: str) -> bool:
    """Whether the vibration by a model is in proportion to the pressure."""
    model = named(name)
    linear = (model.is_reduced or model.is_infinite or model.is_steady) and not model.is_nonlinear
    alone = not (scene.load.gravity or scene.load.support_motion)
    return scene.reading.is_plain and linear and alone


def _raised(found: Solution, factors: Floats) -> Solution:
    """Solutions of n samples whose pressure is times factors (n,)."""
    raised = 20 * np.log10(factors)
    return Solution(*(
        (each.T + raised).T if "level" in name else (each.T * factors).T
        for name, each in found._asdict().items()
    ))  # fmt: skip


def _batch(scene: Scene, keys: tuple[str, ...], method: Method, values: Floats) -> list[Solution]:
    """Solutions of some samples (b, d), on a worker."""
    found = []
    for row in values.tolist():
        changed = dict(zip(keys, row, strict=True))
        together = method.family is not None and method.family.has(changed)
        try:
            found.append(solve(with_values(scene, changed), method, together=together))
        except ValueError as error:
            said = ", ".join(f"{key} = {x:.4g}" for key, x in changed.items())
            raise ValueError(
                f"a sample with {said} cannot be computed ({error}); narrow its distribution, or "
                "give low and high"
            ) from None
    return found


def rows_of(found: Ensemble) -> list[dict[str, Any]]:
    """The samples as rows of a sweep: their numbers, and columns at the probes."""
    scene, record = found.scene, found.scene.reading.record
    unit, per, names = unit_of(record), record.per_unit, found.method.lines
    columns: dict[str, Floats] = {f"rms_{unit}": per * found.rms}
    if found.is_skin:
        columns["level_db"] = found.level
        if found.has_map:
            x, y = map_axes(scene)
            place = 1e4 * (x[1] - x[0]) * (y[1] - y[0])
            columns["above_threshold_cm2"] = place * (found.map_level >= 0).sum(axis=(1, 2))
    columns |= {f"{name}_{unit}": per * found.lines[:, k] for k, name in enumerate(names)}
    same: dict[str, Any] = {
        f"{name}_hz": line_frequency(scene.tacton, name) or 0.0 for name in names
    }
    same |= {f"probe_{axis}_mm": 1e3 * scene.probe_points[:, k] for k, axis in enumerate("xy")}
    keys = [spread.key for spread in found.spreads]
    return [
        dict(zip(keys, row, strict=True)) | plain(same | {n: x[i] for n, x in columns.items()})
        for i, row in enumerate(found.values.tolist())
    ]


def shown_times(scene: Scene) -> Floats:
    """Times (t,) in s of the waveforms that are shown."""
    times = sample_times(scene)
    return times[times >= times[-1] - SHOWN]


def map_axes(scene: Scene) -> tuple[Floats, Floats]:
    """Coordinates (nx,) and (ny,) in metre of the map."""
    return grid(scene, REACH, STEP)


def solve(scene: Scene, method: Method, *, together: bool = True) -> Solution:
    """Solution of one sample, of the reduced-order model of all if its body is one of those
    `together`; raises a ValueError if the model refuses the scene.
    """
    of_map: tuple[int, ...] = (0, 0)
    how = method.options
    if method.mapped:
        of_map, (f, a) = _mapped(scene, method)
    elif method.family and together:
        size = how.h or default_size(method.family.scene.body)
        shared = kept_together(method.family, size, how.tolerance, how.solver)
        f, a = lines_of(shared, scene.body)
        a = a * (scene.pressure.peak_pressure / method.family.scene.pressure.peak_pressure)
    elif method.family:
        own = prepare(
            scene.body, scene.probe_points, h=how.h, solver=how.solver,
            tolerance=reduction_tolerance(how.tolerance), reading=scene.reading, load=scene.load,
        )  # fmt: skip
        motion = components(own, *scene.loads)
        f, a = motion.frequencies, motion.lines
    else:
        return _computed(scene, method)
    f, a = f[f > 0], a[f > 0]
    p = len(scene.probes)
    rms, levels = np.sqrt((np.abs(a) ** 2).sum(axis=0) / 2), _highest(f, np.abs(a))
    return Solution(
        waveform=synthesise(f, a[:, :p], shown_times(scene)),
        lines=_at(_frequencies(scene, method), f, np.abs(a[:, :p])), rms=rms[:p], level=levels[:p],
        map_rms=rms[p:].reshape(of_map), map_level=levels[p:].reshape(of_map),
    )  # fmt: skip


def _mapped(scene: Scene, method: Method) -> tuple[tuple[int, int], tuple[Floats, Complex]]:
    """Shape of the map; lines by the wavenumber integral, at the probes and then on the map."""
    x, y = map_axes(scene)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points, waves = np.vstack([scene.probe_points, places]), compliance(scene.body)
    if method.same_load:
        operator = _operator(scene.pressure, tuple(map(tuple, points.tolist())))
        return (len(y), len(x)), operator(waves)
    return (len(y), len(x)), steady_lines(waves, scene.pressure, points, threshold=FAINT)


@lru_cache(maxsize=2)
def _operator(
    pressure: MovingPressure, points: tuple[tuple[float, ...], ...]
) -> Callable[[Compliance], tuple[Floats, Complex]]:
    return path_operator(pressure, points, threshold=FAINT)


def _computed(scene: Scene, method: Method) -> Solution:
    """Solution by a model, at the probes."""
    how = method.options
    response = compute(scene, how.model, tolerance=how.tolerance, h=how.h, solver=how.solver)
    settled = response.values[int(SETTLE * len(response.times)) :]
    motion = response.values[-len(shown_times(scene)) :] - settled.mean(axis=0)
    frequencies, no_map = _frequencies(scene, method), np.zeros((0, 0))
    lines = np.abs(phasors(response, frequencies)) * (frequencies > 0)[:, None]
    return Solution(
        waveform=motion, lines=lines, rms=settled.std(axis=0), level=_highest(frequencies, lines),
        map_rms=no_map, map_level=no_map,
    )  # fmt: skip


def _frequencies(scene: Scene, method: Method) -> Floats:
    """Frequencies (f,) in Hz of the named lines, 0 of one that a sample has not."""
    return np.array([line_frequency(scene.tacton, name) or 0.0 for name in method.lines])


def _at(frequencies: Floats, f: Floats, amplitudes: Floats) -> Floats:
    """Amplitudes (g, p) at frequencies (g,) of lines at f (f,), which are 0 where there is none."""
    near = np.abs(f - frequencies[:, None]) < 1e-6 * np.maximum(frequencies, 1.0)[:, None]
    found = near @ amplitudes
    return np.where(found > ROUND_OFF * found.max(initial=0.0), found, 0.0)


def _highest(frequencies: Floats, amplitudes: Floats) -> Floats:
    """The highest sensation level (p,) in dB of lines (f, p)."""
    levels = sensation_level(amplitudes, np.asarray(frequencies)[:, None])
    return np.asarray(np.maximum(levels.max(axis=0, initial=-np.inf), SILENT))
