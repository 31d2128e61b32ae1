"""Columns of one row of a sweep: its inputs, its results, their cost, and registered columns."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simple_model import Effort, Response, named_lines, point_kernel
from simple_model.load.sampling import step
from simple_model.quantities import DISPLACEMENT, Quantity
from simple_model.response import SETTLE
from skinwave.models.options import sample_times
from skinwave.results.comparison import compare, spread, steady_rms
from skinwave.results.run import ASSESSED, SUPPORT, Run
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint
from skinwave.sweeps import dataset
from skinwave.system import extensions
from skinwave.system.extensions import Registry
from skinwave.system.failures import reason


@dataclass(frozen=True, kw_only=True)
class Column:
    """Column of a sweep from outside; "own_" precedes its name in the table.

    Parameters
    ----------
    name : small letters, digits and "_"; its end gives a unit, such as "_um" or "_m_per_s"
    value : function of a `Run` that returns a number or, if `per_probe`, one for each probe
    """

    name: str
    value: Callable[[Run], Any]
    per_probe: bool = False


COLUMNS = Registry[Column](what="column")


def register(column: Column) -> None:
    """Register a column; raise a ValueError if its name is taken."""
    if not re.fullmatch("[a-z][a-z0-9_]*", column.name):
        raise ValueError(f"the column '{column.name}' needs a name of small letters and digits")
    extensions.add(COLUMNS, column.name, column, column.value)


def input_columns(point: DesignPoint) -> dict[str, Any]:
    """Return the columns of a row that are known before its run."""
    row: dict[str, Any] = {
        "status": "failed", "error": point.error, "scene": point.text, **point.keys
    }  # fmt: skip
    if point.scene:
        body = point.scene.body
        row |= {
            "name": point.scene.name,
            "drawing_frequency_hz": point.scene.tacton.drawing_frequency,
            "probe_x_mm": [1e3 * x for x, _ in point.scene.probes],
            "probe_y_mm": [1e3 * y for _, y in point.scene.probes],
        }
        if body.is_solid:
            row["rayleigh_speed_m_per_s"] = body.solid.rayleigh_speed
    return row


def result_columns(scene: Scene, response: Response) -> dict[str, Any]:
    """Return the columns of a response: amplitudes, agreement with the point kernel, and cost.

    The lines are the strongest of the load, those of the claims, and that of a moving support.
    """
    weakest_ratio, most_lines = 1e-2, 40  # to the strongest line of the load
    kernel, of_body = response, response.record.of_body
    if of_body:
        kernel = point_kernel(scene.pressure, scene.probe_points, sample_times(scene))
    run = Run(tacton=scene.name, body=scene.body.kind, scene=scene, response=response)
    agreement, scale = compare(kernel, response), response.record.per_unit
    unit = unit_of(response.record)
    support = [run.line_hz[SUPPORT]] if SUPPORT in run.line_hz else []
    level = steady_rms(response, support) if support else agreement.rms_candidate
    within = spread(response.probes, level)
    row: dict[str, Any] = {
        "status": "done", "model": response.model,
        "kernel_peak_pa": _peak(kernel), "kernel_rms_pa": agreement.rms_reference,
        "kernel_misfit": agreement.relative_l2, "kernel_shape_misfit": agreement.shape_misfit,
        "kernel_delay_ms": 1e3 * agreement.delay,
        "kernel_spread_6db_mm": 1e3 * agreement.spread_reference[-6],
        "kernel_spread_20db_mm": 1e3 * agreement.spread_reference[-20],
    } | _cost(response.effort)  # fmt: skip
    if of_body:
        row |= {
            f"peak_{unit}": scale * _peak(response),
            f"rms_{unit}": scale * level,
            "spread_6db_mm": 1e3 * within[-6], "spread_20db_mm": 1e3 * within[-20],
        }  # fmt: skip
    levels = run.levels
    if levels and not run.in_pulses.unresolved:
        row["level_db"] = np.max(list(levels.values()), axis=0)
        row["sensation_line"] = max(levels, key=lambda name: levels[name].max())
    kernel_lines = replace(run, response=kernel).lines if of_body else run.lines
    strong = named_lines(scene.pressure, weakest_ratio, most=most_lines, candidates=ASSESSED)
    for name in (name for name in run.lines if name in {*strong, SUPPORT}):
        row[f"{name}_hz"] = run.frequencies[name]
        if name in kernel_lines:
            pressure = row[f"{name}_kernel_pa"] = kernel_lines[name]
            with np.errstate(divide="ignore", invalid="ignore"):
                row[f"{name}_ratio"] = abs(agreement.scale) * run.lines[name] / pressure
        row |= {f"{name}_{unit}": scale * run.lines[name]} if of_body else {}
        row |= {f"{name}_db": levels[name]} if name in levels else {}
    extensions.load()
    for column in COLUMNS.records.values():
        name = f"own_{column.name}"
        try:
            row[name] = _own_value(column, run)
        except Exception as error:  # whatever a function from outside raises; the rest is kept
            row[name] = None
            problem = f"column {name} is missing: {reason(error)}"
            row["warnings"] = "; ".join(filter(None, (row["warnings"], problem)))
    return plain(row)


def _own_value(column: Column, run: Run) -> Any:
    value = np.asarray(column.value(run), np.float64)
    shape = (len(run.places),) if column.per_probe else ()
    if value.shape != shape:
        raise ValueError(f"its function returns the shape {value.shape}; return {shape}")
    return value.tolist()


def waveform_columns(response: Response) -> dict[str, Any]:
    """Return the waveform at each probe in single precision, the first time and the step in s."""
    record, times = response.record, response.times
    waveforms = list((record.per_unit * response.values.T).astype(np.float32))
    first = {"first_s": float(times[0]), "step_s": step(times)}
    return first | {f"{dataset.WAVEFORM}{record.column}": waveforms}


def plain(row: dict[str, Any]) -> dict[str, Any]:
    """Convert the arrays of a row to lists."""
    return {name: x.tolist() if isinstance(x, np.ndarray | np.generic) else x
            for name, x in row.items()}  # fmt: skip


def unit_of(record: Quantity) -> str:
    """Return the unit in the column names of a quantity."""
    return "um" if record is DISPLACEMENT else record.column


def _cost(effort: Effort) -> dict[str, Any]:
    return {
        "dofs": effort.dofs, "reduced_dofs": effort.reduced_dofs, "steps": effort.steps,
        "solver": effort.solver, "energy_imbalance": effort.energy_imbalance,
        "radiated": effort.radiated, "reduction_error": effort.estimate,
        "peak_memory_gib": effort.peak_memory / 2**30, "warnings": "; ".join(effort.warnings),
    }  # fmt: skip


def _peak(response: Response) -> Any:
    settled = response.values[int(SETTLE * len(response.times)) :]
    return np.abs(settled).max(axis=0)
