"""Assessment of a candidate: its lines under all 15 Tactons, and which claims hold.

Steady state of a linear sheet. Claims are those of `studies.claims`, in the
quantity that the candidate reads.
"""

import time
from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response, Trajectory
from simple_model.layers.constant_loss import constant_loss
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.plates.modes import PlateModes, plate_modes, steady_response
from simple_model.plates.path_forces import modal_path_forces
from simple_model.quantities import quantity
from simple_model.typing import Complex
from skinwave.inference.design import (
    Candidate,
    middle,
    name,
    plate,
    pressure,
    probes,
    thickness,
)
from skinwave.results.claims import (
    BOTH,
    CLAIMS,
    MUCH_LOWER,
    NEEDED,
    multiple_levels,
    rival_levels,
    rivals,
    strongest_rival,
)
from skinwave.results.run import Run
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import BODIES, Scene

MODEL, BODY = "plate-modes", "sheet"
FINEST = 1.35  # of the bending wavenumber at the frequency below: strong lines within 2 %
RESOLVED = 430.0  # Hz: 2 f_AM, 2 f_d and their neighbours are below it
COARSEST = 170.0  # rad/m: of the focal spot
TIMES = np.arange(2500) / 2500.0  # s: lines up to 1250 Hz, for 1 s
CLAIMED = ("M1", "M2", "M3", "M4", "M5")
# M4's sentence for a paper sheet adds velocity to displacement; S4 is the same of what is read.
ASSESSED_AS = {"M4": "S4"}
ACROSS = 41  # places along each side where the sag is looked for
TINY = float(np.finfo(float).tiny)


def row(candidate: Candidate, release: str) -> dict[str, Any]:
    """Row of the table of a candidate: its values, which claims hold, by how much, or an error."""
    started = time.perf_counter()
    found = {"key": name(candidate, release), "version": release, "status": "done", **candidate}
    try:
        found |= assessed(candidate)
    except (ValueError, ArithmeticError, MemoryError) as error:
        found |= {"status": "failed", "error": " ".join(str(error).split())}
    return found | {"seconds": time.perf_counter() - started}


def assessed(candidate: Candidate) -> dict[str, Any]:
    """Claims and levels of a candidate, by column."""
    modes = plate_modes(plate(candidate), finest(candidate))
    forces = modal_forces(candidate, modes)
    lines = dict(responses(candidate, modes, forces))
    runs = [as_run(candidate, name, *each) for name, each in lines.items()]
    mean, vibration = _deflections(lines)
    return {
        "first_mode_hz": float(modes.frequencies[0]),
        "mean_over_thickness": mean / thickness(candidate),
        "vibration_over_thickness": vibration / thickness(candidate),
        "sag_over_thickness": sag(modes, forces) / thickness(candidate),
        **_claims(runs), **_rivals(runs),
    }  # fmt: skip


def finest(candidate: Candidate) -> tuple[float, float]:
    """Wavenumbers in rad/m that are resolved along x and y, by bending in vacuum without
    tension, D k^4 = m w^2, both of which air makes up for.
    """
    own = plate(candidate)
    inertia = own.mass_per_area * (2 * np.pi * RESOLVED) ** 2
    k, across = ((inertia / d) ** 0.25 for d in (own.d11, own.d22))
    return max(FINEST * k, COARSEST), max(FINEST * across, COARSEST)


def responses(
    candidate: Candidate, modes: PlateModes, forces: Mapping[str, tuple[Floats, Complex]]
) -> Iterator[tuple[str, tuple[Floats, Complex]]]:
    """Name of each Tacton of some `modal_forces`, and frequencies (f,) in Hz and displacement
    (f, p) in metre.
    """
    every = [np.concatenate(each) for each in zip(*forces.values(), strict=True)]
    outputs = modes.at(probes(candidate) - middle(candidate))
    modulus = constant_loss(candidate["loss_factor"])
    u = steady_response(modes, every[0], every[1], outputs, modulus)
    ends = np.cumsum([len(f) for f, _ in forces.values()])[:-1]
    for (tacton, (f, _)), part in zip(forces.items(), np.split(u, ends), strict=True):
        yield tacton, (f, part)


def modal_forces(candidate: Candidate, modes: PlateModes) -> dict[str, tuple[Floats, Complex]]:
    """Frequencies (f,) in Hz and modal forces (f, m) of each Tacton, by its name."""
    paths: dict[Trajectory, Complex] = {}
    found = {}
    for each, tacton in tactons():
        load = pressure(candidate, tacton)
        if tacton.trajectory not in paths:
            paths[tacton.trajectory] = modal_path_forces(modes, load, middle(candidate))
        f, forces = load_lines(load).gather(paths[tacton.trajectory])
        heard = f < 0.5 / TIMES[1]
        found[each] = f[heard], forces[heard]
    return found


def sag(modes: PlateModes, forces: Mapping[str, tuple[Floats, Complex]]) -> float:
    """Largest static deflection in metre under the mean of any Tacton, anywhere on the sheet."""
    means = np.array([own[f == 0].sum(axis=0).real for f, own in forces.values()])
    x, y = (np.linspace(-side / 2, side / 2, ACROSS)
            for side in (modes.plate.size_x, modes.plate.size_y))  # fmt: skip
    return float(np.abs(modes.on_grid(x, y) @ (means / modes.squared).T).max())


def as_run(candidate: Candidate, tacton: str, f: Floats, u: Complex) -> Run:
    """Run of steady lines (f,) in Hz of a displacement (f, p) in metre, as a candidate reads it."""
    rates = quantity(candidate["quantity"]).factor(2j * np.pi * f)[:, None]
    return run_of(candidate, tacton, TIMES, synthesise(f, rates * u, TIMES))


def run_of(candidate: Candidate, tacton: str, times: Floats, values: Floats) -> Run:
    """Run of a waveform (t, p) of the quantity that a candidate reads."""
    places, read = probes(candidate), candidate["quantity"]
    scene = Scene(
        pressure=pressure(candidate, dict(tactons())[tacton]), body=BODIES["paper-sheet-loose"],
        probes=tuple(map(tuple, places.tolist())), quantity=read,
    )  # fmt: skip
    response = Response(model=MODEL, times=times, probes=places, values=values, quantity=read)
    return Run(tacton=tacton, body=BODY, scene=scene, response=response)


def _deflections(lines: Mapping[str, tuple[Floats, Complex]]) -> tuple[float, float]:
    """Largest mean, and strongest line, at any point under any Tacton, metre."""
    means = [np.abs(u[f == 0]).max(initial=0.0) for f, u in lines.values()]
    return float(max(means)), float(max(np.abs(u[f > 0]).max() for f, u in lines.values()))


def _claims(runs: list[Run]) -> dict[str, Any]:
    """Whether each claim holds of all Tactons that it is about, and its value."""
    columns: dict[str, Any] = {}
    for claim in CLAIMED:
        columns[f"{claim}_holds"], columns[f"{claim}_value"] = claim_of(claim, runs)
    modulated = [run for run in runs if (run.is_am, run.is_stm) in CLAIMS["M1"][0]]
    return columns | {"second_harmonic_db": min(map(_second_harmonic, modulated))}


def claim_of(claim: str, runs: list[Run]) -> tuple[int, float | None]:
    """Whether a claim holds of those of some runs that it is about, as 0 or 1, and its value.

    A line that it needs and that is below -60 dB in load and response is in no list of lines: it
    does not hold, and has no value.
    """
    kinds, assess = CLAIMS[ASSESSED_AS.get(claim, claim)]
    about = [run for run in runs if (run.is_am, run.is_stm) in kinds]
    needed = set(NEEDED[claim][0] if claim in NEEDED else ["f_AM"])
    if not all(run.frequencies.keys() >= needed for run in about):
        return 0, None
    holds, value, _, _ = assess(about)
    return int(holds), float(value) if isfinite(value) else None


def _second_harmonic(run: Run) -> float:
    """Level of 2 f_AM at the point where it is strongest, dB re f_AM there."""
    ratio = run.lines.get("2f_AM", np.zeros(1)) / run.lines["f_AM"]
    return float(20 * np.log10(np.maximum(ratio, 1e-15)).max())


def _rivals(runs: list[Run]) -> dict[str, Any]:
    """Level of the strongest line other than f_AM under AM+STM, dB re f_AM: the largest at each
    point, on each path and in the root mean square over the points, which line under which Tacton,
    and in how many Tactons it is below 0 dB at all points; the same of multiples of f_AM and f_d
    alone, and in how many Tactons these are below M5's bar.
    """
    both = [run for run in runs if (run.is_am, run.is_stm) == BOTH]
    levels, of_multiples = (np.array([of(run) for run in both])
                            for of in (rival_levels, multiple_levels))  # fmt: skip
    worst = levels.max(axis=1)
    strongest = both[int(np.argmax(worst))]
    sizes = np.array([run.scene.tacton.trajectory.size for run in both])

    def by_path(found: Floats) -> list[float]:
        return [float(found[sizes == size].max()) for size in np.unique(sizes)]

    return {
        "rival_db": levels.max(axis=0).tolist(), "rival_by_path_db": by_path(worst),
        "multiple_db": of_multiples.max(axis=0).tolist(),
        "multiple_by_path_db": by_path(of_multiples.max(axis=1)),
        "rival_of_mean_db": max(map(_rival_of_mean, both)),
        "rival_line": strongest_rival(strongest)[0], "rival_tacton": strongest.tacton,
        "multiple_tacton": both[int(np.argmax(of_multiples.max(axis=1)))].tacton,
        "tactons_highest": int((worst < 0).sum()),
        "tactons_much_lower": int((of_multiples.max(axis=1) < MUCH_LOWER).sum()),
    }  # fmt: skip


def _rival_of_mean(run: Run) -> float:
    """Level of the strongest line other than f_AM in the root mean square over the points, dB."""
    rms = {name: float(np.sqrt(np.mean(run.lines[name] ** 2))) for name in rivals(run)}
    own = float(np.sqrt(np.mean(run.lines["f_AM"] ** 2)))
    return 20 * float(np.log10(max(*rms.values(), TINY) / own))
