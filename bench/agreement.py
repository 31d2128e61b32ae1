"""Agreement of models on random scenes; bench/README.md says when a pair of models agrees.

A scene depends only on the seed and its number.
"""

import argparse
import copy
import math
import random
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from multiprocessing import get_context
from typing import Any

import numpy as np
import tomli_w

import skinwave
from bench import table
from fem.transient import Diverged
from skinwave import models
from skinwave.models.relative_change import relative_changes
from skinwave.scene.file import from_table

SLACK = 1.2  # times the sum of the stated errors
FLOOR = 2e-3  # relative: smaller differences are round-off and interpolation
WEAKEST = 0.01  # of the largest motion: weaker probes are not compared
SLOWEST = 30.0  # s of CPU time, after which a response is stopped and counted as slow
TOLERANCE = 0.05
KERNELS = ("point-kernel", "point-kernel-published")  # their response is a pressure
Table = dict[str, Any]


def random_scene(number: int, seed: int) -> Table:
    """Return the scene with a number and a seed, with the keys of a scene file."""
    draw = random.Random(f"{seed}-{number}")
    body = _body(draw)
    reach = 0.35 * min(body["size_x_mm"], body["size_y_mm"], 40)
    scene = {
        "tacton": _tacton(draw, reach),
        "focus": _focus(draw),
        "body": body,
        "probes": _probes(draw, body, reach),
    }
    _make_hard(random.Random(f"{seed}-{number}-hard"), scene["tacton"], body)
    if body["kind"] not in ("sheet", "palm") and draw.random() < 0.1:
        scene["load"] = {"kind": "shear", "direction": draw.choice(["path", [1.0, 0.0]])}
        if scene["load"]["direction"] == "path" and scene["tacton"]["shape"] == "point":
            scene["load"]["direction"] = [0.0, 1.0]
        scene["probes"]["quantity"] = draw.choice(["displacement_x", "displacement_y", "velocity"])
    elif body["kind"] not in ("sheet",) and draw.random() < 0.05:
        scene["load"] = {"kind": "point_force", "force_n": 1e-3}
        del scene["focus"]
    return scene


def _make_hard(draw: random.Random, tacton: Table, body: Table) -> None:
    """Give some scenes a rhythm of one to ten periods, and some sheets a thickness that is not
    small.
    """
    if draw.random() < 0.15 and "levels" not in tacton and "am_frequency_hz" in tacton:
        on, off = _number(draw, 20, 100), _number(draw, 10, 100)
        periods = round(draw.uniform(1, 10), 2)
        tacton["rhythm"] = {"pulses_ms": [[on, off]]}
        tacton["duration_s"] = round(min(1e-3 * periods * (on + off), 0.6), 4)
    if draw.random() < 0.2 and body["kind"] == "sheet":
        least = min(body["size_x_mm"], body["size_y_mm"])
        body["thickness_mm"] = round(least * draw.uniform(0.02, 0.15), 3)
        if "loss_factor" in body["material"]:
            body["material"]["young_modulus_pa"] = _number(draw, 1e6, 1e8)


def _number(draw: random.Random, low: float, high: float) -> float:
    """Return a random number with four digits, uniform in its logarithm."""
    return float(f"{math.exp(draw.uniform(math.log(low), math.log(high))):.4g}")


def _some(draw: random.Random, chance: float, **choices: list[Any]) -> Table:
    """Return keys with a choice of their values, by chance."""
    return {k: draw.choice(v) for k, v in choices.items()} if draw.random() < chance else {}


def _point(draw: random.Random, reach: float) -> list[float]:
    return [round(draw.uniform(-reach, reach), 2) for _ in range(2)]


def _tacton(draw: random.Random, reach: float) -> Table:
    keys: Table = {"duration_s": _number(draw, 0.005, draw.choice([0.1, 0.5, 2.0]))}
    shape = draw.choice(
        ["point", "point", "line", "circle", "circle", "triangle", "square", "polyline", "recorded"]
    )
    keys["shape"] = shape
    if shape in ("line", "polyline"):
        keys["sweep"] = draw.choice(["there_and_back", "one_way", "sinusoidal"])
    if shape == "recorded":
        gaps = [round(draw.choice([0.0, _number(draw, 0.002, 0.05)]), 5) for _ in range(4)]
        keys["times_s"] = [round(sum(gaps[:k]), 5) for k in range(4)] + [round(sum(gaps) + 0.01, 5)]
        keys["points_mm"] = [_point(draw, reach) for _ in range(5)]
        if draw.random() < 0.3:
            keys["hold"] = True
        if draw.random() < 0.3:
            keys["levels"] = [round(draw.random(), 2) for _ in range(5)]
    elif shape == "polyline":
        keys["points_mm"] = [_point(draw, reach) for _ in range(draw.randint(2, 5))]
        keys["speed_m_per_s"] = _number(draw, 0.02, 30)
    elif shape != "point":
        keys["size_mm"] = _number(draw, 2, reach)
        # At most 2 kHz drawing frequency, far above what bodies follow.
        keys["speed_m_per_s"] = _number(draw, 0.02, min(100, 2 * keys["size_mm"]))
    if draw.random() < 0.7:
        keys["am_frequency_hz"] = _number(draw, 10, 350)
    if draw.random() < 0.15:
        keys["second_am_frequency_hz"] = _number(draw, 10, 350)
        keys["superposition"] = draw.choice([[1.0, 0.0], [0.75, 0.25], [0.5, 0.5]])
    if draw.random() < 0.15:
        keys["envelope_frequency_hz"] = _number(draw, 0.5, 60)
    sampled = shape == "recorded" and "levels" in keys
    if not sampled and draw.random() < 0.15:
        pulses = [[_number(draw, 5, 60), _number(draw, 1, 60)] for _ in range(draw.randint(1, 2))]
        ramp = draw.choice([0.0, 0.3]) * min(on for on, _ in pulses)
        keys["rhythm"] = {"pulses_ms": pulses, "ramp_ms": round(ramp, 3)}
    if shape != "point":
        keys |= _some(draw, 0.15, foci=[[0.0, 0.5], [0.0, 0.25, 0.6]])
    return keys


def _focus(draw: random.Random) -> Table:
    keys: Table = {"peak_pressure_pa": _number(draw, 0.001, 50)}
    keys |= _some(draw, 0.4, drive=["linear", "pressure_squared", "force_corrected"])
    if draw.random() < 0.2:
        keys["depth_of_modulation"] = round(draw.uniform(0.1, 1), 2)
    keys |= _some(draw, 0.2, height_mm=[150, 200, 250])
    return keys | ({"profile": "main_lobe"} if draw.random() < 0.1 else {})


def _body(draw: random.Random) -> Table:
    kind = draw.choice(["slab"] * 5 + ["sheet"] * 5 + ["palm", "disc", "finger"])
    makers = {"slab": _slab, "sheet": _sheet}
    return {"kind": kind} | (makers[kind](draw) if kind in makers else _other(draw, kind))


def _skin(draw: random.Random, softest: float = 8e3, stiffest: float = 80e3) -> Any:
    """Return the material of a solid: a preset, or a table with any law."""
    if draw.random() < 0.25:
        return draw.choice(["palm", "palm-stiff", "palm-zener"])
    keys: Table = {
        "density_kg_m3": round(draw.uniform(950, 1150)),
        "shear_modulus_pa": _number(draw, softest, stiffest),
        "poisson": draw.choice([0.3, 0.45, 0.49]),
    }
    _add_loss(draw, keys, keys["shear_modulus_pa"])
    return keys


def _add_loss(draw: random.Random, keys: Table, modulus: float) -> None:
    law = draw.choice(["voigt", "voigt", "loss_factor", "loss_factor", "prony", "fractional"])
    if law == "voigt":
        keys["viscosity_pa_s"] = float(f"{modulus * draw.uniform(5e-5, 5e-4):.3g}")
    elif law == "loss_factor":
        keys["loss_factor"] = _number(draw, 0.02, 0.5)
    elif law == "prony":
        share, when = draw.uniform(0.1, 0.8), _number(draw, 2e-4, 1e-2)
        keys["prony"] = [{"modulus_pa": float(f"{share * modulus:.3g}"), "time_s": when}]
    else:
        keys["law"] = draw.choice(["fractional-kelvin-voigt", "fractional-zener"])
        keys |= {
            "exponent": round(draw.uniform(0.15, 0.9), 2),
            "time_s": _number(draw, 1e-4, 2e-3),
        }
        if keys["law"] == "fractional-zener":
            keys["fast_modulus_pa"] = float(f"{modulus * draw.uniform(1.5, 5):.3g}")


def _slab(draw: random.Random) -> Table:
    keys: Table = {
        "size_x_mm": round(draw.uniform(16, 32), 1),
        "size_y_mm": round(draw.uniform(16, 32), 1),
        "thickness_mm": round(draw.uniform(2, 8), 1),
        "material": _skin(draw),
        "sides": draw.choice(["absorbing"] * 3 + ["free", "clamped"]),
        "base": draw.choice(["clamped"] * 4 + ["elastic", "absorbing", "free"]),
    }
    if draw.random() < 0.1:
        keys |= {"thickness_mm": math.inf, "base": "clamped"}
    elif keys["base"] == "elastic":
        keys["base_stiffness_n_per_m3"] = _number(draw, 5e5, 5e7)
    if keys["base"] == "free" and keys["sides"] == "free":
        keys["sides"] = "clamped"
    if draw.random() < 0.25:
        keys["layers"] = [
            {"thickness_mm": round(draw.uniform(0.15, 0.4) * min(keys["thickness_mm"], 8), 2),
             "material": _skin(draw)} for _ in range(draw.randint(1, 2))
        ]  # fmt: skip
    return keys


def _sheet(draw: random.Random) -> Table:
    young = _number(draw, 3e8, 6e9)
    material: Table = {
        "density_kg_m3": round(draw.uniform(600, 1000)), "young_modulus_pa": young, "poisson": 0.3
    }  # fmt: skip
    if draw.random() < 0.75:
        material["loss_factor"] = _number(draw, 0.01, 0.2)
    else:
        _add_loss(draw, material, young / 2.6)
    keys: Table = {
        "size_x_mm": round(draw.uniform(15, 40), 1),
        "size_y_mm": round(draw.uniform(15, 40), 1),
        "thickness_mm": round(draw.uniform(0.08, 0.3), 3),
        "material": material,
    }
    mounting: Table = {}
    of_air = draw.random()
    sides = [["left", "right"], ["front", "back"], ["front"], ["left", "front"]]
    mounting |= _some(draw, 0.5, edges=sides)
    if draw.random() < 0.3 and len(mounting.get("edges", "four")) > 1:
        mounting["support"] = "simply"
    if draw.random() < 0.3:
        for axis in "xy":
            mounting[f"tension_{axis}_n_per_m"] = round(draw.uniform(0, 50), 1)
    if mounting:
        keys["mounting"] = mounting
    if of_air < 0.4:
        keys["air"] = "free" if of_air < 0.2 or "edges" in mounting else "baffle"
    return keys


def _other(draw: random.Random, kind: str) -> Table:
    if kind == "palm":
        sizes = [round(draw.uniform(*ends), 1) for ends in ((36, 50), (40, 55), (8, 13))]
        more: Table = {"material": _skin(draw, 15e3)}
    elif kind == "disc":
        across, high = round(draw.uniform(20, 36), 1), round(draw.uniform(3, 8), 1)
        sizes, more = [across, across, high], {"material": _skin(draw)}
        more["sides"] = draw.choice(["free", "clamped", "absorbing"])
    else:
        sizes = [16.0, 25.0, 13.0]
        more = {"base": "free", "sides": "clamped", "regions": {"bone": "bone"},
                "material": _skin(draw, 15e3)}  # fmt: skip
    return dict(zip(("size_x_mm", "size_y_mm", "thickness_mm"), sizes, strict=True)) | more


def _probes(draw: random.Random, body: Table, reach: float) -> Table:
    near = 0.3 if body["kind"] == "finger" else 1.0
    keys: Table = {"points_mm": [_point(draw, near * reach) for _ in range(draw.randint(1, 3))]}
    keys |= _some(draw, 0.4, quantity=["velocity", "acceleration"])
    if body["kind"] == "slab" and draw.random() < 0.15:
        keys["depth_mm"] = round(draw.uniform(0.2, 0.5) * min(body["thickness_mm"], 4), 2)
        keys["quantity"] = draw.choice(["displacement_z", "strain_zz", "displacement"])
    return keys


class TooSlow(Exception):
    """A response took longer than the limit."""


def limited(seconds: float) -> Callable[[str, float], None]:
    """Return a progress callback that raises TooSlow after some seconds of CPU time from now."""
    until = time.process_time() + seconds

    def watch(phase: str, fraction: float) -> None:
        if time.process_time() > until:
            raise TooSlow

    return watch


@dataclass(frozen=True)
class Pair:
    """Difference of two models' responses at the worst probe, and the stated error of each."""

    models: tuple[str, str]
    difference: float
    stated: tuple[float, float]

    @property
    def agrees(self) -> bool:
        return self.difference <= SLACK * sum(self.stated) + FLOOR

    def __str__(self) -> str:
        names = " and ".join(map("{} ({:.2%})".format, self.models, self.stated))
        return f"{names}: {self.difference:.2%}"


@dataclass
class Outcome:
    """Outcome of one scene: pairs of models, faults, and slow models."""

    number: int
    scene: Table
    pairs: list[Pair] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    slow: list[str] = field(default_factory=list)
    is_refused: bool = False

    @property
    def disagreements(self) -> list[Pair]:
        return [pair for pair in self.pairs if not pair.agrees]

    def __str__(self) -> str:
        bad, kind = self.disagreements, self.scene["body"]["kind"]
        slow = f", slow: {', '.join(self.slow)}" if self.slow else ""
        head = f"{kind}, {len(self.pairs)} pairs, {len(bad)} disagree{slow}"
        lines = [f"scene {self.number}: {head}", *map(str, bad), *self.faults]
        if bad or self.faults:
            lines.append(f"  {tomli_w.dumps(self.scene)}".replace("\n", "\n    "))
        return "\n  ".join(lines)


def outcome(
    number: int, scene: Table, only: tuple[str, ...] = (), slowest: float = SLOWEST
) -> Outcome:
    """Compute a scene by all or some models, and compare the responses."""
    result, responses = Outcome(number, scene), {}
    try:
        parsed = from_table(copy.deepcopy(scene))
    except ValueError:
        result.is_refused = True
        return result
    for name in only or [each for each in models.names() if each not in KERNELS]:
        try:
            with warnings.catch_warnings(category=skinwave.SkinwaveWarning, action="ignore"):
                found = skinwave.simulate(parsed, name, TOLERANCE, limited(slowest))
            responses[name] = found
        except TooSlow:
            result.slow.append(name)
        except (ValueError, Diverged):  # refused
            continue
        except Exception:
            result.faults.append(f"fault of {name}: {traceback.format_exc(limit=-2)}")
    for names in combinations(responses, 2):
        a, b = (responses[name] for name in names)
        stated = a.expected_error, b.expected_error
        if not math.isinf(sum(stated)):
            result.pairs.append(Pair(names, difference(a.values, b.values), stated))
    return result


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Return the relative L2 difference of responses (t, p) at the worst probe."""
    if a.shape != b.shape:
        return math.inf
    larger = np.where(np.linalg.norm(a, axis=0) > np.linalg.norm(b, axis=0), a, b)
    sizes = np.linalg.norm(larger, axis=0)
    moves = sizes > WEAKEST * sizes.max()
    return float(relative_changes(a - b, larger)[moves].max(initial=0.0))


def main() -> int:
    """Compare models on random scenes; print disagreements and a table of pairs."""
    parser = argparse.ArgumentParser(prog="python -m bench.agreement", description=__doc__)
    parser.add_argument("count", type=int, help="number of scenes")
    parser.add_argument("seed", type=int)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--models", nargs="+", default=(), help="only these models")
    parser.add_argument("--slowest", type=float, default=SLOWEST, help="CPU time of a response, s")
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.count)
    scenes = [random_scene(k, given.seed) for k in numbers]
    run = partial(outcome, only=tuple(given.models), slowest=given.slowest)
    outcomes = []
    spawn = get_context("spawn")
    with ProcessPoolExecutor(given.workers, spawn, max_tasks_per_child=20) as pool:
        for each in pool.map(run, numbers, scenes):
            outcomes.append(each)
            print(each, flush=True)
    pairs = [pair for each in outcomes for pair in each.pairs]
    shared = Counter(pair.models for pair in pairs)
    bad = Counter(pair.models for pair in pairs if not pair.agrees)
    row = table("pair", "scenes", "disagree")
    for names in sorted(shared):
        row(", ".join(names), f"{shared[names]}", f"{bad[names]}")
    refused = sum(each.is_refused for each in outcomes)
    faults = sum(len(each.faults) for each in outcomes)
    print(f"{len(outcomes)} scenes, {refused} refused: {len(pairs)} pairs, {sum(bad.values())} "
          f"disagree; {faults} faults")  # fmt: skip
    return int(any(each.disagreements or each.faults for each in outcomes))


if __name__ == "__main__":
    raise SystemExit(main())
