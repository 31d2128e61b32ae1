"""Fit of a scene to a measurement: estimates with intervals, and how far to trust them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model.choices import choose
from skinwave.bodies.analytic import has_exact_waves
from skinwave.effort import Progress, silent
from skinwave.fits.identify import (
    Direction,
    Estimate,
    Whiteness,
    combined,
    correlations,
    estimates,
    unresolved,
    whiteness,
    widenings,
)
from skinwave.fits.measured_lines import some
from skinwave.fits.observed import KINDS, data_of
from skinwave.fits.parameters import DELAY, check, of_scene, parse
from skinwave.fits.posterior import Posterior, posterior
from skinwave.fits.predicted import Target, target, with_reduction
from skinwave.fits.problem import Problem
from skinwave.fits.profile import Profile, profiles
from skinwave.fits.solve import Solution, solve
from skinwave.measurements import Measurement
from skinwave.measurements.alignment import opposite_sign
from skinwave.numbers import significant
from skinwave.scene import Scene
from skinwave.sweeps.variation import varied

STARTS = 8
LEAST = 1e-9  # probability that is shown
LEFT_OUT = 1e-3  # of the measured power in lines that are not fitted, from which that is said
MISFIT = 1.5  # chi squared over its degrees of freedom, of known errors, from which a model misfits


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Fit of a scene to a measurement.

    Parameters
    ----------
    measured : Measurement
    target : Target, the scene whose parameters were varied, and the model
    solution : Solution
    estimates : one a parameter, with intervals by the covariance
    correlations : (k, k) float, of the estimates
    unresolved : directions that the data do not resolve
    profiles : of the parameters that are resolved
    whiteness : Whiteness of the residuals
    widenings : (k,) float, factors of the intervals for residuals that are not white
    posterior : Posterior, if it was sampled
    """

    measured: Measurement
    target: Target
    solution: Solution
    estimates: tuple[Estimate, ...]
    correlations: Floats
    unresolved: tuple[Direction, ...]
    profiles: tuple[Profile, ...]
    whiteness: Whiteness
    widenings: Floats
    posterior: Posterior | None = None

    @property
    def values(self) -> dict[str, float]:
        """Values by key at the solution, those that are tied too."""
        return self.solution.problem.parameters.values(self.solution.u)

    @property
    def scene(self) -> Scene:
        """The scene with the estimates."""
        return varied(self.target.scene, of_scene(self.values))

    @property
    def predicted(self) -> Floats:
        """Prediction (n, s) at the solution."""
        return self.solution.problem.predicted(self.solution.u)

    @property
    def misfit(self) -> float:
        """Relative L2 norm of what the fit leaves of the data."""
        values = self.solution.problem.data.values
        return float(np.linalg.norm(self.predicted - values) / np.linalg.norm(values))


def fit(
    scene: Scene,
    measured: Measurement,
    vary: Sequence[str],
    *,
    tie: Sequence[str] = (),
    kind: str = "",
    model: str = "auto",
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Weighted least-squares fit of keys of a scene to a measurement.

    Parameters
    ----------
    scene : Scene, whose Tacton is the one that was measured
    measured : Measurement of displacement, velocity or acceleration
    vary : "KEY=low:high" each, keys of the scene's file, or "gain", "delay_ms", "offset_x_mm",
        "offset_y_mm", by which the measurement may differ from it
    tie : "KEY=expression" each, of keys that are varied
    kind : "waveforms", "lines" or "amplitudes", what of the measurement; if not given, waveforms
        or, of spectra, lines
    model : name of a model, or "auto": the wavenumber integral where the body has one, else "fem"
    starts : how many, between the limits
    seed : of the starts
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If a key, a limit or the model does not fit the scene, or the measurement has no such data.
    """
    parameters = parse(vary, tie)
    kind = choose("kind", kind or ("lines" if measured.is_spectrum else "waveforms"), KINDS)
    aim = target(scene, _model(scene, model), measured.record, measured.places)
    check(scene, parameters)
    aim = with_reduction(aim, parameters, progress)
    problem = Problem(
        parameters=parameters, data=data_of(kind, measured, aim), linear=aim.linear
    )  # fmt: skip
    return assessed(measured, aim, solve(problem, starts, seed, progress), progress)


def assessed(
    measured: Measurement, aim: Target, solution: Solution, progress: Progress = silent
) -> Fit:
    """Solution of a fit with all that is said of it.

    Parameters
    ----------
    measured, aim : as of the fit
    solution : Solution
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Fit
    """
    return Fit(
        measured=measured, target=aim, solution=solution, estimates=estimates(solution),
        correlations=correlations(solution), unresolved=unresolved(solution),
        profiles=profiles(solution, progress), whiteness=whiteness(solution.residual),
        widenings=widenings(solution),
    )  # fmt: skip


def sampled(found: Fit, steps: int, seed: int = 0, progress: Progress = silent) -> Fit:
    """A fit with samples of its posterior.

    Parameters
    ----------
    found : Fit
    steps : of each walker
    seed : of the walkers
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Fit
    """
    return replace(found, posterior=posterior(found.solution, steps, seed, progress))


def _model(scene: Scene, model: str) -> str:
    if model != "auto":
        return model
    flat = has_exact_waves(scene.body) or scene.body.of_kind.is_plate
    return "flat-body" if flat else "fem"


def sentences(found: Fit) -> list[str]:
    """Sentences on what was fitted, and how well."""
    solution, data = found.solution, found.solution.problem.data
    n = len(solution.starts)
    ratio = solution.cost / solution.dof
    expected = ", of errors that are known" if data.is_known else ""
    return [
        f"{found.target.model} was fitted to {data.words}.",
        f"{solution.reached} of {n} start{'s' * (n > 1)} reached the solution, "
        f"which leaves {significant(100 * found.misfit, 2)} % of the measured motion"
        + (f"; chi squared over its degrees of freedom is {significant(ratio)}{expected}."
           if expected else "."),
        *(_resolved(each) for each in found.estimates if each.is_resolved and not each.at_limit),
    ]  # fmt: skip


def _resolved(each: Estimate) -> str:
    value, low, high = shown(each.value, each.low, each.high)
    return f"{each.key} = {value}, 95 % interval {low} to {high}."


def shown(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A value and its interval, to two digits of the interval's width."""
    width = max(high - low, 1e-12 * abs(value), 1e-300)
    largest = max(abs(value), abs(low), abs(high))
    digits = min(max(3, int(np.ceil(np.log10(largest / width))) + 2), 12) if largest else 3
    return significant(value, digits), significant(low, digits), significant(high, digits)


def cautions(found: Fit) -> list[str]:
    """Sentences, without a full stop, on what is not to be trusted."""
    solution = found.solution
    said = [
        "the fit did not converge: its steps ended before chi squared was least; give more starts "
        "or closer limits"
    ] * (not solution.converged)
    said += [_at_limit(found, each) for each in found.estimates if each.at_limit]
    said += [_unresolved(found, each) for each in found.unresolved]
    said += _beyond_errors(found) + _coloured(found) + _elsewhere(found) + _turned(found)
    said += _left_out(found)
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


def _unresolved(found: Fit, direction: Direction) -> str:
    """Sentence on keys of which the data determine a combination, or nothing."""
    keys = direction.keys
    if len(keys) == 1:
        return f"the data do not determine {keys[0]} between its limits; fix it, or measure more"
    together = f"{', '.join(keys[:-1])} and {keys[-1]}"
    said = f"the data do not resolve {together} from each other"
    if np.isfinite(direction.exponent):
        value, low, high = combined(found.solution, direction)
        power = round(direction.exponent, 2)
        product = (
            f"{keys[0]} times {keys[1]}" if power == 1
            else f"{keys[0]} over {keys[1]}" if power == -1
            else f"{keys[0]} times {keys[1]} to the power of {power:g}"
        )  # fmt: skip
        middle, least, most = shown(value, low, high)
        said += f"; only {product} is determined, {middle} (95 % interval {least} to {most})"
    return f"{said}; fix {'one' if len(keys) == 2 else 'some'} of them"


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
    if found.whiteness.is_white or np.isnan(found.whiteness.p):
        return []
    return [
        f"the residuals are not white (Ljung-Box, p {probability(found.whiteness.p)}): what is left "
        f"has structure, for which the intervals are widened by {_factors(found)}; if it is no "
        "noise, look for what the scene leaves out"
    ]


def _factors(found: Fit) -> str:
    """Words on the factors of the intervals of what is resolved."""
    each = [x for x, e in zip(found.widenings, found.estimates, strict=True) if e.is_resolved]
    low, high = (significant(x, 3) for x in (min(each, default=1.0), max(each, default=1.0)))
    return f"a factor of {low}" if low == high else f"factors of {low} to {high}"


def probability(p: float) -> str:
    """A probability with its sign of relation."""
    return f"= {significant(p, 2)}" if p >= LEAST else f"< {LEAST:g}"


def _turned(found: Fit) -> list[str]:
    has_delay = DELAY in found.solution.problem.parameters.keys
    return [opposite_sign(found.target.model, has_delay)] * found.solution.may_be_turned


def _left_out(found: Fit) -> list[str]:
    """Sentence on lines that are strong in the measurement, and not fitted."""
    strong = [line for line in found.solution.problem.data.left_out if line.share > 0]
    share = sum(line.share for line in strong)
    if share <= LEFT_OUT:
        return []
    return [
        f"lines that are not fitted, {some(tuple(line.name for line in strong))}, have "
        f"{significant(100 * share, 2)} % of the measured power, and in the model next to none; "
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
