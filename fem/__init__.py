"""Finite-element elastodynamics on tetrahedra.

    M u'' + C u' + K u = P q(t),  probes = S u

(`maxwell` describes what Prony terms and other modulus laws add to K.)

Operators are assembled and factorised once. Index letters of einsum in this package:

    e    element or facet
    q    quadrature point
    a b  nodes of an element
    h    sides of the edges at which facets meet
    d    derivative along an element edge, from corner 0 to another corner
    i j  components of displacement
    c    components of a symmetric tensor: xx, yy, zz, xy, xz, yz
    k l  directions at rest: three in a solid, two in a membrane
    v w  linear pressure functions of a macroelement; in-plane strains xx, yy and 2 xy
    n    node, or degree of freedom
    p    probe, or point
    m    mode, or vector of a basis
    t    time, or body of a training set
    f    frequency
    g    geometry
"""

from fem import nonlinear
from fem.air import air_around
from fem.assembly import Operators, assemble
from fem.boundary import Support
from fem.coat import Coat
from fem.energy import Elastic, EnergyBalance, imbalance, mechanical_energy, with_energy_balance
from fem.finite_strain import Membrane, finite_strain
from fem.harmonic import LineSolver, harmonic
from fem.krylov import NotReduced, reduce
from fem.linear_solver import Factor, available, factorise
from fem.load_and_probe import (
    displacement_operator,
    facet_normals,
    facet_points,
    is_inside,
    locate,
    pressure_operator,
    probe_operator,
)
from fem.maxwell import MaxwellBranch
from fem.plane_stiffness import Tension
from fem.reduced import Poles, ReducedModel, poles, transfer
from fem.static import modes, static
from fem.stress import relaxation, strain_operator
from fem.transient import Diverged, State, at_rest, transient
from simple_model import Material, PronyTerm, from_young, of_law, tabulated
from simple_model.layers.material import PRESETS
from simple_model.typing import Complex

__all__ = [
    "PRESETS", "Coat", "Complex", "Diverged", "Elastic", "EnergyBalance", "Factor", "LineSolver",
    "Material", "MaxwellBranch", "Membrane", "NotReduced", "Operators", "Poles", "PronyTerm",
    "ReducedModel", "State", "Support", "Tension", "air_around", "assemble", "at_rest", "available",
    "displacement_operator", "facet_normals", "facet_points", "factorise", "finite_strain",
    "from_young", "harmonic", "imbalance", "is_inside", "locate", "mechanical_energy", "modes",
    "nonlinear", "of_law", "poles", "pressure_operator", "probe_operator", "reduce", "relaxation",
    "static", "strain_operator", "tabulated", "transfer", "transient", "with_energy_balance",
]  # fmt: skip
