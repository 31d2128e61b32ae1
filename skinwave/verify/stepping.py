"""Time stepping: order, numerical damping, energy, extreme steps; and the scaling of units."""

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

import numpy as np
from scipy import sparse

import fem
import meshes
from skinwave.verify import references
from skinwave.verify.case import Case, Check, Plot, below, largest, order, relative
from skinwave.verify.references import Complex, Floats
from skinwave.verify.statics import column, layered_column_mesh

CHUNG = "Chung and Hulbert, J Appl Mech 60:371 (1993)"
SKIN: dict[str, Any] = {"density": 1000.0, "shear_modulus": 25e3, "poisson": 0.4999}


def oscillator(damping: float = 0.0) -> fem.Operators:
    """One degree of freedom of unit mass and stiffness."""
    K, C, M, R = (sparse.csr_array([[value]]) for value in (1.0, damping, 1.0, 0.0))
    return fem.Operators(K=K, C=C, M=M, R=R, free=np.array([0]), n_dofs=1)


def drive(t: float) -> Floats:
    """Force (1,) on an oscillator."""
    return np.array([np.sin(3 * t)])


def order_in_time() -> Case:
    """A driven, damped oscillator from rest."""
    exact = references.driven_oscillator(2.0, damping=0.2, drive=3.0)
    steps, radii = [100, 200, 400, 800], (0.0, 0.5, 0.8, 1.0)
    checks, errors = order_of_steps(oscillator(0.2), exact, radii, steps)
    sizes = 1 / np.array(steps)
    lines = {f"spectral radius {radius:g}": (sizes, e) for radius, e in errors.items()}
    lines["slope 2"] = (sizes, (checks[-1].value * (sizes / sizes[-1]) ** 2).tolist())
    return Case(
        title="Time stepping has order two",
        source="driven oscillator: Meirovitch (1997), sections 3.1 and 3.2; order: Chung and "
        "Hulbert (1993)",
        mesh="one degree of freedom; 100, 200, 400 and 800 steps",
        checks=tuple(checks),
        plot=Plot(x="1 / steps", y="error", log=True, drawn=("slope 2",), lines=lines),
    )


def order_of_steps(
    ops: fem.Operators, exact: float, radii: Iterable[float], steps: list[int]
) -> tuple[list[Check], dict[float, list[float]]]:
    """Checks of the error of a driven oscillator after 2 s in so many steps, and these errors."""
    checks, errors = list[Check](), dict[float, list[float]]()
    for radius in radii:
        errors[radius] = []
        for n in steps:
            states = fem.transient(ops, drive, 2.0 / n, spectral_radius=radius)
            last = next(islice(states, n, None)).displacement[0]
            errors[radius].append(float(abs(last - exact)))
        name = f"spectral radius {radius:g}"
        checks.append(order(f"order, {name}", 1 / np.array(steps), errors[radius], 2, 0.1))
        checks.append(below(f"error after 2 s, smallest step, {name}", errors[radius][-1], 1e-5))
    return checks, errors


def numerical_damping() -> Case:
    """The map from one step to the next has the published spectral radius and period."""
    checks = []
    for radius in (0.5, 0.8, 0.9, 1.0):
        for wdt in (0.1, 0.3, 1.0):
            theirs = _eigenvalue(references.generalized_alpha_step(wdt, radius))
            ours = _eigenvalue(np.array(list(_stepped(wdt, radius))).T)
            name = f"radius {radius:g}, w dt = {wdt:g}:"
            if radius < 1:
                checks.append(relative(f"{name} loss a step", 1 - abs(ours), 1 - abs(theirs), 1e-3))
            ours, theirs = wdt / np.angle(ours) - 1, wdt / np.angle(theirs) - 1
            checks.append(relative(f"{name} period error", ours, theirs, 1e-3))
    return Case(
        title="Numerical damping and period error of generalized-alpha",
        source=CHUNG,
        mesh="one degree of freedom, one step from each unit state",
        checks=tuple(checks),
    )


def energy_kept() -> Case:
    """Average acceleration conserves the energy of free vibration."""
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    ops = fem.assemble(mesh, fem.Material(**SKIN))
    _, shapes = fem.modes(ops, 3)
    zero, free, u = np.zeros(mesh.n_dofs), ops.free, shapes.sum(axis=1)
    a = ops.expand(fem.factorise(ops.M).solve(-(ops.K @ u[free])))
    start = fem.State(time=0.0, displacement=u, velocity=zero, acceleration=a)
    states = islice(fem.transient(ops, lambda t: zero, 1e-4, initial=start), 4001)
    energies = np.array([fem.stored(ops, state) for state in states])
    return Case(
        title="Free vibration conserves energy, 4,000 steps",
        source="Hughes, The Finite Element Method (1987), chapter 9: average acceleration",
        mesh="block of 2 by 2 by 1 cells, nu = 0.4999",
        checks=(below("largest relative drift", np.abs(energies / energies[0] - 1).max(), 1e-10),),
    )


def extreme_steps() -> Case:
    """A step load with time steps a hundred times too large and too small."""
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    ops = fem.assemble(mesh, fem.Material(**SKIN))
    P = fem.load_operator(mesh)
    push = P @ np.ones(P.shape[1])
    period = 1 / fem.modes(ops, 1)[0][0]
    rest = fem.static(ops, push)[ops.free]
    checks = []
    for radius in (0.0, 1.0):
        for factor in (100.0, 0.01):
            dt = factor * period / 40
            states = fem.transient(ops, lambda t: push, dt, spectral_radius=radius)
            moved = (s.displacement[ops.free] for s in islice(states, 1001))
            ratio = np.sqrt(max(x @ ops.K @ x for x in moved) / (rest @ ops.K @ rest))
            what = f"spectral radius {radius:g}, dt = period x {factor / 40:g}"
            checks.append(Check(what=f"{what} (excess over 2)", value=float(ratio), reference=2.0,
                                error=max(0.0, float(ratio) - 2), bar=1e-6))  # fmt: skip
    return Case(
        title="Time steps 100 times too large and too small stay bounded",
        source="Energy balance of a step load from rest, u K u / 2 <= f u: Hughes (1987), chapter "
        "9; Chung and Hulbert (1993): stable for any step",
        mesh="block of 2 by 2 by 1 cells, nu = 0.4999; 1000 steps of each",
        checks=tuple(checks),
        note="Largest energy norm of the motion over that at rest, which cannot exceed 2.",
    )


def columns() -> Case:
    """Steady motion of a column: no viscosity to overdamped, foam to steel."""
    hz, checks = np.array([20.0, 60.0, 120.0]), []
    for density, mu, lag in (
        (1000.0, 25e3, 0.0), (1000.0, 25e3, 2e-4), (1000.0, 25e3, 0.1), (30.0, 5e3, 1e-3),
        (7800.0, 77e9, 1e-6),
    ):  # fmt: skip
        solid = fem.Material(density=density, shear_modulus=mu, poisson=0.0, viscosity=lag * mu)
        name = f"density {density:g}, modulus {mu:g} Pa, viscosity {lag * mu:g} Pa s"
        checks.append(column_check(name, solid, hz, 2 * mu * (1 + 2j * np.pi * hz * lag)))
    return Case(
        title="Kelvin-Voigt column, fixed at its base and pushed at its top, 20 to 120 Hz",
        source="Meirovitch (1997), chapter 7: tan(k L) / (k E), complex E (nu = 0)",
        mesh="24 cells high, one across; 0.6 to 12 elements a wavelength and more",
        checks=tuple(checks),
        note="Complex amplitude of the top under 1 Pa; the worst of three frequencies is shown.",
    )


def column_check(name: str, solid: fem.Material, hz: Floats, modulus: Complex) -> Check:
    """Check of the top of a column of 50 mm, whose modulus of compression is complex."""
    ops, force, read = column(layered_column_mesh([0.05], 24), {0: solid})
    found = fem.harmonic(ops, force, hz) @ read
    exact = references.layered_column(2 * np.pi * hz, [0.05], [solid.density], [modulus])
    return largest(name, found, exact, 0.005, "um")


def units() -> Case:
    """The same body in units of length, time and mass a million times larger and smaller."""
    base, checks = _answers(1.0, 1.0, 1.0), []
    for name, place in (("length", 0), ("time", 1), ("mass", 2)):
        for factor in (1e-6, 1e-3, 1e3, 1e6):
            scales = [1.0, 1.0, 1.0]
            scales[place] = factor
            change = np.abs(_answers(*scales) / base - 1).max()
            checks.append(below(f"unit of {name} x {factor:g}: largest change", change, 1e-8))
    return Case(
        title="Units scaled by a millionth to a million",
        source="Dimensional analysis: Buckingham, Phys Rev 4:345 (1914)",
        mesh="block of 4 by 4 by 2 cells, dashpots at its sides",
        checks=tuple(checks),
        note="Static, steady and transient responses and natural frequencies, made dimensionless.",
    )


def _answers(length: float, time: float, mass: float) -> Floats:
    """Dimensionless responses of one body, given in units that are these times smaller."""
    pascal = mass / length / time**2
    mesh = meshes.block((0.02 * length, 0.02 * length, 0.01 * length), 0.005 * length)
    solid = fem.Material(
        density=1000 * mass / length**3, shear_modulus=25e3 * pascal, poisson=0.49,
        viscosity=5 * pascal * time,
    )  # fmt: skip
    ops = fem.assemble(mesh, solid, absorbing="sides")
    points, P = fem.facet_points(mesh)[:, :2], fem.load_operator(mesh)
    force = pascal * (P @ np.exp(-(points**2).sum(axis=1) / 2 / (4e-3 * length) ** 2))
    S = fem.probe_operator(mesh, np.array([[0, 0], [0.005, 0.0025]]) * length)
    steps = fem.transient(ops, lambda t: force * np.sin(600 * t / time), 5e-4 * time)
    late = next(islice(steps, 40, None)).displacement
    moved = [fem.static(ops, force), *fem.harmonic(ops, force, [140 / time]), late]
    frequencies = fem.modes(ops, 3)[0] * time
    return np.concatenate([*(S @ u / length for u in moved), frequencies])


def _eigenvalue(matrix: Floats) -> complex:
    """The eigenvalue of the motion itself: the complex one above the real axis."""
    values = np.linalg.eigvals(matrix)
    return complex(values[np.argmax(values.imag)])


def _stepped(dt: float, radius: float) -> Iterator[list[float]]:
    """(u, dt v, dt^2 a) after a step of ours from each unit state, which need not be in balance.

    An unbalanced start is the balanced one under a force that acts at time 0 only; it enters the
    step's balance with the weight a_f and is taken back out.
    """
    a_m, a_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma, beta = 0.5 - a_m + a_f, (1 - a_m + a_f) ** 2 / 4
    for u, v, a in np.eye(3):
        one = [np.array([value]) for value in (u, v / dt, a / dt**2)]
        start = fem.State(time=0.0, displacement=one[0], velocity=one[1], acceleration=one[2])
        push = a / dt**2 + u

        def force(t: float, push: float = push) -> Floats:
            return np.array([push * (t == 0)])

        states = fem.transient(oscillator(), force, dt, spectral_radius=radius, initial=start)
        after = next(islice(states, 1, None))
        extra = a_f * push / ((1 - a_m) + (1 - a_f) * beta * dt**2)
        yield [
            after.displacement[0] - dt**2 * beta * extra,
            dt * (after.velocity[0] - dt * gamma * extra),
            dt**2 * (after.acceleration[0] - extra),
        ]
