"""Our own cost: how it grows with the mesh, and our models against each other."""

import time
import timeit
from collections.abc import Callable
from dataclasses import replace
from unittest import mock

import numpy as np

import fem
from simple_model import point_kernel
from skinwave.bodies.build import build
from skinwave.models.full import TRANSIENT_RATE, assembled, meshed
from skinwave.models.prepared import answer, prepare
from skinwave.scene import paper15
from skinwave.scene.scene import PROBES, Body
from skinwave.system.effort import Clock, peak_memory, silent

SIZES = (10e-3, 6e-3, 4.7e-3, 3.4e-3, 2.7e-3, 1.9e-3, 1.7e-3)  # m, of elements: to 500 k dofs
MOST_MEMORY = 16 * 2**30  # bytes
WHOLE = np.array(PROBES) + (0.3e-3, 0.7e-3)  # on no plane across which a body could be halved


def growth() -> None:
    """One reduced model at each size; the solver's share is its factorisation and its solves."""
    print("\ngrowth: skin slab reduced to 5 probes, first installed solver")
    print(f"{'dofs':>9} {'assemble s':>11} {'factorise s':>12} {'solves s':>9} {'rest s':>7} "
          f"{'total s':>8} {'in solver':>10} {'peak GiB':>9}")  # fmt: skip
    sizes, costs = [], []
    before = peak_memory()
    for h in SIZES:
        mesh = build(Body(), h).mesh
        unknowns = mesh.n_dofs - 3 * len(np.unique(mesh.facets["bottom"]))
        # Memory grows with the power 1.2 at most; a size must fit before it is tried.
        if sizes and before + costs[-1][-1] * (unknowns / sizes[-1]) ** 1.2 > MOST_MEMORY:
            print(f"{unknowns:9,} skipped: more than {MOST_MEMORY / 2**30:.0f} GiB")
            continue
        assemble, factorise, solves, total = reduction(h)
        sizes.append(unknowns)
        costs.append((total, factorise, peak_memory() - before))
        print(
            f"{unknowns:9,} {assemble:11.2f} {factorise:12.2f} {solves:9.2f} "
            f"{total - assemble - factorise - solves:7.2f} {total:8.2f} "
            f"{100 * (factorise + solves) / total:8.0f} % {peak_memory() / 2**30:9.2f}"
        )
    total, factorise, memory = np.polyfit(np.log(sizes), np.log(costs), 1)[0]
    print(
        f"dofs to the power {total:.2f}: time; {factorise:.2f}: time to factorise; "
        f"{memory:.2f}: memory beyond the {before / 2**30:.2f} GiB of the start"
    )


def reduction(h: float) -> tuple[float, float, float, float]:
    """Seconds to assemble, to factorise, in solves, and in all of the offline stage of the whole
    slab.
    """
    spent = {"factorise": 0.0, "solve": 0.0}

    def timed(name: str, run: Callable, *arguments: object, **options: object) -> object:
        started = time.perf_counter()
        result = run(*arguments, **options)
        spent[name] += time.perf_counter() - started
        return result

    def factorise(*arguments: object, **options: object) -> fem.Factor:
        factor = timed("factorise", fem.factorise, *arguments, **options)
        solve = lambda b: timed("solve", factor.solve, b)  # noqa: E731
        return fem.Factor(solve=solve, backend=factor.backend)

    started = time.perf_counter()
    with mock.patch("fem.reduced.factorise", factorise):
        prepared = prepare(Body(), WHOLE, h=h)
    total = time.perf_counter() - started
    return prepared.effort.seconds["assemble"], spent["factorise"], spent["solve"], total


def models() -> None:
    """Ratios: the point kernel to one exp a sample; one more Tacton to the full time stepping."""
    print("\nmodels, the default skin slab, AM 140 Hz + STM 20 mm")
    tacton = dict(paper15.tactons())["am140-stm20"]
    published = paper15.scenes("x", tacton)["point-kernel-published"].pressure
    for seconds, probes, rate in ((1, 5, 40_000), (10, 200, 10_000), (10, 200, 40_000)):
        times, points = np.arange(seconds * rate) / rate, np.zeros((probes, 2)) + 0.004
        plain = np.ones((len(times), probes))
        exponential = _best(lambda: np.exp(plain))  # noqa: B023
        for focus in ("gaussian", "main_lobe"):
            pressure = replace(published, profile=focus)
            kernel = _best(lambda: point_kernel(pressure, points, times))  # noqa: B023
            print(
                f"point kernel, {focus}, {seconds} s at {rate / 1e3:g} kHz, {probes} probes: "
                f"{kernel:.3f} s, {kernel / exponential:.1f} times one exp a sample"
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
        f"reduced model of {len(ops.free):,} dofs: ready in {ready:.1f} s; one more Tacton "
        f"{warm:.2f} s, 1/{full / warm:.0f} of {TRANSIENT_RATE:.0f} full time steps ({full:.0f} s, "
        f"from {steps})"
    )


def _best(run: Callable[[], object]) -> float:
    return min(timeit.repeat(run, number=1, repeat=3))
