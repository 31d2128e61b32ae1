"""Fits of a scene to a measurement: estimates, intervals, and what the data do not resolve."""
