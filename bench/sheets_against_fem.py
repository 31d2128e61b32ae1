"""Ritz's method beside finite elements on candidates of the inference: `python -m
bench.sheets_against_fem [N [CELLS [FIRST]]]` prints one row a sheet.

Both have the same load, loss (Rayleigh damping, as elements have it) and air: that in a baffle for
frames, none for other supports, which elements take in vacuum only. Two errors are relative to
elements: the largest of natural frequencies below 300 Hz, and that of all lines but the mean, of
three Tactons at five points, in the L2 norm. Near a resonance the second is many times the first:
the third is that of lines of a sheet whose stiffness is off by a part that makes it least. Elements
have errors of their own, of frequency as well: more CELLS show how large.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from simple_model.load_spectrum import load_lines
from simple_model.plate_modes import PlateModes, plate_modes
from simple_model.plate_response import modal_path_forces
from skinwave.bodies.sheet import damping
from skinwave.inference import registered_laws  # noqa: F401
from skinwave.inference.assess import finest
from skinwave.inference.design import Candidate, hypercube, middle, plate, pressure, probes, sizes
from skinwave.inference.scenes import scene_text
from skinwave.models.prepared import Prepared, prepare
from skinwave.models.reduction import read_at, respond
from skinwave.scene_file import loads
from skinwave.studies.paper15 import tactons

CHOSEN = ("am140", "am80-stm10", "am210-stm20")
HIGHEST = 300.0  # Hz
OFF = 0.02  # of a stiffness
LONGEST = 0.105  # m: larger sheets take elements minutes


def candidates(count: int) -> list[Candidate]:
    """The first small sheets of the hypercube."""
    return [c for c in hypercube(2000) if max(sizes(c)) < LONGEST][:count]


Lines = dict[str, tuple[np.ndarray, np.ndarray]]


def of_elements(candidate: Candidate, cells: int) -> Prepared:
    """Reduced body of the sheet, in air if it has a frame."""
    body = loads(scene_text(candidate)).body
    body = replace(body, air=body.mounting.is_frame)
    return prepare(body, probes(candidate), h=min(sizes(candidate)) / cells)


def of_modes(candidate: Candidate) -> PlateModes:
    """Modes of the sheet, in air if it has a frame."""
    own = plate(candidate)
    framed = "free" not in (own.left, own.front)
    return plate_modes(own if framed else replace(own, air_density=0.0), finest(candidate))


def by_elements(candidate: Candidate, reduced: Prepared) -> Lines:
    """Frequencies and lines (f, p) of each Tacton."""
    found = {}
    for name, tacton in tactons():
        if name in CHOSEN:
            lines = read_at(respond(reduced.body, pressure(candidate, tacton)), reduced.read)
            found[name] = lines.frequencies, lines.lines
    return found


Forces = dict[str, tuple[np.ndarray, np.ndarray]]


def modal_forces(candidate: Candidate, modes: PlateModes) -> Forces:
    """Frequencies (f,) and modal forces (f, m) of each Tacton."""
    found = {}
    for name, tacton in tactons():
        if name in CHOSEN:
            load = pressure(candidate, tacton)
            found[name] = load_lines(load).gather(modal_path_forces(modes, load, middle(candidate)))
    return found


def by_modes(
    candidate: Candidate,
    modes: PlateModes,
    forces: Forces,
    rates: tuple[float, float],
    stiffer: float = 0.0,
) -> Lines:
    """As `by_elements`, with modal damping of `rates` a and b, a M + b K of bending, of a sheet
    whose bending stiffness and tension are larger by a part.
    """
    outputs = modes.at(probes(candidate) - middle(candidate))
    by_mass, by_stiffness = rates
    squared = (1 + stiffer) * modes.squared
    rate = by_mass + by_stiffness * modes.elastic * squared
    found = {}
    for name, (f, force) in forces.items():
        w = 2 * np.pi * f[:, None]
        found[name] = f, force / (squared + 1j * w * rate - w**2) @ outputs.T
    return found


def backward_error(elements: Lines, of_part: Callable[[float], Lines]) -> tuple[float, float]:
    """Least error of the lines over stiffnesses that are a little off, and by how much."""
    best = minimize_scalar(
        lambda part: line_error(elements, of_part(part)), bounds=(-OFF, OFF), method="bounded",
        options={"xatol": 1e-5},
    )  # fmt: skip
    return float(best.fun), float(best.x)


def frequency_error(reduced: Prepared, modes: PlateModes) -> float:
    """Largest relative distance of a natural frequency of elements to the next one of the modes."""
    poles = reduced.body.poles.values
    f = np.abs(poles[poles.imag > 0]) / (2 * np.pi)
    f = f[f < HIGHEST]
    return float((np.abs(modes.frequencies - f[:, None]).min(axis=1) / f).max(initial=0.0))


def line_error(reference: Lines, modes: Lines) -> float:
    """Relative error of the lines up to 1 kHz."""
    apart = size = 0.0
    for name, (f, u) in reference.items():
        g, v = modes[name]
        kept, same = (f > 0) & (f < 1000), (g > 0) & (g < 1000)
        np.testing.assert_allclose(f[kept], g[same])
        apart += float((np.abs(u[kept] - v[same]) ** 2).sum())
        size += float((np.abs(u[kept]) ** 2).sum())
    return float(np.sqrt(apart / size))


def main(count: int = 20, cells: int = 48, first: int = 0) -> None:
    """Print the errors of each sheet."""
    found = []
    for candidate in candidates(count)[first:]:
        reduced, modes = of_elements(candidate, cells), of_modes(candidate)
        elements = by_elements(candidate, reduced)
        rates = damping(loads(scene_text(candidate)).body)
        of_part = partial(by_modes, candidate, modes, modal_forces(candidate, modes), rates)
        lines = line_error(elements, of_part(0.0))
        least, off = backward_error(elements, of_part)
        found.append((frequency_error(reduced, modes), lines, least, abs(off)))
        x, y = sizes(candidate)
        print(f"{1e3 * x:4.0f} x {1e3 * y:3.0f} mm  {candidate['support']:10s} loss "
              f"{candidate['loss_factor']:.3f}  frequencies {100 * found[-1][0]:5.2f} %  lines "
              f"{100 * lines:6.2f} %, {100 * least:5.2f} % of a stiffness {100 * off:+.2f} % off",
              flush=True)  # fmt: skip
    for words, of in (("median", np.median), ("largest", np.max)):
        print(words + " {:.2f}, {:.2f}, {:.2f} and {:.2f} %".format(
            *100 * of(found, axis=0)))  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
