"""A candidate at large deflection, under the Tactons that decide M1, M4 and M5.

M1 is about each Tacton without a path, M4 and M5 about each modulated one with a path: where the
linear sheet shows the claim, all of them decide, where it does not, the one under which a rival of
f_AM is strongest; if that one shows it at large deflection, all of them do then. The sheet is
computed by `fem-nonlinear` from rest, and by the modes of the same elements without stretching, in
the steady state: the two differ by large deflection, and by the start.
"""

import time
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from skinwave.inference.assess import as_run, claim_of, run_of
from skinwave.inference.design import PARAMETERS, Candidate, thickness
from skinwave.inference.nearest_sheets import distinct
from skinwave.inference.ranking import Row
from skinwave.inference.scenes import scene_of
from skinwave.models import named
from skinwave.models.advice import beyond
from skinwave.models.stretching import MOST_MODES, unstretched_lines
from skinwave.planning.sheets import modes_below
from skinwave.planning.simulate import compute
from skinwave.results.run import Run
from skinwave.scene.paper15 import tactons

MODEL = "fem-nonlinear"
HIGHEST = 420.0  # Hz: 2 f_AM, the highest of the lines that decide M4 and M5
STEP = 1e-4  # s; the frequency of a mode at 420 Hz is 0.6 % low
ALONE = tuple(name for name, each in tactons()
              if each.am_frequency and not each.trajectory.size)  # fmt: skip
MOVING = tuple(name for name, each in tactons() if each.am_frequency and each.trajectory.size)
ABOUT = {"M1": ALONE, "M4": MOVING, "M5": MOVING}
CLAIMS = tuple(ABOUT)


def candidate_of(row: Row) -> Candidate:
    """The candidate of a row."""
    return {p.key: row[p.key] for p in PARAMETERS}


def refusal(row: Row) -> str:
    """Why a candidate's sheet is not computed at large deflection; empty if it is."""
    scene = scene_of(candidate_of(row), next(tactons())[1])
    if found := beyond(named(MODEL), scene):
        return f"{MODEL} {', and '.join(limit.why for limit in found)}"
    if (count := modes_below(scene.body, HIGHEST)) > MOST_MODES:
        return (
            f"it has about {count:.0f} modes below {HIGHEST:.0f} Hz, of which {MODEL} takes "
            f"{MOST_MODES}"
        )
    return ""


def stretched_sheets(rows: Sequence[Row], count: int) -> list[Row]:
    """The nearest sheets, each of another size or support, that large deflection is computed of."""
    return list(islice(distinct(rows, lambda row: not refusal(row)), count))


def deciding(row: Row, stretched: Sequence[Row] = ()) -> list[str]:
    """Names of the Tactons that decide M1, M4 or M5 of a sheet, by its rows at large deflection
    that are there.
    """
    wanted = {*ALONE, row["rival_tacton"], row["multiple_tacton"]}
    own = [each for each in stretched if each["sheet"] == row["key"] and each["tacton"] in wanted]
    there = {each["tacton"] for each in own if each["status"] == "done"}
    is_open = there == wanted and None in (verdict(own, claim) for claim in CLAIMS)
    if is_open or row["M4_holds"] or row["M5_holds"]:
        wanted |= {*MOVING}
    return [name for name, _ in tactons() if name in wanted]


def claims_of(tacton: str) -> list[str]:
    """The claims that are about a Tacton."""
    return [claim for claim, about in ABOUT.items() if tacton in about]


def verdict(stretched: Sequence[Row], claim: str, how: str = "large") -> bool | None:
    """Whether a claim holds of a sheet, by its rows; None if it may: of some Tactons it holds, and
    others that it is about were not computed.
    """
    by_tacton = {row["tacton"]: row.get(f"{claim}_{how}_holds") for row in stretched}
    if any(held is not None and not held for held in by_tacton.values()):
        return False
    return all(by_tacton.get(tacton) for tacton in ABOUT[claim]) or None


def stretched_row(sheet: Row, tacton: str) -> dict[str, Any]:
    """Row of a sheet under a Tacton: which of the claims that it decides hold, or an error."""
    started = time.perf_counter()
    found: dict[str, Any] = {"sheet": sheet["key"], "tacton": tacton, "status": "done"}
    try:
        found |= _compared(sheet, tacton)
    except (ValueError, ArithmeticError, MemoryError) as error:
        found |= {"status": "failed", "error": " ".join(str(error).split())}
    return found | {"seconds": time.perf_counter() - started}


def _compared(sheet: Row, tacton: str) -> dict[str, Any]:
    candidate = candidate_of(sheet)
    scene = scene_of(candidate, dict(tactons())[tacton])
    f, u = unstretched_lines(scene)
    response = compute(scene, MODEL, dt=STEP)
    columns: dict[str, Any] = {
        "linear_over_thickness": _mean(u[f < 1e-9].real.sum(axis=0)) / thickness(candidate),
        "large_over_thickness": _mean(response.values.mean(axis=0)) / thickness(candidate),
    }
    heard = f < 0.5 / STEP
    runs = {"linear": as_run(candidate, tacton, f[heard], u[heard]),
            "large": _read(candidate, tacton, response)}  # fmt: skip
    for words, run in runs.items():
        columns.update(_levels(tacton, words, run))
    return columns


def _mean(values: Floats) -> float:
    return float(np.abs(values).max())


def _levels(tacton: str, words: str, run: Run) -> Iterator[tuple[str, float | None]]:
    for claim in claims_of(tacton):
        holds, value = claim_of(claim, [run])
        yield f"{claim}_{words}_holds", holds
        yield f"{claim}_{words}", value


def _read(candidate: Candidate, tacton: str, response: Response) -> Run:
    """A displacement in the quantity that a candidate reads."""
    values = response.values if candidate["quantity"] == "displacement" else response.velocity
    return run_of(candidate, tacton, response.times, values)
