"""Recovery of a known material by `skinwave fit`: share of draws inside the 95 % intervals.

    python -m bench.fit_recovery [waveforms | lines | amplitudes] [--spectra] [--draws 50]
        [--starts 20] [--out FILE] [--table]

A slab of skin of another modulus (by up to 30 %), viscosity, gain and delay in each draw moves by
the wavenumber integral; noise of 5 % of the RMS motion at each place is added to waveforms of 1 s,
in three repetitions. With `--spectra` what is measured are complex lines, and the noise of each is
5 % of the strongest at its place: 70 times the noise that such waveforms have in a line. Prints a
row a draw, and at the end the shares, and how far the worst start of all draws is off the true
modulus and off that of the draw's own solution, which differs from the true one by the noise. With
`--out FILE` a row of JSON is added for each draw, and draws that are there are not made again. With
`--table` the fits (not what is measured) take the wavenumber integrals from polynomials of
Chebyshev in the logarithms of modulus and viscosity, which are made once, and whose error is
printed: a run is then thirty times cheaper, and hundreds of fits take minutes.
"""

import argparse
import json
import time
from pathlib import Path
from unittest import mock

import numpy as np
from numpy.polynomial import chebyshev

from simple_model.layers.flat_body import steady_lines
from simple_model.load.spectrum import synthesise
from skinwave.bodies.analytic import compliance
from skinwave.measure import Measurement, predicted
from skinwave.measure.fit import fit
from skinwave.scene.file import read
from skinwave.scene.scene import Scene
from skinwave.scene.variation import varied

SCENE = "examples/am-and-stm-on-skin.toml"
MODULUS, VISCOSITY = "body.material.shear_modulus_pa", "body.material.viscosity_pa_s"
LIMITS = {
    MODULUS: (8000, 80000), VISCOSITY: (1, 20), "gain": (0.2, 5), "delay_ms": (-5, 5),
}  # fmt: skip
NODES = (64, 32)  # of the table, in modulus and viscosity
NOISE, REPETITIONS, RATE, DURATION = 0.05, 3, 10_000, 1.0


def truth(rng: np.random.Generator) -> dict[str, float]:
    return {
        MODULUS: 25e3 * rng.uniform(0.7, 1.3), VISCOSITY: rng.uniform(3, 8),
        "gain": rng.uniform(0.6, 1.6), "delay_ms": rng.uniform(-3, 3),
    }  # fmt: skip


def measured(scene: Scene, spectra: bool, true: dict[str, float], rng: np.random.Generator):
    moved = varied(scene, {key: true[key] for key in (MODULUS, VISCOSITY)})
    f, a = steady_lines(compliance(moved.body), moved.pressure, moved.probe_points)
    late = np.exp(-2j * np.pi * f * true["delay_ms"] / 1e3)
    a = true["gain"] * a * (2j * np.pi * f * late)[:, None]
    given = {"quantity": "velocity", "places": moved.probe_points, "name": "synthetic"}
    if not spectra:
        times = np.arange(int(RATE * DURATION)) / RATE
        x = synthesise(f, a, times)
        noise = NOISE * x.std(axis=0) * rng.standard_normal((REPETITIONS, *x.shape))
        return Measurement(**given, times=times, values=x + noise)
    shape = (2, REPETITIONS, *a[f > 0].shape)
    noise = NOISE / np.sqrt(2) * np.abs(a).max(axis=0) * rng.standard_normal(shape)
    values = a[f > 0] + noise[0] + 1j * noise[1]
    return Measurement(**given, frequencies=f[f > 0], values=values)


def tabulated(exact):
    """The prediction of lines (f, p) as polynomials of modulus and viscosity, made on first use."""
    tables: dict[bytes, np.ndarray] = {}
    x, y = (chebyshev.chebpts1(n) for n in NODES)

    def place(key: str, value: float) -> float:
        low, high = np.log(LIMITS[key])
        return float(2 * (np.log(value) - low) / (high - low) - 1)

    def values(key: str, at: float) -> float:
        low, high = np.log(LIMITS[key])
        return float(np.exp(low + (at + 1) * (high - low) / 2))

    def made(aim, frequencies):
        each = [[exact(aim, {MODULUS: values(MODULUS, a), VISCOSITY: values(VISCOSITY, b)},
                       frequencies) for b in y] for a in x]  # fmt: skip
        by_x = np.linalg.solve(chebyshev.chebvander(x, len(x) - 1), np.reshape(each, (len(x), -1)))
        by_x = by_x.reshape(len(x), len(y), -1).transpose(1, 0, 2).reshape(len(y), -1)
        found = np.linalg.solve(chebyshev.chebvander(y, len(y) - 1), by_x)
        return found.reshape(len(y), len(x), len(frequencies), -1)

    def lines(aim, given, frequencies):
        key = frequencies.tobytes()
        if key not in tables:
            tables[key] = made(aim, frequencies)
            off = [
                np.linalg.norm(lines(aim, one, frequencies) - exact(aim, one, frequencies))
                / np.linalg.norm(exact(aim, one, frequencies))
                for one in some_materials()
            ]
            print(f"table of {len(frequencies)} lines: largest error {max(off):.1e}", flush=True)
        a = chebyshev.chebvander(np.array([place(MODULUS, given[MODULUS])]), len(x) - 1)[0]
        b = chebyshev.chebvander(np.array([place(VISCOSITY, given[VISCOSITY])]), len(y) - 1)[0]
        table = tables[key]
        return (a @ (b @ table.reshape(len(y), -1)).reshape(len(x), -1)).reshape(table.shape[2:])

    return lines


def some_materials() -> list[dict[str, float]]:
    shares = np.random.default_rng(5).random((20, 2))
    return [
        {key: float(LIMITS[key][0] * (LIMITS[key][1] / LIMITS[key][0]) ** share)
         for key, share in zip((MODULUS, VISCOSITY), each, strict=True)}
        for each in shares
    ]  # fmt: skip


def drawn(scene: Scene, kind: str, spectra: bool, draw: int, starts: int) -> dict:
    """Row of a draw: moduli, whether the true values are inside the intervals, CPU seconds."""
    rng = np.random.default_rng([0, draw])
    true = truth(rng)
    data = measured(scene, spectra, true, rng)
    keys = [key for key in LIMITS if key != "delay_ms" or kind != "amplitudes"]
    vary = [f"{key}={LIMITS[key][0]}:{LIMITS[key][1]}" for key in keys]
    began = time.process_time()
    found = fit(scene, data, vary, kind=kind, starts=starts, seed=draw)
    seconds = time.process_time() - began
    by_profile = {each.key: (each.low, each.high) for each in found.profiles}
    values = found.solution.problem.parameters.values
    ended = [values(start.ended)[MODULUS] for start in found.solution.starts]
    return {
        "kind": kind, "spectra": spectra, "draw": draw, "starts": starts, "keys": keys,
        "seconds": seconds, "true": true[MODULUS], "found": found.values[MODULUS], "ended": ended,
        "reached": found.solution.reached, "runs": found.solution.runs,
        "half": float(np.log(found.estimates[0].high / found.estimates[0].low) / 2),
        "chi": found.solution.cost / found.solution.dof,
        "white": bool(found.whiteness.is_white), "turned": found.solution.may_be_turned,
        "inside": [
            [bool(each.low <= true[each.key] <= each.high) for each in found.estimates],
            [bool(by_profile[key][0] <= true[key] <= by_profile[key][1]) for key in keys],
        ],
    }  # fmt: skip


def away(row: dict, of: str) -> float:
    """How far the worst start is off a modulus of the row, relative."""
    return max(abs(modulus / row[of] - 1) for modulus in row["ended"])


def tell(row: dict) -> None:
    print(
        f"{row['kind']} {row['draw']}: worst of {row['starts']} starts "
        f"{100 * away(row, 'true'):.3f} % off the true modulus, "
        f"{100 * away(row, 'found'):.4f} % off the solution; half interval "
        f"{100 * row['half']:.3f} %, chi2/dof {row['chi']:.3f}, {row['runs']} runs, "
        f"{row['seconds']:.1f} s CPU, inside {row['inside']}", flush=True,
    )  # fmt: skip


def conclude(rows: list[dict]) -> None:
    shares = 100 * np.mean([row["inside"] for row in rows], axis=0)
    print(
        f"{rows[0]['kind']}, {len(rows)} draws from {rows[0]['starts']} starts: worst start "
        f"{100 * max(away(row, 'true') for row in rows):.3f} % off the true modulus, "
        f"{100 * max(away(row, 'found') for row in rows):.4f} % off the solution; the solutions "
        f"{100 * max(abs(row['found'] / row['true'] - 1) for row in rows):.3f} % off the true one"
    )
    for key, covariance, profile in zip(rows[0]["keys"], *shares, strict=True):
        print(f"{key}: inside by covariance {covariance:.0f} %, by profile {profile:.0f} %")
    print(f"all: {shares.mean():.1f} %; CPU s {np.median([row['seconds'] for row in rows]):.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", nargs="?", default="waveforms")
    parser.add_argument("--spectra", action="store_true")
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    known, rows = {}, []
    if options.out and options.out.exists():
        for row in map(json.loads, options.out.read_text().splitlines()):
            known[row["kind"], row["spectra"], row["draw"], row["starts"]] = row
    scene, exact = read(SCENE), predicted._flat_lines
    source = tabulated(exact) if options.table else exact
    for draw in range(options.draws):
        row = known.get((options.kind, options.spectra, draw, options.starts))
        if row is None:
            with mock.patch.object(predicted, "_flat_lines", source):
                row = drawn(scene, options.kind, options.spectra, draw, options.starts)
            if options.out:
                with options.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
        tell(row)
        rows.append(row)
    conclude(rows)


if __name__ == "__main__":
    main()
