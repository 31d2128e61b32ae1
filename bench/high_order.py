"""`python -m bench.high_order`: NGSolve at order 4, condensed, beside ours at equal error.

The clamped slab of skin with free sides, at Poisson's ratio 0.4999, under one Tacton (AM 140 Hz,
circle of 20 mm at 12 m/s). NGSolve solves its lines one by one, as its user would: tetrahedra of a
mesh of its own, complex symmetric, sparse Cholesky, two threads. On half of the body it does by
hand what ours do where all probes lie on a plane of symmetry.

Errors are of the complex displacement of the probes over the largest of a line, the worst of the
strongest lines, against order 5 on half of the body. Each mesh is in a process of its own; with
--cpu on one thread, which gives CPU seconds that other work on the machine disturbs little.
"""

import argparse
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import fem
from bench.beside import the_tacton
from simple_model.load.spectrum import load_lines, pressure_lines
from skinwave.bodies.build import build, operators
from skinwave.models.loads import probe_rows, surface_load
from skinwave.models.prepared import answer, components, prepare
from skinwave.models.symmetry import even_part
from skinwave.scene import paper15
from skinwave.scene.scene import PROBES, SURFACE, Body, Scene

BODY = Body(sides="free")
STRONGEST = (50.986, 140.0, 190.986)  # Hz, lines that are assessed
NEGLIGIBLE = 1e-2  # of the strongest line's pressure: what a Tacton's lines are counted down to
REFERENCE = (8.0, 5, True)  # mm, order, half: at 191 Hz 0.05 % from elements of 6 mm
PEER = ((14.0, 4, False), (9.0, 4, False), (11.0, 4, True), (10.0, 4, True))
OURS = (4.0, 3.5, 3.0, 2.5)  # mm
REDUCED = (4.0, 3.5, 2.5)  # mm
Clock = Callable[[], float]
GRID, REACH = 1e-4, 0.03  # m: of the pressure that NGSolve interpolates, and how far it goes


@dataclass(frozen=True, kw_only=True)
class Row:
    """Cost of a mesh: `once`, and for `each` line or Tacton, in s; its displacement (f, p)."""

    name: str
    dofs: int
    once: float
    each: float
    displacement: np.ndarray


def scene() -> Scene:
    return replace(paper15.scenes("bench", the_tacton())["skin-slab"], body=BODY)


def chosen(frequencies: np.ndarray) -> list[int]:
    """Indices of the lines that are assessed."""
    return [int(np.abs(frequencies - f).argmin()) for f in STRONGEST]


def patterns() -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (f,) of the assessed lines, and their pressure (f, y, x) on a grid."""
    axis = np.linspace(-REACH, REACH, round(2 * REACH / GRID) + 1)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    parts = [pressure_lines(scene().pressure, part, 1e-3) for part in np.array_split(points, 64)]
    lines = chosen(parts[0][0])
    found = np.hstack([amplitudes[lines] for _, amplitudes in parts])
    return parts[0][0][lines], found.reshape(len(lines), len(axis), len(axis))


def peer_mesh(h: float, half: bool) -> Any:
    """A mesh of NGSolve's own of the body, or of the half with positive y."""
    import ngsolve as ng
    from netgen.occ import Box, OCCGeometry, Pnt

    x, y, z = BODY.width / 2, BODY.height / 2, BODY.depth
    solid = Box(Pnt(-x, 0 if half else -y, -z), Pnt(x, y, 0))
    for face in solid.faces:
        middle = face.center
        names = {"top": middle.z, "bottom": middle.z + z, "mirror": middle.y if half else 1.0}
        face.name = next((name for name, off in names.items() if abs(off) < 1e-9), "side")
    return ng.Mesh(OCCGeometry(solid).GenerateMesh(maxh=h))


def peer_line(mesh: Any, space: Any) -> Callable[[float, np.ndarray], np.ndarray]:
    """Displacement (p,) of the probes at one line: its frequency in Hz and pressure (y, x)."""
    import ngsolve as ng

    skin = BODY.solid
    u, v = space.TnT()

    def strain(w: Any) -> Any:
        return ng.Sym(ng.Grad(w))

    elastic = 2 * skin.shear_modulus * ng.InnerProduct(strain(u), strain(v))
    elastic += skin.first_lame * ng.div(u) * ng.div(v)

    def solved(hertz: float, pressure: np.ndarray) -> np.ndarray:
        w = 2 * np.pi * hertz
        lossy = 1 + 1j * w * skin.viscosity / skin.shear_modulus
        A = ng.BilinearForm(space, symmetric=True, condense=True)
        A += (lossy * elastic - w**2 * skin.density * u * v) * ng.dx
        q = ng.VoxelCoefficient((-REACH, -REACH), (REACH, REACH), pressure, linear=True)
        b = ng.LinearForm(space)
        b += -q * v[2] * ng.ds("top", bonus_intorder=6)
        A.Assemble()
        b.Assemble()
        factor = A.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
        b.vec.data += A.harmonic_extension_trans * b.vec
        found = ng.GridFunction(space)
        found.vec.data = factor * b.vec
        found.vec.data += A.harmonic_extension * found.vec
        found.vec.data += A.inner_solve * b.vec
        return np.array([-found(mesh(x, y, -1e-9))[2] for x, y in PROBES])

    return solved


def peer(cases: tuple[tuple[float, int, bool], ...], clock: Clock) -> list[Row]:
    """NGSolve at sizes in mm, of an order, on all of the body or half of it."""
    import ngsolve as ng

    peer_mesh(0.05, half=False)  # imports and starts what is not timed
    frequencies, pressures = patterns()
    rows = []
    for h, order, half in cases:
        started = clock()
        mesh = peer_mesh(h / 1e3, half)
        with ng.TaskManager():
            space = ng.VectorH1(
                mesh, order=order, complex=True, dirichlet="bottom",
                dirichlety="mirror" if half else "",
            )  # fmt: skip
            solve = peer_line(mesh, space)
            once = clock() - started
            even = (pressures + pressures[:, ::-1]) / 2 if half else pressures
            seconds, found = timed(solve, frequencies, even, clock)
        dofs = sum(space.FreeDofs(True))
        name = f"NGSolve, order {order}{', half' if half else ''}, {h:g} mm"
        rows.append(Row(name=name, dofs=dofs, once=once, each=seconds, displacement=found))
    return rows


def timed(
    solve: Callable[[float, np.ndarray], np.ndarray],
    frequencies: np.ndarray,
    loads: np.ndarray,
    clock: Clock,
) -> tuple[float, np.ndarray]:
    """Median seconds of a line, and the displacement (f, p) at all."""
    seconds, found = [], []
    for hertz, load in zip(frequencies.tolist(), loads, strict=True):
        started = clock()
        found.append(solve(hertz, load))
        seconds.append(clock() - started)
    return median(seconds), np.array(found)


def harmonic(sizes: tuple[float, ...], clock: Clock) -> list[Row]:
    """Ours line by line at sizes in mm, as `fem-harmonic` solves them."""
    rows = []
    for h in sizes:
        started = clock()
        made = build(BODY, h / 1e3, "y")
        ops = operators(made)
        P, points = even_part(*surface_load(made), "y")
        S, _ = probe_rows(BODY, made, np.array(PROBES), SURFACE)
        solver = fem.LineSolver(ops)
        once = clock() - started
        frequencies, pressures = pressure_lines(scene().pressure, points, 1e-3)
        lines = chosen(frequencies)

        def solve(
            hertz: float, q: np.ndarray, P: Any = P, S: Any = S, solver: Any = solver
        ) -> np.ndarray:
            return np.asarray(S @ solver(hertz, P @ q))

        seconds, found = timed(solve, frequencies[lines], pressures[lines], clock)
        rows.append(
            Row(name=f"fem-harmonic, {h:g} mm", dofs=len(ops.free), once=once, each=seconds,
                displacement=found)
        )  # fmt: skip
    return rows


def reduced(sizes: tuple[float, ...], clock: Clock) -> list[Row]:
    """Our reduced-order model at sizes in mm, cold, of which each is a whole Tacton."""
    rows, asked = [], scene()
    for h in sizes:
        started = clock()
        made = prepare(BODY, asked.probe_points, h=h / 1e3)
        answer(made, asked)
        seconds = clock() - started
        motion = components(made, *asked.loads)
        found = motion.lines[chosen(motion.frequencies)]
        rows.append(
            Row(name=f"fem, cold, {h:g} mm", dofs=made.effort.dofs, once=0.0, each=seconds,
                displacement=found)
        )  # fmt: skip
    return rows


def error(row: Row, reference: np.ndarray) -> float:
    apart = np.abs(row.displacement - reference).max(axis=1) / np.abs(reference).max(axis=1)
    return float(apart.max())


def alone(run: Callable[[Any, Clock], list[Row]], cases: Any, clock: Clock) -> Iterator[Row]:
    """Rows of a code, each in a process of its own."""
    for case in cases:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            yield from pool.submit(run, (case,), clock).result()


def reference_of(kept: Path | None) -> np.ndarray:
    """Displacement (f, p) of the reference, from a file if there is one."""
    if kept and kept.exists():
        return np.load(kept)
    found = next(alone(peer, (REFERENCE,), time.perf_counter)).displacement
    if kept:
        np.save(kept, found)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.high_order", description=__doc__)
    parser.add_argument("--reference", type=Path, help="file (.npy) that keeps the reference")
    parser.add_argument("--cpu", action="store_true", help="CPU seconds of one thread")
    asked = parser.parse_args()
    os.environ["SKINWAVE_CACHE"] = ""  # every first response is a cold one
    if asked.cpu:
        os.environ["OMP_NUM_THREADS"] = os.environ["NGS_NUM_THREADS"] = "1"
    clock = time.process_time if asked.cpu else time.perf_counter
    count = len(np.unique(np.round(load_lines(scene().pressure, NEGLIGIBLE).frequencies, 9)))
    reference = reference_of(asked.reference)
    print(f"a Tacton of {count} lines; errors at {', '.join(f'{f:.0f}' for f in STRONGEST)} Hz")
    print(f"{'':<28} {'dofs':>8} {'once s':>7} {'line s':>7} {'Tacton s':>9} {'error':>7}")
    for run, cases in ((peer, PEER), (harmonic, OURS), (reduced, REDUCED)):
        for row in alone(run, cases, clock):
            line = f"{row.each:7.2f}" if run is not reduced else f"{'':7}"
            whole = row.each if run is reduced else row.once + count * row.each
            print(
                f"{row.name:<28} {row.dofs:8,} {row.once:7.2f} {line} {whole:9.1f} "
                f"{100 * error(row, reference):6.2f} %",
                flush=True,
            )


if __name__ == "__main__":
    main()
