"""Coverage of the interval of a best value: `python -m bench.best_interval [SAMPLES] [SEED]`.

Best drawing speed on a soft and on a stiff slab, as `skinwave sweep --best` finds it. Beside it,
random samples of the spreads, each with its best speed on a fine grid by lines of the steady state
alone, without a table. The interval is to hold 95 % of them.
"""

import sys
import time

import numpy as np

import skinwave
from meshes.tetmesh import Floats
from simple_model import sensation_level
from simple_model.path_operator import path_operator
from skinwave.bodies.analytic import compliance
from skinwave.scene import Scene
from skinwave.spreads import spreads_of, with_values
from skinwave.sweeps.variation import varied
from skinwave.uncertainty.sampling import quantiles

KEY, COLUMN, RANGE = "tacton.speed_m_per_s", "level_db[0]", "2:24:12"
FINE = np.linspace(2, 24, 89)  # m/s
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
    """Best speed (n,) in m/s on the fine grid of each random sample of the spreads."""
    spreads = spreads_of(scene)
    drawn = quantiles(spreads, np.random.default_rng(seed).random((n, len(spreads))))
    keys = [each.key for each in spreads]
    bodies = [with_values(scene, dict(zip(keys, row, strict=True))).body for row in drawn.tolist()]
    waves = [compliance(body) for body in bodies]
    levels = np.empty((n, len(FINE)))
    for k, speed in enumerate(FINE.tolist()):
        load = varied(scene, {KEY: speed}).pressure
        operator = path_operator(load, scene.probes, threshold=1e-3)
        for own, each in zip(levels, waves, strict=True):
            f, a = operator.steady_lines(each)
            vibrates = f > 0
            own[k] = sensation_level(np.abs(a[vibrates, 0]), f[vibrates]).max()
    return np.asarray(FINE[levels.argmax(axis=1)])


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
        held = (low <= speeds) & (speeds <= high)
        print(
            f"{material}: {found.value:.1f} m/s, {low:.1f} to {high:.1f} ({seconds:.0f} s, CPU "
            f"{cpu:.0f} s); of {n} samples {held.mean():.1%} within, {(speeds < low).mean():.1%} "
            f"below, {(speeds > high).mean():.1%} above",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
