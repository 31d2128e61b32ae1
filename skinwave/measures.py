"""One row of a sweep: what was commanded, what came out of it, and what that cost."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from simple_model import Response, point_kernel, sensation_level, tacton_lines
from skinwave.claims import Run
from skinwave.comparison import Agreement, compare, moving_rms
from skinwave.prepared import sample_times
from skinwave.scene import Scene
from skinwave.variation import Case

SETTLE = 0.25  # of a response, before which it is not looked at
TEXTS = (
    "key", "status", "error", "model", "asked_model", "version", "name", "scene",
    "felt_line", "solver", "warnings",
)  # fmt: skip
NUMBERS = (
    "tolerance", "asked_h_mm", "h_mm", "expected_error", "drawing_frequency_hz",
    "rayleigh_speed_m_per_s", "spread_6db_mm", "spread_20db_mm", "kernel_spread_6db_mm",
    "kernel_spread_20db_mm", "seconds", "dofs", "reduced_dofs", "steps", "reduction_error",
    "energy_imbalance", "radiated", "peak_memory_gib",
)  # fmt: skip
AT_PROBES = (
    "probe_x_mm", "probe_y_mm", "peak_um", "rms_um", "level_db", "kernel_peak_pa", "kernel_rms_pa",
    "kernel_misfit", "kernel_lag_ms",
)  # fmt: skip
COSTS = ("seconds", "peak_memory_gib")  # which differ from run to run


def columns(cases: Iterable[Case]) -> dict[str, str]:
    """The columns of a sweep and whether each is "text", "number" or, at each probe, "numbers"."""
    found = dict.fromkeys(TEXTS, "text")
    of_lines: dict[str, str] = {}
    for case in cases:
        for key, value in case.keys.items():
            found.setdefault(key, "text" if isinstance(value, str) else "number")
        for name in tacton_lines(case.scene.tacton) if case.scene else ():
            of_lines[f"{name}_hz"] = "number"
            of_lines |= {f"{name}_{unit}": "numbers" for unit in ("um", "db", "kernel_pa", "ratio")}
    return (
        found
        | dict.fromkeys(NUMBERS, "number")
        | dict.fromkeys(AT_PROBES, "numbers")
        | dict(sorted(of_lines.items()))
    )


def commanded(case: Case) -> dict[str, Any]:
    """The part of a row that is known before the run."""
    row: dict[str, Any] = {"status": "failed", "error": case.error, "scene": case.text, **case.keys}
    if case.scene:
        body = case.scene.body
        row |= {
            "name": case.scene.name,
            "drawing_frequency_hz": case.scene.tacton.trajectory.drawing_frequency,
            "probe_x_mm": [1e3 * x for x, _ in case.scene.probes],
            "probe_y_mm": [1e3 * y for _, y in case.scene.probes],
        }
        if body.kind not in ("none", "sheet"):
            row["rayleigh_speed_m_per_s"] = body.solid.rayleigh_speed
    return row


def measured(scene: Scene, response: Response) -> dict[str, Any]:
    """The part of a row that an answer gives: what it is, beside the point kernel, and its cost."""
    run = Run(tacton=scene.name, body=scene.body.kind, scene=scene, response=response)
    kernel = response
    if response.unit == "m":
        kernel = point_kernel(scene.pressure, scene.probe_points, sample_times(scene))
    published = Run(tacton=run.tacton, body="none", scene=scene, response=kernel)
    names = list(run.frequencies)
    agreement = compare(kernel, response, tuple(run.frequencies.values()))
    row: dict[str, Any] = {"status": "done", "model": response.model}
    for k, name in enumerate(names):
        row[f"{name}_hz"] = run.frequencies[name]
        row[f"{name}_kernel_pa"] = published.lines[name]
        row[f"{name}_ratio"] = agreement.line_ratios[k]
    row |= _kernel(kernel, agreement) | _effort(response)
    if response.unit == "m":
        row |= _motion(run, agreement)
    return {name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in row.items()}  # fmt: skip


def _kernel(kernel: Response, agreement: Agreement) -> dict[str, Any]:
    return {
        "kernel_peak_pa": _peak(kernel),
        "kernel_rms_pa": moving_rms(kernel),
        "kernel_misfit": agreement.relative_l2,
        "kernel_lag_ms": 1e3 * agreement.lag,
        "kernel_spread_6db_mm": 1e3 * agreement.spread_reference[-6],
        "kernel_spread_20db_mm": 1e3 * agreement.spread_reference[-20],
    }


def _motion(run: Run, agreement: Agreement) -> dict[str, Any]:
    row: dict[str, Any] = {
        "peak_um": 1e6 * _peak(run.response),
        "rms_um": 1e6 * moving_rms(run.response),
        "spread_6db_mm": 1e3 * agreement.spread_candidate[-6],
        "spread_20db_mm": 1e3 * agreement.spread_candidate[-20],
    }
    levels = {n: sensation_level(run.lines[n], f) for n, f in run.frequencies.items()}
    for name, level in levels.items():
        row[f"{name}_um"], row[f"{name}_db"] = 1e6 * run.lines[name], level
    if levels:
        row["level_db"] = np.max(list(levels.values()), axis=0)
        row["felt_line"] = max(levels, key=lambda name: levels[name].max())
    return row


def _effort(response: Response) -> Mapping[str, Any]:
    effort = response.effort
    return {
        "dofs": effort.dofs,
        "reduced_dofs": effort.reduced_dofs,
        "steps": effort.steps,
        "solver": effort.solver,
        "reduction_error": effort.estimate,
        "energy_imbalance": effort.energy_imbalance,
        "radiated": effort.radiated,
        "peak_memory_gib": effort.peak_memory / 2**30,
        "warnings": "; ".join(effort.warnings),
    }


def _peak(response: Response) -> Any:
    kept = response.displacement[int(SETTLE * len(response.times)) :]
    return np.abs(kept).max(axis=0)
