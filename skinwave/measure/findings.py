"""Sentences on a fit: results, warnings, and what the fitted scene cannot store."""

from collections.abc import Iterator

import numpy as np

from simple_model.numbers import as_sentence, first_few, percent, plural, share_of, significant
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.fit import Fit
from skinwave.measure.inspection import flaws
from skinwave.measure.intervals import Estimate
from skinwave.measure.misfit import NOT_DESCRIBED
from skinwave.measure.parameters import DELAY


def sentences(result: Fit) -> list[str]:
    """Return sentences on the fitted keys and the quality of the fit."""
    solution, data = result.solution, result.solution.problem.data
    misfit = share_of(result.intervals.misfit, "the measured motion")
    ratio = significant(solution.cost / solution.dof)
    known = f"; chi squared over its degrees of freedom is {ratio}, with known errors"
    none = f" {as_sentence(NOT_DESCRIBED)[:-1]}, so no estimate has an interval."
    return [
        f"{result.target.model} was fitted to {data.words}.",
        f"{solution.agreeing_starts} of {plural(len(solution.starts), 'start')} reached the "
        "solution.",
        f"The residual is {misfit}{known * data.is_known}."
        f"{none * (not result.intervals.is_described)}",
        *(
            "{} = {}, 95 % interval {} to {}.".format(each.key, *round_to_interval(each))
            for each in result.estimates
            if each.is_resolved and not each.at_limit
        ),
    ]


def round_to_interval(each: Estimate) -> tuple[str, str, str]:
    """Return an estimate and its interval, to two digits of the interval's width."""
    numbers = each.value, each.low, each.high
    width = max(each.high - each.low, 1e-12 * abs(each.value), 1e-300)
    largest = max(map(abs, numbers))
    digits = min(max(3, int(np.ceil(np.log10(largest / width))) + 2), 12) if largest else 3
    value, low, high = (significant(x, digits) for x in numbers)
    return value, low, high


def cautions(result: Fit) -> list[str]:
    """Return warnings, without a full stop."""
    return [*_of_solution(result), *_of_estimates(result),
            *flaws(result.measured, result.target.scene.pressure)]  # fmt: skip


def _of_solution(result: Fit) -> Iterator[str]:
    solution, test = result.solution, result.intervals.whiteness
    count = len(solution.starts)
    missed = count - solution.agreeing_starts
    strong = [line for line in solution.problem.data.left_out if line.share > 0]
    left = share_of(result.intervals.unexplained, "the measured motion")
    factor = significant(max(result.intervals.widenings.tolist(), default=1.0))
    if not result.intervals.is_described:
        yield (
            f"poor fit: {NOT_DESCRIBED}, {left} is unexplained and no estimate has an interval; "
            "check the model and the scene"
        )
    elif result.intervals.unexplained:
        yield (
            f"the misfit beyond the noise is {left}; intervals are widened for it by up to a "
            f"factor of {factor}; check the model and the scene"
        )
    elif not test.is_white:
        yield (
            f"the residuals are not white (Ljung-Box, p {probability(test.p)}); intervals are "
            f"widened by up to a factor of {factor}; check what the scene leaves out"
        )
    if solution.may_be_flipped:
        yield opposite_sign(result.target.model, DELAY in solution.problem.parameters.keys)
    if not solution.converged:
        yield "the search did not converge: chi squared may be smaller; give more --starts"
    if missed > count / 2:
        yield (
            f"{missed} of {count} starts ended at a larger misfit, so a better solution may exist; "
            "give more --starts"
        )
    least_share = 1e-3  # of the measured power in lines that are not fitted
    if (share := sum(line.share for line in strong)) > least_share:
        yield (
            f"the lines {first_few([line.name for line in strong])} are not fitted: they "
            f"have {percent(share)} of the measured power, but are negligible in the model; check "
            "drive and path of the scene"
        )


def _of_estimates(result: Fit) -> Iterator[str]:
    directions = dict.fromkeys(result.intervals.unresolved)
    for keys in directions:
        if len(keys) > 1:
            names = f"{', '.join(keys[:-1])} and {keys[-1]}"
            yield f"the data do not separate {names}; fix one of them, or measure more"
        else:
            yield _undetermined_keys(keys[0])
    named = {key for keys in directions for key in keys}
    for each, limits in zip(result.estimates, result.solution.problem.parameters.free, strict=True):
        if each.at_limit:
            yield (
                f"{each.key} = {significant(each.value, 4)} is at a limit of its range, "
                f"{limits.low:g} to {limits.high:g}, and intervals are not valid; widen the range, "
                "or check the scene"
            )
        elif not each.is_resolved and each.key not in named and result.intervals.is_described:
            yield (
                _undetermined_keys(each.key)
                if not result.intervals.unexplained
                else (
                    f"with this misfit {each.key} may have any value between its limits; check the "
                    "model and the scene"
                )
            )
        if each.is_curved and not each.at_limit:
            yield (
                f"the interval of {each.key} is approximate, because the model is not linear over "
                "it; measure more"
            )


def _undetermined_keys(key: str) -> str:
    return f"the data do not determine {key} between its limits; fix it, or measure more"


def probability(p: float) -> str:
    """Return a probability with = or <."""
    least_probability = 1e-9  # that is shown
    return f"= {significant(p, 2)}" if p >= least_probability else f"< {least_probability:g}"


def notes(result: Fit) -> list[str]:
    """Return sentences, without a full stop, on what the fitted scene cannot store."""
    parameters = result.solution.problem.parameters
    sentences = [
        f"{key} = {value:.6g} belongs to the measurement and is not part of the scene"
        for key, value in result.values.items() if "." not in key
    ]  # fmt: skip
    for each in result.estimates:
        if "." in each.key and (each.at_limit or not each.is_resolved):
            reason = "is at a limit" if each.at_limit else "has no interval"
            sentences.append(f"{each.key} {reason}: its spread is its whole range")
    sentences += [f"{key} is tied and has no spread" for key in parameters.ties if "." in key]
    is_part = np.array(["." in key for key in parameters.keys])
    correlations = np.nan_to_num(result.intervals.correlations)
    table = np.where(np.outer(is_part, is_part), correlations, 0.0)
    np.fill_diagonal(table, 0.0)
    correlated = 0.1  # smallest correlation that is mentioned
    if (largest := float(np.abs(table).max())) >= correlated:
        sentences.append(
            f"correlations of the estimates, up to {significant(largest, 2)}, are dropped"
        )
    return sentences
