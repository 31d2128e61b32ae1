"""Fits of a scene to a measurement: estimates, their intervals, and what the data do not resolve."""
