"""Tetrahedra within a closed surface: meshing, quality, smoothing, curving, built-in meshes."""
