"""Layered skin fitted to published waves.

Shear moduli, thicknesses and one loss for all layers are fitted, within published ranges, to phase
speeds, 1/e lengths and decay exponents over frequency. The squared logarithms of the factors are
averaged within a set and summed over the sets.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from bench import table
from simple_model import Material
from skinwave.bodies import BODIES, Body
from skinwave.bodies.parts import solid_of
from skinwave.typing import Floats
from skinwave.verify.predictions import Curves, decay_exponents, leading_wave
from skinwave.verify.published import EXPONENT, WAVES, Published

GRID = np.arange(100.0, 701.0, 100.0)  # Hz
NO_WAVE, LARGEST = np.log(3.0), 2.0  # logarithms of factors: without a wave, and the largest
DRAWS, STARTS = 24, 2  # random draws within the ranges; the best of them start a fit
MOST_ITERATIONS, STEP = 12, 0.02  # of a fit; step of the logarithms
LAYERS = ("epidermis", "dermis", "hypodermis")  # from the surface down, above "muscle"


@dataclass(frozen=True, kw_only=True)
class Range:
    """Published range of a number, SI, and its source."""

    low: float
    high: float
    source: str


def _young(low: float, high: float, source: str) -> Range:
    """Return a range of shear moduli from Young's moduli in kPa of incompressible tissue."""
    return Range(low=1e3 * low / 3, high=1e3 * high / 3, source=source)


LOSS = Range(
    low=0.07 / (2 * np.pi * 200), high=6.4e-4,
    source="viscosity over shear modulus: loss factor at 200 Hz of 0.07 (0.14 +- 0.07, pig, "
    "Kirkpatrick et al. 2004, doi 10.1117/1.1803843) to 0.8 (Zhang et al. 2011)",
)  # fmt: skip
PALM: Mapping[str, Range] = {
    "dermis": _young(12.1, 217, "skin of fingers 12.1 to 48.4 kPa (Yang et al. 2018, J Ultrasound "
                     "Med) to skin under suction 129 +- 88 kPa (Diridollou et al. 2000)"),
    "hypodermis": _young(7.1, 45.1, "26.1 +- 19.0 kPa (Isogai et al. 2022, doi "
                         "10.1589/jpts.34.777)"),
    "muscle": _young(16.5, 91, "thenar muscle, 25.0 +- 8.5 at rest to 62.5 +- 28.5 kPa in a pinch "
                     "(Iida et al. 2025, doi 10.1016/j.ultrasmedbio.2024.12.003)"),
    "hypodermis thickness": Range(low=2e-3, high=6e-3, source="hypodermis of 2 to 6 mm"),
    "depth": Range(low=10e-3, high=25e-3, source="assumed"),
    "loss": LOSS,
}  # fmt: skip
FOREARM: Mapping[str, Range] = {
    "muscle": Range(low=1e3, high=16.8e3, source="shear waves of 1.0 to 4.1 m/s in vivo by "
                    "magnetic resonance (Blank et al. 2022, doi 10.1007/s10439-022-02935-y)"),
    "hypodermis thickness": Range(low=2e-3, high=10e-3, source="hypodermis of 2 to 10 mm"),
    "loss": LOSS,
}  # fmt: skip
RANGES = {"palm-layers": PALM, "forearm-layers": FOREARM}


def values_of(body: Body, names: Iterable[str]) -> dict[str, float]:
    """Return named numbers of a body, in SI."""
    solids = [*(solid_of(each.material) for each in body.layers), body.solid]
    known = {"depth": body.depth, "loss": body.solid.viscosity / body.solid.shear_modulus}
    known |= zip((*LAYERS, "muscle"), (each.shear_modulus for each in solids), strict=True)
    for name, each in zip(LAYERS, body.layers, strict=True):
        known[f"{name} thickness"] = each.thickness
    return {name: known[name] for name in names}


def with_values(body: Body, values: Mapping[str, float]) -> Body:
    """Return the body with other numbers; all layers have the same loss."""

    def solid(name: str, material: str | Material) -> Material:
        known = solid_of(material)
        shear = values.get(name, known.shear_modulus)
        return replace(known, shear_modulus=shear, viscosity=values["loss"] * shear)

    layers = tuple(
        replace(each, material=solid(name, each.material),
                thickness=values.get(f"{name} thickness", each.thickness))
        for name, each in zip(LAYERS, body.layers, strict=True)
    )  # fmt: skip
    return replace(body, layers=layers, material=solid("muscle", body.material),
                   depth=values.get("depth", body.depth))  # fmt: skip


def misses(body: Body, curves: Curves, published: Published) -> Floats:
    """Return logarithms (n,) of the factors of a set from 100 Hz: ours over the published value, or
    over the nearer end of a published range; nan without a wave.
    """
    f, values = np.array(published.frequencies), np.array(published.values)
    lows, highs = np.array([published.between(k) for k in range(len(f))]).T
    known, is_exponent = f >= GRID[0], published.quantity is EXPONENT
    found = decay_exponents(body, f) if is_exponent else curves.at(published.quantity, f)
    nearest = np.where(np.isnan(values), np.clip(found, lows, highs), values)
    return np.log(found / nearest)[known]


def residuals(body: Body, sets: Sequence[Published]) -> Floats:
    """Return the logarithms of all factors, weighted so that each set counts once."""
    curves = leading_wave(body, GRID)
    logs = [np.clip(misses(body, curves, each), -LARGEST, LARGEST) for each in sets]
    return np.concatenate([np.nan_to_num(x, nan=NO_WAVE) / np.sqrt(len(x)) for x in logs])


def fit(preset: str, sets: Sequence[Published]) -> dict[str, float]:
    """Fit the numbers of a preset, in SI, within their ranges, from the best of random draws and of
    the preset's own numbers.
    """
    ranges, body = RANGES[preset], BODIES[preset]
    low, high = np.log([(each.low, each.high) for each in ranges.values()]).T

    def named(x: Floats) -> dict[str, float]:
        return dict(zip(ranges, np.exp(x).tolist(), strict=True))

    def remainder(x: Floats) -> Floats:
        return residuals(with_values(body, named(x)), sets)

    draws = np.random.default_rng(0).uniform(low, high, (DRAWS, len(low)))
    own = np.log(list(values_of(body, ranges).values()))
    draws = np.clip([own, *draws], low + 1e-3, high - 1e-3)
    first = np.argsort([np.square(remainder(x)).sum() for x in draws])[:STARTS]
    found = [
        least_squares(remainder, x, bounds=(low, high), diff_step=STEP, max_nfev=MOST_ITERATIONS,
                      x_scale=high - low)
        for x in draws[first]
    ]  # fmt: skip
    return named(min(found, key=lambda each: each.cost).x)


def main(presets: bool) -> None:
    """Print the numbers of both presets and of fits, and the median factor of each set."""
    for preset, ranges in RANGES.items():
        sets = [each for each in WAVES if preset in each.bodies]
        numbers = {"preset": values_of(BODIES[preset], ranges)}
        if not presets:
            numbers["fit"] = fit(preset, [each for each in sets if preset in each.fitted])
        print(f"\n{preset}: shear moduli in Pa, thicknesses in m, loss in s")
        row = table("", "range", *numbers)
        for name, each in ranges.items():
            row(name, f"{each.low:.3g} to {each.high:.3g}",
                *(f"{values[name]:.3g}" for values in numbers.values()))  # fmt: skip
        bodies = [with_values(BODIES[preset], values) for values in numbers.values()]
        curves = [leading_wave(body, GRID) for body in bodies]
        for each in sets:
            logs = [misses(*found, each) for found in zip(bodies, curves, strict=True)]
            factors = [np.exp(np.median(np.nan_to_num(np.abs(x), nan=NO_WAVE))) for x in logs]
            row(each.name, "median factor", *(f"{x:.2f}" for x in factors))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m bench.layered_skin")
    parser.add_argument("--presets", action="store_true", help="skip the fits")
    main(parser.parse_args().presets)
