"""`python -m bench.child CODE RESULT WARM-UP PROBLEM`: one code in a process of its own.

So that no code's threads, memory or crash touch another's, and each can have its own interpreter.
"""

import contextlib
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, cg

from bench.codes import CODES, Assembled
from bench.problem import Problem, load

LONGEST = 100.0  # s of stepping; what is left is extrapolated
SHORT = 5.0  # s, below which a factorisation is repeated and the better one taken


def march(body: Assembled, p: Problem, longest: float = np.inf) -> dict[str, Any]:
    """Average acceleration from rest: seconds to factorise, seconds a step, probes (t, p)."""
    dt, lag, to_nodes = float(p.dt), float(p.lag), body.to_nodes
    free = abs(to_nodes[np.flatnonzero(p.fixed)]).sum(axis=0) == 0
    push, read = csr_array(to_nodes.T[:, p.pushed]), csr_array(p.probes) @ to_nodes
    scale = dt / 2 * lag + dt**2 / 4
    factorised = []
    while len(factorised) < 2 and sum(factorised) < SHORT:
        started = time.perf_counter()
        solve = body.factorise(scale, free)
        factorised.append(time.perf_counter() - started)
    u = v = np.zeros(to_nodes.shape[1])
    a = _first_acceleration(body, push @ p.forces[0], free)
    seen, ended = [read @ u], [time.perf_counter()]
    for force in p.forces[1:]:
        u, v = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
        a = solve(push @ force - body.K @ (u + lag * v))
        u, v = u + dt**2 / 4 * a, v + dt / 2 * a
        seen.append(read @ u)
        ended.append(time.perf_counter())
        if ended[-1] - ended[0] > longest:
            break
    # All steps are alike; the median leaves out those that other processes held up.
    step, steps = np.median(np.diff(ended)), len(seen) - 1
    return {"factorise": min(factorised), "step": step, "steps": steps, "seen": seen}


def _first_acceleration(body: Assembled, force: np.ndarray, free: np.ndarray) -> np.ndarray:
    n = len(force)
    M = LinearOperator((n, n), matvec=lambda x: np.where(free, body.M @ (free * x), x), dtype=float)
    a, failed = cg(M, free * force, maxiter=5000)
    if failed:
        raise ArithmeticError("the mass matrix could not be inverted")
    return a


def measured(assemble: Callable[[Problem], Assembled], small: Problem, p: Problem) -> dict:
    """Seconds of the large problem after a warm-up on the small one, whose waveform is returned."""
    body = assemble(small)
    results = {"waveform": march(body, small)["seen"]} if len(small.forces) else {}
    body = assemble(p)
    if body.seconds < SHORT:
        body = min(body, assemble(p), key=lambda each: each.seconds)
    results |= {"assemble": body.seconds, "check": body.check(p.nodes)}
    if len(p.forces):
        results |= march(body, p, LONGEST)
    return results


def main(name: str, result: str, small: str, large: str) -> None:
    code, threads = CODES[name], contextlib.nullcontext()
    if name == "ngsolve":
        from ngsolve import TaskManager

        threads = TaskManager()
    with threads:
        results = measured(code.assemble, load(small), load(large))
    np.savez(result, version=version(code.package), **results)


if __name__ == "__main__":
    main(*sys.argv[1:])
