"""Best value of a varied key: where a column of the sweep's table is largest, with the interval
that the spreads of the scene leave.

The best point of the grid and its neighbours give a parabola, and its vertex a further run. Each
sample of the spreads has a best value of its own, found in the same way; the interval holds 95 %
of them, and is wider by a tenth of a step of the grid at each end, to which they are found.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simple_model.choices import choose
from simple_model.numbers import significant
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.limits import takes
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of
from skinwave.scene.variation import Choice, Variation, combinations
from skinwave.sweeps.ensemble import is_linear
from skinwave.sweeps.reductions import model_of
from skinwave.sweeps.sweep import Combined, Sweep
from skinwave.sweeps.table_figures import at_probe, value
from skinwave.typing import Floats

SAMPLES, FEWEST = 199, 39  # of the spreads; those that have a 95 % interval
ENDS = (2.5, 97.5)  # percentiles between which the interval lies
VERTICES = 2  # runs that refine a best value beyond the grid
RESOLUTION = 0.1  # of a step of the grid, to which a best value is then found
FOLDER = "samples"  # within that of the sweep: the sweep of the samples


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


def check(variations: Sequence[Variation], samples: int | None = None) -> Choice:
    """The one key whose best value is asked for; refuses, before any work, what has none."""
    if samples is not None and samples < FEWEST:
        raise ValueError(
            f"{samples} samples are too few for a 95 % interval; give {FEWEST} or more"
        )
    if len(variations) != 1:
        raise ValueError(
            f"a best value is of one key, and {len(variations)} are varied; vary one and set the "
            "others in the scene"
        )
    (found,) = variations
    values = set(found.values) if isinstance(found, Choice) else set()
    numbers = [x for x in values if isinstance(x, int | float) and not isinstance(x, bool)]
    if not isinstance(found, Choice) or len(numbers) < max(3, len(values)):
        raise ValueError(
            f"a best value of {found.key} needs at least three values, all numbers; give "
            f"{found.key}=start:stop:n"
        )
    return found


def best_value(
    sweep: Sweep, variation: Choice, column: str, samples: int | None = None, seed: int = 0
) -> Best:
    """Best value of a key that `check` accepts, of a column such as "level_db[0]"; resumes an
    interrupted one. There are `SAMPLES` samples of the spreads if not said otherwise.

    Raises
    ------
    ValueError
        If no run has such a column of numbers, or too few samples have it.
    """
    n, key, grid = samples or SAMPLES, variation.key, variation.values
    (best,), (result,) = optima(lambda runs: _column(sweep, column, runs), key, grid, [{}])
    if not np.isfinite(result):
        raise ValueError(f"column '{column}' has no finite number in this sweep; choose another")
    found = Best(
        key=key, column=column, value=float(best), result=float(result),
        limits=(float(min(grid)), float(max(grid))),
    )  # fmt: skip
    points = [point for point in sweep.points([{key: x} for x in grid]) if point.scene]
    scenes = [point.scene for point in points if point.scene]
    models = [model_of(scene, sweep.options.model) for scene in scenes]
    # The pressure moves no best value of what is in proportion to it.
    linear = all(map(is_linear, scenes, models))
    fixed = {key, PRESSURE} if linear else {key}
    spreads: list[Spread] = [
        each for each in spreads_of(points[0].before or scenes[0]) if each.key not in fixed
    ]
    if not spreads:
        return found
    # Samples are of the steady state where the wavenumber integral from rest is asked for.
    steady = {*models} == {FLAT_BODY.name} and all(takes(HARMONIC, scene) for scene in scenes)
    own = replace(
        sweep, folder=sweep.folder / FOLDER, assessed=False,
        options=replace(sweep.options, model=HARMONIC.name) if steady else sweep.options,
        progress=lambda step, part: sweep.progress("samples" if step == "run" else step, part),
    )  # fmt: skip
    settings = combinations(spreads, "lhs", n, seed)
    values, results = optima(lambda runs: _column(own, column, runs), key, grid, settings)
    values = values[np.isfinite(results)]
    if len(values) < FEWEST:
        raise ValueError(
            f"only {len(values)} of {n} samples have a number in column '{column}'; narrow "
            "their distributions or choose another column"
        )
    low, high = np.percentile(values, ENDS, method="weibull")
    margin = RESOLUTION * np.diff(np.unique(grid)).max()
    low, high = np.clip((low - margin, high + margin), *found.limits).tolist()
    names = tuple(each.key for each in spreads)
    return replace(found, interval=(low, high), samples=len(values), uncertain=names)


def _column(sweep: Sweep, column: str, combined: Combined) -> Floats:
    """A column (n,) of the runs of combinations of values, nan where there is none."""
    points = sweep.points(combined)
    found = sweep.run(points)
    if found.interrupted:
        raise KeyboardInterrupt
    if found.missing:
        raise ValueError(f"workers were killed; {found.missing} runs are missing, start again")
    rows = sweep.rows(points)
    choose("column", at_probe(column)[0], dict.fromkeys(name for row in rows for name in row))
    return np.array([value(row, column) for row in rows])


def optima(
    evaluate: Callable[[Combined], Floats], key: str, grid: Sequence[float], settings: Combined
) -> tuple[Floats, Floats]:
    """Best values (n,) of a key for settings (n,) of other keys, refined beyond a grid (g,), and
    the column there, -inf of a setting that has none; `evaluate` gives the column (m,) of runs
    (m,), nan where there is none.
    """

    def tried(values: Floats) -> Floats:
        """The column (n, g) at values (n, g) of the key."""
        # Runs of one value follow each other: they share the load, whose lines are cached.
        runs = [
            {**own, key: x} for at in values.T.tolist() for own, x in zip(settings, at, strict=True)
        ]
        found = evaluate(runs).reshape(values.T.shape).T
        return np.where(np.isfinite(found), found, -np.inf)

    x = np.tile(np.unique(grid), (len(settings), 1))
    y = tried(x)
    for _ in range(VERTICES):
        vertices = np.array([[_vertex(*each)] for each in zip(x, y, strict=True)])
        x, y = np.hstack([x, vertices]), np.hstack([y, tried(vertices)])
    best = y.argmax(axis=1)[:, None]
    return np.take_along_axis(x, best, 1)[:, 0], np.take_along_axis(y, best, 1)[:, 0]


def _vertex(x: Floats, y: Floats) -> float:
    """Vertex of the parabola through the best of some points and its neighbours; the best point if
    there is none among them.
    """
    best = float(x[y.argmax()])
    x, first = np.unique(x[np.isfinite(y)], return_index=True)
    y = y[np.isfinite(y)][first]
    if len(x) < 3:
        return best
    k = min(max(int(y.argmax()), 1), len(x) - 2)
    (a, b, c), slopes = x[k - 1 : k + 2], np.diff(y[k - 1 : k + 2]) / np.diff(x[k - 1 : k + 2])
    if not slopes[1] < slopes[0]:
        return best
    vertex = (a + b) / 2 + (c - a) / 2 * slopes[0] / (slopes[0] - slopes[1])
    return float(np.clip(vertex, a, c))
