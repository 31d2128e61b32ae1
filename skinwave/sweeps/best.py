"""Best values of one or two varied keys: where a column of the sweep's table is largest, with
intervals under the spreads of the scene.

The best point of a grid and its neighbours define a quadratic function; a run at its maximum is
better. Each sample of the spreads has best values of its own, found in the same way. An
interval contains 95 % of those of a key, extended at each end by their accuracy, a tenth of a step.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

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

FEWEST_SAMPLES = 39  # for a 95 % interval
ACCURACY = 0.1  # of a best value, in steps of the grid


@dataclass(frozen=True, kw_only=True)
class Best:
    """Best value of a key, with the best values of the other keys of a search.

    Parameters
    ----------
    key, column : str, the varied key, and the column of the table to be maximised
    value, result : float, the best value, and the value of the column there
    limits : lowest and highest value of the grid
    interval : 95 % interval of the samples' best values; None if no uncertain number of the scene
        affects the column
    samples, failed : int, number of samples, and of others without a number in the column
    uncertain : keys of the sampled numbers
    drawn : best value of each sample

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
    drawn: tuple[float, ...] = ()

    @property
    def is_at_end(self) -> bool:
        """Whether the best value is an end of the range; a better one may lie beyond."""
        return self.value in self.limits

    def __repr__(self) -> str:
        return f"<Best: {words([self])}>"


def words(bests: Sequence[Best]) -> str:
    """Return the best values of a search and their intervals in one or more sentences."""
    first, several = bests[0], len(bests) > 1
    text = " and ".join(
        f"{best.key} = {significant(best.value)}" + ", an end of the range," * best.is_at_end
        for best in bests
    )
    text += f" {'give' if several else 'gives'} the largest {first.column}, "
    text += significant(first.result)
    if first.interval is None:
        return f"{text}; no interval, because no uncertain number of the scene affects it"
    text += f"; 95 % {'intervals' if several else 'interval'} "
    text += " and ".join(" to ".join(map(significant, best.interval or ())) for best in bests)
    text += f", from {first.samples} samples of {', '.join(first.uncertain)}"
    for best in bests:
        if {*(best.interval or ())} & {*best.limits}:
            text += f". The interval of {best.key} reaches an end of the range: widen the range"
    return text


def check(variations: Sequence[Variation], samples: int | None = None) -> list[Choice]:
    """Return the one or two varied keys and their grids; raise a ValueError for other designs."""
    if samples is not None and samples < FEWEST_SAMPLES:
        raise ValueError(
            f"{samples} samples are too few for a 95 % interval; give {FEWEST_SAMPLES} or more"
        )
    if not 1 <= len(variations) <= 2:
        raise ValueError(
            f"best values need one or two varied keys, not {len(variations)}; vary these and set "
            "the others in the scene"
        )
    for each in variations:
        values = set(each.values) if isinstance(each, Choice) else set()
        numbers = [x for x in values if isinstance(x, int | float) and not isinstance(x, bool)]
        if len(numbers) < max(3, len(values)):
            raise ValueError(
                f"a best value of {each.key} needs at least three values, all numbers; give "
                f"{each.key}=start:stop:n"
            )
    return [each for each in variations if isinstance(each, Choice)]


def find_best(
    sweep: Sweep, grids: Sequence[Choice], column: str, samples: int | None = None, seed: int = 0
) -> tuple[Best, ...]:
    """Find the best value of each key on grids that `check` accepts; an interrupted search resumes.

    Raises a ValueError if no run has a number in the column, or too few samples have one.
    """
    n, levels = samples or 199, {grid.key: grid.values for grid in grids}
    (values,), (result,) = optima(lambda runs: _column(sweep, column, runs), levels, [{}])
    if not np.isfinite(result):
        raise ValueError(f"column '{column}' has no finite number in this sweep; choose another")
    found = tuple(
        Best(
            key=key, column=column, value=float(value), result=float(result),
            limits=(float(min(levels[key])), float(max(levels[key]))),
        )
        for key, value in zip(levels, values, strict=True)
    )  # fmt: skip
    points = [point for point in sweep.points(combinations(grids)) if point.scene]
    scenes = [point.scene for point in points if point.scene]
    models = [model_of(scene, sweep.options) for scene in scenes]
    # If the motion is proportional to the pressure, this does not change the best value.
    fixed = {*levels, *([PRESSURE] if all(map(is_linear, scenes, models)) else [])}
    spreads: list[Spread] = [
        each for each in spreads_of(points[0].before or scenes[0]) if each.key not in fixed
    ]
    if not spreads:
        return found
    # Samples use the steady state in place of the wavenumber integral from rest.
    steady = {*models} == {FLAT_BODY.name} and all(takes(HARMONIC, scene) for scene in scenes)
    own = replace(
        sweep, folder=sweep.folder / "samples", assessed=False, waveforms=False,
        options=replace(sweep.options, model=HARMONIC.name) if steady else sweep.options,
        progress=lambda step, part: sweep.progress("samples" if step == "run" else step, part),
    )  # fmt: skip
    settings = combinations(spreads, "lhs", n, seed)
    bests, results = optima(lambda runs: _column(own, column, runs), levels, settings)
    bests = bests[np.isfinite(results)]
    if len(bests) < FEWEST_SAMPLES:
        raise ValueError(
            f"only {len(bests)} of {n} samples have a number in column '{column}'; narrow their "
            "distributions or choose another column"
        )
    with_intervals = []
    for best, drawn in zip(found, bests.T, strict=True):
        margin = ACCURACY * np.diff(np.unique(levels[best.key])).max()
        ends = np.percentile(drawn, (2.5, 97.5), method="weibull") + [-margin, margin]
        low, high = np.clip(ends, *best.limits).tolist()
        with_intervals.append(replace(
            best, interval=(low, high), samples=len(bests), failed=n - len(bests),
            uncertain=tuple(each.key for each in spreads), drawn=tuple(drawn.tolist()),
        ))  # fmt: skip
    return tuple(with_intervals)


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
    grids: Mapping[str, Sequence[float]],
    settings: Combinations,
    refinements: int = 2,
) -> tuple[Floats, Floats]:
    """Return the best values (n, d) of d keys for settings (n,) of other keys, and the column (n,)
    there, -inf if a setting has none.

    They are refined from grids of all combinations, at `refinements` vertices for each key.
    `evaluate` returns the column (m,) of runs (m,), or nan.
    """

    def column_at(values: Floats) -> Floats:
        """Return the column (n, g) at values (n, g, d) of the keys."""
        # Runs at one value follow each other, because they share the cached lines of the load.
        runs = [
            {**own, **dict(zip(grids, at, strict=True))}
            for places in values.swapaxes(0, 1).tolist()
            for own, at in zip(settings, places, strict=True)
        ]
        column = evaluate(runs).reshape(values.shape[1], values.shape[0]).T
        return np.where(np.isfinite(column), column, -np.inf)

    levels = [np.unique(grid) for grid in grids.values()]
    mesh = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, len(levels))
    x = np.tile(mesh, (len(settings), 1, 1))
    y = column_at(x)
    for _ in range(refinements * len(levels)):
        vertices = np.array([[_vertex(*each, levels)] for each in zip(x, y, strict=True)])
        x, y = np.hstack([x, vertices]), np.hstack([y, column_at(vertices)])
    best = np.arange(len(x)), y.argmax(axis=1)
    return x[best], y[best]


def _vertex(x: Floats, y: Floats, levels: Sequence[Floats]) -> Floats:
    """Return the largest value (d,) of a quadratic function near the best of points (m, d).

    The function goes through the best point. Its errors at points up to the neighbouring levels of
    the grid are least squares, with weights that fall with the fourth power of distance.
    """
    best, finite = x[y.argmax()], np.isfinite(y)
    levels = [each[np.isin(each, own)] for each, own in zip(levels, x[finite].T, strict=True)]
    if min(map(len, levels)) < 3:
        return best
    pairs = zip(levels, best, strict=True)
    middle = [np.clip(abs(each - at).argmin(), 1, len(each) - 2) for each, at in pairs]
    low, high = np.transpose([each[[k - 1, k + 1]] for each, k in zip(levels, middle, strict=True)])
    near, step = finite & ((low <= x) & (x <= high)).all(axis=1), (high - low) / 2
    away, drop = (x[near] - best) / step, y.max() - y[near]
    rows, columns = np.triu_indices(len(best))
    terms = np.hstack([away, away[:, rows] * away[:, columns]])
    weights = np.maximum(np.linalg.norm(away, axis=1), ACCURACY) ** -4
    drop = weights * drop / (drop.max() or 1)
    fitted, _, rank, _ = np.linalg.lstsq(weights[:, None] * terms, drop, rcond=None)
    if rank < len(fitted):
        return best
    slope, curvature = fitted[: len(best)], np.zeros((len(best), len(best)))
    curvature[rows, columns] = fitted[len(best) :]
    curvature += curvature.T
    lowest = minimize(
        lambda z: (slope @ z + z @ curvature @ z / 2, slope + curvature @ z),
        np.zeros(len(best)), jac=True, tol=1e-12,
        bounds=np.transpose([(low - best) / step, (high - best) / step]),
    )  # fmt: skip
    return np.clip(best + step * lowest.x, low, high)
