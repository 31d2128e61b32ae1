"""Errors that `fem` states, beside true ones: `python -m bench.stated_errors [N] [SEED]`.

Small random scenes: bodies of most supports and of one to three layers under random Tactons, read
at random probes, weak ones among them. The reference has elements half as large on the body that
the plan models. A scene fails if its true error is more than 1.1 times the stated one.
"""

import sys
from dataclasses import replace
from itertools import count

import numpy as np

import skinwave
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.layers.material import Material
from skinwave.bodies.parts import Layer, Relief
from skinwave.models.reduced import answer, prepare
from skinwave.planning.refinement import about_its_rest, relative_change
from skinwave.scene.scene import Body, Scene

MOST = 1.1  # times the stated error
LARGEST = 8000  # degrees of freedom: of more the reference takes minutes
ROUND = Relief(edge_radius=3e-3, corner_radius=0.012)
CIRCLE = Trajectory(shape="circle", size=0.01, speed=5.0)
REFERENCE = 1e-4  # relative error of the reduction of a reference


def random_scene(rng: np.random.Generator) -> Scene:
    """One small scene, of a slab or a palm."""

    def material() -> Material:
        shear = rng.uniform(8e3, 4e4)
        return Material(
            density=1000.0, shear_modulus=shear, poisson=float(rng.choice([0.45, 0.49, 0.4999])),
            viscosity=shear * rng.uniform(1e-4, 4e-4),
        )  # fmt: skip

    def body() -> Body:
        depth = rng.uniform(4e-3, 10e-3)
        if rng.random() < 0.2:
            return Body(kind="palm", width=0.04, height=0.045, depth=depth + 4e-3,
                        material=material(), sides="free", relief=ROUND)  # fmt: skip
        layers = tuple(
            Layer(thickness=depth * rng.uniform(0.15, 0.4), material=material())
            for _ in range(rng.integers(0, 3))
        )
        base = str(rng.choice(["clamped", "clamped", "elastic", "free"]))
        sides = str(rng.choice(["clamped", "free"])) if base != "free" else "clamped"
        return Body(
            width=rng.uniform(0.02, 0.03), height=rng.uniform(0.02, 0.03), depth=depth,
            material=material(), layers=layers, base=base, sides=sides,
            base_stiffness=10 ** rng.uniform(6, 7) if base == "elastic" else 0.0,
        )  # fmt: skip

    path = Trajectory() if rng.random() < 0.5 else CIRCLE
    tacton = Tacton(
        trajectory=path, am_frequency=rng.uniform(30, 250), duration=rng.uniform(0.03, 0.15)
    )
    probes = tuple((float(x), float(y)) for x, y in rng.uniform(-9e-3, 9e-3, (3, 2)))
    return Scene(pressure=MovingPressure(tacton=tacton), body=body(), probes=probes)


def stated_and_true(scene: Scene, tolerance: float, h: float | None = None) -> tuple[float, float]:
    """Stated error of `fem` with its planned elements, or those of h in metre, and the true one."""
    plan = skinwave.plan(scene, skinwave.SolveOptions(tolerance=tolerance, model="fem", h=h))
    assert plan.prepared
    assert plan.h
    if plan.prepared.effort.dofs > LARGEST:
        raise ValueError(f"{plan.prepared.effort.dofs} degrees of freedom")
    found = answer(plan.prepared, replace(scene, body=plan.body))
    fine = prepare(
        plan.body, scene.probe_points, h=plan.h / 2, tolerance=REFERENCE, symmetry=plan.symmetry,
        reading=scene.reading, load=scene.load,
    )  # fmt: skip
    better = answer(fine, replace(scene, body=plan.body)).values
    waveforms = (about_its_rest(scene, each) for each in (found.values, better))
    return plan.error, relative_change(*waveforms)


def main(number: int = 50, seed: int = 0) -> int:
    """Table of the scenes; the number of those that fail."""
    rng, failed = np.random.default_rng(seed), 0
    print("kind, layers, base and sides | asked | stated | true | true over stated")
    for k in count():
        if k == number:
            break
        scene, tolerance = random_scene(rng), float(rng.choice([0.03, 0.05, 0.1]))
        try:
            stated, true = stated_and_true(scene, tolerance)
        except ValueError as error:  # too large, or refused
            print(f"left out: {error}", flush=True)
            continue
        failed += true > MOST * stated
        body = scene.body
        row = (100 * tolerance, 100 * stated, 100 * true, true / stated)
        print(k, body.kind, len(body.layers), body.base, body.sides,
              "| {:g} % | {:.2f} % | {:.2f} % | {:.2f}".format(*row), flush=True)  # fmt: skip
    print(f"{failed} of {number} fail")
    return failed


if __name__ == "__main__":
    sys.exit(min(1, main(*map(int, sys.argv[1:]))))
