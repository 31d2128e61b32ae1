"""Fit of a scene to a measurement: estimates with intervals, and how far to trust them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model.choices import choose
from skinwave.measure import Measurement
from skinwave.measure.fitted import fitted
from skinwave.measure.identify import (
    Direction,
    Estimate,
    Whiteness,
    correlations,
    estimates,
    unresolved,
    whiteness,
    widenings,
)
from skinwave.measure.observed import KINDS, data_of
from skinwave.measure.parameters import check, parse
from skinwave.measure.posterior import Posterior, posterior
from skinwave.measure.predicted import Target, target, with_reduction
from skinwave.measure.problem import Problem
from skinwave.measure.profile import Profile, profiles
from skinwave.measure.solve import Solution, solve
from skinwave.models.advice import takes
from skinwave.models.flat_body import FLAT_BODY
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, silent

STARTS = 8


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
        """The scene with the estimates, each with its spread."""
        return fitted(self.target.scene, self.solution, self.estimates)

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
    return FLAT_BODY.name if takes(FLAT_BODY, scene) else "fem"
