"""Ritz's method beside finite elements on candidates of the inference.

    python -m bench.sheets_against_fem [--sheets 0 1 ...] [--cells 48] [--coarser 36]

Prints a row a sheet. Both have the same load, loss factor and air:
that in a baffle for frames, none for other supports, which elements take in vacuum only. Errors are
relative to elements: the largest of natural frequencies below 300 Hz, and that of all lines but the
mean, of three Tactons at five points, in the L2 norm. Near a resonance the second is many times the
first: the next one is that of lines of a sheet whose stiffness is off by a part that makes it
least. Elements have errors of their own: "elements" is the difference of these lines to those by
the coarser elements, whose equivalent is thicker in proportion (`skinwave.bodies.sheet`).
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from unittest import mock

import numpy as np
from scipy.optimize import minimize_scalar

from simple_model.layers.constant_loss import constant_loss
from simple_model.layers.material import ModulusLaw
from simple_model.load.spectrum import load_lines
from simple_model.plates.modes import Family, PlateModes, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from simple_model.typing import Complex, Floats
from skinwave.bodies import sheet
from skinwave.inference import registered_laws  # noqa: F401
from skinwave.inference.assess import finest
from skinwave.inference.design import Candidate, hypercube, middle, plate, pressure, probes, sizes
from skinwave.inference.scenes import scene_text
from skinwave.models.prepared import Prepared, prepare
from skinwave.models.reduction import read_at, respond
from skinwave.scene.file import loads
from skinwave.scene.paper15 import tactons

CHOSEN = ("am140", "am80-stm10", "am210-stm20")
HIGHEST = 300.0  # Hz
OFF = 0.02  # of a stiffness
LONGEST = 0.105  # m: larger sheets take elements minutes
SHALLOW = 0.48  # thickness of the equivalent over the size of elements: errors of both are alike


def candidates(count: int) -> list[Candidate]:
    """The first small sheets of the hypercube."""
    return [c for c in hypercube(2000) if max(sizes(c)) < LONGEST][:count]


Lines = dict[str, tuple[np.ndarray, np.ndarray]]


def of_elements(candidate: Candidate, cells: int) -> Prepared:
    """Reduced body of the sheet, in air if it has a frame."""
    body = loads(scene_text(candidate)).body
    body = replace(body, air=body.mounting.is_frame)
    with mock.patch.object(sheet, "SHEET_THICKNESS", SHALLOW / cells):
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
    stiffer: float = 0.0,
) -> Lines:
    """As `by_elements`, of a sheet whose bending stiffness and tension are larger by a part."""
    modulus = constant_loss(candidate["loss_factor"])
    outputs = modes.at(probes(candidate) - middle(candidate))
    found = {}
    for name, (f, force) in forces.items():
        ends = np.cumsum([len(family.squared) for family in modes.families])[:-1]
        parts = zip(modes.families, np.split(force, ends, axis=1), strict=True)
        motion = [damped(family, f, part, modulus, stiffer) for family, part in parts]
        found[name] = f, np.hstack(motion) @ outputs.T
    return found


def damped(
    family: Family, f: Floats, forces: Complex, modulus: ModulusLaw, stiffer: float
) -> Complex:
    """Modal coordinates (f, m) of a family, all of its modes together."""
    bending = np.diag(family.squared) if family.bending is None else family.bending
    each = []
    for w, force in zip(2 * np.pi * f, forces, strict=True):
        dynamic = (modulus(w) - 1) * (1 + stiffer) * bending
        own = (1 + stiffer) * family.squared - w**2
        each.append(np.linalg.solve(dynamic + np.diag(own), force))
    return np.array(each)


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


def compared(candidate: Candidate, cells: int, coarser: int) -> tuple[float, ...]:
    """Errors of frequencies and lines, the least one and by which stiffness, that of elements."""
    reduced, modes = of_elements(candidate, cells), of_modes(candidate)
    elements = by_elements(candidate, reduced)
    of_part = partial(by_modes, candidate, modes, modal_forces(candidate, modes))
    own = line_error(elements, by_elements(candidate, of_elements(candidate, coarser)))
    lines, (least, off) = line_error(elements, of_part(0.0)), backward_error(elements, of_part)
    return frequency_error(reduced, modes), lines, least, off, own


def main() -> None:
    """Print the errors of each sheet."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sheets", type=int, nargs="+", default=range(20))
    parser.add_argument("--cells", type=int, default=48)
    parser.add_argument("--coarser", type=int, default=36)
    options = parser.parse_args()
    all_of, found = candidates(max(options.sheets) + 1), []
    for k in options.sheets:
        candidate, (x, y) = all_of[k], sizes(all_of[k])
        found.append(compared(candidate, options.cells, options.coarser))
        frequencies, lines, least, off, own = 100 * np.array(found[-1])
        print(f"{k:2d} {1e3 * x:4.0f} x {1e3 * y:3.0f} mm  {candidate['support']:10s} loss "
              f"{candidate['loss_factor']:.3f}  frequencies {frequencies:5.2f} %  lines "
              f"{lines:6.2f} %, {least:5.2f} % of a stiffness {off:+.2f} % off; elements "
              f"{own:6.2f} %", flush=True)  # fmt: skip
    for words, of in (("median", np.median), ("largest", np.max)):
        print(words + " {:.2f}, {:.2f}, {:.2f}, {:.2f} and {:.2f} %".format(
            *100 * of(np.abs(found), axis=0)))  # fmt: skip


if __name__ == "__main__":
    main()
