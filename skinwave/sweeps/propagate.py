"""Propagation of uncertain numbers to the vibration of a scene: an ensemble of solutions, and its
percentiles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Floats
from simple_model import named_lines
from skinwave.models.flat_body import HARMONIC
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of, with_values
from skinwave.sweeps.indices import ENDS
from skinwave.sweeps.sampling import one_at_a_time, samples
from skinwave.sweeps.shared_body import has, shared_body
from skinwave.sweeps.solutions import Method, Solution, has_exact_map, map_axes, solve
from skinwave.system.effort import Progress, one_thread, silent
from skinwave.system.processes import pool

PERCENTILES = (5, 25, 50, 75, 95)
WEAKEST, MOST = 1e-2, 24  # of the strongest line of the load, and lines, that are looked at
BATCH = 16  # samples that are handed out together
ALONE = 2 * BATCH  # samples up to which no other process is worth its start


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble:
    """Solutions of n samples of a scene.

    Parameters
    ----------
    scene : Scene, with the central values
    method : Method
    spreads : (d,) Spread, the uncertain numbers
    values : (n, d) float, in the units of their keys
    waveform : (n, t, p) float; `lines` (n, f, p), `rms` (n, p), `level` (n, p), `map_rms` and
        `map_level` (n, ny, nx) float likewise: see `Solution`
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
    progress: Progress | None = None,
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
    ends = one_at_a_time(spreads, ENDS)
    family = shared_body(scene, spreads, np.vstack([values, ends]), method, progress)
    method = replace(method, family=family, steady=family is not None)
    return ensemble(scene, spreads, values, method, workers=workers, progress=progress)


def method_of(scene: Scene, model: str, *, h: float | None = None, solver: str = "auto") -> Method:
    """Method that samples of a scene are solved by.

    Parameters
    ----------
    scene : Scene
    model, h, solver : of the response where the wavenumber integral is not exact

    Returns
    -------
    Method
    """
    lines = tuple(named_lines(scene.pressure, WEAKEST, most=MOST))
    same = all(s.part == "material" or s.key == PRESSURE for s in spreads_of(scene))
    return Method(
        lines=lines, model=model, h=h, solver=solver, mapped=has_exact_map(scene), same_load=same
    )


def ensemble(
    scene: Scene,
    spreads: Sequence[Spread],
    values: Floats,
    method: Method,
    *,
    workers: int = 1,
    progress: Progress | None = None,
) -> Ensemble:
    """Ensemble of given samples, the same whatever the number of processes.

    Parameters
    ----------
    scene : Scene, with the central values
    spreads : (d,) Spread
    values : (n, d) float
    method : Method
    workers : processes; with several, a script needs `if __name__ == "__main__"`
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Ensemble

    Raises
    ------
    ValueError
        If a sample makes no scene, or is refused by the model.
    """
    keys = tuple(spread.key for spread in spreads)
    batches = np.split(values, range(BATCH, len(values), BATCH))
    work = partial(_batch, scene, keys, method)
    report = progress or silent
    if workers < 2 or len(values) <= ALONE:
        with one_thread():
            found = [_reported(work(b), k, len(batches), report) for k, b in enumerate(batches)]
    else:
        with pool(workers) as processes:
            futures = [processes.submit(work, batch) for batch in batches]
            found = [
                _reported(future.result(), k, len(batches), report)
                for k, future in enumerate(futures)
            ]
    solved = [solution for batch in found for solution in batch]
    return Ensemble(
        scene=scene, method=method, spreads=tuple(spreads), values=values,
        waveform=np.stack([s.waveform for s in solved]),
        lines=np.stack([s.lines for s in solved]),
        rms=np.stack([s.rms for s in solved]),
        level=np.stack([s.level for s in solved]),
        map_rms=np.stack([s.map_rms for s in solved]),
        map_level=np.stack([s.map_level for s in solved]),
    )  # fmt: skip


def _reported(found: list[Solution], k: int, batches: int, report: Progress) -> list[Solution]:
    report("samples", (k + 1) / batches)
    return found


def _batch(scene: Scene, keys: tuple[str, ...], method: Method, values: Floats) -> list[Solution]:
    """Solutions of some samples (b, d), on a worker."""
    found = []
    for row in values:
        changed = dict(zip(keys, map(float, row), strict=True))
        own = method
        if method.family and not has(method.family, changed):
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


def percentiles(values: NDArray[np.float64]) -> Floats:
    """Percentiles `PERCENTILES` (5, ...) of samples (n, ...), by linear interpolation."""
    return np.asarray(np.percentile(values, PERCENTILES, axis=0))


def outputs(found: Ensemble) -> dict[str, Floats]:
    """Scalar outputs (n,) of an ensemble by name, with the unit of each."""
    asked = found.scene.reading.asked
    per = asked.per_unit
    named = {
        f"RMS at ({1e3 * x:g}, {1e3 * y:g}) mm, {asked.shown}": per * found.rms[:, p]
        for p, (x, y) in enumerate(found.scene.probes)
    }
    if found.scene.reading.is_plain and found.scene.body.is_skin:
        named["highest sensation level at a probe, dB"] = found.level.max(axis=1)
        if found.has_map:
            named["area above threshold, cm²"] = 1e4 * found.area
    return named
