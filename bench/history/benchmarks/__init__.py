"""Benchmarks that airspeed velocity runs over the history of the project, some seconds in all."""
