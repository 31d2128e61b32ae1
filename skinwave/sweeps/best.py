"""Best value of a varied key: where a column of the sweep's table is largest, with the interval
under the spreads of the scene.

The best point of a grid and its neighbours define a parabola, and a run at its vertex refines the
best value. Each sample of the spreads has a best value of its own, computed in the same way. The
interval contains 95 % of them, extended at each end by their accuracy, a tenth of a grid step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simple_model.choices import choose
from simple_model.numbers import significant
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.limits import takes
from skinwave.report.column_labels import at_probe
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of
from skinwave.scene.variation import Choice, Variation, combinations
from skinwave.sweeps.ensemble import is_linear
from skinwave.sweeps.reductions import model_of
from skinwave.sweeps.sweep import Combinations, Sweep
from skinwave.sweeps.table_figures import value
from skinwave.typing import Floats

SAMPLES, FEWEST_SAMPLES = 199, 39  # by default; for a 95 % interval
ENDS = (2.5, 97.5)  # percentiles at the ends of the interval
REFINEMENTS = 2  # runs at vertices
ACCURACY = 0.1  # of a best value, in steps of the grid
FOLDER = "samples"  # of the sweep of the samples, in that of the sweep


@dataclass(frozen=True, kw_only=True)
class Best:
    """Best value of a key.

    Parameters
    ----------
    key, column : str, the varied key, and the column of the table to be maximised
    value, result : float, the best value, and the value of the column there
    limits : lowest and highest value of the grid
    interval : 95 % interval of the samples' best values; None if no uncertain number of the scene
        affects the column
    samples, failed : int, number of samples, and of others without a number in the column
    uncertain : keys of the sampled numbers

    >>> best = Best(key="tacton.size_mm", column="rms_um[0]", value=14, result=3.2, limits=(5, 20))
    >>> best.is_at_end
    False
    """

    key: str
    column: str
    value: float
    result: float
    limits: tuple[float, float]
    interval: tuple[float, float] | None = None
    samples: int = 0
    failed: int = 0
    uncertain: tuple[str, ...] = ()

    @property
    def is_at_end(self) -> bool:
        """Whether the best value is an end of the range; a better one may lie beyond."""
        return self.value in self.limits

    @property
    def words(self) -> str:
        """The best value and its interval in one or two sentences."""
        end = ", an end of the range," if self.is_at_end else ""
        text = f"{self.key} = {significant(self.value)}{end} gives the largest {self.column}, "
        text += significant(self.result)
        if self.interval is None:
            return f"{text}; no interval, because no uncertain number of the scene affects it"
        low, high = map(significant, self.interval)
        text += f"; 95 % interval {low} to {high}, from {self.samples} samples of "
        text += ", ".join(self.uncertain)
        if set(self.interval) & set(self.limits):
            text += ". The interval reaches an end of the range: widen the range"
        return text

    def __repr__(self) -> str:
        return f"<Best: {self.words}>"


def check(variations: Sequence[Variation], samples: int | None = None) -> Choice:
    """Return the one varied key and its grid; raise a ValueError if there is none."""
    if samples is not None and samples < FEWEST_SAMPLES:
        raise ValueError(
            f"{samples} samples are too few for a 95 % interval; give {FEWEST_SAMPLES} or more"
        )
    if len(variations) != 1:
        raise ValueError(
            f"a best value needs one varied key, not {len(variations)}; vary one and set the "
            "others in the scene"
        )
    (grid,) = variations
    values = set(grid.values) if isinstance(grid, Choice) else set()
    numbers = [x for x in values if isinstance(x, int | float) and not isinstance(x, bool)]
    if not isinstance(grid, Choice) or len(numbers) < max(3, len(values)):
        raise ValueError(
            f"a best value of {grid.key} needs at least three values, all numbers; give "
            f"{grid.key}=start:stop:n"
        )
    return grid


def find_best(
    sweep: Sweep, grid: Choice, column: str, samples: int | None = None, seed: int = 0
) -> Best:
    """Find the best value of a key on a grid that `check` accepts; an interrupted search resumes.

    Raises a ValueError if no run has a number in the column, or too few samples have one.
    """
    n, key, values = samples or SAMPLES, grid.key, grid.values
    (best,), (result,) = optima(lambda runs: _column(sweep, column, runs), key, values, [{}])
    if not np.isfinite(result):
        raise ValueError(f"column '{column}' has no finite number in this sweep; choose another")
    found = Best(
        key=key, column=column, value=float(best), result=float(result),
        limits=(float(min(values)), float(max(values))),
    )  # fmt: skip
    points = [point for point in sweep.points([{key: x} for x in values]) if point.scene]
    scenes = [point.scene for point in points if point.scene]
    models = [model_of(scene, sweep.options) for scene in scenes]
    # If the motion is proportional to the pressure, this does not change the best value.
    fixed = {key, PRESSURE} if all(map(is_linear, scenes, models)) else {key}
    spreads: list[Spread] = [
        each for each in spreads_of(points[0].before or scenes[0]) if each.key not in fixed
    ]
    if not spreads:
        return found
    # Samples use the steady state in place of the wavenumber integral from rest.
    steady = {*models} == {FLAT_BODY.name} and all(takes(HARMONIC, scene) for scene in scenes)
    own = replace(
        sweep, folder=sweep.folder / FOLDER, assessed=False,
        options=replace(sweep.options, model=HARMONIC.name) if steady else sweep.options,
        progress=lambda step, part: sweep.progress("samples" if step == "run" else step, part),
    )  # fmt: skip
    settings = combinations(spreads, "lhs", n, seed)
    bests, results = optima(lambda runs: _column(own, column, runs), key, values, settings)
    bests = bests[np.isfinite(results)]
    if len(bests) < FEWEST_SAMPLES:
        raise ValueError(
            f"only {len(bests)} of {n} samples have a number in column '{column}'; narrow their "
            "distributions or choose another column"
        )
    low, high = np.percentile(bests, ENDS, method="weibull")
    margin = ACCURACY * np.diff(np.unique(values)).max()
    low, high = np.clip((low - margin, high + margin), *found.limits).tolist()
    uncertain = tuple(each.key for each in spreads)
    return replace(
        found, interval=(low, high), samples=len(bests), failed=n - len(bests), uncertain=uncertain
    )


def _column(sweep: Sweep, column: str, combined: Combinations) -> Floats:
    """Run combinations of values, and return a column (n,) of their results, or nan."""
    points = sweep.points(combined)
    outcome = sweep.run(points)
    if outcome.interrupted:
        raise KeyboardInterrupt
    if outcome.missing:
        raise ValueError(
            f"workers were killed, and {outcome.missing} runs are missing; repeat the command"
        )
    rows = sweep.rows(points)
    choose("column", at_probe(column)[0], dict.fromkeys(name for row in rows for name in row))
    return np.array([value(row, column) for row in rows])


def optima(
    evaluate: Callable[[Combinations], Floats],
    key: str,
    grid: Sequence[float],
    settings: Combinations,
) -> tuple[Floats, Floats]:
    """Return the best values (n,) of a key for settings (n,) of other keys, refined from a grid
    (g,), and the column there, -inf if a setting has none.

    `evaluate` returns the column (m,) of runs (m,), or nan.
    """

    def column_at(values: Floats) -> Floats:
        """Return the column (n, g) at values (n, g) of the key."""
        # Runs at one value follow each other, because they share the cached lines of the load.
        runs = [
            {**own, key: x} for at in values.T.tolist() for own, x in zip(settings, at, strict=True)
        ]
        column = evaluate(runs).reshape(values.T.shape).T
        return np.where(np.isfinite(column), column, -np.inf)

    x = np.tile(np.unique(grid), (len(settings), 1))
    y = column_at(x)
    for _ in range(REFINEMENTS):
        vertices = np.array([[_vertex(*each)] for each in zip(x, y, strict=True)])
        x, y = np.hstack([x, vertices]), np.hstack([y, column_at(vertices)])
    best = y.argmax(axis=1)[:, None]
    return np.take_along_axis(x, best, 1)[:, 0], np.take_along_axis(y, best, 1)[:, 0]


def _vertex(x: Floats, y: Floats) -> float:
    """Return the vertex of the parabola through the best point and its neighbours, or the point."""
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
