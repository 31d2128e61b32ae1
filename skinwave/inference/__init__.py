"""Inference: which bodies and measurements would show what was measured."""
