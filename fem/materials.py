"""Materials of all models."""

from simple_model.material import PRESETS, Material, from_young

__all__ = ["PRESETS", "Material", "from_young"]
