"""One row of a sweep: what was commanded, what came out of it, and what that cost."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from simple_model import Effort, Response, named_lines, point_kernel, sensation_level
from simple_model.quantities import DISPLACEMENT
from skinwave.models.options import sample_times
from skinwave.results.comparison import compare, moving_rms
from skinwave.results.run import ASSESSED, SUPPORT, Run
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint

WEAKEST, MOST = 1e-2, 40  # of the strongest line of a load, and lines, that have columns
SETTLE = 0.25  # of a response, before which it is not looked at
TEXTS = (
    "key", "status", "error", "model", "asked_model", "version", "name", "scene",
    "sensation_line", "solver", "warnings",
)  # fmt: skip
NUMBERS = (
    "tolerance", "asked_h_mm", "h_mm", "expected_error", "drawing_frequency_hz",
    "rayleigh_speed_m_per_s", "spread_6db_mm", "spread_20db_mm", "kernel_spread_6db_mm",
    "kernel_spread_20db_mm", "seconds", "dofs", "reduced_dofs", "reduced_together", "steps",
    "reduction_error", "energy_imbalance", "radiated", "peak_memory_gib",
)  # fmt: skip
AT_PROBES = (
    "probe_x_mm", "probe_y_mm", "peak_um", "rms_um", "level_db", "kernel_peak_pa", "kernel_rms_pa",
    "kernel_misfit", "kernel_shape_misfit", "kernel_delay_ms",
)  # fmt: skip


def columns(cases: Iterable[DesignPoint]) -> dict[str, str]:
    """The columns of a sweep and whether each is "text", "whole", "number" or, at each probe,
    "numbers".
    """
    found = {"index": "whole"} | dict.fromkeys(TEXTS, "text")
    of_lines: dict[str, str] = {}
    of_probes: dict[str, str] = {}
    for case in cases:
        for key, value in case.keys.items():
            found.setdefault(key, "text" if isinstance(value, str) else "number")
        if case.scene is None:
            continue
        others = _others(case.scene)
        of_probes |= {f"{what}_{unit}": "numbers" for unit in others for what in ("peak", "rms")}
        for name in _columned(case.scene):
            of_lines[f"{name}_hz"] = "number"
            of_lines |= {f"{name}_{unit}": "numbers" for unit in ("um", "db", "kernel_pa", "ratio")}
            of_lines |= dict.fromkeys((f"{name}_{unit}" for unit in others), "numbers")
    return (
        found
        | dict.fromkeys(NUMBERS, "number")
        | dict.fromkeys(AT_PROBES, "numbers")
        | of_probes
        | dict(sorted(of_lines.items()))
    )


def _others(scene: Scene) -> list[str]:
    """Ending of the columns of a quantity other than the displacement."""
    asked = scene.reading.asked
    return [] if asked is DISPLACEMENT else [asked.column]


def _columned(scene: Scene) -> Iterable[str]:
    """Lines that have columns: the strongest of the load, those that claims are about, and that
    of a support that moves.
    """
    found = named_lines(scene.pressure, WEAKEST, most=MOST, candidates=ASSESSED)
    return [*found, *([SUPPORT] if scene.load.support_motion else [])]


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
    """Columns of a row that a response gives: its amplitudes, comparison with the kernel, cost."""
    kernel = response
    if response.record.of_body:
        kernel = point_kernel(scene.pressure, scene.probe_points, sample_times(scene))
    run = Run(tacton=scene.name, body=scene.body.kind, scene=scene, response=response)
    frequencies, found = run.frequencies, run.lines
    agreement = compare(kernel, response)
    row: dict[str, Any] = {"status": "done", "model": response.model}
    published = found if kernel is response else replace(run, response=kernel).lines
    for name, frequency in frequencies.items():
        row[f"{name}_hz"] = frequency
        if name in published:
            row[f"{name}_kernel_pa"] = published[name]
            with np.errstate(divide="ignore", invalid="ignore"):
                row[f"{name}_ratio"] = abs(agreement.scale) * found[name] / published[name]
    row |= {
        "kernel_peak_pa": _peak(kernel), "kernel_rms_pa": moving_rms(kernel),
        "kernel_misfit": agreement.relative_l2, "kernel_shape_misfit": agreement.shape_misfit,
        "kernel_delay_ms": 1e3 * agreement.delay,
        "kernel_spread_6db_mm": 1e3 * agreement.spread_reference[-6],
        "kernel_spread_20db_mm": 1e3 * agreement.spread_reference[-20],
    } | _effort(response.effort)  # fmt: skip
    if response.record.of_body:
        unit = "um" if response.record is DISPLACEMENT else response.record.column
        per = response.record.per_unit
        row |= {
            f"peak_{unit}": per * _peak(response), f"rms_{unit}": per * moving_rms(response),
            "spread_6db_mm": 1e3 * agreement.spread_candidate[-6],
            "spread_20db_mm": 1e3 * agreement.spread_candidate[-20],
            **{f"{name}_{unit}": per * amplitudes for name, amplitudes in found.items()},
        }  # fmt: skip
        row |= _above_threshold(run) if run.is_skin else {}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in row.items()}  # fmt: skip


def _above_threshold(run: Run) -> dict[str, Any]:
    """Sensation levels of lines and, if all are resolved, the line with the highest."""
    levels = {n: sensation_level(a, run.frequencies[n]) for n, a in run.lines.items()}
    row: dict[str, Any] = {f"{name}_db": level for name, level in levels.items()}
    if levels and not run.unresolved:
        row["level_db"] = np.max(list(levels.values()), axis=0)
        row["sensation_line"] = max(levels, key=lambda name: levels[name].max())
    return row


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
