"""Which sheet did Lim, Seifi and Park measure?

The paper publishes five claims about spectral lines on a sheet of paper (M1 to M5 in
`skinwave/results/claims.py`), but not the sheet, the measured points, the quantity of the
vibrometer, or the drive law of the device. This script samples all of them with a Latin hypercube,
computes the lines of each candidate under the 15 Tactons, and counts the candidates that show each
claim.

    python examples/which_sheet.py --samples 2000 -o which-sheet

A candidate takes about a second. After Ctrl-C, the same command resumes `candidates.jsonl`. It
writes the nearest sheets as scene files. To run one with a drive law of this module, use

    PYTHONPATH=examples SKINWAVE_EXTENSIONS=which_sheet skinwave run which-sheet/sheet-1.toml

A candidate is a linear plate in open air, in the steady state. A large sag would make it stiffer.
"""

import argparse
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest, entropy

from simple_model import DRIVES, DriveLaw, Response
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.plates.modes import PlateModes, modal_motion, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from skinwave.models.plate_modes import plate_of, relative_modulus
from skinwave.results.claims import CLAIMS, LIMITS, rival_levels, strongest_rival
from skinwave.results.run import Run
from skinwave.scene.distributions import uniform
from skinwave.scene.file import dumps, from_table
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import Scene
from skinwave.scene.variation import Choice, combinations
from skinwave.typing import Array, Bools, Floats, Ints

Row = Mapping[str, Any]  # of a candidate: its parameters and results

COMPRESSION = 0.25  # relative excess of the gain at small drive over that at full drive
SIDES = {"A3": (420, 297), "A4": (297, 210), "A5": (210, 148), "A6": (148, 105)}  # mm
# Unpublished parameters: choices, or the bounds of a number. "square" has sides of side_mm.
PARAMETERS: dict[str, tuple[Any, ...]] = {
    "size": (*SIDES, "square"),
    "side_mm": (60, 300),
    "support": ("clamped", "simply", "two_edges", "two_clips", "corners"),
    "tension_x_n_per_m": (0, 50),  # of held edges
    "tension_y_n_per_m": (0, 50),
    "grammage_g_m2": (60, 120),
    "young_x_gpa": (4, 9),
    "young_ratio": (0.3, 0.7),  # modulus across the grain over that along it
    "loss_factor": (0.01, 0.06),
    "off_middle": (0.0, 0.5),  # of the focus, towards an edge
    "start_mm": (-5, 5),  # of the first point along the radius
    "beside_mm": (0, 10),  # of the points, beside the radius
    "quantity": ("displacement", "velocity"),
    "drive": ("linear", "force_corrected", "pressure_squared", "compressed", "clipped"),
    "depth_of_modulation": (0.5, 1.0),
    "height_mm": (150, 250),
}
DENSITY, POISSON = 780.0, 0.3  # kg/m3 of office paper; nu_xy
CLIP_RADIUS, CLEARANCE = 5.0, 30.0  # mm; between the middle of the path and an edge
CLAIMED = ("M1", "M2", "M3", "M4", "M5")
ASSESSED_AS = {"M4": "S4"}  # M4 adds velocity to displacement; S4 takes the quantity that is read
FINEST = 1.35  # bending wavenumbers at `RESOLVED`, for strong lines within 2 %
RESOLVED = 430.0  # Hz, above 2 f_AM, 2 f_d and their neighbours
COARSEST = 170.0  # rad/m, of the focal spot
TIMES = np.arange(2500) / 2500.0  # s: lines up to 1250 Hz, for 1 s
ACROSS = 41  # places along each side where the sag is evaluated
PLAUSIBLE = 10.0  # thicknesses, about 1 mm, of sag
BINS, SHUFFLES = 5, 40  # of a number; to estimate information by chance


def clipped(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """Return [A max(0, 1 + 2 m M)/(1 + 2 m)]^2: overmodulated sound pressure, never negative."""
    return (amplitude * np.maximum(1 + 2 * depth * modulation, 0) / (1 + 2 * depth)) ** 2


def compressed(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """Return (1 + c) x/(1 + c x), x = [A (1 + m M)/(1 + m)]^2: acoustic saturation."""
    x = (amplitude * (1 + depth * modulation) / (1 + depth)) ** 2
    return np.asarray((1 + COMPRESSION) * x / (1 + COMPRESSION * x))


for law in (clipped, compressed):
    DRIVES.setdefault(law.__name__, DriveLaw(name=law.__name__, pressure=law))


def hypercube(samples: int, seed: int = 0) -> list[Row]:
    """Return the candidates of a Latin hypercube."""
    varied = [
        Choice(key=key, values=values) if isinstance(values[0], str) else uniform(key, *values)
        for key, values in PARAMETERS.items()
    ]
    return list(combinations(varied, "lhs", samples, seed))


def scene_of(candidate: Row) -> Scene:
    """Return the scene of a candidate under AM of 140 Hz on a circle of 20 mm."""
    x, y = SIDES.get(candidate["size"], (candidate["side_mm"],) * 2)
    off = candidate["off_middle"] * max(0.0, x / 2 - CLEARANCE)
    young_x = 1e9 * candidate["young_x_gpa"]
    return from_table({
        "name": "a candidate for the sheet that was measured",
        "tacton": {
            "am_frequency_hz": 140.0, "shape": "circle", "size_mm": 20.0, "speed_m_per_s": 12.0,
        },
        "focus": {key: candidate[key] for key in ("height_mm", "drive", "depth_of_modulation")},
        "body": {
            "kind": "sheet", "size_x_mm": x, "size_y_mm": y,
            "thickness_mm": candidate["grammage_g_m2"] / DENSITY,
            "sides": "clamped", "air": "free", "mounting": _mounting(candidate, x, y),
            "material": {
                "density_kg_m3": DENSITY, "young_x_pa": young_x,
                "young_y_pa": young_x * candidate["young_ratio"], "poisson_xy": POISSON,
                "loss_factor": candidate["loss_factor"],
            },
        },
        "placement": {"offset_mm": [-off, 0.0]},
        "probes": {
            "points_mm": [[candidate["start_mm"] + 5.0 * k, candidate["beside_mm"]]
                          for k in range(5)],
            "quantity": candidate["quantity"],
        },
    })  # fmt: skip


def _mounting(candidate: Row, x: float, y: float) -> dict[str, Any]:
    """Return edges, tension and clips of a sheet with sides in mm."""
    support = candidate["support"]
    along = ["left", "right"] if support in ("clamped", "simply", "two_edges") else []
    across = ["front", "back"] if support in ("clamped", "simply") else []
    found: dict[str, Any] = {"edges": [*along, *across]}
    for edges, axis in ((along, "x"), (across, "y")):
        key = f"tension_{axis}_n_per_m"
        found[key] = candidate[key] if edges else 0.0
    if along:
        found["support"] = "simply" if support == "simply" else "clamped"
        return found
    rows = [y / 2 - CLIP_RADIUS, CLIP_RADIUS - y / 2][: 2 if support == "corners" else 1]
    corners = [[side * (x / 2 - CLIP_RADIUS), row] for row in rows for side in (-1, 1)]
    return found | {"clips_mm": corners, "clip_radius_mm": CLIP_RADIUS}


def assess(candidate: Row) -> dict[str, Any]:
    """Return the row of a candidate: its parameters, sag, and result and value of each claim."""
    scene = scene_of(candidate)
    plate = plate_of(scene.body)
    inertia = plate.mass_per_area * (2 * np.pi * RESOLVED) ** 2
    finest = [max(FINEST * (inertia / d) ** 0.25, COARSEST) for d in (plate.d11, plate.d22)]
    modes = plate_modes(plate, finest)
    runs, means = zip(*_runs(scene, modes), strict=True)
    row = dict(candidate)
    x, y = (np.linspace(-side / 2, side / 2, ACROSS) for side in (plate.size_x, plate.size_y))
    sag = modes.on_grid(x, y) @ (np.array(means) / modes.squared).T
    row["sag_over_thickness"] = float(np.abs(sag).max()) / scene.body.depth
    for claim in CLAIMED:
        row[f"{claim}_holds"], row[f"{claim}_value"] = claim_of(claim, runs)
    both = [run for run in runs if run.is_am and run.is_stm]
    row["rival_line"] = strongest_rival(max(both, key=lambda run: rival_levels(run).max()))[0]
    return row


def _runs(scene: Scene, modes: PlateModes) -> Iterator[tuple[Run, Floats]]:
    """Yield the steady state of each Tacton, and the modal forces (m,) of its mean."""
    quantity, offset = scene.reading.record, scene.body.placement.offset
    shapes = modes.at(scene.probe_points - offset)
    paths: dict[Any, Array] = {}  # Tactons on one path share its forces
    for name, tacton in tactons():
        own = replace(scene, pressure=replace(scene.pressure, tacton=tacton))
        path = tacton.trajectory
        if path not in paths:
            paths[path] = modal_path_forces(modes, own.pressure, offset)
        f, forces = load_lines(own.pressure).gather(paths[path])
        f, forces = f[f < 0.5 / TIMES[1]], forces[f < 0.5 / TIMES[1]]
        u = modal_motion(modes, f, forces, partial(relative_modulus, scene.body)) @ shapes.T
        response = Response(
            model="plate-modes", times=TIMES, probes=scene.probe_points, quantity=quantity.name,
            values=synthesise(f, quantity.factor(2j * np.pi * f)[:, None] * u, TIMES),
        )  # fmt: skip
        mean = forces[f == 0].sum(axis=0).real
        yield Run(tacton=name, body="sheet", scene=own, response=response), mean


def claim_of(claim: str, runs: Sequence[Run]) -> tuple[int, float]:
    """Return whether a claim holds (0 or 1) and its value, nan without the lines that it needs."""
    assessed = CLAIMS[ASSESSED_AS.get(claim, claim)]
    own = [run for run in runs if (run.is_am, run.is_stm) in assessed.kinds]
    needed = set(CLAIMS[claim].needs[0] if CLAIMS[claim].needs else ["f_AM"])
    if not all(run.frequencies.keys() >= needed for run in own):
        return 0, nan
    holds, value, *_ = assessed.assess(own)
    return int(holds), float(value)


def fill(path: Path, candidates: Sequence[Row], workers: int = 1) -> list[Row]:
    """Return the rows of all candidates, after appending the missing ones to the table."""
    path.touch()
    rows = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    if [{key: row[key] for key in PARAMETERS} for row in rows] != candidates[: len(rows)]:
        raise ValueError(f"{path} has other --samples or --seed; choose another -o")
    os.environ |= {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # of each process
    with path.open("a", encoding="utf-8") as file, ProcessPoolExecutor(workers) as pool:
        for row in (pool.map if workers > 1 else map)(assess, candidates[len(rows) :]):
            print(json.dumps(row), file=file, flush=True)
            rows.append(row)
    return rows


def holds(rows: Sequence[Row], *claims: str) -> Bools:
    """Return whether all given claims hold, for each row (r,)."""
    return np.array([all(row[f"{claim}_holds"] for claim in claims) for row in rows])


def share(mask: Bools) -> str:
    """Return the share of a mask (r,), with its 95 % interval (Clopper and Pearson, 1934)."""
    if not len(mask):
        return "no candidates"
    low, high = binomtest(int(mask.sum()), len(mask)).proportion_ci()
    mean, low, high = (f"{float(f'{100 * x:.2g}'):g}" for x in (mask.mean(), low, high))
    return f"{mean} % ({low} to {high} %)"


def information(rows: Sequence[Row], mask: Bools) -> dict[str, float]:
    """Return the share of a mask's entropy that each parameter explains beyond chance, sorted."""
    rng, found = np.random.default_rng(0), {}
    whole = _entropy(mask, np.zeros(len(mask), int))
    shuffled = [rng.permutation(mask) for _ in range(SHUFFLES)]
    for key, (low, high, *_) in PARAMETERS.items():
        values = np.array([row[key] for row in rows])
        if not isinstance(low, str):
            values = np.floor(BINS * (values - low) / (high - low))
        bins = np.unique(values, return_inverse=True)[1]
        gain, *by_chance = (whole - _entropy(each, bins) for each in (mask, *shuffled))
        excess = gain - float(np.mean(by_chance)) if gain > max(by_chance) else 0.0
        found[key] = excess / whole if whole else 0.0
    return dict(sorted(found.items(), key=lambda each: -each[1]))


def _entropy(mask: Bools, bins: Ints) -> float:
    """Return the Shannon entropy in bits of a mask (r,), given bins (r,) without empty ones."""
    counts = np.stack([np.bincount(bins, mask), np.bincount(bins, ~mask)])
    return float(counts.sum(axis=0) @ entropy(counts, base=2) / len(mask))


def nearest(rows: Sequence[Row]) -> list[Row]:
    """Return plausible sheets, those first that show most of M1 to M3, then those near M4, M5."""
    plausible = [r for r in rows if r["sag_over_thickness"] < PLAUSIBLE and isfinite(r["M5_value"])]
    shown = [-sum(row[f"{claim}_holds"] for claim in CLAIMED[:3]) for row in plausible]
    beyond = [max(row["M4_value"], row["M5_value"] - LIMITS.much_lower) for row in plausible]
    return [plausible[k] for k in np.lexsort((beyond, shown))]


def findings(rows: Sequence[Row]) -> str:
    """Summarise the share of each claim, the parameter that decides it, and the nearest sheets."""
    lines = [f"{len(rows):,} candidates"]
    sag = np.array([row["sag_over_thickness"] for row in rows])
    for claims in (*((claim,) for claim in CLAIMED), CLAIMED):
        mask = holds(rows, *claims)
        key, part = next(iter(information(rows, mask).items()))
        decides = f"; {key} explains {100 * part:.0f} % of its entropy" if part else ""
        flat = f"{share(mask[sag < 0.5])} of sheets with a sag below half the thickness"
        lines.append(f"{' and '.join(claims)}: {share(mask)}; {flat}{decides}")
    for row in nearest(rows)[:3]:
        shown = [claim for claim in CLAIMED if row[f"{claim}_holds"]]
        lines.append(
            f"near: {row['size']}, {row['support']}, {row['drive']}, sag of "
            f"{row['sag_over_thickness']:.2g} thicknesses, shows {', '.join(shown)}; rival line "
            f"{row['rival_line']} {row['M4_value']:+.1f} dB, multiple {row['M5_value']:+.1f} dB"
        )
    return "\n".join(lines)


def main() -> None:
    """Compute the missing candidates, and print what the table shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=2000, help="number of candidates")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("-o", "--out", type=Path, default=Path("which-sheet"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path, candidates = options.out / "candidates.jsonl", hypercube(options.samples, options.seed)
    rows = fill(path, candidates, options.workers)
    print(findings(rows))
    for k, row in enumerate(nearest(rows)[:3], 1):
        (options.out / f"sheet-{k}.toml").write_text(dumps(scene_of(row)), encoding="utf-8")


if __name__ == "__main__":
    main()
