"""Shapes of bodies: structured grids of sheets and blocks, and the level set of a palm."""
