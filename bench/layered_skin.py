"""Layered skin fitted to published waves, and sources held out: `python -m bench.layered_skin`.

Shear moduli, thicknesses and one loss of all layers are fitted, within published ranges, to phase
speeds, 1/e lengths and decay exponents by frequency, as `skinwave validate` defines them. Squared
logarithms of the factors of a set are averaged, and the sets summed. Then the same without one
source, which the fit predicts (*). Last, a modulus of a preset at a time is doubled, to see which
one limits the speed. `--presets` leaves out all fits.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from simple_model import Material
from simple_model.typing import Floats
from skinwave.bodies import BODIES, Body
from skinwave.bodies.parts import solid_of
from skinwave.verify.published import EXPONENT, Published, wave_sets
from skinwave.verify.published_waves import Curves, decay_exponents, leading_wave

GRID = np.arange(100.0, 701.0, 100.0)  # Hz
NO_WAVE, FURTHEST = np.log(3.0), 2.0  # of a factor: without a wave, and the largest that counts
DRAWS, STARTS = 24, 2  # random numbers within the ranges, the best of which start a fit
MOST, STEP = 12, 0.02  # iterations of a fit, and its step of logarithms
LAYERS = ("epidermis", "dermis", "hypodermis")  # from the surface down; what is below is "muscle"


@dataclass(frozen=True, kw_only=True)
class Range:
    """Published range of a number, SI, and its source."""

    low: float
    high: float
    source: str


def _young(low: float, high: float, source: str) -> Range:
    """Range of shear moduli in Pa by Young's moduli in kPa of incompressible tissue."""
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
HELD_OUT = {"palm-layers": ("Manfredi", "Potts"), "forearm-layers": ()}


def values_of(body: Body, names: Iterable[str]) -> dict[str, float]:
    """Numbers of a body by their names in its ranges, SI."""
    solids = [*(solid_of(each.material) for each in body.layers), body.solid]
    known = {name: solid.shear_modulus
             for name, solid in zip((*LAYERS, "muscle"), solids, strict=True)}  # fmt: skip
    known |= {f"{name} thickness": each.thickness
              for name, each in zip(LAYERS, body.layers, strict=True)}  # fmt: skip
    known |= {"depth": body.depth, "loss": body.solid.viscosity / body.solid.shear_modulus}
    return {name: known[name] for name in names}


def with_values(body: Body, values: Mapping[str, float]) -> Body:
    """The body with other numbers; the loss is that of all its layers."""

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


def source_of(published: Published) -> str:
    """First word of a set's name, of its source."""
    return published.name.partition(":")[0]


def ours(body: Body, curves: Curves, published: Published) -> tuple[Floats, Floats, Floats]:
    """Frequencies (n,) of a set from 100 Hz, our values, and the logarithms of their factors over
    the published value or, where only a range is published, its nearer end; nan without a wave.
    """
    f, values = np.array(published.frequencies), np.array(published.values)
    lows, highs = np.array([published.between(k) for k in range(len(f))]).T
    known = f >= GRID[0]
    f, lows, highs, values = f[known], lows[known], highs[known], values[known]
    is_exponent = published.quantity is EXPONENT
    found = decay_exponents(body, f) if is_exponent else curves.at(published.quantity, f)
    return f, found, np.log(found / np.where(np.isnan(values), np.clip(found, lows, highs), values))


def residuals(body: Body, sets: Sequence[Published]) -> Floats:
    """Logarithms of all factors, each set with a weight of 1 in the sum of their squares."""
    curves = leading_wave(body, GRID)
    parts = []
    for each in sets:
        misses = ours(body, curves, each)[2]
        bounded = np.where(np.isnan(misses), NO_WAVE, np.clip(misses, -FURTHEST, FURTHEST))
        parts.append(bounded / np.sqrt(len(misses)))
    return np.concatenate(parts)


def fit(preset: str, sets: Sequence[Published]) -> dict[str, float]:
    """Numbers of a preset, SI, within their ranges: the best of fits that begin at the best of
    random draws and the preset's own numbers.
    """
    ranges, body = RANGES[preset], BODIES[preset]
    low, high = np.log([(each.low, each.high) for each in ranges.values()]).T

    def named(x: Floats) -> dict[str, float]:
        return dict(zip(ranges, np.exp(x).tolist(), strict=True))

    def misses(x: Floats) -> Floats:
        return residuals(with_values(body, named(x)), sets)

    draws = np.random.default_rng(0).uniform(low, high, (DRAWS, len(low)))
    own = np.log(list(values_of(body, ranges).values()))
    draws = np.clip([own, *draws], low + 1e-3, high - 1e-3)
    first = np.argsort([np.square(misses(x)).sum() for x in draws])[:STARTS]
    found = [
        least_squares(misses, x, bounds=(low, high), diff_step=STEP, max_nfev=MOST,
                      x_scale=high - low)
        for x in draws[first]
    ]  # fmt: skip
    return named(min(found, key=lambda each: each.cost).x)


def compare(
    bodies: Mapping[str, Body], sets: Sequence[Published], names: Mapping[str, str]
) -> None:
    """Print published and our values by set and frequency, and the median factor of each set.

    Parameters
    ----------
    bodies : to compare, by the heads of their columns
    sets : to compare them with
    names : by source, the column that was fitted without it
    """
    curves = {name: leading_wave(body, GRID) for name, body in bodies.items()}
    print(f"{'set':30}{'Hz':>5}{'published':>13}", *(f"{name:>20}" for name in bodies))
    for each in sets:
        found = {name: ours(body, curves[name], each) for name, body in bodies.items()}
        size = each.quantity.size
        for f in next(iter(found.values()))[0]:
            k = each.frequencies.index(f)
            low, high = (x / size for x in each.between(k))
            shown = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
            cells = [_cell(f, *columns, size, names.get(source_of(each)) == name)
                     for name, columns in found.items()]  # fmt: skip
            print(f"{each.name:30}{f:5g}{shown:>13}", *cells)
        middle = [f"{_factor(columns[2]):.2f}" for columns in found.values()]
        print(f"{each.name:30}{'median factor':>18}", *(f"{each:>20}" for each in middle))


def _factor(misses: Floats) -> float:
    return float(np.exp(np.median(np.where(np.isnan(misses), NO_WAVE, np.abs(misses)))))


def _cell(at: float, f: Floats, found: Floats, misses: Floats, size: float, held: bool) -> str:
    k = int(np.flatnonzero(f == at)[0])
    if np.isnan(found[k]):
        return f"{'no wave':>20}"
    star = "*" if held else ""
    text = f"{found[k] / size:.3g} ({np.exp(misses[k]):.2f}){star}"
    return f"{text:>20}"


def main(*arguments: str) -> None:
    """Print fits and predictions of both presets."""
    for preset, ranges in RANGES.items():
        sets = [each for each in wave_sets() if preset in each.bodies]
        train = [each for each in sets if preset in each.built]
        numbers = {"preset": values_of(BODIES[preset], ranges)}
        if "--presets" not in arguments:
            numbers["all"] = fit(preset, train)
            for source in HELD_OUT[preset]:
                rest = [each for each in train if source_of(each) != source]
                numbers[f"without {source}"] = fit(preset, rest)
        print(f"\n{preset}: shear moduli in Pa, thicknesses in m, loss in s")
        print(f"{'':22}{'range':>22}", *(f"{name:>20}" for name in numbers))
        for name, each in ranges.items():
            cells = (f"{values[name]:>20.3g}" for values in numbers.values())
            print(f"{name:22}{f'{each.low:.3g} to {each.high:.3g}':>22}", *cells)
        bodies = {name: with_values(BODIES[preset], v) for name, v in numbers.items()}
        compare(bodies, sets, {source: f"without {source}" for source in HELD_OUT[preset]})
        preset_values = numbers["preset"]
        for name in (name for name in preset_values if name in (*LAYERS, "muscle")):
            doubled = with_values(BODIES[preset], preset_values | {name: 2 * preset_values[name]})
            speeds = leading_wave(doubled, GRID).speed
            print(f"twice the modulus of {name}: {speeds[1]:.2f} m/s at 200 Hz, "
                  f"{speeds[3]:.2f} m/s at 400 Hz")  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
