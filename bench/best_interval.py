"""Coverage of the interval of a best value: `python -m bench.best_interval [SAMPLES] [SEED]`.

Best drawing speed on a soft and on a stiff slab, as `skinwave sweep --best` finds it. Beside it,
random samples of the spreads, each with its best speed by lines of the steady state alone, without
a table: on a grid of 1 m/s, then on one of 0.1 m/s about the best. The interval is to hold 95 %.
"""

import sys
import time
from functools import cache, partial

import numpy as np

import skinwave
from meshes.tetmesh import Floats
from simple_model import sensation_level
from simple_model.layers.compliance import Compliance
from simple_model.layers.path_operator import PathOperator, path_operator
from skinwave.bodies.analytic import compliance
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of, with_values
from skinwave.scene.variation import varied
from skinwave.sweeps.sampling import quantiles

KEY, COLUMN, RANGE = "tacton.speed_m_per_s", "level_db[0]", "2:24:12"
LOW, HIGH, STEPS = 2, 24, 10  # m/s, and fine steps in 1 m/s
SCENE = """name = "Circle of 20 mm on a slab"
[tacton]
duration_s = 0.4
shape = "circle"
size_mm = 20
speed_m_per_s = 8
[body]
kind = "slab"
material = "{}"
sides = "absorbing"
[probes]
points_mm = [[10, 0]]
"""


def best_speeds(scene: Scene, n: int, seed: int) -> Floats:
    """Best speed (n,) in m/s of each random sample of the spreads."""
    spreads = spreads_of(scene)
    drawn = quantiles(spreads, np.random.default_rng(seed).random((n, len(spreads))))
    keys = [each.key for each in spreads]
    bodies = [with_values(scene, dict(zip(keys, row, strict=True))).body for row in drawn.tolist()]
    waves = [compliance(body) for body in bodies]
    found = np.empty(n)
    for k, each in enumerate(waves):
        level = partial(level_at, scene, each)
        coarse = max(range(LOW * STEPS, HIGH * STEPS + 1, STEPS), key=level)
        about = range(max(coarse - STEPS, LOW * STEPS), min(coarse + STEPS, HIGH * STEPS) + 1)
        found[k] = max(about, key=level) / STEPS
    return found


def level_at(scene: Scene, waves: Compliance, step: int) -> float:
    """Sensation level in dB at the probe, at a speed in fine steps."""
    f, a = operator_at(scene, step).steady_lines(waves)
    return float(sensation_level(np.abs(a[f > 0, 0]), f[f > 0]).max())


@cache
def operator_at(scene: Scene, step: int) -> PathOperator:
    """Operator of the load at a speed in fine steps."""
    load = varied(scene, {KEY: step / STEPS}).pressure
    return path_operator(load, scene.probes, threshold=1e-3)


def main(n: int = 200, seed: int = 4711) -> None:
    """One line for each slab."""
    for material in ("palm", "palm-stiff"):
        scene = skinwave.loads(SCENE.format(material))
        started, cpu = time.perf_counter(), time.process_time()
        found = skinwave.best_value(scene, {KEY: RANGE}, COLUMN)
        assert found.interval
        seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
        speeds = best_speeds(scene, n, seed)
        low, high = found.interval
        half = 0.5 / STEPS  # of a fine step, to which a best speed is known
        below, above = speeds + half < low, speeds - half > high
        print(
            f"{material}: {found.value:.1f} m/s, {low:.1f} to {high:.1f} ({seconds:.0f} s, CPU "
            f"{cpu:.0f} s); of {n} samples {1 - (below | above).mean():.1%} within, "
            f"{below.mean():.1%} below, {above.mean():.1%} above",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
