"""One row of a sweep: what was commanded, what came out of it, and what that cost."""

from dataclasses import replace
from typing import Any

import numpy as np

from simple_model import Effort, Response, named_lines, point_kernel, sensation_level
from simple_model.quantities import DISPLACEMENT, Quantity
from skinwave.models.options import sample_times
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.run import ASSESSED, SUPPORT, Run
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint

WEAKEST, MOST = 1e-2, 40  # of the strongest line of a load, and lines, that have columns
SETTLE = 0.25  # of a response, before which it is not looked at


def commanded(case: DesignPoint) -> dict[str, Any]:
    """The part of a row that is known before the run."""
    row: dict[str, Any] = {"status": "failed", "error": case.error, "scene": case.text, **case.keys}
    if case.scene:
        body = case.scene.body
        row |= {
            "name": case.scene.name,
            "drawing_frequency_hz": case.scene.tacton.drawing_frequency,
            "probe_x_mm": [1e3 * x for x, _ in case.scene.probes],
            "probe_y_mm": [1e3 * y for _, y in case.scene.probes],
        }
        if body.is_solid:
            row["rayleigh_speed_m_per_s"] = body.solid.rayleigh_speed
    return row


def measured(scene: Scene, response: Response) -> dict[str, Any]:
    """Columns of a row that a response gives: its amplitudes, comparison with the kernel, cost.

    Lines with columns are the strongest of the load, those that claims are about, and that of a
    support that moves.
    """
    kernel, of_body = response, response.record.of_body
    if of_body:
        kernel = point_kernel(scene.pressure, scene.probe_points, sample_times(scene))
    run = Run(tacton=scene.name, body=scene.body.kind, scene=scene, response=response)
    agreement, per = compare(kernel, response), response.record.per_unit
    unit = unit_of(response.record)
    row: dict[str, Any] = {
        "status": "done", "model": response.model,
        "kernel_peak_pa": _peak(kernel), "kernel_rms_pa": moving_rms(kernel),
        "kernel_misfit": agreement.relative_l2, "kernel_shape_misfit": agreement.shape_misfit,
        "kernel_delay_ms": 1e3 * agreement.delay,
        "kernel_spread_6db_mm": 1e3 * agreement.spread_reference[-6],
        "kernel_spread_20db_mm": 1e3 * agreement.spread_reference[-20],
    } | _effort(response.effort)  # fmt: skip
    if of_body:
        row |= {
            f"peak_{unit}": per * _peak(response), f"rms_{unit}": per * moving_rms(response),
            "spread_6db_mm": 1e3 * agreement.spread_candidate[-6],
            "spread_20db_mm": 1e3 * agreement.spread_candidate[-20],
        }  # fmt: skip
    levels = {}
    if run.is_skin:
        levels = {n: sensation_level(a, run.frequencies[n]) for n, a in run.lines.items()}
    if levels and not run.unresolved:
        row["level_db"] = np.max(list(levels.values()), axis=0)
        row["sensation_line"] = max(levels, key=lambda name: levels[name].max())
    published = replace(run, response=kernel).lines if of_body else run.lines
    strong = named_lines(scene.pressure, WEAKEST, most=MOST, candidates=ASSESSED)
    for name in (name for name in run.lines if name in {*strong, SUPPORT}):
        row[f"{name}_hz"] = run.frequencies[name]
        if name in published:
            row[f"{name}_kernel_pa"] = published[name]
            with np.errstate(divide="ignore", invalid="ignore"):
                row[f"{name}_ratio"] = abs(agreement.scale) * run.lines[name] / published[name]
        row |= {f"{name}_{unit}": per * run.lines[name]} if of_body else {}
        row |= {f"{name}_db": levels[name]} if levels else {}
    return plain(row)


def plain(row: dict[str, Any]) -> dict[str, Any]:
    """A row whose arrays are lists, as a table has them."""
    return {name: x.tolist() if isinstance(x, np.ndarray | np.generic) else x
            for name, x in row.items()}  # fmt: skip


def unit_of(record: Quantity) -> str:
    """The end of columns of a quantity, which is its unit."""
    return "um" if record is DISPLACEMENT else record.column


def _effort(effort: Effort) -> dict[str, Any]:
    same = ("dofs", "reduced_dofs", "steps", "solver", "energy_imbalance", "radiated")
    return {name: getattr(effort, name) for name in same} | {
        "reduction_error": effort.estimate,
        "peak_memory_gib": effort.peak_memory / 2**30,
        "warnings": "; ".join(effort.warnings),
    }


def _peak(response: Response) -> Any:
    kept = response.values[int(SETTLE * len(response.times)) :]
    return np.abs(kept).max(axis=0)
