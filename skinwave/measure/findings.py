"""Sentences on a fit: what was found, and what of it is not to be trusted."""

from collections.abc import Sequence

import numpy as np

from simple_model.numbers import counted, percent, significant
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.fit import Fit
from skinwave.measure.inspection import flaws
from skinwave.measure.intervals import Direction, Estimate, combined, sharing
from skinwave.measure.observed import some
from skinwave.measure.parameters import DELAY

MISFIT = 1.5  # chi squared over its degrees of freedom, of known errors, from which a model misfits
LEFT_OUT = 1e-3  # of the measured power in lines that are not fitted, from which that is said
LEAST = 1e-9  # probability that is shown


def sentences(found: Fit) -> list[str]:
    """Sentences on what was fitted, and how well."""
    solution, data = found.solution, found.solution.problem.data
    ratio = significant(solution.cost / solution.dof)
    known = f"; chi squared over its degrees of freedom is {ratio}, of errors that are known"
    said = [
        f"{found.target.model} was fitted to {data.words}.",
        f"{solution.reached} of {counted(len(solution.starts), 'start')} reached the solution, "
        f"which leaves {percent(found.misfit)} of the measured motion{known * data.is_known}.",
    ]  # fmt: skip
    for each in found.estimates:
        if each.is_resolved and not each.at_limit:
            value, low, high = shown(each.value, each.low, each.high)
            said.append(f"{each.key} = {value}, 95 % interval {low} to {high}.")
    return said


def shown(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A value and its interval, to two digits of the interval's width."""
    width = max(high - low, 1e-12 * abs(value), 1e-300)
    largest = max(abs(value), abs(low), abs(high))
    digits = min(max(3, int(np.ceil(np.log10(largest / width))) + 2), 12) if largest else 3
    return significant(value, digits), significant(low, digits), significant(high, digits)


def cautions(found: Fit) -> list[str]:
    """Sentences, without a full stop, on what is not to be trusted."""
    solution = found.solution
    turned = opposite_sign(found.target.model, DELAY in solution.problem.parameters.keys)
    said = [turned] * solution.may_be_turned + [
        "the fit did not converge: its steps ended before chi squared was least; give more starts "
        "or closer limits"
    ] * (not solution.converged)
    said += [_at_limit(found, each) for each in found.estimates if each.at_limit]
    said += [_unresolved(found, each) for each in sharing(found.unresolved)]
    said += _beyond_errors(found) + _coloured(found) + _elsewhere(found)
    said += _left_out(found) + flaws(found.measured, found.target.scene.pressure)
    named = {key for each in found.unresolved for key in each.keys}
    said += [
        f"the data do not determine {each.key} between its limits; measure more, or leave it out"
        for each in found.estimates if not each.is_resolved and each.key not in named
    ]  # fmt: skip
    said += [
        f"the interval of {each.key} by its profile ends at a limit; widen the limits if they are "
        "not known" for each in found.profiles if each.is_open
    ]  # fmt: skip
    return said


def _at_limit(found: Fit, each: Estimate) -> str:
    free = found.solution.problem.parameters.free
    limits = next((one.low, one.high) for one in free if one.key == each.key)
    return (
        f"{each.key} = {significant(each.value, 4)} is at a limit of its range, {limits[0]:g} to "
        f"{limits[1]:g}, and the intervals are of no use; widen it, or check the scene"
    )


def _unresolved(found: Fit, directions: Sequence[Direction]) -> str:
    """Sentence on keys of which the data determine a combination, or nothing, by directions that
    share them.
    """
    keys = tuple(dict.fromkeys(key for each in directions for key in each.keys))
    if len(keys) == 1:
        return f"the data do not determine {keys[0]} between its limits; fix it, or measure more"
    if len(directions) >= len(keys):
        none = f"neither {keys[0]} nor {keys[1]}" if len(keys) == 2 else f"none of {_list(keys)}"
        return f"the data determine {none} between their limits; fix them, or measure more"
    said = f"the data do not resolve {_list(keys)} from each other"
    if np.isfinite(directions[0].exponent):
        value, low, high = combined(found.solution, directions[0])
        if np.isfinite(low):
            middle, least, most = shown(value, low, high)
            said += f"; only {_product(directions[0])} is determined, {middle} "
            said += f"(95 % interval {least} to {most})"
    return f"{said}; fix {'one' if len(keys) == 2 else 'some'} of them"


def _list(keys: Sequence[str]) -> str:
    return f"{', '.join(keys[:-1])} and {keys[-1]}"


def _product(direction: Direction) -> str:
    """Words for the combination of two keys that a direction leaves."""
    (first, second), power = direction.keys, round(direction.exponent, 2)
    if abs(power) == 1:
        return f"{first} {'times' if power == 1 else 'over'} {second}"
    return f"{first} times {second} to the power of {power:g}"


def _beyond_errors(found: Fit) -> list[str]:
    solution = found.solution
    if not solution.problem.data.is_known or solution.scale < MISFIT:
        return []
    return [
        f"chi squared is {significant(solution.scale)} times its degrees of freedom: the model "
        "leaves more than the errors of the measurement explain, and the intervals, widened by "
        f"{significant(np.sqrt(solution.scale), 2)}, have no sure meaning"
    ]


def _coloured(found: Fit) -> list[str]:
    if found.whiteness.is_white:
        return []
    return [
        f"the residuals are not white (Ljung-Box, p {probability(found.whiteness.p)}): what is "
        f"left has structure, for which the intervals are widened by {_factors(found)}; if it is "
        "no noise, look for what the scene leaves out"
    ]


def _factors(found: Fit) -> str:
    """Words on the factors of the intervals of what is resolved."""
    each = [x for x, e in zip(found.widenings, found.estimates, strict=True) if e.is_resolved]
    low, high = (significant(x, 3) for x in (min(each, default=1.0), max(each, default=1.0)))
    return f"a factor of {low}" if low == high else f"factors of {low} to {high}"


def probability(p: float) -> str:
    """A probability with its sign of relation."""
    return f"= {significant(p, 2)}" if p >= LEAST else f"< {LEAST:g}"


def _left_out(found: Fit) -> list[str]:
    """Sentence on lines that are strong in the measurement, and not fitted."""
    strong = [line for line in found.solution.problem.data.left_out if line.share > 0]
    share = sum(line.share for line in strong)
    if share <= LEFT_OUT:
        return []
    return [
        f"lines that are not fitted, {some(tuple(line.name for line in strong))}, have "
        f"{percent(share)} of the measured power, and in the model next to none; "
        "check the drive and the path of the scene"
    ]


def _elsewhere(found: Fit) -> list[str]:
    """Sentence on starts that did not reach the solution."""
    missed = len(found.solution.starts) - found.solution.reached
    if missed <= len(found.solution.starts) / 2:
        return []
    return [
        f"{missed} of {len(found.solution.starts)} starts ended elsewhere, with a larger misfit; "
        "there may be a better solution yet, give more --starts"
    ]
