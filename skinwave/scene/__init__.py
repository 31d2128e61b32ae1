"""Scenes: the load, the body and the probes of an experiment, and their files."""
