"""Which sheet did Lim, Seifi and Park measure?

The paper publishes five claims about spectral lines on a sheet of paper (M1 to M5 in
`docs/results.md`), but not the sheet: its size, support, tension, grammage and moduli, the places
of the five points, the quantity that the vibrometer read, and the drive law of the device. This
script draws all of them from a Latin hypercube, computes the lines of each candidate under the 15
Tactons, and counts the candidates that show each claim.

    python examples/which_sheet.py --samples 2000 -o which-sheet

A candidate takes about a second of one core. The table `candidates.csv` grows row by row, and the
same command continues it after Ctrl-C. The nearest sheets are written as scene files; to run one
whose drive law is defined here, name this module as an extension:

    PYTHONPATH=examples SKINWAVE_EXTENSIONS=which_sheet skinwave run which-sheet/sheet-1.toml

A candidate is an orthotropic, stretched thin plate in air, by Ritz's method, in the steady state.
It is linear: a sheet that sags by more than half its thickness would stretch, and be stiffer.
"""

import argparse
import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from simple_model import DRIVES, DriveLaw, Response
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.plates.modes import PlateModes, modal_motion, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from skinwave.models.plate_modes import plate_of, relative_modulus
from skinwave.results.claims import BOTH, CLAIMS, MUCH_LOWER, NEEDED, rival_levels, strongest_rival
from skinwave.results.run import Run
from skinwave.scene.distributions import uniform
from skinwave.scene.file import dumps, from_table
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import Scene
from skinwave.scene.variation import Choice, combinations
from skinwave.system.plain_text import number_in

Floats = NDArray[np.float64]
Row = Mapping[str, Any]  # of a candidate: its parameters, and what was found

COMPRESSION = 0.25  # of the pressure at small drive over that at full drive, less 1
SIDES = {"A3": (420, 297), "A4": (297, 210), "A5": (210, 148), "A6": (148, 105)}  # mm
SUPPORTS = ("clamped", "simply", "two_edges", "two_clips", "corners")
# What is not published: words, or the bounds of a number. "square" has sides of side_mm.
PARAMETERS: dict[str, tuple[Any, ...]] = {
    "size": (*SIDES, "square"),
    "side_mm": (60, 300),
    "support": SUPPORTS,
    "tension_x_n_per_m": (0, 50),  # of edges that are held
    "tension_y_n_per_m": (0, 50),
    "grammage_g_m2": (60, 120),
    "young_x_gpa": (4, 9),
    "young_ratio": (0.3, 0.7),  # across over along
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
CLIP_RADIUS = 0.005  # m
KEPT_CLEAR = 0.030  # m between the middle of the path and an edge
CLAIMED = ("M1", "M2", "M3", "M4", "M5")
# M4 of a paper sheet adds velocity to displacement; S4 asks the same of the quantity that is read.
ASSESSED_AS = {"M4": "S4"}
FINEST = 1.35  # of the bending wavenumber at the frequency below: strong lines within 2 %
RESOLVED = 430.0  # Hz: 2 f_AM, 2 f_d and their neighbours are below it
COARSEST = 170.0  # rad/m: of the focal spot
TIMES = np.arange(2500) / 2500.0  # s: lines up to 1250 Hz, for 1 s
ACROSS = 41  # places along each side where the sag is evaluated
PLAUSIBLE = 10.0  # thicknesses, about 1 mm, by which a sheet that was measured may sag
SHEETS = 3  # scene files of the nearest ones
BINS, SHUFFLES = 5, 40  # of a number; of the information that few rows show by chance


def clipped(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """[A max(0, 1 + 2 m M)/(1 + 2 m)]^2: sound pressure modulated beyond its full depth, and off
    where it would change its sign.
    """
    return (amplitude * np.maximum(1 + 2 * depth * modulation, 0) / (1 + 2 * depth)) ** 2


def compressed(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """(1 + c) x/(1 + c x) of x = [A (1 + m M)/(1 + m)]^2: acoustic saturation, by which full drive
    yields less than in proportion.
    """
    x = (amplitude * (1 + depth * modulation) / (1 + depth)) ** 2
    return np.asarray((1 + COMPRESSION) * x / (1 + COMPRESSION * x))


for law in (clipped, compressed):
    DRIVES.setdefault(law.__name__, DriveLaw(name=law.__name__, pressure=law))


def hypercube(samples: int, seed: int = 0) -> list[Row]:
    """Candidates of a Latin hypercube, the same for the same seed."""
    varied = [
        Choice(key=key, values=of) if _is_words(key) else uniform(key, *of)
        for key, of in PARAMETERS.items()
    ]
    return list(combinations(varied, "lhs", samples, seed))


def _is_words(key: str) -> bool:
    return isinstance(PARAMETERS[key][0], str)


def scene_of(candidate: Row) -> Scene:
    """Scene of a candidate under AM of 140 Hz on the circle of 20 mm."""
    x, y = SIDES.get(candidate["size"], (candidate["side_mm"],) * 2)
    thickness = candidate["grammage_g_m2"] / DENSITY  # mm
    off = candidate["off_middle"] * max(0.0, x / 2 - 1e3 * KEPT_CLEAR)
    young_x = 1e9 * candidate["young_x_gpa"]
    table = {
        "name": "a candidate for the sheet that was measured",
        "tacton": {
            "am_frequency_hz": 140.0, "shape": "circle", "size_mm": 20.0, "speed_m_per_s": 12.0,
        },
        "focus": {key: candidate[key] for key in ("height_mm", "drive", "depth_of_modulation")},
        "body": {
            "kind": "sheet", "size_x_mm": x, "size_y_mm": y, "thickness_mm": thickness,
            "sides": "clamped", "air": True, "mounting": _mounting(candidate, x, y),
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
    }  # fmt: skip
    return from_table(table)


def _mounting(candidate: Row, x: float, y: float) -> dict[str, Any]:
    """Edges, tension and clips of a sheet with sides in mm."""
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
    radius = 1e3 * CLIP_RADIUS
    rows = [y / 2 - radius, radius - y / 2][: 2 if support == "corners" else 1]
    corners = [[side * (x / 2 - radius), row] for row in rows for side in (-1, 1)]
    return found | {"clips_mm": corners, "clip_radius_mm": radius}


def assess(candidate: Row) -> dict[str, Any]:
    """Row of a candidate: its values, its sag, and whether and by which number each claim holds."""
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
    both = [run for run in runs if (run.is_am, run.is_stm) == BOTH]
    row["rival_line"] = strongest_rival(max(both, key=lambda run: rival_levels(run).max()))[0]
    return row


def _runs(scene: Scene, modes: PlateModes) -> Iterator[tuple[Run, Floats]]:
    """Steady state of each Tacton, of the quantity that the vibrometer reads, and the modal forces
    (m,) of its mean.
    """
    asked, offset = scene.reading.record, scene.body.placement.offset
    shapes = modes.at(scene.probe_points - offset)
    paths: dict[Any, NDArray[Any]] = {}  # Tactons on one path share its forces
    for name, tacton in tactons():
        own = replace(scene, pressure=replace(scene.pressure, tacton=tacton))
        path = tacton.trajectory
        if path not in paths:
            paths[path] = modal_path_forces(modes, own.pressure, offset)
        f, forces = load_lines(own.pressure).gather(paths[path])
        f, forces = f[f < 0.5 / TIMES[1]], forces[f < 0.5 / TIMES[1]]
        u = modal_motion(modes, f, forces, partial(relative_modulus, scene.body)) @ shapes.T
        response = Response(
            model="plate-modes", times=TIMES, probes=scene.probe_points, quantity=asked.name,
            values=synthesise(f, asked.factor(2j * np.pi * f)[:, None] * u, TIMES),
        )  # fmt: skip
        mean = forces[f == 0].sum(axis=0).real
        yield Run(tacton=name, body="sheet", scene=own, response=response), mean


def claim_of(claim: str, runs: Sequence[Run]) -> tuple[int, float | None]:
    """Whether a claim holds of all runs that it is about, as 0 or 1, and its value.

    If a line that it needs is below -60 dB in load and response it does not hold, without a value.
    """
    kinds, evaluate = CLAIMS[ASSESSED_AS.get(claim, claim)]
    about = [run for run in runs if (run.is_am, run.is_stm) in kinds]
    needed = set(NEEDED[claim][0] if claim in NEEDED else ["f_AM"])
    if not all(run.frequencies.keys() >= needed for run in about):
        return 0, None
    holds, value, *_ = evaluate(about)
    return int(holds), float(value) if isfinite(value) else None


def fill(path: Path, candidates: Sequence[Row], workers: int = 1) -> list[Row]:
    """Rows of all candidates; those that the table has are read, the others appended to it.

    Raises a ValueError if the table is of other candidates.
    """
    there = read_rows(path) if path.exists() else []
    pairs = zip(there, candidates, strict=False)
    if not all(row[key] == own[key] for row, own in pairs for key in PARAMETERS):
        raise ValueError(f"{path} has other --samples or --seed; choose another -o")
    os.environ |= {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # of each process
    with path.open("a", newline="", encoding="utf-8") as file, ProcessPoolExecutor(workers) as pool:
        compute = pool.map if workers > 1 else map
        for k, row in enumerate(compute(assess, candidates[len(there) :]), len(there)):
            writer = csv.DictWriter(file, row)
            if k == 0:
                writer.writeheader()
            writer.writerow(row)
            file.flush()
    return read_rows(path)


def read_rows(path: Path) -> list[Row]:
    """Rows of a table, numbers as numbers and nan where there is none."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{key: _cell(text) for key, text in row.items()} for row in csv.DictReader(file)]


def _cell(text: str) -> Any:
    number = number_in(text or "nan")
    return text if number is None else number


def holds(rows: Sequence[Row], *claims: str) -> NDArray[np.bool_]:
    """Whether all of some claims hold of each row (r,)."""
    return np.array([all(row[f"{claim}_holds"] for claim in claims) for row in rows])


def share(mask: NDArray[np.bool_]) -> str:
    """Share of a mask (r,) that is set, with its 95 % interval (Clopper and Pearson, 1934)."""
    if not len(mask):
        return "no candidates"
    low, high = binomtest(int(mask.sum()), len(mask)).proportion_ci(0.95, "exact")
    return f"{100 * mask.mean():.2g} % ({100 * low:.2g} to {100 * high:.2g} %)"


def information(rows: Sequence[Row], mask: NDArray[np.bool_]) -> dict[str, float]:
    """Part of the entropy of a mask (r,) that each parameter takes away, less what chance does,
    largest first.
    """
    rng, entropy, found = np.random.default_rng(0), _entropy(mask), {}
    shuffled = [rng.permutation(mask) for _ in range(SHUFFLES)]
    for key, of in PARAMETERS.items():
        values = [row[key] for row in rows]
        if _is_words(key):
            bins = np.array([of.index(value) for value in values])
        else:
            share = (np.array(values) - of[0]) / (of[1] - of[0])
            bins = np.clip((BINS * share).astype(int), 0, BINS - 1)
        gain, *by_chance = (entropy - _entropy(each, bins) for each in (mask, *shuffled))
        told = gain - float(np.mean(by_chance)) if gain > max(by_chance) else 0.0
        found[key] = told / entropy if entropy else 0.0
    return dict(sorted(found.items(), key=lambda each: -each[1]))


def _entropy(mask: NDArray[np.bool_], bins: NDArray[np.int_] | None = None) -> float:
    """Shannon entropy in bits of a mask (r,), given bins (r,)."""
    bins = np.zeros(len(mask), int) if bins is None else bins
    counts = np.stack([np.bincount(bins, mask), np.bincount(bins, ~mask)])
    shares = counts / np.maximum(counts.sum(axis=0), 1)
    logs = np.log2(shares, where=shares > 0, out=np.zeros_like(shares))
    return float(-(counts * logs).sum() / len(mask))


def nearest(rows: Sequence[Row]) -> list[Row]:
    """Plausible sheets, those first that show the most of M1 to M3, and of these those that come
    nearest to what M4 and M5 ask.
    """
    plausible = [r for r in rows if r["sag_over_thickness"] < PLAUSIBLE and isfinite(r["M5_value"])]
    shown = [-sum(row[f"{claim}_holds"] for claim in CLAIMED[:3]) for row in plausible]
    beyond = [max(row["M4_value"], row["M5_value"] - MUCH_LOWER) for row in plausible]
    return [plausible[k] for k in np.lexsort((beyond, shown))]


def findings(rows: Sequence[Row]) -> str:
    """Share of each claim, the parameter that decides it, and the nearest sheets, in lines."""
    lines = [f"{len(rows):,} candidates"]
    sag = np.array([row["sag_over_thickness"] for row in rows])
    for claims in (*((claim,) for claim in CLAIMED), CLAIMED):
        mask = holds(rows, *claims)
        key, part = next(iter(information(rows, mask).items()))
        decides = f"; {key} takes away {100 * part:.0f} % of its entropy" if part else ""
        flat = f"; {share(mask[sag < 0.5])} of sheets that sag by less than half a thickness"
        lines.append(f"{' and '.join(claims)}: {share(mask)}{flat}{decides}")
    for row in nearest(rows)[:SHEETS]:
        shown = [claim for claim in CLAIMED if row[f"{claim}_holds"]]
        lines.append(
            f"near: {row['size']}, {row['support']}, {row['drive']}, sags by "
            f"{row['sag_over_thickness']:.2g} thicknesses, shows {', '.join(shown)}; strongest "
            f"rival {row['rival_line']} {row['M4_value']:+.1f} dB, multiple {row['M5_value']:+.1f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Compute the candidates that are missing, and say what the table shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=2000, help="candidates")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("-o", "--out", type=Path, default=Path("which-sheet"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    candidates = hypercube(options.samples, options.seed)
    rows = fill(options.out / "candidates.csv", candidates, options.workers)
    print(findings(rows))
    for k, row in enumerate(nearest(rows)[:SHEETS], 1):
        (options.out / f"sheet-{k}.toml").write_text(dumps(scene_of(row)), encoding="utf-8")


if __name__ == "__main__":
    main()
