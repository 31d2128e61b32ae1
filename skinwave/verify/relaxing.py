"""The standard linear solid: a column, an oscillator, a half-space, and a focus on skin."""

from functools import partial
from itertools import islice

import numpy as np

import fem
from simple_model.layers.compliance import half_space
from simple_model.layers.wavenumber_integral import point_response
from skinwave.verify import references
from skinwave.verify.case import Case, below, misfit
from skinwave.verify.exact import RADII, circling_on_skin
from skinwave.verify.statics import WIDTH
from skinwave.verify.stepping import column_check, drive, order_of_steps, oscillator

ZENER = "standard linear solid: Zener, Elasticity and Anelasticity of Metals (1948)"
SKIN = fem.Material(
    density=1000.0, shear_modulus=7.86e3, poisson=0.49,
    prony=(fem.PronyTerm(modulus=10e3, time=1e-3),),
)  # fmt: skip
MODULUS, TIME = 0.8, 0.7  # of the oscillator's Maxwell branch: stiffness and relaxation time


def column_that_relaxes() -> Case:
    """Steady motion of a column, from very short to very long relaxation times."""
    hz, mu, relaxing = np.array([20.0, 60.0, 120.0, 200.0]), 25e3, 10e3
    checks = []
    for time in (1e-7, 1e-4, 0.5e-3, 3e-3, 1e3):
        term, turned = fem.PronyTerm(modulus=relaxing, time=time), 2j * np.pi * hz * time
        solid = fem.Material(density=1000.0, shear_modulus=mu, poisson=0.0, prony=(term,))
        modulus = 2 * (mu + relaxing * turned / (1 + turned))
        checks.append(column_check(f"relaxation time {time:g} s", solid, hz, modulus))
    return Case(
        title="Standard linear solid: column fixed at its base and pushed at its top, 20 to 200 Hz",
        source=f"Meirovitch (1997), chapter 7: tan(k L) / (k E), complex E (nu = 0) of the {ZENER}",
        mesh="24 cells high, one across",
        checks=tuple(checks),
        note="Complex amplitude of the top under 1 Pa; the worst of four frequencies is shown.",
    )


def oscillator_that_relaxes() -> Case:
    """Time stepping with a Maxwell branch: its order, and its energy balance."""
    exact = references.relaxing_oscillator(2.0, modulus=MODULUS, time=TIME, drive=3.0)
    checks, _ = order_of_steps(_springs(), exact, (0.0, 0.8, 1.0), [200, 400, 800, 1600])
    for dt in (0.01, 30.0):
        name = f"relative energy imbalance after 300 steps of {dt:g} s"
        checks.append(below(name, _imbalance(dt), 1e-10))
    return Case(
        title="Time stepping of an oscillator with a Maxwell branch",
        source="partial fractions of the transform: Flugge, Viscoelasticity (1975), chapter 3; "
        "order: Chung and Hulbert (1993)",
        mesh="one degree of freedom of unit mass and stiffness",
        checks=tuple(checks),
    )


def half_space_that_relaxes() -> Case:
    """Wavenumber integral of a half-space under a vibrating focus."""
    hz = np.array([20.0, 80.0, 140.0, 210.0])
    w = 2 * np.pi * hz
    found = point_response(half_space(SKIN, poisson=0.5), RADII, w, WIDTH)
    turned = 1j * w * 1e-3
    moduli = 7.86e3 + 10e3 * turned / (1 + turned)
    exact = [
        references.gaussian_response(
            partial(references.half_space_kernel, w=a, density=1000, mu=mu, poisson=0.5),
            RADII, width=WIDTH,
        )
        for a, mu in zip(w, moduli, strict=True)
    ]  # fmt: skip
    return Case(
        title="Wavenumber integral (flat-body): a focus on a half-space of standard linear solid",
        source=f"Lamb's kernel with the complex modulus of the {ZENER}; Hankel's integral on the "
        "real axis",
        mesh="none",
        checks=(misfit("20 to 210 Hz, nu = 0.5, relative L2", found, exact, 1e-4, "um"),),
    )


def circling_on_skin_that_relaxes() -> Case:
    """AM and circling focus on a bonded layer."""
    return circling_on_skin(SKIN, "skin as a standard linear solid", half=0.07, growth=1.3)


def _springs() -> fem.Operators:
    plain = oscillator()
    branch = fem.MaxwellBranch(K=MODULUS * plain.K, time=TIME)
    return fem.Operators(**{**vars(plain), "branches": (branch,)})


def _imbalance(dt: float) -> float:
    ops = _springs()
    states = fem.with_energy_balance(ops, fem.transient(ops, drive, dt), drive)
    state, spent = next(islice(states, 300, None))
    return fem.imbalance(spent, fem.stored(ops, state))
