"""Symmetric tensors as six components xx, yy, zz, xy, xz, yz, in the last axis of an array.

Shear components are those of the tensor, half of the engineering strain. Stress is positive in
tension.
"""

import numpy as np

from simple_model.layers.material import Material
from simple_model.typing import Floats

COMPONENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
TENSOR = tuple(("xyz".index(pair[0]), "xyz".index(pair[1])) for pair in COMPONENTS)
DIAGONAL = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
MEAN = np.outer(DIAGONAL, DIAGONAL) / 3  # e -> tr(e) / 3 of the diagonal
TWICE = 2 - DIAGONAL  # how often a component counts in the product of two tensors


def hooke(material: Material) -> Floats:
    """Hooke's law (6, 6) in Pa at rest, sigma = lam tr(e) I + 2 mu e."""
    return 2 * material.shear_modulus * np.eye(6) + 3 * material.first_lame * MEAN


def energy_root(material: Material) -> Floats:
    """Matrix R (6, 6) in Pa^(1/2) of the strain energy density at rest, e : sigma / 2 = |R e|^2."""
    root: Floats = np.linalg.cholesky(hooke(material) * TWICE[:, None] / 2)
    return root.T


def largest_shear(strain: Floats) -> Floats:
    """Largest engineering shear strain (...) of strains (..., 6), e_1 - e_3."""
    matrices = np.empty((*strain.shape[:-1], 3, 3))
    for c, (i, j) in enumerate(TENSOR):
        matrices[..., i, j] = matrices[..., j, i] = strain[..., c]
    principal = np.linalg.eigvalsh(matrices)
    return np.asarray(principal[..., 2] - principal[..., 0])


def von_mises(stress: Floats) -> Floats:
    """Von Mises stress (...) of stresses (..., 6): (3/2 s : s)^(1/2) of the deviator s."""
    deviator = stress - stress @ MEAN
    return np.sqrt(1.5 * np.maximum((TWICE * deviator**2).sum(axis=-1), 0.0))
