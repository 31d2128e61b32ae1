"""Recovery of a known material by `skinwave fit`: share of draws inside the 95 % intervals.

    python -m bench.fit_recovery [waveforms | lines | amplitudes] [--draws 50] [--starts 20]

A slab of skin of another modulus (by up to 30 %), viscosity, gain and delay in each draw moves by
the wavenumber integral; noise of 5 % is added, of the RMS motion at each place to waveforms of 1 s,
or of the strongest line at each place to complex lines, in three repetitions. The first draw is
fitted from all starts, the others from two. Prints a row a draw, and the shares at the end.
"""

import argparse
import time

import numpy as np

from simple_model.flat_body import steady_lines
from simple_model.load_spectrum import synthesise
from skinwave.bodies.analytic import compliance
from skinwave.fits.fit import fit
from skinwave.measurements import Measurement
from skinwave.scene import Scene
from skinwave.scene_file import read
from skinwave.sweeps.variation import varied

SCENE = "examples/am-and-stm-on-skin.toml"
MODULUS, VISCOSITY = "body.material.shear_modulus_pa", "body.material.viscosity_pa_s"
LIMITS = {
    MODULUS: (8000, 80000), VISCOSITY: (1, 20), "gain": (0.2, 5), "delay_ms": (-5, 5),
}  # fmt: skip
NOISE, REPETITIONS, RATE, DURATION = 0.05, 3, 10_000, 1.0


def truth(rng: np.random.Generator) -> dict[str, float]:
    return {
        MODULUS: 25e3 * rng.uniform(0.7, 1.3), VISCOSITY: rng.uniform(3, 8),
        "gain": rng.uniform(0.6, 1.6), "delay_ms": rng.uniform(-3, 3),
    }  # fmt: skip


def measured(scene: Scene, kind: str, true: dict[str, float], rng: np.random.Generator):
    moved = varied(scene, {key: true[key] for key in (MODULUS, VISCOSITY)})
    f, a = steady_lines(compliance(moved.body), moved.pressure, moved.probe_points)
    late = np.exp(-2j * np.pi * f * true["delay_ms"] / 1e3)
    a = true["gain"] * a * (2j * np.pi * f * late)[:, None]
    given = {"quantity": "velocity", "places": moved.probe_points, "name": "synthetic"}
    if kind == "waveforms":
        times = np.arange(int(RATE * DURATION)) / RATE
        x = synthesise(f, a, times)
        noise = NOISE * x.std(axis=0) * rng.standard_normal((REPETITIONS, *x.shape))
        return Measurement(**given, times=times, values=x + noise)
    shape = (2, REPETITIONS, *a[f > 0].shape)
    noise = NOISE / np.sqrt(2) * np.abs(a).max(axis=0) * rng.standard_normal(shape)
    values = a[f > 0] + noise[0] + 1j * noise[1]
    return Measurement(**given, frequencies=f[f > 0], values=values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", nargs="?", default="waveforms")
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--starts", type=int, default=20)
    options = parser.parse_args()
    scene, rng = read(SCENE), np.random.default_rng(0)
    keys = [key for key in LIMITS if key != "delay_ms" or options.kind != "amplitudes"]
    vary = [f"{key}={LIMITS[key][0]}:{LIMITS[key][1]}" for key in keys]
    inside, worst, seconds = [], 0.0, []
    for draw in range(options.draws):
        true = truth(rng)
        data = measured(scene, options.kind, true, rng)
        began = time.process_time()
        starts = 2 if draw else options.starts
        found = fit(scene, data, vary, kind=options.kind, starts=starts, seed=draw)
        seconds.append(time.process_time() - began)
        by_profile = {each.key: (each.low, each.high) for each in found.profiles}
        inside.append([
            [each.low <= true[each.key] <= each.high for each in found.estimates],
            [by_profile[key][0] <= true[key] <= by_profile[key][1] for key in keys],
        ])  # fmt: skip
        ended = [found.solution.problem.parameters.values(x.ended) for x in found.solution.starts]
        off = max(abs(values[MODULUS] / true[MODULUS] - 1) for values in ended)
        worst = max(worst, off)
        print(
            draw, f"starts {starts}, worst modulus {100 * off:.3f} % off,",
            f"half interval {50 * (found.estimates[0].high / found.estimates[0].low - 1):.3f} %,",
            f"chi2/dof {found.solution.cost / found.solution.dof:.3f},",
            f"{seconds[-1]:.1f} s CPU, inside {inside[-1]}", flush=True,
        )  # fmt: skip
    shares = 100 * np.mean(inside, axis=0)
    print(f"{options.kind}: modulus of the worst start of all draws {100 * worst:.3f} % off")
    for key, covariance, profile in zip(keys, *shares, strict=True):
        print(f"{key}: inside by covariance {covariance:.0f} %, by profile {profile:.0f} %")
    print(f"seconds of CPU: first {seconds[0]:.1f}, median of the others {np.median(seconds):.1f}")


if __name__ == "__main__":
    main()
