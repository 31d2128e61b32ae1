"""Error budget of a response: numerical error, and uncertainty due to the spread of materials and
of the device, all relative to the waveform of the worst probe.

Propagation of uncertainty is of first order: each number varies by one standard deviation either
way, half the difference of the waveforms is its contribution, and contributions of independent
numbers add as squares. Waveforms are in the steady state, about the mean. Layers are solved by
wavenumber integrals: a palm as flat layers as deep as its middle, a tilted body as a flat one. A
supported sheet is solved by the modes of a linear plate. For a body from a file, whose resonances
depend on its sides, and a curled sheet, only the uncertainty due to the pressure is known.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite, nan

import numpy as np

from simple_model.layers.compliance import layered
from simple_model.layers.flat_body import steady_lines
from simple_model.numbers import change_text, significant, stated_error
from skinwave.bodies.analytic import flat_layers
from skinwave.models.limits import takes
from skinwave.models.plate_modes import MODES
from skinwave.models.plate_modes import steady_lines as steady_lines_of_plate
from skinwave.models.relative_change import relative_changes
from skinwave.planning.record import PlanRow
from skinwave.planning.refinement import controller, element_sizes
from skinwave.scene.distributions import Spread
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, spreads_of
from skinwave.scene.variation import with_values
from skinwave.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True)
class ErrorBudget:
    """Relative errors of the worst probe's waveform: `numerical`, and those due to one standard
    deviation of numbers of the `material` and of the `device`; 0 if no spread is known, nan if not
    computed, for a `reason`.
    """

    numerical: float
    material: float
    device: float
    reason: str = ""

    @property
    def words(self) -> str:
        """All three errors in one sentence."""
        both = f"{self._clause('material', self.material)}, {self._clause('device', self.device)}"
        return f"{both}; the numerical error is {stated_error(self.numerical)}"

    @property
    def spreads(self) -> str:
        """The uncertainties from the material and the device in a few words."""
        return ", ".join(
            f"{name} {self._percent(value) if value else '(spread unknown)'}"
            for name, value in (("material", self.material), ("device", self.device))
        )

    @property
    def largest(self) -> tuple[str, float]:
        """Name and value of the larger uncertainty; "" and 0 if none is known."""
        known = {"material": self.material, "device": self.device}
        name = max(known, key=lambda each: known[each] if isfinite(known[each]) else -1.0)
        return (name, known[name]) if isfinite(known[name]) else ("", 0.0)

    def _clause(self, name: str, value: float) -> str:
        if not value:
            return f"the spread of the {name} is not known"
        if not isfinite(value):
            return f"the uncertainty from the {name} is {self._percent(value)}"
        changed = f"changes the waveform at the worst probe by {change_text(value)}"
        return f"one standard deviation of the {name} {changed}"

    def _percent(self, value: float) -> str:
        if isfinite(value):
            return change_text(value)
        return f"not computed ({self.reason})" if self.reason else "not computed"


def error_budget(scene: Scene, numerical: float = nan) -> ErrorBudget:
    """Return the error budget of a response with a `numerical` relative error."""
    spreads, reason = spreads_of(scene), ""
    found = {"material": 0.0, "device": 0.0}
    for part in found:
        own = [spread for spread in spreads if (spread.part == "material") == (part == "material")]
        try:
            squares = [_change(scene, spread) ** 2 for spread in own]
            found[part] = float(np.sqrt(np.max(np.sum(squares, axis=0))))
        except ValueError as error:
            found[part], reason = nan, reason or str(error)
    return ErrorBudget(numerical=numerical, reason=reason, **found)


def _change(scene: Scene, spread: Spread) -> Floats:
    """Return the relative change (p,) of the motion by one standard deviation of a number.

    Raises a ValueError if it is not computed.
    """
    sigma = (0.15865525393145707, 0.8413447460685429)  # quantiles a standard deviation either way
    key, ends = spread.key, spread.distribution.quantile(spread.value, sigma).tolist()
    if key == PRESSURE:
        return np.full(len(scene.probes), (ends[1] - ends[0]) / (2 * spread.value))
    lines_of = _closed_form(scene)
    not_in_layers = ("placement.", "probes.")  # sections whose numbers do not affect flat layers
    if lines_of is _lines_of_layers and key.startswith(not_in_layers):
        raise ValueError(f"flat layers do not depend on {key}")
    try:
        lines = [lines_of(scene), *(lines_of(with_values(scene, {key: end})) for end in ends)]
    except (ValueError, ArithmeticError):  # a number out of range, or almost no loss
        raise ValueError(f"there is no response at one standard deviation of {key}") from None
    (f, centre), (f_low, low), (f_high, high) = lines
    if not (np.array_equal(f, f_low) and np.array_equal(f, f_high)):
        raise ValueError(f"lines of the load depend on {key}")
    return relative_changes((high - low)[f > 0] / 2, centre[f > 0])


def _closed_form(scene: Scene) -> Callable[[Scene], tuple[Floats, Complex]]:
    """Return the function that computes a scene's steady lines; raise a ValueError without one."""
    body = scene.body
    if not any(solid.has_loss for _, solid in body.strata):
        raise ValueError("the body has no loss")
    if scene.tacton.trajectory.shape == "recorded":
        raise ValueError("the path is recorded")
    if body.of_kind.is_plate:
        if not takes(MODES, scene):
            raise ValueError("the sheet has no modes of a flat plate")
        return steady_lines_of_plate
    if body.of_kind.dispersion is None:
        raise ValueError(
            f"a {body.kind} has no flat layers; skinwave run --samples samples its elements"
        )
    if not (scene.reading.is_plain and scene.load.is_normal):
        raise ValueError("only for the displacement under a normal load")
    return _lines_of_layers


def _lines_of_layers(scene: Scene, threshold: float = 1e-3) -> tuple[Floats, Complex]:
    """Return frequencies (f,) in Hz and amplitudes (f, p) at the probes of flat layers."""
    pressure = replace(scene.pressure, profile="gaussian")
    compliance = layered(flat_layers(scene.body))
    return steady_lines(compliance, pressure, scene.probe_points, threshold=threshold)


def mesh_row(scene: Scene, h: float | None, error: float, enough: float = 0.1) -> PlanRow:
    """Return the row of the error budget of a response, with the finest mesh that is worthwhile: a
    numerical error below a share `enough` of the uncertainty gains nothing.
    """
    budget = error_budget(scene, error)
    name, largest = budget.largest
    if not largest:
        return PlanRow(what="uncertainty", value=budget.spreads, reason="no spread is known")
    reason = (
        f"the uncertainty from the {name} ({change_text(largest)}) hides numerical errors below "
        f"{change_text(enough * largest)}"
    )
    if h is not None and error > 0:
        coarsest = float(element_sizes(scene.body)[0])
        size = min(controller(scene).size(h, error, enough * largest), max(coarsest, h))
        reason += f": elements of {significant(1e3 * size, 2)} mm are fine enough"
    return PlanRow(what="uncertainty", value=budget.spreads, reason=reason)
