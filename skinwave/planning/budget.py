"""Error budget of a response: its numerical error beside what the spread of materials and of the
device leaves, all relative to the waveform of the worst probe.

First order: a number is moved one standard deviation either way, the others stay; half of the
difference of the waveforms counts, and those of independent numbers add as squares. In the steady
state and about the mean: layers by wavenumber integrals, where a palm is taken as flat layers as
deep as its middle, and a body that is tilted as one that lies flat; a held sheet by the modes of a
linear plate. Resonances of a body from a file depend on its sides, and curled sheets have no such
modes: there only the effect of the pressure is known.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan

import numpy as np

from simple_model.layers.compliance import layered
from simple_model.layers.flat_body import steady_lines
from simple_model.numbers import percent, significant, stated_error
from skinwave.bodies.analytic import flattened
from skinwave.models.limits import takes
from skinwave.models.plate_modes import MODES
from skinwave.models.plate_modes import steady_lines as steady_lines_of_plate
from skinwave.planning.refinement import CONTROLLER, element_sizes
from skinwave.planning.rows import PlanRow
from skinwave.scene.distributions import Spread
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import PRESSURE, spreads_of
from skinwave.scene.variation import with_values
from skinwave.typing import Complex, Floats

SIGMA = (0.15865525393145707, 0.8413447460685429)  # quantiles a standard deviation either way
FAINT = 1e-3  # of the load's strongest line: lines that no budget needs
LEFT_OUT = ("placement.", "probes.")  # sections of numbers that flat layers know nothing of
ENOUGH = 0.1  # of another error: a numerical one below it gains nothing


@dataclass(frozen=True, kw_only=True)
class ErrorBudget:
    """Relative errors of the worst probe's waveform: `numerical`; by one standard deviation of the
    numbers of `material` and of `device`; nan where it is not computed, 0 where no spread is known.
    """

    numerical: float
    material: float
    device: float

    @property
    def words(self) -> str:
        """The three in one sentence."""
        return (
            f"Error of the worst probe's waveform: numerical {stated_error(self.numerical)}; one "
            f"standard deviation of the {self.spreads}"
        )

    @property
    def spreads(self) -> str:
        """The material's and the device's in a few words."""
        known = {"material": self.material, "device": self.device}
        return ", ".join(
            f"{name} {_percent(value) if value else '(spread unknown)'}"
            for name, value in known.items()
        )

    @property
    def largest(self) -> tuple[str, float]:
        """The larger of the material's and the device's, if any is known; else none and 0."""
        known = {"material": self.material, "device": self.device}
        name = max(known, key=lambda each: known[each] if isfinite(known[each]) else -1.0)
        return (name, known[name]) if isfinite(known[name]) else ("", 0.0)


def _percent(value: float) -> str:
    return percent(value) if isfinite(value) else "not computed"


def error_budget(scene: Scene, numerical: float = nan) -> ErrorBudget:
    """Error budget at a scene's probes, of a response with a `numerical` relative error."""
    spreads = spreads_of(scene)
    of_body = tuple(s for s in spreads if s.part == "material")
    others = tuple(s for s in spreads if s.part != "material")
    return ErrorBudget(
        numerical=numerical, material=_part(scene, of_body), device=_part(scene, others)
    )


def _part(scene: Scene, spreads: Sequence[Spread]) -> float:
    """Relative change of the worst probe's waveform by some numbers; nan if it is not computed."""
    changes: list[Floats] = []
    for spread in spreads:
        low, high = spread.distribution.quantile(spread.value, SIGMA)
        if spread.key == PRESSURE:
            changes.append(np.full(len(scene.probes), (high - low) / (2 * spread.value)))
        elif (found := _change(scene, spread.key, (float(low), float(high)))) is not None:
            changes.append(found)
        else:
            return nan
    return float(np.sqrt(np.sum(np.square(changes), axis=0)).max()) if changes else 0.0


def _change(scene: Scene, key: str, ends: tuple[float, float]) -> Floats | None:
    """Half the relative difference (p,) of the motion at both ends of a number, or None."""
    lines_of = _closed_form(scene)
    if lines_of is None or (lines_of is _lines and key.startswith(LEFT_OUT)):
        return None
    try:
        lines = [lines_of(scene), *(lines_of(with_values(scene, {key: end})) for end in ends)]
    except (ValueError, ArithmeticError):  # a number out of range, or next to no loss
        return None
    (f, centre), (f_low, low), (f_high, high) = lines
    if not (np.array_equal(f, f_low) and np.array_equal(f, f_high)):
        return None
    size = np.linalg.norm(centre, axis=0)
    return np.linalg.norm(high - low, axis=0) / 2 / np.where(size > 0, size, np.inf)


def _closed_form(scene: Scene) -> Callable[[Scene], tuple[Floats, Complex]] | None:
    """The function of a scene to its steady lines, by flat layers or modes; or None."""
    body = scene.body
    lossy = any(solid.has_loss for _, solid in body.strata)
    if not lossy or scene.tacton.trajectory.shape == "recorded":
        return None
    if body.of_kind.is_plate:
        return _of_plate if takes(MODES, scene) else None
    flat = body.of_kind.dispersion is not None
    return _lines if flat and scene.reading.is_plain and scene.load.is_normal else None


def _lines(scene: Scene) -> tuple[Floats, Complex]:
    """Frequencies (f,) in Hz above 0 and amplitudes (f, p) at the probes, of flat layers."""
    pressure = replace(scene.pressure, profile="gaussian")
    compliance = layered(flattened(scene.body))
    f, a = steady_lines(compliance, pressure, scene.probe_points, threshold=FAINT)
    return f[f > 0], a[f > 0]


def _of_plate(scene: Scene) -> tuple[Floats, Complex]:
    """The same of a held sheet, in the quantity that its probes read."""
    f, a = steady_lines_of_plate(scene)
    return f[f > 0], a[f > 0]


def mesh_row(scene: Scene, h: float | None, error: float) -> PlanRow:
    """Row of the error budget of a response, and from which mesh on nothing is gained."""
    found = error_budget(scene, error)
    name, largest = found.largest
    if not largest:
        return PlanRow(what="uncertainty", value=found.spreads, reason="nothing to compare with")
    reason = f"a numerical error below a tenth of the {name}'s, {_percent(ENOUGH * largest)}, gains"
    if h is None or not error > 0:
        return PlanRow(what="uncertainty", value=found.spreads, reason=f"{reason} nothing")
    coarsest = float(element_sizes(scene.body)[0])
    size = min(CONTROLLER.size(h, error, ENOUGH * largest), max(coarsest, h))
    return PlanRow(
        what="uncertainty", value=found.spreads,
        reason=f"{reason} nothing: nor does a mesh finer than {significant(1e3 * size, 2)} mm",
    )  # fmt: skip
