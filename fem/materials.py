"""Materials of all models."""

from simple_model import Material, from_young
from simple_model.layers.material import PRESETS

__all__ = ["PRESETS", "Material", "from_young"]
