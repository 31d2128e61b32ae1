"""Skin waves of mid-air ultrasound: scenes, models, comparison, reports.

    scene = skinwave.read("scene.toml")
    response = skinwave.simulate(scene)

Names are looked up when they are first used, so that `skinwave --help` answers at once.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "BODIES": "scene",
    "Body": "scene",
    "Scene": "scene",
    "read": "scene_file",
    "loads": "scene_file",
    "dumps": "scene_file",
    "simulate": "simulation",
    "SkinwaveWarning": "effort",
    "Plan": "planning.plan",
    "plan": "planning.plan",
    "Field": "fields",
    "field": "fields",
    "Agreement": "comparison",
    "compare": "comparison",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'skinwave' has no attribute '{name}'")
    value = getattr(import_module(f"skinwave.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
