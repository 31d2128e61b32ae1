"""`python -m bench [elements across]`: assembly by every installed code, in turn, and growth."""

import os
import platform
import sys
import time
from importlib.metadata import PackageNotFoundError, version

import numpy as np

import fem
import meshes
from bench.assembly import CODES
from skinwave.effort import peak_memory


def block(across: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat block of 6 across^2 across/4 tetrahedra."""
    line = np.linspace(-0.05, 0.05, across + 1)
    mesh = meshes.extrude(line, line, np.linspace(-0.02, 0, across // 4 + 1), order=1)
    return np.array(mesh.points), np.array(mesh.tets)


def assembly(across: int) -> None:
    small, large = block(8), block(across)
    print(f"\nK and M of {len(large[1]):,} ten-node tetrahedra, {os.cpu_count()} cores")
    print(f"{'code':<12} {'version':<12} {'s':>7} {'ratio':>7}  {'energy J':>14} {'mass kg':>10}")
    first = None
    for name, assemble in CODES.items():
        try:
            number = version(name)
        except PackageNotFoundError:
            print(f"{name:<12} not installed")
            continue
        try:
            assemble(*small)
            seconds, (energy, mass) = min(assemble(*large) for _ in range(2))
        except Exception as error:  # a peer that fails is a row of the table, not the end of it
            print(f"{name:<12} {number:<12} failed: {type(error).__name__}: {error}")
            continue
        first = first or seconds
        print(
            f"{name:<12} {number:<12} {seconds:7.2f} {seconds / first:7.1f}  "
            f"{energy:14.6e} {mass:10.6f}"
        )


def growth() -> None:
    print("\ngrowth: skin slab, K + s C + s^2 M, first installed solver")
    print(f"{'unknowns':>9} {'assemble s':>11} {'factorise s':>12} {'solve s':>8} {'peak GiB':>9}")
    sizes, costs = [], []
    for h in (7e-3, 4.5e-3, 3.4e-3, 2.6e-3, 2.0e-3):
        grading = meshes.Grading(radius=0.03, growth=1.25, coarsest=0.006)
        mesh = meshes.block((0.1, 0.1, 0.015), h, grading=grading)
        t0 = time.perf_counter()
        ops = fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
        t1 = time.perf_counter()
        factor = fem.factorise(ops.K + 1257 * ops.C + 1257**2 * ops.M)
        t2 = time.perf_counter()
        factor.solve(np.ones(len(ops.free)))
        t3 = time.perf_counter()
        sizes.append(len(ops.free))
        costs.append((t1 - t0, t2 - t1, t3 - t2))
        print(
            f"{len(ops.free):9,} {t1 - t0:11.2f} {t2 - t1:12.2f} {t3 - t2:8.3f} "
            f"{peak_memory() / 2**30:9.2f}"
        )
    exponents = np.polyfit(np.log(sizes), np.log(costs), 1)[0]
    print("time grows with unknowns to the power " + ", ".join(f"{e:.2f}" for e in exponents))


if __name__ == "__main__":
    print(platform.processor() or platform.machine(), "python", platform.python_version())
    growth()  # first: the peak memory of a process never falls
    assembly(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
