"""Best value of a varied key: where a column of the sweep's table is largest, with the interval
that the spreads of the scene leave.

The best point of the grid and its neighbours give a parabola, and its vertex a further run. Each
sample of the spreads has a best value of its own, found in the same way; the interval holds 95 %
of them, and is wider by a tenth of a step of the grid at each end, to which they are found.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from meshes.tetmesh import Floats
from simple_model.choices import choose
from simple_model.numbers import significant
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.limits import takes
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of
from skinwave.scene.variation import DesignPoint, Variation
from skinwave.sweeps.ensemble import is_linear
from skinwave.sweeps.measures import columns
from skinwave.sweeps.reductions import ModelOptions
from skinwave.sweeps.sampling import samples as samples_of
from skinwave.sweeps.sweep import Combined, Sweep, model_of
from skinwave.sweeps.table_figures import at_probe, value

SAMPLES, FEWEST = 199, 39  # of the spreads; those that have a 95 % interval
ENDS = (2.5, 97.5)  # percentiles between which the interval lies
VERTICES = 2  # runs that refine a best value beyond the grid
RESOLUTION = 0.1  # of a step of the grid, to which a best value is then found
FOLDER = "samples"  # within that of the sweep: the sweep of the samples

Evaluate = Callable[[Combined], Floats]  # the column (n,) of runs (n,), nan where there is none


@dataclass(frozen=True, kw_only=True)
class Best:
    """The `value` of a `key` at which a `column` is largest, and the column there, `result`; the
    `limits` of the values that were tried; and the 95 % `interval` of the best values of `samples`
    of the numbers that are `uncertain`, None if none is.
    """

    key: str
    column: str
    value: float
    result: float
    limits: tuple[float, float]
    interval: tuple[float, float] | None = None
    samples: int = 0
    uncertain: tuple[str, ...] = ()

    @property
    def is_at_end(self) -> bool:
        """Whether the best value is an end of the range, beyond which a better one may lie."""
        return self.value in self.limits

    @property
    def words(self) -> str:
        """The best value and its interval in one or two sentences."""
        end = ", an end of the range," if self.is_at_end else ""
        said = f"{self.key} = {significant(self.value)}{end} gives the largest {self.column}, "
        said += significant(self.result)
        if self.interval is None:
            return f"{said}; no interval, because no uncertain number of the scene moves it"
        low, high = map(significant, self.interval)
        said += f"; 95 % interval {low} to {high}, from {self.samples} samples of "
        said += ", ".join(self.uncertain)
        if set(self.interval) & set(self.limits):
            said += ". The interval reaches an end of the range: widen the range"
        return said

    def __repr__(self) -> str:
        return f"<Best: {self.words}>"


def check(
    variations: Sequence[Variation],
    column: str,
    wanted: Sequence[DesignPoint],
    samples: int | None = None,
) -> None:
    """Refuse, before any work, what has no best value.

    Parameters
    ----------
    variations : of the sweep
    column : of its table, such as "level_db[0]"
    wanted : runs of its grid
    samples : of the spreads, `SAMPLES` if not given

    Raises
    ------
    ValueError
        If several keys vary, their values are not three numbers or more, there is no such column
        of numbers, or there are too few samples for an interval.
    """
    if samples is not None and samples < FEWEST:
        raise ValueError(
            f"{samples} samples are too few for a 95 % interval; give {FEWEST} or more"
        )
    if len(variations) != 1:
        raise ValueError(
            f"a best value is of one key, and {len(variations)} are varied; vary one and set the "
            "others in the scene"
        )
    key, values = variations[0].key, set(variations[0].values)
    numbers = [x for x in values if isinstance(x, int | float) and not isinstance(x, bool)]
    if len(numbers) < max(3, len(values)):
        raise ValueError(
            f"a best value of {key} needs at least three values, all numbers; give "
            f"{key}=start:stop:n"
        )
    types, (name, probe) = columns(wanted), at_probe(column)
    choose("column", name, list(types))
    if types[name] == "text":
        raise ValueError(f"column '{name}' holds words; choose one of numbers, such as level_db[0]")
    probes = max(len(case.scene.probes) for case in wanted if case.scene)
    if probe is not None and probe >= probes:
        raise ValueError(
            f"column '{column}' is of a probe that the scene does not have; take one of "
            f"{name}[0] to {name}[{probes - 1}]"
        )


def best_value(
    sweep: Sweep,
    cases: Callable[[Combined], list[DesignPoint]],
    variation: Variation,
    column: str,
    samples: int | None = None,
    seed: int = 0,
) -> Best:
    """Best value of a key that `check` accepts; resumes an interrupted one.

    Parameters
    ----------
    sweep : what runs the cases
    cases : combinations of values -> cases
    variation : of the key
    column : of the table
    samples : of the spreads, `SAMPLES` if not given
    seed : of the samples

    Returns
    -------
    Best

    Raises
    ------
    ValueError
        If no run has the column, or too few samples have it.
    """
    n, key, grid = samples or SAMPLES, variation.key, variation.values
    evaluate = partial(_column, cases, column)
    (best,), (result,) = optima(partial(evaluate, sweep), key, grid, [{}])
    if not np.isfinite(result):
        raise ValueError(f"column '{column}' has no finite number in this sweep; choose another")
    found = Best(
        key=key, column=column, value=float(best), result=float(result),
        limits=(float(min(grid)), float(max(grid))),
    )  # fmt: skip
    runs = [case for case in cases([{key: x} for x in grid]) if case.scene]
    scenes = [case.scene for case in runs if case.scene]
    spreads = _that_move(key, runs[0].before or scenes[0], scenes, sweep.options.model)
    if not spreads:
        return found
    names = tuple(each.key for each in spreads)
    own = replace(
        sweep, folder=sweep.folder / FOLDER, options=_of_samples(sweep.options, scenes),
        progress=lambda step, part: sweep.progress("samples" if step == "run" else step, part),
    )  # fmt: skip
    drawn = samples_of(spreads, n, seed).tolist()
    settings = [dict(zip(names, row, strict=True)) for row in drawn]
    values, results = optima(partial(evaluate, own), key, grid, settings)
    values = values[np.isfinite(results)]
    if len(values) < FEWEST:
        raise ValueError(
            f"only {len(values)} of {n} samples have a number in column '{column}'; narrow "
            "their distributions or choose another column"
        )
    low, high = np.percentile(values, ENDS, method="weibull")
    margin = RESOLUTION * np.diff(np.unique(grid)).max()
    low, high = np.clip((low - margin, high + margin), *found.limits).tolist()
    return replace(found, interval=(low, high), samples=len(values), uncertain=names)


def _column(
    cases: Callable[[Combined], list[DesignPoint]], column: str, sweep: Sweep, combined: Combined
) -> Floats:
    """A column (n,) of the runs of combinations of values, nan where there is none."""
    wanted = cases(combined)
    found = sweep.run(wanted)
    if found.interrupted:
        raise KeyboardInterrupt
    if found.missing:
        raise ValueError(f"workers were killed; {found.missing} runs are missing, start again")
    rows = sweep.in_order(wanted, combined, (at_probe(column)[0],))
    return np.array([value(row, column) for row in rows])


def _that_move(key: str, base: Scene, scenes: Sequence[Scene], model: str) -> list[Spread]:
    """Uncertain numbers of a scene that move the best value of a key: not the pressure of what is
    in proportion to it.
    """
    in_proportion = all(is_linear(scene, model_of(scene, model)) for scene in scenes)
    fixed = {key, PRESSURE} if in_proportion else {key}
    return [each for each in spreads_of(base) if each.key not in fixed]


def optima(
    evaluate: Evaluate, key: str, grid: Sequence[float], settings: Combined
) -> tuple[Floats, Floats]:
    """Best value of a key for each setting of other keys, refined beyond a grid.

    Parameters
    ----------
    evaluate : values by key, of each run (m,) -> the column (m,), nan where there is none
    key : the one that varies
    grid : (g,) its values, three or more
    settings : (n,) values of the other keys

    Returns
    -------
    values (n,) of the key, and the column there (n,), -inf of a setting that has none
    """
    x = np.tile(np.unique(grid), (len(settings), 1))
    y = _tried(evaluate, key, x, settings)
    for _ in range(VERTICES):
        vertices = np.array([[_vertex(*each)] for each in zip(x, y, strict=True)])
        x = np.hstack([x, vertices])
        y = np.hstack([y, _tried(evaluate, key, vertices, settings)])
    y = np.where(np.isfinite(y), y, -np.inf)
    best = y.argmax(axis=1)[:, None]
    return np.take_along_axis(x, best, 1)[:, 0], np.take_along_axis(y, best, 1)[:, 0]


def _tried(evaluate: Evaluate, key: str, values: Floats, settings: Combined) -> Floats:
    """The column (n, g) at values (n, g) of the key, under n settings."""
    # Runs of one value follow each other: they share the load, whose lines are cached.
    runs = [
        {**own, key: x} for at in values.T.tolist() for own, x in zip(settings, at, strict=True)
    ]
    return evaluate(runs).reshape(values.T.shape).T


def _vertex(x: Floats, y: Floats) -> float:
    """Vertex of the parabola through the best of some points and its neighbours; the best point if
    there is none among them.
    """
    known = np.isfinite(y)
    if not known.any():
        return float(x[0])
    x, first = np.unique(x[known], return_index=True)
    y = y[known][first]
    best = int(y.argmax())
    k = min(max(best, 1), len(x) - 2)
    if k < 1:  # fewer than three points
        return float(x[best])
    (a, b, c), slopes = x[k - 1 : k + 2], np.diff(y[k - 1 : k + 2]) / np.diff(x[k - 1 : k + 2])
    if not slopes[1] < slopes[0]:
        return float(x[best])
    vertex = (a + b) / 2 + (c - a) / 2 * slopes[0] / (slopes[0] - slopes[1])
    return float(np.clip(vertex, a, c))


def _of_samples(asked: ModelOptions, scenes: Sequence[Scene]) -> ModelOptions:
    """Options of the samples: the steady state where the wavenumber integral from rest is asked
    for, without an estimate of its error.
    """
    has_steady = all(
        model_of(scene, asked.model) == FLAT_BODY.name and takes(HARMONIC, scene)
        for scene in scenes
    )
    return replace(asked, model=HARMONIC.name if has_steady else asked.model, is_assessed=False)
