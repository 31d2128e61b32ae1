"""One reduced palm for a range of materials, each beside its own: `python -m bench.parametric`.

CPU seconds on one thread. `--own` is how many random materials are reduced on their own, `--h` the
element size in mm; the default of the palm takes some 15 s each.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import skinwave
from fem.line_basis import line_errors
from skinwave.models import parametric
from skinwave.models.free_keys import values_at, with_values
from skinwave.models.prepared import components
from skinwave.models.prepared import prepare as own_body

SCENE = Path(__file__).parent.parent / "examples/palm.toml"
RANGES = {
    "body.material.shear_modulus_pa": (15e3, 40e3),
    "body.material.viscosity_pa_s": (3.0, 10.0),
}


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    started = time.process_time()
    found = run()
    return found, time.process_time() - started


def main() -> None:
    """Offline stage, evaluations, errors, and a fit."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--own", type=int, default=200)
    options.add_argument("--h", type=float, default=None)
    asked = options.parse_args()
    h = asked.h and asked.h / 1e3
    scene = skinwave.read(SCENE)
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        os.environ["SKINWAVE_CACHE"] = one
        _, alone = timed(lambda: own_body(scene.body, scene.probe_points, h=h))
        os.environ["SKINWAVE_CACHE"] = other
        prepared, offline = timed(lambda: skinwave.prepare(scene, RANGES, h=h))
        print(
            f"{prepared.effort.dofs:,} dofs: one body {alone:.1f} s, offline {offline:.1f} s, "
            f"{offline / alone:.1f} times; {prepared.effort.factorisations} factorisations, "
            f"{prepared.effort.reduced_dofs} vectors, {len(prepared.frequencies)} lines, "
            f"estimate {prepared.effort.estimate:.1e}",
            flush=True,
        )
        evaluations(prepared)
        fit(scene, prepared, h)
        compare(scene, prepared, asked.own, h)


def evaluations(prepared: parametric.ParametricBody) -> None:
    shares = np.random.default_rng(0).random((200, len(prepared.keys)))
    each = [timed(lambda s=s: parametric.lines(prepared, values_at(prepared.keys, s)))[1]
            for s in shares]  # fmt: skip
    waveforms = timed(lambda: parametric.answer(prepared, values_at(prepared.keys, shares[0])))[1]
    print(
        f"200 materials: median {1e3 * np.median(each):.1f} ms, slowest {1e3 * max(each):.1f} ms; "
        f"waveform from rest {waveforms:.2f} s",
        flush=True,
    )


def compare(
    scene: skinwave.Scene, prepared: parametric.ParametricBody, count: int, h: float | None
) -> None:
    """Errors against the reductions of random materials on their own, a line for every ten."""
    whole, worst, spent = [], [], []
    for k, shares in enumerate(np.random.default_rng(1).random((count, len(prepared.keys)))):
        values = values_at(prepared.keys, shares)
        frequencies, found = parametric.lines(prepared, values)
        expected, seconds = timed(lambda: own_lines(scene, prepared, values, h))  # noqa: B023
        moving = frequencies > 0
        apart = np.linalg.norm((found - expected)[moving])
        whole.append(apart / np.linalg.norm(expected[moving]))
        worst.append(line_errors(found, expected).max())
        spent.append(seconds)
        if (k + 1) % 10 == 0 or k + 1 == count:
            print(
                f"{k + 1} materials: largest relative L2 {max(whole):.1e}, of one line "
                f"{max(worst):.1e}; their own {np.median(spent):.1f} s each (mesh cached)",
                flush=True,
            )


def own_lines(
    scene: skinwave.Scene,
    prepared: parametric.ParametricBody,
    values: Mapping[str, float],
    h: float | None,
) -> np.ndarray:
    """Lines of a material by its own reduction."""
    body = with_values(scene.body, prepared.keys, values)
    motion = components(own_body(body, scene.probe_points, h=h), scene.pressure)
    return motion.lines[[np.argmin(np.abs(motion.frequencies - f)) for f in prepared.frequencies]]


def fit(scene: skinwave.Scene, prepared: parametric.ParametricBody, h: float | None) -> None:
    """Modulus and viscosity from the lines of a material's own reduction, from eight starts."""
    hidden = values_at(prepared.keys, [0.37, 0.58])
    measured = own_lines(scene, prepared, hidden, h)
    count = 0

    def misfit(shares: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        apart = (parametric.lines(prepared, values_at(prepared.keys, shares))[1] - measured).ravel()
        return np.concatenate([apart.real, apart.imag]) / np.abs(measured).max()

    starts = np.random.default_rng(0).random((8, len(prepared.keys)))
    fits = [least_squares(misfit, start, bounds=(0, 1), x_scale=0.1) for start in starts]
    found = values_at(prepared.keys, min(fits, key=lambda each: each.cost).x)
    off = max(abs(found[key] / hidden[key] - 1) for key in hidden)
    print(
        f"fit from 8 starts: {count} evaluations for {prepared.effort.factorisations} "
        f"factorisations, {count / prepared.effort.factorisations:.0f} times; off by {off:.1e}",
        flush=True,
    )


if __name__ == "__main__":
    main()
