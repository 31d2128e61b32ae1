"""Mesh and surface files: reading with limits, writing, and import of a body."""
