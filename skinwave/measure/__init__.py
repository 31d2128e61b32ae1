"""Measurements on a body: reading, inspection, comparison with models, and fits to them."""

from skinwave.measure.measurement import Measurement
from skinwave.measure.recording import Given, Recording

__all__ = ["Given", "Measurement", "Recording"]
