"""Seconds of `skinwave fit` on a palm of elements: `python -m bench.fit_palm [--draw N]`.

The palm of `examples/palm.toml` in another material, reduced on its own, moves from rest; noise of
2 % of the RMS motion at each place is added in three repetitions. Modulus, viscosity, gain and
delay are fitted to it by the command, in processes of their own: with an empty cache, with the body
cached, and to lines alone. Wall seconds and CPU seconds of one thread, with the whole command.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import skinwave
from skinwave.measure import Measurement
from skinwave.measure.writing import write
from skinwave.scene.variation import varied

SCENE = Path(__file__).parent.parent / "examples/palm.toml"
MODULUS, VISCOSITY = "body.material.shear_modulus_pa", "body.material.viscosity_pa_s"
LIMITS = {
    MODULUS: (15e3, 40e3), VISCOSITY: (3.0, 10.0), "gain": (0.2, 5.0), "delay_ms": (-2.0, 2.0),
}  # fmt: skip
NOISE, REPETITIONS = 0.02, 3


def measured(rng: np.random.Generator) -> tuple[dict[str, float], Measurement]:
    """True values, and what is measured of them."""
    true = {key: float(rng.uniform(*np.quantile(LIMITS[key], [0.2, 0.8]))) for key in LIMITS}
    true["gain"], true["delay_ms"] = 1.3, 0.4
    scene = varied(skinwave.read(SCENE), {key: true[key] for key in (MODULUS, VISCOSITY)})
    found = skinwave.simulate(scene, model="fem")
    noise = rng.standard_normal((REPETITIONS, *found.values.shape)) * found.values.std(axis=0)
    return true, Measurement(
        quantity="displacement", places=found.probes, times=found.times + true["delay_ms"] / 1e3,
        values=true["gain"] * (found.values + NOISE * noise),
    )  # fmt: skip


def run(folder: Path, name: str, *more: str) -> tuple[dict, float, float]:
    """The fit, as JSON has it, and wall and CPU seconds of the command."""
    vary = [f"{key}={low}:{high}" for key, (low, high) in LIMITS.items()]
    words = [sys.executable, "-m", "skinwave", "fit", str(SCENE), "--model", "fem", "--measured",
             str(folder / "measured.npz"), "--vary", *vary, "-o", str(folder / name), "--quiet",
             *more]  # fmt: skip
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, check=True, env={**os.environ, "SKINWAVE_CACHE": str(folder / "cache")})
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads((folder / name / "fit.json").read_text(encoding="utf-8")), wall, cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", type=int, default=0)
    options = parser.parse_args()
    began = time.process_time()
    true, data = measured(np.random.default_rng(options.draw))
    print(f"one material: {time.process_time() - began:.1f} s CPU", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(data, folder / "measured.npz")
        tried = {"cold": (), "cached": (), "lines, cached": ("--to", "lines")}
        for title, more in tried.items():
            told, wall, cpu = run(folder, title.replace(", ", "-"), *more)
            off = [100 * abs(told["values"][key] / true[key] - 1) for key in (MODULUS, VISCOSITY)]
            runs, factorised = told["predictions"], told["factorisations"]
            print(
                f"{title}: {wall:.0f} s wall, {cpu:.0f} s CPU; {runs} runs for "
                f"{factorised} factorisations, {runs / factorised:.0f} times; "
                f"{told['starts_that_reached_it']} of {told['starts']} starts; modulus "
                f"{off[0]:.3f} % off, viscosity {off[1]:.3f} % off; chi2/dof "
                f"{told['chi_squared'] / told['degrees_of_freedom']:.3f}", flush=True,
            )  # fmt: skip
            print(*told["warnings"], sep="\n", flush=True)


if __name__ == "__main__":
    main()
