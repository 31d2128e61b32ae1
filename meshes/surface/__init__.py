"""Triangulated surfaces: checks, repair, self-intersection, alignment and level sets."""
