"""Figures, maps, three-dimensional views and films."""
