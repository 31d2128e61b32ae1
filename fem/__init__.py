"""Finite-element elastodynamics on tetrahedra.

    M u'' + C u' + K u = P q(t),  probes = S u

(`maxwell` has what Prony terms and other modulus laws add to K.)

Operators are built once, factorised once, and then only solved with. Index letters of every
einsum in this package:

    e    element or facet
    q    quadrature point
    a b  nodes of an element
    h    sides of the edges at which facets meet
    d    derivative along an element edge, from corner 0 to another corner
    i j  components of displacement
    c    components of a symmetric tensor: xx, yy, zz, xy, xz, yz
    k l  directions at rest, of which a membrane has two
    v w  linear pressure functions of a macroelement; in-plane strains xx, yy and 2 xy
    n    node, or degree of freedom
    p    probe, or point
    m    mode, or vector of a basis
    t    time, or body of a training set
    f    frequency
    g    geometry
"""

from fem import nonlinear
from fem.added_mass import added_mass
from fem.assembly import Operators, assemble
from fem.boundary import Support
from fem.coat import Coat
from fem.energy import EnergyBalance, imbalance, mean_power, stored, with_energy_balance
from fem.finite_strain import Elastic, Membrane, finite_strain, shell_stiffness
from fem.harmonic import LineSolver, harmonic
from fem.interior import displacement_operator, is_inside, locate
from fem.krylov import NotReduced, load_subspace, reduce
from fem.linear_solver import Factor, available, factorise
from fem.load_and_probe import (
    facet_normals,
    facet_points,
    load_operator,
    node_operator,
    on_surface,
    probe_operator,
    surface_frame,
)
from fem.maxwell import DispersiveBranch, MaxwellBranch
from fem.plane_stiffness import Tension
from fem.reduced import (
    Poles,
    ReducedModel,
    exponential_sum,
    impulse_response,
    line_response,
    poles,
    transfer,
)
from fem.reduced_nonlinear import StretchingModes, stretching_modes
from fem.static import modes, static
from fem.stress import (
    SolidPart,
    materials_at,
    nodal_strain,
    relaxation,
    relaxed,
    solid_parts,
    strain_operator,
)
from fem.transient import Diverged, State, at_rest, transient
from fem.typing import Complex
from simple_model import Material, PronyTerm, from_young, of_law, tabulated
from simple_model.layers.material import PRESETS

__all__ = [
    "PRESETS", "Coat", "Complex", "DispersiveBranch", "Diverged", "Elastic", "EnergyBalance",
    "Factor", "LineSolver", "Material", "MaxwellBranch", "Membrane", "NotReduced", "Operators",
    "Poles", "PronyTerm", "ReducedModel", "SolidPart", "State", "StretchingModes", "Support",
    "Tension", "added_mass", "assemble", "at_rest", "available", "displacement_operator",
    "exponential_sum", "facet_normals", "facet_points", "factorise", "finite_strain", "from_young",
    "harmonic", "imbalance", "impulse_response", "is_inside", "line_response", "load_operator",
    "load_subspace", "locate", "materials_at", "mean_power", "modes", "nodal_strain",
    "node_operator", "nonlinear", "of_law", "on_surface", "poles",
    "probe_operator", "reduce", "relaxation", "relaxed", "shell_stiffness", "solid_parts", "static",
    "stored", "strain_operator", "stretching_modes", "surface_frame",
    "tabulated", "transfer", "transient", "with_energy_balance",
]  # fmt: skip
