"""Meshes, loads and bodies that several verification cases share."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import fem
import meshes
from meshes import TetMesh
from skinwave.typing import Array

WIDTH = 4.35e-3  # m, standard deviation of the Gaussian focus
RADII = np.array([0, 5, 10, 15, 20]) * 1e-3  # m
QUARTER = {"bottom": "xyz", "right": "xyz", "back": "xyz", "left": "x", "front": "y"}
SLIDING = {"left": "x", "right": "x", "front": "y", "back": "y"}
FOREARM: dict[str, Any] = {"density": 1000.0, "shear_modulus": 7.86e3, "viscosity": 5.03}
THICKNESS = 1e-4  # m, of paper
PAPER = {"bending_stiffness": 4e9 * 1e-12 / 12 / 0.91, "mass_per_area": 0.08}
SOURCES = {  # of several cases
    "Achenbach": "Achenbach, Wave Propagation in Elastic Solids (1973)",
    "Boussinesq": "Boussinesq's kernel; Gradshteyn and Ryzhik, 6.618.1",
    "Hankel": "Hankel's integral on the real axis: Sneddon, Fourier Transforms (1951)",
    "Hughes": "Hughes, The Finite Element Method (1987), chapter 9",
    "Lamb": "Lamb, Phil Trans R Soc A 203:1 (1904)",
    "Lysmer": "Lysmer and Kuhlemeyer, J Eng Mech Div ASCE 95:859 (1969)",
    "Meirovitch": "Meirovitch, Principles and Techniques of Vibrations (1997)",
    "Zener": "standard linear solid: Zener, Elasticity and Anelasticity of Metals (1948)",
}


def unit_solid(poisson: float) -> fem.Material:
    """Return a material of density 1 and shear modulus 1."""
    return fem.Material(density=1, shear_modulus=1, poisson=poisson)


def lossy_paper(thickness: float, lag: float) -> fem.Material:
    """Return the material of a sheet like `PAPER`, whose viscosity is the lag times its modulus."""
    mu = 12 * PAPER["bending_stiffness"] * (1 - 0.3**2) / thickness**3 / 2.6
    density = PAPER["mass_per_area"] / thickness
    return fem.Material(density=density, shear_modulus=mu, poisson=0.3, viscosity=lag * mu)


def gaussian(width: float = WIDTH) -> Callable[[Array], Array]:
    """Return a pressure of 1 Pa at the origin, as a function of points (p, 2 or 3)."""
    return lambda x: np.exp(-(x[:, :2] ** 2).sum(axis=1) / 2 / width**2)


def push(mesh: TetMesh, pressure: Callable[[Array], Array] | None = None) -> Array:
    """Return nodal forces (3 n,) in N of a pressure on the top; 1 Pa by default."""
    points = fem.facet_points(mesh)
    return fem.pressure_operator(mesh) @ (pressure(points) if pressure else np.ones(len(points)))


def read(mesh: TetMesh, u: Array, x: ArrayLike, y: float = 0.0) -> Array:
    """Return the displacement (p,) into the body at points x (p,), y of the top, for u (3 n,)."""
    x = np.atleast_1d(x)
    return fem.probe_operator(mesh, np.column_stack([x, np.full(len(x), y)])) @ u


def quarter_space(length: float, growth: float, radius: float, h: float = 0.0025) -> TetMesh:
    """Return a quarter of a block, fine within a radius of the focus."""
    across = meshes.graded_axis(length, h, meshes.Grading(radius=radius, growth=growth))
    down = meshes.graded_axis(length, h, meshes.Grading(radius=0.0, growth=growth))
    return meshes.extrude(across, across, -down[::-1])


def column(
    lengths: list[float], cells: int, solids: dict[int, fem.Material]
) -> tuple[fem.Operators, Array, Array]:
    """Return a column of layers, from the base upwards, one cell wide with sliding sides.

    Return its operators, the force (3 n,) of 1 Pa, and the weights (3 n,) of the mean of its top.
    """
    ends = np.concatenate([[0], np.cumsum(lengths)]) - sum(lengths)
    z = np.concatenate([[ends[0]], *(np.linspace(a, b, cells + 1)[1:] for a, b in pairwise(ends))])
    side = [0.0, min(lengths) / cells * 2]
    mesh = meshes.extrude(side, side, z)
    middle = mesh.points[mesh.tets[:, :4]].mean(axis=1)[:, 2]
    mesh = replace(mesh, region=np.searchsorted(ends[1:-1], middle))
    ops = fem.assemble(mesh, solids, fixed={"bottom": "xyz", **SLIDING})
    force = push(mesh)
    return ops, force, force / np.abs(force).sum()


def frequencies(mesh: TetMesh, material: fem.Material, fixed: dict[str, str], n: int) -> Array:
    """Return the n lowest natural frequencies in Hz."""
    return fem.modes(fem.assemble(mesh, material, fixed=fixed), n)[0]


def nearest(values: Array, reference: float) -> float:
    """Return the value with the smallest relative distance to a reference."""
    return float(values[np.argmin(np.abs(values / reference - 1))])
