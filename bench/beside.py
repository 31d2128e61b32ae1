"""Comparison with other codes: `python -m bench.beside [assembly | waves | fingertip]`.

The tables of cost use one mesh, material and load, and one process for each code. The skin slab has
free sides, because not every code has absorbing ones, and Poisson's ratio 0.45, up to which plain
quadratic tetrahedra do not lock. skinwave computes the nodal forces beforehand. A code that is not
installed is reported as not measured.

`fingertip` solves the fingertip of the verification by scikit-fem on the same mesh. It prints the
largest difference of the motion of any node, and the values in `skinwave/verify/statics.py`.
"""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from importlib.metadata import version
from multiprocessing import get_context
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_array
from scipy.sparse.linalg import LinearOperator, cg, splu

import fem
import meshes
from bench.codes import CODES, Assembled, Problem
from skinwave.bodies.build import build
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.scene import paper15
from skinwave.scene.scene import PROBES, Body
from skinwave.verify import statics

SKIN = replace(fem.PRESETS["palm"], poisson=0.45)
BODY = Body(material=SKIN, sides="free")
TACTON = "am140-stm20"
ACROSS = (8, 40)  # cells of the blocks of the assembly, the first a warm-up
SIZE = 4.7e-3  # m, elements of the waves
RATE, STEPS = 10_000, 1000  # steps per second, for an error of 1 %; steps that are timed


def assembly() -> None:
    """Print the time of each code to assemble K and M of a block."""
    small, large = (problem(block(n)) for n in ACROSS)
    print(f"K and M of {len(large.cells):,} ten-node tetrahedra")
    print(f"{'code':<12}{'version':<12}{'s':>8}{'ratio':>7}{'energy J':>15}{'mass kg':>10}")
    first = None
    for name, row in each_code(time_assembly, small, large):
        seconds, (energy, mass) = row["seconds"], row["check"]
        first = first or seconds
        print(f"{name:<12}{row['version']:<12}{seconds:8.2f}{seconds / first:7.1f}"
              f"{energy:15.6e}{mass:10.6f}", flush=True)  # fmt: skip


def waves() -> None:
    """Print the time of one and of fifteen Tactons of 1 s on the skin slab, extrapolated."""
    tacton = dict(paper15.tactons())[TACTON]
    scene = paper15.scenes("bench", tacton, {"slab": BODY})["slab"]
    mesh, times = build(BODY, SIZE).mesh, np.arange(STEPS + 1) / RATE
    P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)
    load = {
        "fixed": np.isin(np.arange(len(mesh.points)), mesh.facets["bottom"]),
        "forces": csr_array(P @ scene.pressure(points, times).T),
        "probes": fem.probe_operator(mesh, PROBES),
    }
    started = time.perf_counter()
    prepared = reduce_scene(scene, SolveOptions(h=SIZE))
    ready = time.perf_counter()
    answer(prepared, scene)
    one = time.perf_counter() - started
    fifteen = one + 14 * (time.perf_counter() - ready)
    print(f"{mesh.n_dofs:,} dofs, {RATE:,} steps a second")
    print(f"{'code':<12}{'assemble':>9}{'factorise':>10}{'ms/step':>8}{'1 Tacton':>10}{'ratio':>7}"
          f"{'15':>9}{'ratio':>7}{'to ours':>9}")  # fmt: skip
    print(f"{'skinwave, reduced':<39}{one:9.1f}s{1:7.1f}{fifteen:8.1f}s{1:7.1f}")
    ours = None
    for name, row in each_code(time_steps, problem(mesh), load):
        once, second = row["seconds"] + row["factorise"], row["step"] * RATE
        ours = row["motion"] if ours is None else ours
        apart = np.linalg.norm(row["motion"] - ours) / np.linalg.norm(ours)
        print(f"{name:<12}{row['seconds']:8.2f}s{row['factorise']:9.2f}s"
              f"{1e3 * row['step']:8.2f}{once + second:9.1f}s{(once + second) / one:7.1f}"
              f"{once + 15 * second:8.0f}s{(once + 15 * second) / fifteen:7.0f}{apart:9.1e}",
              flush=True)  # fmt: skip


def fingertip() -> None:
    """Print the motion of the fingertip with and without bone, by scikit-fem."""
    mesh = statics.fingertip()
    for name, materials in statics.FINGERTIPS.items():
        solids = [materials[r] for r in mesh.region.tolist()]
        mu, nu, rho, viscosity = (
            np.array([getattr(m, key) for m in solids])[:, None]
            for key in ("shear_modulus", "poisson", "density", "viscosity")
        )
        tip = replace(problem(mesh), mu=mu, nu=nu, rho=rho)
        body, C = CODES["scikit-fem"][0](tip), CODES["scikit-fem"][0](replace(tip, mu=viscosity)).K
        is_fixed = np.repeat(np.isin(np.arange(len(mesh.points)), mesh.facets["sides"]), 3)
        free = np.flatnonzero(abs(body.to_nodes[np.flatnonzero(is_fixed)]).sum(axis=0) == 0)
        force, w = body.to_nodes.T @ statics.fingertip_push(mesh), 2 * np.pi * statics.FREQUENCY
        motions = zip(statics.fingertip_motion(mesh, materials),
                      (body.K, body.K + 1j * w * C - w**2 * body.M), strict=True)  # fmt: skip
        for own, A in motions:
            found = np.zeros(len(force), A.dtype)
            factor = splu(csc_matrix(A)[free][:, free])
            found[free] = factor.solve(force[free].astype(A.dtype))
            other = body.to_nodes @ found
            print(
                f"{name}: largest difference {np.abs(own - other).max() / np.abs(other).max():.1e}"
            )
            print(statics.fingertip_summary(mesh, other).tolist())


def time_assembly(name: str, small: Problem, large: Problem) -> dict[str, Any]:
    """Return the seconds of a code after a warm-up, with strain energy and mass."""
    with threads(name):
        CODES[name][0](small)
        body = CODES[name][0](large)
        return {"seconds": body.seconds, "check": body.check(large.nodes)}


def time_steps(name: str, given: Problem, load: dict[str, Any]) -> dict[str, Any]:
    """Return the seconds of assembly, factorisation and a step of average acceleration from rest,
    and the displacement (t, p) of the probes.
    """
    with threads(name):
        body, dt, lag = CODES[name][0](given), 1 / RATE, SKIN.viscosity / SKIN.shear_modulus
        is_fixed = np.repeat(load["fixed"], 3)
        free = abs(body.to_nodes[np.flatnonzero(is_fixed)]).sum(axis=0) == 0
        forces, read = body.to_nodes.T @ load["forces"], load["probes"] @ body.to_nodes
        started = time.perf_counter()
        solve = body.factorise(dt / 2 * lag + dt**2 / 4, free)
        factorised = time.perf_counter() - started
        u = v = np.zeros(len(free))
        a = first_acceleration(body, forces[:, [0]].toarray().ravel(), free)
        motion, seconds = [read @ u], []
        for k in range(1, STEPS + 1):
            force, started = forces[:, [k]].toarray().ravel(), time.perf_counter()
            u, v = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
            a = solve(force - body.K @ (u + lag * v))
            u, v = u + dt**2 / 4 * a, v + dt / 2 * a
            motion.append(read @ u)
            seconds.append(time.perf_counter() - started)
    # The median ignores steps delayed by other processes.
    return {"seconds": body.seconds, "factorise": factorised, "step": np.median(seconds),
            "motion": np.array(motion)}  # fmt: skip


def first_acceleration(body: Assembled, force: np.ndarray, free: np.ndarray) -> np.ndarray:
    n = len(force)
    M = LinearOperator((n, n), matvec=lambda x: np.where(free, body.M @ (free * x), x), dtype=float)
    a, failed = cg(M, free * force, maxiter=5000)
    if failed:
        raise ArithmeticError("the mass matrix could not be inverted")
    return a


def threads(name: str) -> contextlib.AbstractContextManager[Any]:
    if name != "ngsolve":
        return contextlib.nullcontext()
    from ngsolve import TaskManager

    return TaskManager()


def block(across: int) -> meshes.TetMesh:
    line = np.linspace(-0.05, 0.05, across + 1)
    return meshes.extrude(line, line, np.linspace(-0.02, 0, across // 4 + 1))


def problem(mesh: meshes.TetMesh) -> Problem:
    return Problem(
        nodes=np.array(mesh.points), cells=np.array(mesh.tets), mu=SKIN.shear_modulus,
        surface=meshes.boundary_facets(mesh.tets[:, :4]), nu=SKIN.poisson, rho=SKIN.density,
    )  # fmt: skip


def each_code(run: Callable[..., dict], *given: Any) -> Iterator[tuple[str, dict]]:
    """Yield the measurements of each installed code, from a process of its own."""
    for name, (_, package) in CODES.items():
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
            try:
                row = alone.submit(run, name, *given).result()
                yield name, row | {"version": version(package)[:11]}
            except ImportError as error:
                print(f"{name:<12}not measured: {error}", flush=True)


if __name__ == "__main__":
    tables = {"assembly": assembly, "waves": waves, "fingertip": fingertip}
    for table in sys.argv[1:] or tables:
        tables[table]()
