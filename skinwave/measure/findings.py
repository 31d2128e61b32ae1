"""Sentences on a fit: what was found, what is not to be trusted, what its scene does not hold."""

from collections.abc import Iterator, Sequence

import numpy as np

from simple_model.numbers import percent, plural, significant
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.fit import Fit
from skinwave.measure.inspection import flaws
from skinwave.measure.intervals import Estimate
from skinwave.measure.observed import some
from skinwave.measure.parameters import DELAY

MISFIT = 1.5  # chi squared over its degrees of freedom, of known errors, from which a model misfits
LEFT_OUT = 1e-3  # of the measured power in lines that are not fitted, from which that is said
LEAST = 1e-9  # probability that is shown
CORRELATED = 0.1  # from which it is said that a correlation is dropped


def sentences(found: Fit) -> list[str]:
    """Sentences on what was fitted, and how well."""
    solution, data = found.solution, found.solution.problem.data
    ratio = significant(solution.cost / solution.dof)
    known = f"; chi squared over its degrees of freedom is {ratio}, of errors that are known"
    said = [
        f"{found.target.model} was fitted to {data.words}.",
        f"{solution.reached} of {plural(len(solution.starts), 'start')} reached the solution, "
        f"which leaves {percent(found.misfit)} of the measured motion{known * data.is_known}.",
    ]  # fmt: skip
    for each in found.estimates:
        if each.is_resolved and not each.at_limit:
            value, low, high = shown(each)
            said.append(f"{each.key} = {value}, 95 % interval {low} to {high}.")
    return said


def shown(each: Estimate) -> tuple[str, str, str]:
    """An estimate and its interval, to two digits of the interval's width."""
    numbers = each.value, each.low, each.high
    width = max(each.high - each.low, 1e-12 * abs(each.value), 1e-300)
    largest = max(map(abs, numbers))
    digits = min(max(3, int(np.ceil(np.log10(largest / width))) + 2), 12) if largest else 3
    value, low, high = (significant(x, digits) for x in numbers)
    return value, low, high


def cautions(found: Fit) -> list[str]:
    """Sentences, without a full stop, on what is not to be trusted."""
    return [*_of_solution(found), *_of_estimates(found),
            *flaws(found.measured, found.target.scene.pressure)]  # fmt: skip


def _of_solution(found: Fit) -> Iterator[str]:
    solution, test = found.solution, found.intervals.whiteness
    missed, count = len(solution.starts) - solution.reached, len(solution.starts)
    strong = [line for line in solution.problem.data.left_out if line.share > 0]
    if solution.may_be_turned:
        yield opposite_sign(found.target.model, DELAY in solution.problem.parameters.keys)
    if not solution.converged:
        yield (
            "the fit did not converge: its steps ended before chi squared was least; give more "
            "starts or closer limits"
        )
    if missed > count / 2:
        yield (
            f"{missed} of {count} starts ended elsewhere, with a larger misfit; there may be a "
            "better solution yet, give more --starts"
        )
    if solution.problem.data.is_known and solution.scale >= MISFIT:
        yield (
            f"chi squared is {significant(solution.scale)} times its degrees of freedom: the model "
            "leaves more than the errors of the measurement explain, and the intervals, widened by "
            f"{significant(np.sqrt(solution.scale), 2)}, are not valid 95 % intervals"
        )
    if not test.is_white:
        yield (
            f"the residuals are not white (Ljung-Box, p {probability(test.p)}), and the intervals "
            f"are widened by {_factors(found)}; if what is left is not noise, look for what the "
            "scene leaves out"
        )
    if (share := sum(line.share for line in strong)) > LEFT_OUT:
        yield (
            f"lines that are not fitted, {some(tuple(line.name for line in strong))}, have "
            f"{percent(share)} of the measured power, and in the model next to none; check the "
            "drive and the path of the scene"
        )


def _of_estimates(found: Fit) -> Iterator[str]:
    keys_together = dict.fromkeys(found.intervals.unresolved)
    named = {key for keys in keys_together for key in keys}
    for keys in keys_together:
        yield (
            f"the data do not resolve {_list(keys)} from each other; fix one of them, or measure "
            "more" if len(keys) > 1 else _undetermined(keys[0])
        )  # fmt: skip
    for each, limits in zip(found.estimates, found.solution.problem.parameters.free, strict=True):
        if each.at_limit:
            yield (
                f"{each.key} = {significant(each.value, 4)} is at a limit of its range, "
                f"{limits.low:g} to {limits.high:g}, so that the intervals are not valid; widen "
                "it, or check the scene"
            )
        elif not each.is_resolved and each.key not in named:
            yield _undetermined(each.key)
        if each.is_curved and not each.at_limit:
            yield (
                f"the interval of {each.key} is approximate: the model is not linear over it; "
                "measure more, or widen the interval"
            )


def _undetermined(key: str) -> str:
    return f"the data do not determine {key} between its limits; fix it, or measure more"


def _list(keys: Sequence[str]) -> str:
    return f"{', '.join(keys[:-1])} and {keys[-1]}"


def _factors(found: Fit) -> str:
    """Words on the factors of the intervals that are widened."""
    of_resolved = zip(found.intervals.widenings, found.estimates, strict=True)
    each = [x for x, e in of_resolved if e.is_resolved]
    low, high = (significant(x, 3) for x in (min(each, default=1.0), max(each, default=1.0)))
    return f"a factor of {low}" if low == high else f"factors of {low} to {high}"


def probability(p: float) -> str:
    """A probability with its sign of relation."""
    return f"= {significant(p, 2)}" if p >= LEAST else f"< {LEAST:g}"


def notes(found: Fit) -> list[str]:
    """Sentences, without a full stop, on what a scene with the estimates does not hold."""
    parameters = found.solution.problem.parameters
    said = [
        f"{key} = {value:.6g} of the measurement, which is no part of the scene"
        for key, value in found.values.items() if "." not in key
    ]  # fmt: skip
    for each in found.estimates:
        if not each.is_resolved and "." in each.key:
            said.append(f"{each.key} is not resolved by the measurement: its spread is that "
                        "between its limits")  # fmt: skip
        elif each.is_resolved and each.at_limit:
            said.append(f"{each.key} is at a limit of its range, and its spread is that range")
    said += [
        f"{key} was tied to others, and has no spread" for key in parameters.ties if "." in key
    ]
    is_part = np.array(["." in key for key in parameters.keys])
    known = np.nan_to_num(found.intervals.correlations)
    table = np.where(np.outer(is_part, is_part), known, 0.0)
    np.fill_diagonal(table, 0.0)
    if (largest := float(np.abs(table).max())) >= CORRELATED:
        said.append(
            "spreads are independent of each other: correlations of the estimates, up to "
            f"{significant(largest, 2)}, are dropped"
        )
    return said
