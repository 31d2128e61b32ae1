"""Measurements on a body: reading, inspection, comparison with models, and fits to them."""

from skinwave.measure.measurement import Measurement
from skinwave.measure.recording import Given, Reader, Recording, register

__all__ = ["Given", "Measurement", "Reader", "Recording", "register"]
