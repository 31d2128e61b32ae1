"""The standard linear solid: a column, an oscillator, a half-space, and a focus on skin."""

from functools import partial
from itertools import islice

import numpy as np

import fem
from simple_model.compliance import half_space
from simple_model.flat_body import point_response
from skinwave.verify import references
from skinwave.verify.case import Case, Check, below, largest, misfit, order
from skinwave.verify.exact import RADII, circling_on_skin
from skinwave.verify.references import Floats
from skinwave.verify.statics import WIDTH, column, layered_column_mesh
from skinwave.verify.stepping import oscillator

ZENER = "standard linear solid: Zener, Elasticity and Anelasticity of Metals (1948)"
SKIN = fem.Material(
    density=1000.0, shear_modulus=7.86e3, poisson=0.49,
    prony=(fem.PronyTerm(modulus=10e3, time=1e-3),),
)  # fmt: skip
MODULUS, TIME = 0.8, 0.7  # of the oscillator's Maxwell branch: stiffness and relaxation time


def column_that_relaxes() -> Case:
    """Steady motion of a column, from very short to very long relaxation times."""
    length, mu, relaxing = 0.05, 25e3, 10e3
    hz = np.array([20.0, 60.0, 120.0, 200.0])
    mesh, w = layered_column_mesh([length], 24), 2 * np.pi * hz
    checks = []
    for time in (1e-7, 1e-4, 0.5e-3, 3e-3, 1e3):
        solid = fem.Material(
            density=1000.0, shear_modulus=mu, poisson=0.0,
            prony=(fem.PronyTerm(modulus=relaxing, time=time),),
        )  # fmt: skip
        ops, force, read = column(mesh, {0: solid})
        found = fem.harmonic(ops, force, hz) @ read
        modulus = 2 * (mu + relaxing * 1j * w * time / (1 + 1j * w * time))
        exact = references.layered_column(w, [length], [1000.0], [modulus])
        checks.append(largest(f"relaxation time {time:g} s", 1e6 * found, 1e6 * exact, 0.005, "um"))
    return Case(
        title="Standard linear solid: column fixed at its base and pushed at its top, 20 to 200 Hz",
        source=f"Meirovitch (1997), chapter 7: tan(k L) / (k E), complex E (nu = 0) of the {ZENER}",
        mesh="24 cells high, one across",
        checks=tuple(checks),
        note="Complex amplitude of the top under 1 Pa; the worst of four frequencies is shown.",
    )


def oscillator_that_relaxes() -> Case:
    """Time stepping with a Maxwell branch: its order, and its energy balance."""
    steps = [200, 400, 800, 1600]
    sizes, checks = 1 / np.array(steps), list[Check]()
    for radius in (0.0, 0.8, 1.0):
        errors = [_error(n, radius) for n in steps]
        checks.append(order(f"order, spectral radius {radius:g}", sizes, errors, 2, 0.1))
        name = f"error after 2 s, smallest step, spectral radius {radius:g}"
        checks.append(below(name, errors[-1], 1e-5))
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
        checks=(misfit("20 to 210 Hz, nu = 0.5, relative L2", 1e6 * found, 1e6 * np.array(exact),
                       1e-4, "um"),),
    )  # fmt: skip


def circling_on_skin_that_relaxes() -> Case:
    """AM and circling focus on a bonded layer."""
    return circling_on_skin(SKIN, "skin as a standard linear solid")


def _springs() -> fem.Operators:
    plain = oscillator()
    branch = fem.MaxwellBranch(K=MODULUS * plain.K, time=TIME)
    return fem.Operators(**{**vars(plain), "branches": (branch,)})


def _drive(t: float) -> Floats:
    return np.array([np.sin(3 * t)])


def _error(n: int, radius: float) -> float:
    """Error after 2 s in n steps."""
    states = fem.transient(_springs(), _drive, 2.0 / n, spectral_radius=radius)
    exact = references.relaxing_oscillator(2.0, modulus=MODULUS, time=TIME, drive=3.0)
    return float(abs(next(islice(states, n, None)).displacement[0] - exact))


def _imbalance(dt: float) -> float:
    ops = _springs()
    with_energy_balance = fem.with_energy_balance(ops, fem.transient(ops, _drive, dt), _drive)
    state, spent = next(islice(with_energy_balance, 300, None))
    return fem.imbalance(spent, fem.stored(ops, state))
