"""skinwave against other codes: the same mesh, material and load, in turn.

The skin slab of the scenes with two changes that let every code take part: free sides, as
absorbing ones are not in all of them, and Poisson's ratio 0.45, up to which plain quadratic
tetrahedra do not lock. Nodal forces are skinwave's own, computed beforehand
and carried over by the nodes' coordinates, so that no code pays for them while it steps.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import fem
import meshes
from bench import codes
from bench.child import march
from bench.codes import CODES
from bench.problem import Problem
from skinwave.bodies.build import build
from skinwave.models.prepared import answer, prepare, sample_times
from skinwave.scene import paper15
from skinwave.scene.scene import PROBES, Body, Scene

SKIN = replace(fem.PRESETS["palm"], poisson=0.45)
BODY = Body(material=SKIN, sides="free")
TACTON = "am140-stm20"
SMALL = 9e-3  # m, elements of the small mesh, on which waveforms are compared
SHORT = 0.1  # s of those waveforms
RATES = (4_000, 5_000, 6_000, 8_000, 10_000, 12_000, 16_000, 20_000)  # Hz, the longest step first
FINE = 80_000  # Hz, the steps by which those are assessed
WRONG = 0.01  # relative error that the time steps may make at the worst probe
STEPS = 1000  # at most, from which a second is extrapolated
PATIENCE = 1800  # s for all that one code is asked for
DEBIAN = "/usr/bin/python3"  # dolfinx has no wheels; this is where its package puts it


def assembly(across: int) -> None:
    """Time to assemble K and M of a block of 6 across^2 across/4 tetrahedra, by every code."""
    small, large = block(8), block(across)
    print(f"\nK and M of {len(large.cells):,} ten-node tetrahedra")
    print(f"{'code':<12} {'version':<12} {'s':>7} {'ratio':>7}  {'energy J':>14} {'mass kg':>10}")
    first = None
    for name, result in in_turn(small, large):
        if isinstance(result, str):
            print(f"{name:<12} {result}")
            continue
        seconds, (energy, mass) = float(result["assemble"]), result["check"]
        first = first or seconds
        print(
            f"{name:<12} {str(result['version'])[:12]:<12} {seconds:7.2f} {seconds / first:7.1f}  "
            f"{energy:14.6e} {mass:10.6f}"
        )


def waves(h: float) -> None:
    """Time for one Tacton of a second, and for fifteen, on the skin slab with elements of h."""
    reference = reduced_waveform()
    rate = slowest_rate()
    small, large = problem(SMALL, rate, SHORT), problem(h, rate, STEPS / rate)
    free = large.fixed.size - int(large.fixed.sum())
    print(
        f"\none Tacton of 1 s (AM 140 Hz, circle of 20 mm at 12 m/s) at {len(PROBES)} probes, "
        f"cold: {free:,} dofs, {rate:,} steps"
    )
    print(f"{'code':<12} {'solver':<24} {'assemble':>8} {'factorise':>9} {'ms/step':>8} "
          f"{'from':>5} {'1 Tacton':>9} {'ratio':>6} {'15':>9} {'ratio':>6} {'wave':>8} "
          f"{'to ours':>8}")  # fmt: skip
    one, fifteen = ours(h)
    print(f"{'skinwave':<12} {'reduced, all measured':<24} {'':>33} "
          f"{one:8.1f}s {1:6.1f} {fifteen:8.1f}s {1:6.1f}")  # fmt: skip
    stepped = None
    for name, result in in_turn(small, large):
        if isinstance(result, str):
            print(f"{name:<12} {result}")
            continue
        fixed_cost = float(result["assemble"] + result["factorise"])
        second = float(result["step"]) * rate
        waveform = resampled(result["waveform"], rate)
        stepped = waveform if stepped is None else stepped
        solver = f"fem, {fem.available()[0]}" if name == "skinwave" else CODES[name].solver
        print(
            f"{name:<12} {solver:<24} {result['assemble']:7.2f}s {result['factorise']:8.2f}s "
            f"{1e3 * result['step']:8.2f} {result['steps']:5d} "
            f"{fixed_cost + second:8.1f}s {(fixed_cost + second) / one:6.1f} "
            f"{fixed_cost + 15 * second:8.0f}s {(fixed_cost + 15 * second) / fifteen:6.0f} "
            f"{difference(waveform, stepped):8.1e} {difference(waveform, reference):8.1e}"
        )
    compared = small.fixed.size - int(small.fixed.sum())
    print(
        f"""all but the first row: seconds extrapolated from the median of the steps under 'from'
wave, to ours: relative L2 difference of the worst probe's first {SHORT:g} s, on {compared:,}
dofs, to skinwave's steps and to its reduced model"""
    )


def ours(h: float) -> tuple[float, float]:
    """Seconds of the first Tacton and of all fifteen, meshing included."""
    scenes = {name: scene_of(tacton) for name, tacton in paper15.tactons()}
    first, every = [], []
    for _ in range(2):
        started = time.perf_counter()
        prepared = prepare(BODY, np.array(PROBES), h=h)
        ready = time.perf_counter() - started
        seconds = {}
        for name, scene in scenes.items():
            started = time.perf_counter()
            answer(prepared, scene)
            seconds[name] = time.perf_counter() - started
        first.append(ready + seconds[TACTON])
        every.append(ready + sum(seconds.values()))
    return min(first), min(every)


def slowest_rate() -> int:
    """Time steps a second that a code needs, by skinwave's own steps on the small mesh."""
    body = codes.skinwave(problem(SMALL, RATES[0], SHORT))

    def stepped(rate: int) -> np.ndarray:
        return resampled(march(body, problem(SMALL, rate, SHORT))["seen"], rate)

    fine, errors = stepped(FINE), {}
    for rate in RATES:
        errors[rate] = difference(stepped(rate), fine)
        if errors[rate] <= WRONG:
            break
    listed = ", ".join(f"{rate:,} {100 * error:.2f} %" for rate, error in errors.items())
    print(f"\nerror of time steps against {FINE:,} a second, worst probe: {listed}")
    return rate


def reduced_waveform() -> np.ndarray:
    scene = scene_of(replace(the_tacton(), duration=SHORT))
    return answer(prepare(BODY, np.array(PROBES), h=SMALL), scene).displacement


def the_tacton() -> paper15.Tacton:
    return dict(paper15.tactons())[TACTON]


def scene_of(tacton: paper15.Tacton) -> Scene:
    return replace(
        paper15.scenes("bench", tacton)["skin-slab"], body=Body(material=SKIN, sides="free")
    )


def resampled(seen: np.ndarray, rate: int) -> np.ndarray:
    """Waveforms (t, p) at the times of every response, as the time stepping of a scene reads."""
    times = sample_times(scene_of(replace(the_tacton(), duration=SHORT)))
    return CubicSpline(np.arange(len(seen)) / rate, seen)(times)


def difference(waveform: np.ndarray, reference: np.ndarray) -> float:
    squares = ((waveform - reference) ** 2).sum(axis=0) / (reference**2).sum(axis=0)
    return float(np.sqrt(squares.max()))


def block(across: int) -> Problem:
    line = np.linspace(-0.05, 0.05, across + 1)
    return unloaded(meshes.extrude(line, line, np.linspace(-0.02, 0, across // 4 + 1)))


def problem(h: float, rate: int, seconds: float) -> Problem:
    """The skin slab under the Tacton, in `rate` steps a second."""
    mesh, times = build(BODY, h).mesh, np.arange(round(seconds * rate) + 1) / rate
    P, points = fem.load_operator(mesh), fem.facet_points(mesh)
    pushed = np.flatnonzero(abs(P).sum(axis=1) > 0)
    fixed = np.zeros(mesh.points.shape, bool)
    fixed[np.unique(mesh.facets["bottom"])] = True
    pressure = scene_of(the_tacton()).pressure
    return replace(
        unloaded(mesh),
        fixed=fixed.ravel(),
        lag=np.array(SKIN.viscosity / SKIN.shear_modulus),
        dt=np.array(1 / rate),
        pushed=pushed,
        forces=np.vstack([(P[pushed] @ pressure(points, part).T).T for part in np.array_split(
            times, len(times) // 100 + 1)]),
        probes=fem.probe_operator(mesh, PROBES).toarray(),
    )  # fmt: skip


def unloaded(mesh: meshes.TetMesh) -> Problem:
    return Problem(
        nodes=np.array(mesh.points),
        cells=np.array(mesh.tets),
        surface=meshes.boundary_facets(mesh.tets[:, :4]),
        material=np.array([SKIN.shear_modulus, SKIN.poisson, SKIN.density]),
    )


def in_turn(small: Problem, large: Problem) -> Iterator[tuple[str, dict | str]]:
    """Measurements of every code, one process after the other, or why there are none."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [p.save(Path(folder, f"{k}.npz")) for k, p in enumerate((small, large))]
        result = Path(folder, "result.npz")
        for name in CODES:
            python = DEBIAN if name == "dolfinx" else sys.executable
            command = [python, "-m", "bench.child", name, result, *paths]
            root = Path(__file__).parents[1]
            try:
                subprocess.run(
                    command, cwd=root, capture_output=True, check=True, timeout=PATIENCE, text=True
                )
            except subprocess.CalledProcessError as error:
                lines = error.stderr.strip().splitlines() or [f"exit code {error.returncode}"]
                yield name, f"not measured: {lines[-1]}"
                continue
            except (OSError, subprocess.TimeoutExpired) as error:
                yield name, f"not measured: {error}"
                continue
            with np.load(result) as file:
                yield name, dict(file)
