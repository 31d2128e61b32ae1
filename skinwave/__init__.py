"""Skin waves of mid-air ultrasound: scenes, models, comparison, reports.

    scene = skinwave.read("scene.toml")
    response = skinwave.simulate(scene)

Names are imported when they are first used, so that `skinwave --help` is immediate.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what readers of types and editors see of the names below
    from skinwave.models.options import SolveOptions
    from skinwave.models.parametric import ParametricBody, prepare
    from skinwave.planning.plan import plan
    from skinwave.planning.record import Plan
    from skinwave.planning.simulate import simulate
    from skinwave.report.fields import Field, field
    from skinwave.report.styles import paper
    from skinwave.results.citations import cite
    from skinwave.results.comparison import Agreement, compare
    from skinwave.scene.file import dumps, loads, read
    from skinwave.scene.load import SupportMotion
    from skinwave.scene.scene import BODIES, Body, Load, Scene, Sides
    from skinwave.sweeps.best import Best
    from skinwave.sweeps.in_python import SweepTable, best_value, best_values, read_sweep, sweep
    from skinwave.system.effort import SkinwaveWarning

_HOMES = {
    "BODIES": "scene.scene",
    "Body": "scene.scene",
    "Load": "scene.scene",
    "Sides": "scene.scene",
    "Scene": "scene.scene",
    "read": "scene.file",
    "loads": "scene.file",
    "dumps": "scene.file",
    "simulate": "planning.simulate",
    "SkinwaveWarning": "system.effort",
    "SupportMotion": "scene.load",
    "Plan": "planning.record",
    "Field": "report.fields",
    "field": "report.fields",
    "Agreement": "results.comparison",
    "compare": "results.comparison",
    "SolveOptions": "models.options",
    "plan": "planning.plan",
    "ParametricBody": "models.parametric",
    "prepare": "models.parametric",
    "cite": "results.citations",
    "paper": "report.styles",
    "sweep": "sweeps.in_python",
    "best_value": "sweeps.in_python",
    "best_values": "sweeps.in_python",
    "read_sweep": "sweeps.in_python",
    "Best": "sweeps.best",
    "SweepTable": "sweeps.in_python",
}
__all__ = [
    "BODIES", "Agreement", "Best", "Body", "Field", "Load", "ParametricBody", "Plan", "Scene",
    "Sides", "SkinwaveWarning", "SolveOptions", "SupportMotion", "SweepTable", "best_value",
    "best_values", "cite", "compare", "dumps", "field", "loads", "paper", "plan", "prepare", "read",
    "read_sweep", "simulate", "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value = _version()
    elif name in _HOMES:
        value = getattr(import_module(f"skinwave.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'skinwave' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def _version() -> str:
    """Installed version; "unknown" of sources that were never installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("skinwave")
    except PackageNotFoundError:
        return "unknown"
