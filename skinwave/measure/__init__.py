"""Measurements on a body: reading, inspection, comparison with models, and fits to them."""

from skinwave.measure.measurement import Measurement

__all__ = ["Measurement"]
