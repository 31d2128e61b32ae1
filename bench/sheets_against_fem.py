"""Ritz's method beside finite elements on candidates of the inference: `python -m
bench.sheets_against_fem [N [CELLS]]` prints one row a sheet.

Both have the same load, loss (Rayleigh damping, as elements have it) and air: that in a baffle for
frames, none for other supports, which elements take in vacuum only. The error is that of all lines
but the mean, of three Tactons at five points, relative to elements, in the L2 norm.
"""

import sys
import time
from dataclasses import replace

import numpy as np

from fem.materials import rayleigh_damping
from fem.viscoelastic import LOSS_BAND
from simple_model.load_spectrum import load_lines
from simple_model.plate_modes import plate_modes
from simple_model.plate_response import modal_path_forces
from skinwave.inference.assess import finest
from skinwave.inference.design import Candidate, hypercube, middle, plate, pressure, probes, sizes
from skinwave.inference.scenes import scene_text
from skinwave.models.prepared import prepare
from skinwave.models.reduction import read_at, respond
from skinwave.scene_file import loads
from skinwave.studies.paper15 import tactons

CHOSEN = ("am140", "am80-stm10", "am210-stm20")
LONGEST = 0.105  # m: larger sheets take elements minutes


def candidates(count: int) -> list[Candidate]:
    """The first small sheets of the hypercube."""
    return [c for c in hypercube(2000) if max(sizes(c)) < LONGEST][:count]


def by_elements(candidate: Candidate, cells: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Frequencies and lines (f, p) of each Tacton."""
    scene = loads(scene_text(candidate))
    framed = scene.body.mounting.is_frame
    body = replace(scene.body, air=framed)
    h = min(sizes(candidate)) / cells
    reduced = prepare(body, probes(candidate), h=h)
    found = {}
    for name, tacton in tactons():
        if name in CHOSEN:
            lines = read_at(respond(reduced.body, pressure(candidate, tacton)), reduced.read)
            found[name] = lines.frequencies, lines.lines
    return found


def by_modes(candidate: Candidate) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """As `by_elements`, with modal damping a M + b K of bending."""
    own = plate(candidate)
    modes = plate_modes(
        own if "free" not in (own.left, own.front) else replace(own, air_density=0.0),
        finest(candidate),
    )
    outputs = modes.at(probes(candidate) - middle(candidate))
    by_mass, by_stiffness = rayleigh_damping(candidate["loss_factor"], LOSS_BAND)
    found = {}
    for name, tacton in tactons():
        if name in CHOSEN:
            load = pressure(candidate, tacton)
            f, forces = load_lines(load).gather(modal_path_forces(modes, load, middle(candidate)))
            w = 2 * np.pi * f[:, None]
            rate = by_mass + by_stiffness * modes.elastic * modes.squared
            found[name] = f, forces / (modes.squared + 1j * w * rate - w**2) @ outputs.T
    return found


def error(candidate: Candidate, cells: int) -> float:
    """Relative error of the lines."""
    reference, modes = by_elements(candidate, cells), by_modes(candidate)
    apart = size = 0.0
    for name, (f, u) in reference.items():
        g, v = modes[name]
        kept, same = (f > 0) & (f < 1000), (g > 0) & (g < 1000)
        np.testing.assert_allclose(f[kept], g[same])
        apart += float((np.abs(u[kept] - v[same]) ** 2).sum())
        size += float((np.abs(u[kept]) ** 2).sum())
    return float(np.sqrt(apart / size))


def main(count: int = 20, cells: int = 48) -> None:
    """Print the error of each sheet."""
    found = []
    for candidate in candidates(count):
        started = time.perf_counter()
        found.append(error(candidate, cells))
        x, y = sizes(candidate)
        print(f"{1e3 * x:5.0f} x {1e3 * y:3.0f} mm  {candidate['support']:10s} loss "
              f"{candidate['loss_factor']:.3f}  error {100 * found[-1]:6.2f} %  "
              f"{time.perf_counter() - started:5.1f} s", flush=True)  # fmt: skip
    print(f"median {100 * np.median(found):.2f} %, largest {100 * max(found):.2f} %")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
