"""Finite-element elastodynamics on tetrahedra.

    M u'' + C u' + K u = P q(t),  probes = S u

(`relaxation` has what generalised Maxwell branches add to K.)

Operators are built once, factorised once, and then only solved with. Index letters of every
einsum in this package: e element, q quadrature point, a b element nodes, i j components,
n node, p probe, t time, f frequency, l derivative along an element edge.
"""

from fem import nonlinear
from fem.air import Added, added_mass
from fem.assembly import Operators, assemble
from fem.boundary import Support
from fem.energy import Spent, audited, imbalance, mean_power, stored
from fem.finite_strain import Elastic, Membrane, finite_strain
from fem.harmonic import harmonic
from fem.linear_solver import Factor, available, factorise
from fem.materials import PRESETS, Material, from_young
from fem.modal import Complex, Poles, exponential_sum, line_response, poles, respond
from fem.reduced import ReducedModel, load_subspace, reduce, transfer
from fem.reduced_nonlinear import StretchingModes, stretching_modes
from fem.relaxation import Branch
from fem.static import modes, static
from fem.surface import (
    facet_normals,
    facet_points,
    load_operator,
    on_surface,
    pressure_force,
    probe_operator,
)
from fem.transient import Diverged, State, at_rest, transient

__all__ = [
    "PRESETS",
    "Added",
    "Branch",
    "Complex",
    "Diverged",
    "Elastic",
    "Factor",
    "Material",
    "Membrane",
    "Operators",
    "Poles",
    "ReducedModel",
    "Spent",
    "State",
    "StretchingModes",
    "Support",
    "added_mass",
    "assemble",
    "at_rest",
    "audited",
    "available",
    "exponential_sum",
    "facet_normals",
    "facet_points",
    "factorise",
    "finite_strain",
    "from_young",
    "harmonic",
    "imbalance",
    "line_response",
    "load_operator",
    "load_subspace",
    "mean_power",
    "modes",
    "nonlinear",
    "on_surface",
    "poles",
    "pressure_force",
    "probe_operator",
    "reduce",
    "respond",
    "static",
    "stored",
    "stretching_modes",
    "transfer",
    "transient",
]
