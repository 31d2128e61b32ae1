"""Errors that `fem` states, beside true ones: `python -m bench.stated_errors [N] [SEED]`.

Scenes are those of `bench.agreement` with solid bodies. The reference has elements half as large on
the body that the plan models. A scene fails if its true error is more than 1.1 times the stated
one.
"""

import sys
from dataclasses import replace

import skinwave
from bench.agreement import table
from skinwave.models.prepared import answer, prepare
from skinwave.planning.refinement import about_its_rest, relative_change
from skinwave.scene.file import from_table
from skinwave.scene.scene import Scene

MOST = 1.1  # times the stated error
LARGEST = 8000  # degrees of freedom: of more the reference takes minutes
REFERENCE = 1e-4  # relative error of the reduction of a reference
TOLERANCE = 0.05


def stated_and_true(scene: Scene, tolerance: float) -> tuple[float, float]:
    """Stated error of `fem` with its planned elements, and the true one."""
    plan = skinwave.plan(scene, skinwave.SolveOptions(tolerance=tolerance, model="fem"))
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


def main(number: int = 20, seed: int = 0) -> int:
    """Table of scenes; the number of those that fail."""
    failed, k = 0, 0
    print(f"{'scene':<16}{'stated':>9}{'true':>9}{'true / stated':>15}")
    for scene in range(number):
        drawn = table(scene, seed)
        if drawn["body"]["kind"] == "sheet":
            continue
        try:
            stated, true = stated_and_true(from_table(drawn), TOLERANCE)
        except ValueError:  # too large, or refused
            continue
        failed, k = failed + (true > MOST * stated), k + 1
        print(f"{scene:<4}{drawn['body']['kind']:<12}{stated:9.2%}{true:9.2%}{true / stated:15.2f}",
              flush=True)  # fmt: skip
    print(f"{failed} of {k} fail")
    return failed


if __name__ == "__main__":
    sys.exit(min(1, main(*map(int, sys.argv[1:]))))
