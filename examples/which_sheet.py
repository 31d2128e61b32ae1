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
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import binomtest

from simple_model import DRIVES, DriveLaw, Response
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.plates.modes import PlateModes, modal_motion, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from simple_model.quantities import quantity
from skinwave.models.plate_modes import plate_of, relative_modulus
from skinwave.results.claims import BOTH, CLAIMS, MUCH_LOWER, NEEDED, rival_levels, strongest_rival
from skinwave.results.run import Run
from skinwave.scene.file import dumps, from_table
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import Scene
from skinwave.scene.variation import Variation, combinations

Floats = NDArray[np.float64]
Candidate = Mapping[str, Any]
Row = Mapping[str, Any]

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
TABLE = "candidates.csv"


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


def hypercube(samples: int, seed: int = 0) -> list[Candidate]:
    """Candidates of a Latin hypercube, the same for the same seed."""
    varied = [
        Variation(key=key, values=of) if _is_words(key) else Variation(key=key, bounds=of)
        for key, of in PARAMETERS.items()
    ]
    return list(combinations(varied, "lhs", samples, seed))


def _is_words(key: str) -> bool:
    return isinstance(PARAMETERS[key][0], str)


def scene_of(candidate: Candidate) -> Scene:
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


def _mounting(candidate: Candidate, x: float, y: float) -> dict[str, Any]:
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


def assess(candidate: Candidate) -> dict[str, Any]:
    """Row of a candidate: its values, its first mode and sag, and whether and by which number each
    claim holds.
    """
    scene = scene_of(candidate)
    plate = plate_of(scene.body)
    inertia = plate.mass_per_area * (2 * np.pi * RESOLVED) ** 2
    finest = [max(FINEST * (inertia / d) ** 0.25, COARSEST) for d in (plate.d11, plate.d22)]
    modes = plate_modes(plate, finest)
    forces = {name: each for name, *each in _forces(scene, modes)}
    runs = [_run(scene, modes, name, *each) for name, each in forces.items()]
    means = np.array([own[f == 0].sum(axis=0).real for f, own in forces.values()])
    row = dict(candidate)
    row["first_mode_hz"] = float(modes.frequencies[0])
    row["sag_over_thickness"] = _sag(modes, means) / scene.body.depth
    for claim in CLAIMED:
        row[f"{claim}_holds"], row[f"{claim}_value"] = claim_of(claim, runs)
    both = [run for run in runs if (run.is_am, run.is_stm) == BOTH]
    row["rival_line"] = strongest_rival(max(both, key=lambda run: rival_levels(run).max()))[0]
    return row


def _forces(scene: Scene, modes: PlateModes) -> Iterator[tuple[str, Floats, NDArray[Any]]]:
    """Name, frequencies (f,) in Hz and modal forces (f, m) of each Tacton."""
    paths: dict[Any, NDArray[Any]] = {}  # Tactons on one path share its forces
    for name, tacton in tactons():
        load, path = replace(scene.pressure, tacton=tacton), tacton.trajectory
        if path not in paths:
            paths[path] = modal_path_forces(modes, load, scene.body.placement.offset)
        f, forces = load_lines(load).gather(paths[path])
        below = f < 0.5 / TIMES[1]
        yield name, f[below], forces[below]


def _run(scene: Scene, modes: PlateModes, name: str, f: Floats, forces: NDArray[Any]) -> Run:
    """Steady state of a Tacton, of the quantity that the vibrometer reads."""
    shapes = modes.at(scene.probe_points - scene.body.placement.offset)
    u = modal_motion(modes, f, forces, partial(relative_modulus, scene.body)) @ shapes.T
    read = scene.reading.asked.name
    values = synthesise(f, quantity(read).factor(2j * np.pi * f)[:, None] * u, TIMES)
    own = replace(scene, pressure=replace(scene.pressure, tacton=dict(tactons())[name]))
    response = Response(
        model="plate-modes", times=TIMES, probes=scene.probe_points, values=values, quantity=read
    )
    return Run(tacton=name, body="sheet", scene=own, response=response)


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


def _sag(modes: PlateModes, means: Floats) -> float:
    """Largest static deflection in metre, anywhere on the sheet, of modal forces (t, m)."""
    x, y = (np.linspace(-side / 2, side / 2, ACROSS)
            for side in (modes.plate.size_x, modes.plate.size_y))  # fmt: skip
    return float(np.abs(modes.on_grid(x, y) @ (means / modes.squared).T).max())


def fill(path: Path, candidates: Sequence[Candidate], workers: int = 1) -> list[Row]:
    """Rows of all candidates; those that the table has are read, the others appended to it.

    Raises a ValueError if the table is of other candidates.
    """
    there = read_rows(path) if path.exists() else []
    pairs = zip(there, candidates, strict=False)
    if not all(row[key] == own[key] for row, own in pairs for key in PARAMETERS):
        raise ValueError(f"{path} has other --samples or --seed; choose another -o")
    with path.open("a", newline="", encoding="utf-8") as file:
        for k, row in enumerate(_assessed(candidates[len(there) :], workers), len(there)):
            writer = csv.DictWriter(file, row)
            if k == 0:
                writer.writeheader()
            writer.writerow(row)
            file.flush()
    return read_rows(path)


def _assessed(candidates: Sequence[Candidate], workers: int) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from map(assess, candidates)
        return
    os.environ |= {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # of each process
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(assess, candidates)


def read_rows(path: Path) -> list[Row]:
    """Rows of a table, numbers as numbers and nan where there is none."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{key: _cell(key, text) for key, text in row.items()}
                for row in csv.DictReader(file)]  # fmt: skip


def _cell(key: str, text: str) -> Any:
    if key == "rival_line" or (key in PARAMETERS and _is_words(key)):
        return text
    return float(text) if text else float("nan")


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
    rng, entropy = np.random.default_rng(0), _entropy(mask)
    shuffled = [rng.permutation(mask) for _ in range(SHUFFLES)]
    found = {}
    for key in PARAMETERS:
        bins = _binned(rows, key)
        gain, *by_chance = (entropy - _entropy(each, bins) for each in (mask, *shuffled))
        told = gain - float(np.mean(by_chance)) if gain > max(by_chance) else 0.0
        found[key] = told / entropy if entropy else 0.0
    return dict(sorted(found.items(), key=lambda each: -each[1]))


def _binned(rows: Sequence[Row], key: str) -> NDArray[np.int_]:
    values = [row[key] for row in rows]
    if _is_words(key):
        return np.array([PARAMETERS[key].index(value) for value in values])
    low, high = PARAMETERS[key]
    return np.clip((BINS * (np.array(values) - low) / (high - low)).astype(int), 0, BINS - 1)


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

    def shortfall(row: Row) -> tuple[float, float]:
        beyond = max(row["M4_value"], row["M5_value"] - MUCH_LOWER)
        return -sum(row[f"{claim}_holds"] for claim in CLAIMED[:3]), beyond

    plausible = [row for row in rows if row["sag_over_thickness"] < PLAUSIBLE]
    return sorted((r for r in plausible if isfinite(r["M5_value"])), key=shortfall)


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


def draw(rows: Sequence[Row], figure: Figure) -> None:
    """Distribution of the levels that M4 and M5 are about."""
    ax = figure.subplots()
    part = 100 * np.arange(1, len(rows) + 1) / len(rows)
    for column, words, bar, colour in (
        ("M4_value", "strongest rival of f_AM", 0.0, "#0072B2"),
        ("M5_value", "strongest multiple of f_AM or f_d", MUCH_LOWER, "#D55E00"),
    ):
        ax.step(np.sort([row[column] for row in rows]), part, where="post", label=words, c=colour)
        ax.axvline(bar, color=colour, ls=":", label=f"{column[:2]} holds below {bar:g} dB")
    ax.set(xlabel="level, dB re f_AM", ylabel="candidates below it, %", xlim=(-30, 60))
    ax.legend(frameon=False)


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
    rows = fill(options.out / TABLE, candidates, options.workers)
    print(findings(rows))
    for k, row in enumerate(nearest(rows)[:SHEETS], 1):
        (options.out / f"sheet-{k}.toml").write_text(dumps(scene_of(row)), encoding="utf-8")
    figure = Figure(figsize=(7, 4), layout="constrained")
    draw(rows, figure)
    figure.savefig(options.out / "levels.png", dpi=150)


if __name__ == "__main__":
    main()
