"""`python -m bench [elements across]`: growth, our models in turn, and all codes in turn."""

import os
import platform
import sys
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

import numpy as np

import fem
import meshes
from bench.assembly import CODES
from simple_model import point_kernel
from skinwave import paper15
from skinwave.effort import Clock, peak_memory, silent
from skinwave.full import assembled, meshed
from skinwave.plan import TRANSIENT_RATE
from skinwave.simulation import answer, prepare


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


def models() -> None:
    """Ratios: the point kernel to one exp a sample; one more Tacton to the full time stepping."""
    print("\nmodels, the default skin slab, AM 140 Hz + STM 20 mm")
    tacton = dict(paper15.tactons())["am140-stm20"]
    published = paper15.scenes("x", tacton)["none"].pressure
    for seconds, probes, rate in ((1, 5, 40_000), (10, 200, 10_000)):
        times, points = np.arange(seconds * rate) / rate, np.zeros((probes, 2)) + 0.004
        kernel = _best(lambda: point_kernel(published, points, times))  # noqa: B023
        plain = np.ones((len(times), probes))
        exponential = _best(lambda: np.exp(plain))  # noqa: B023
        print(
            f"point kernel, {seconds} s at {rate / 1e3:g} kHz, {probes} probes: {kernel:.3f} s, "
            f"{kernel / exponential:.1f} times one exp a sample"
        )
    scene = paper15.scenes("x", tacton)["skin-slab"]
    started = time.perf_counter()
    prepared = prepare(scene.body, scene.probe_points)
    ready = time.perf_counter() - started
    warm = _best(lambda: answer(prepared, scene))
    ops = assembled(meshed(scene.body, None, Clock(), silent), Clock(), silent)
    push = np.ones(ops.n_dofs)
    states = fem.transient(ops, lambda t: push, 1 / TRANSIENT_RATE)
    next(states)  # factorises
    steps = 200
    started = time.perf_counter()
    for _ in range(steps):
        next(states)
    full = (time.perf_counter() - started) / steps * TRANSIENT_RATE
    print(
        f"reduced model of {len(ops.free):,} unknowns: ready in {ready:.1f} s; one more Tacton "
        f"{warm:.2f} s, 1/{full / warm:.0f} of {TRANSIENT_RATE:.0f} full time steps ({full:.0f} s, "
        f"from {steps})"
    )


def _best(run: Callable[[], object], repeats: int = 3) -> float:
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


if __name__ == "__main__":
    os.environ["SKINWAVE_CACHE"] = ""
    print(platform.processor() or platform.machine(), "python", platform.python_version())
    growth()  # first: the peak memory of a process never falls
    models()
    assembly(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
