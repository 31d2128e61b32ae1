"""Time stepping, damping and units."""

from dataclasses import replace
from itertools import islice

import numpy as np
from scipy import sparse

import fem
import meshes
from skinwave.typing import Complex, Floats
from skinwave.verify import references
from skinwave.verify.case import Check, Checks, below, case, order, relative
from skinwave.verify.setups import SOURCES, column, gaussian, push

SKIN = fem.Material(density=1000.0, shear_modulus=25e3, poisson=0.4999)
BLOCK = "block of 2 by 2 by 1 cells, nu = 0.4999"


def oscillator(damping: float = 0.0) -> fem.Operators:
    """Return one degree of freedom with unit mass and stiffness."""
    K, C, M, R = (sparse.csr_array([[value]]) for value in (1.0, damping, 1.0, 0.0))
    return fem.Operators(K=K, C=C, M=M, R=R, free=np.array([0]), n_dofs=1)


@case(f"{SOURCES['Hughes']}: average acceleration", mesh=BLOCK)
def energy() -> Checks:
    """Free vibration conserves energy, 4,000 steps."""
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    ops = fem.assemble(mesh, SKIN)
    _, shapes = fem.modes(ops, 3)
    zero, free, u = np.zeros(mesh.n_dofs), ops.free, shapes.sum(axis=1)
    a = ops.expand(fem.factorise(ops.M).solve(-(ops.K @ u[free])))
    start = fem.State(time=0.0, displacement=u, velocity=zero, acceleration=a)
    states = islice(fem.transient(ops, lambda t: zero, 1e-4, initial=start), 4001)
    energies = np.array([fem.mechanical_energy(ops, state) for state in states])
    yield below("largest relative drift", np.abs(energies / energies[0] - 1).max(), 1e-10)


@case(
    f"Energy balance of a step load from rest, u K u / 2 <= f u: {SOURCES['Hughes']}: stable for "
    "any step",
    mesh=f"{BLOCK}; 1000 steps of each",
    note="Values are the largest energy norm of the motion over that at rest, at most 2.",
)
def extreme_steps() -> Checks:
    """Time steps 100 times too large and too small."""
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    ops, force = fem.assemble(mesh, SKIN), push(mesh)
    period = 1 / fem.modes(ops, 1)[0][0]
    rest = fem.static(ops, force)[ops.free]
    for factor in (2.5, 2.5e-4):
        states = fem.transient(ops, lambda t: force, factor * period)
        motion = (s.displacement[ops.free] for s in islice(states, 1001))
        ratio = float(np.sqrt(max(x @ ops.K @ x for x in motion) / (rest @ ops.K @ rest)))
        what = f"dt = period x {factor:g} (excess over 2)"
        yield Check(what=what, value=ratio, reference=2.0, error=max(0.0, ratio - 2), bar=1e-6)


@case(
    f"{SOURCES['Meirovitch']}, chapter 7: tan(k L) / (k E), complex E (nu = 0); {SOURCES['Zener']}",
    mesh="24 cells high, one across; at least 0.6 elements per wavelength",
    note="Complex amplitude of the top under 1 Pa, at the frequency with the largest error.",
)
def columns() -> Checks:
    """Column fixed at its base and pushed at its top: Kelvin-Voigt and standard linear solid."""
    hz = np.array([20.0, 60.0, 120.0])
    for density, mu, lag in (
        (1000.0, 25e3, 0.0), (1000.0, 25e3, 2e-4), (1000.0, 25e3, 0.1),
        (30.0, 5e3, 1e-3), (7800.0, 77e9, 1e-6),
    ):  # fmt: skip
        solid = fem.Material(density=density, shear_modulus=mu, poisson=0.0, viscosity=lag * mu)
        name = f"density {density:g}, modulus {mu:g} Pa, viscosity {lag * mu:g} Pa s"
        yield _column_check(name, solid, hz, 2 * mu * (1 + 2j * np.pi * hz * lag))
    hz, mu, relaxing = np.array([20.0, 60.0, 120.0, 200.0]), 25e3, 10e3
    for time in (1e-7, 1e-4, 0.5e-3, 3e-3, 1e3):
        term, turned = fem.PronyTerm(modulus=relaxing, time=time), 2j * np.pi * hz * time
        solid = fem.Material(density=1000.0, shear_modulus=mu, poisson=0.0, prony=(term,))
        modulus = 2 * (mu + relaxing * turned / (1 + turned))
        yield _column_check(f"relaxation time {time:g} s", solid, hz, modulus)


@case(
    "partial fractions: Flugge, Viscoelasticity (1975), chapter 3; "
    f"{SOURCES['Meirovitch']}, sections 3.1 and 3.2; order: {SOURCES['Hughes']}",
    mesh="one degree of freedom of unit mass and stiffness, damped or with a Maxwell branch",
)
def order_in_time() -> Checks:
    """Time stepping of a driven oscillator: order two and energy balance."""
    exact = references.driven_oscillator(2.0, damping=0.2, drive=3.0)
    yield from _order_of_steps(oscillator(0.2), exact, 100, "damped")
    plain = oscillator()
    modulus, time = 0.8, 0.7  # of the Maxwell branch: stiffness and relaxation time
    ops = replace(plain, branches=(fem.MaxwellBranch(K=modulus * plain.K, time=time),))
    exact = references.driven_oscillator(2.0, modulus=modulus, time=time, drive=3.0)
    yield from _order_of_steps(ops, exact, 200, "with a Maxwell branch")
    for dt in (0.01, 30.0):
        states = fem.with_energy_balance(ops, fem.transient(ops, _drive, dt), _drive)
        state, spent = next(islice(states, 300, None))
        what = f"relative energy imbalance after 300 steps of {dt:g} s"
        yield below(what, fem.imbalance(spent, fem.mechanical_energy(ops, state)), 1e-10)


@case(
    "Dimensional analysis: Buckingham, Phys Rev 4:345 (1914)",
    mesh="block of 4 by 4 by 2 cells, dashpots at its sides",
    note="Dimensionless static, steady and transient responses and natural frequencies.",
)
def units() -> Checks:
    """Units scaled by a millionth to a million."""
    base = _responses()
    for name in ("length", "time", "mass"):
        for factor in (1e-6, 1e-3, 1e3, 1e6):
            change = np.abs(_responses(**{name: factor}) / base - 1).max()
            yield below(f"unit of {name} x {factor:g}: largest change", change, 1e-8)


def _responses(length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> Floats:
    """Return dimensionless responses of one body, in units that are these factors smaller."""
    pascal = mass / length / time**2
    mesh = meshes.block((0.02 * length, 0.02 * length, 0.01 * length), 0.005 * length)
    solid = fem.Material(
        density=1000 * mass / length**3, shear_modulus=25e3 * pascal, poisson=0.49,
        viscosity=5 * pascal * time,
    )  # fmt: skip
    ops = fem.assemble(mesh, solid, absorbing="sides")
    force = pascal * push(mesh, gaussian(4e-3 * length))
    S = fem.probe_operator(mesh, np.array([[0, 0], [0.005, 0.0025]]) * length)
    steps = fem.transient(ops, lambda t: force * np.sin(600 * t / time), 5e-4 * time)
    late = next(islice(steps, 40, None)).displacement
    motions = [fem.static(ops, force), *fem.harmonic(ops, force, [140 / time]), late]
    return np.concatenate([*(S @ u / length for u in motions), fem.modes(ops, 3)[0] * time])


def _drive(t: float) -> Floats:
    """Return the force (1,) on an oscillator."""
    return np.array([np.sin(3 * t)])


def _order_of_steps(ops: fem.Operators, exact: float, fewest: int, name: str) -> Checks:
    """Check a driven oscillator after 2 s in `fewest` to eight times as many steps."""
    steps = [fewest, 2 * fewest, 4 * fewest, 8 * fewest]
    errors = []
    for n in steps:
        states = fem.transient(ops, _drive, 2.0 / n)
        errors.append(abs(next(islice(states, n, None)).displacement[0] - exact))
    yield order(f"order, {name}", 1 / np.array(steps), errors, 2, 0.1)
    yield below(f"error after 2 s, smallest step, {name}", errors[-1], 1e-5)


def _column_check(name: str, solid: fem.Material, hz: Floats, modulus: Complex) -> Check:
    """Check the top of a column of 50 mm with a complex modulus of compression."""
    ops, force, top = column([0.05], 24, {0: solid})
    exact = references.layered_column(2 * np.pi * hz, [0.05], [solid.density], [modulus])
    return relative(name, fem.harmonic(ops, force, hz) @ top, exact, 0.005, "um")
