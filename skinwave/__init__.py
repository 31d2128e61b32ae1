"""Skin waves of mid-air ultrasound: scenes, models, comparison, reports.

    scene = skinwave.read("scene.toml")
    response = skinwave.simulate(scene)

Names are imported when they are first used, so that `skinwave --help` is immediate.
"""

from skinwave.safe_path import leave_out_working_folder

leave_out_working_folder()

from importlib import import_module  # noqa: E402
from typing import TYPE_CHECKING, Any  # noqa: E402

if TYPE_CHECKING:  # what readers of types and editors see of the names below
    from skinwave.citations import cite
    from skinwave.comparison import Agreement, compare
    from skinwave.effort import SkinwaveWarning
    from skinwave.fields import Field, field
    from skinwave.parametric import ParametricBody, prepare
    from skinwave.pictures.styles import paper
    from skinwave.planning.plan import Plan, plan
    from skinwave.scene import BODIES, Body, Load, Scene, Sides
    from skinwave.scene_file import dumps, loads, read
    from skinwave.simulation import simulate
    from skinwave.support_motion import SupportMotion
    from skinwave.sweeps.best import Best
    from skinwave.sweeps.in_python import SweepTable, best_value, sweep

_HOMES = {
    "BODIES": "scene",
    "Body": "scene",
    "Load": "scene",
    "Sides": "scene",
    "Scene": "scene",
    "read": "scene_file",
    "loads": "scene_file",
    "dumps": "scene_file",
    "simulate": "simulation",
    "SkinwaveWarning": "effort",
    "SupportMotion": "support_motion",
    "Plan": "planning.plan",
    "Field": "fields",
    "field": "fields",
    "Agreement": "comparison",
    "compare": "comparison",
    "plan": "planning.plan",
    "ParametricBody": "parametric",
    "prepare": "parametric",
    "cite": "citations",
    "paper": "pictures.styles",
    "sweep": "sweeps.in_python",
    "best_value": "sweeps.in_python",
    "Best": "sweeps.best",
    "SweepTable": "sweeps.in_python",
}
__all__ = [
    "BODIES", "Agreement", "Best", "Body", "Field", "Load", "ParametricBody", "Plan", "Scene",
    "Sides", "SkinwaveWarning", "SupportMotion", "SweepTable", "best_value", "cite", "compare",
    "dumps", "field", "loads", "paper", "plan", "prepare", "read", "simulate", "sweep",
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
