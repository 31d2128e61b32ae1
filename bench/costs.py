"""Predicted over measured cost of a first response; bench/README.md says what is measured."""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import tomli_w

from bench import in_process, table, timed
from skinwave import loads
from skinwave.bodies.build import build
from skinwave.models import BUILT_IN, named
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.scene.file import read
from skinwave.scene.scene import Scene
from skinwave.system.effort import peak_memory

PATH = {
    "am_frequency_hz": 140, "duration_s": 0.5, "shape": "circle", "size_mm": 20, "speed_m_per_s": 12
}  # fmt: skip
FEW, MANY = ([[round(x * 0.4, 1), 0.0] for x in range(n)] for n in (5, 50))
WEAK = "[focus]\npeak_pressure_pa = 1\n"
SKIN = "[body]\nkind = 'slab'\n"
SMALL = SKIN + "size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 10\nsides = 'clamped'\n"
LAYERED = SKIN + "material = 'muscle'\n" + "".join(
    f"[[body.layers]]\nthickness_mm = {t}\nmaterial = '{name}'\n"
    for t, name in ((0.3, "epidermis"), (1, "dermis"), (3, "fat"))
)  # fmt: skip
PAPER = "[body]\npreset = 'paper-sheet'\n"
SHEET = PAPER + "size_x_mm = 50\nsize_y_mm = 50\n"
FILM = (
    "[body]\nkind = 'sheet'\nthickness_mm = 0.1\nmaterial = {density_kg_m3 = 1400, "
    "young_modulus_pa = 4e9, poisson = 0.35, loss_factor = 0.05}\n"
)
HALF = SKIN + "thickness_mm = inf\n"
NONE = "[body]\nkind = 'none'\n"
TWO_EDGES = PAPER + "[body.mounting]\nedges = ['left', 'right']\n"
FILE = "[body]\nkind = 'mesh'\nfile = '{file}'\n"


def circle(body: str, **path: Any) -> str:
    """Return a scene file with a Tacton that differs from `PATH`."""
    return tomli_w.dumps({"tacton": PATH | path}) + body


def case(
    model: str, body: str, probes: object = FEW, more: str = "", **path: Any
) -> tuple[str, str]:
    """Return a model and a scene file."""
    return model, circle(f"{body}[probes]\npoints_mm = {probes}\n{more}", **path)


STRAIN = "quantity = 'largest_shear_strain'\ndepth_mm = 2\n"
SCENES = {  # model and scene file
    "skin slab": case("auto", SKIN),
    "skin slab, 2 s at 50 probes": case("flat-body", SKIN, MANY, duration_s=2),
    "skin slab, strain": case("flat-body", SKIN, more=STRAIN),
    "layered skin": case("flat-body", LAYERED),
    "layered skin, steady": case("flat-body-harmonic", LAYERED, duration_s=1),
    "half-space": case("flat-body", HALF),
    "half-space, steady": case("flat-body-harmonic", HALF),
    "slow path on a half-space": case("auto", HALF, speed_m_per_s=1, duration_s=1),
    "layered skin, elements": case("fem", LAYERED, size_mm=10),
    "palm": case("auto", "[body]\nkind = 'palm'\n"),
    "finger": case("auto", "[body]\nkind = 'finger'\n", [[0, 0], [2, 0]], size_mm=6),
    "disc": case("auto", "[body]\nkind = 'disc'\n"),
    "mesh from a file": case("auto", FILE),
    "small slab, line by line": case("fem-harmonic", SMALL),
    "small slab, step by step": case("fem-transient", SMALL, duration_s=0.03),
    "paper, linear": case("plate-modes-transient", WEAK + PAPER),
    "paper, steady": case("plate-modes", PAPER),
    "plastic film, infinite": case("flat-body", FILM),
    "paper, stretched": case("auto", PAPER),
    "paper on two edges": case("plate-modes-transient", WEAK + TWO_EDGES),
    "paper on two edges, stretched": case("auto", TWO_EDGES, duration_s=0.2),
    "small sheet, elements": case("fem", WEAK + SHEET),
    "small sheet, stretched elements": case("fem-nonlinear", SHEET, duration_s=0.1),
    "small sheet, stretched step by step": case(
        "fem-nonlinear-transient", SHEET + "air = false\n", duration_s=0.008
    ),
    "no body": case("auto", NONE),
    "no body, 5 s at 50 probes": case("point-kernel", NONE, MANY, duration_s=5),
}
TOLERANCES = {"layered skin, elements": 0.1}  # others: 0.05


def scene_of(name: str, folder: Path) -> tuple[Scene, SolveOptions]:
    """Return a scene by its name, with its mesh file in a folder, and its options."""
    model, text = SCENES[name]
    for each in BUILT_IN:  # imported beforehand, because seconds are without imports
        named(each)
    import_module("scipy.interpolate"), import_module("scipy.signal"), import_module("scipy.stats")
    if "{file}" in text:
        import meshio

        mesh = build(loads("[body]\nkind = 'palm'").body, 6e-3).mesh
        meshio.write(folder / "body.vtu", meshio.Mesh(mesh.points, [("tetra10", mesh.tets)]))
        text = text.format(file="body.vtu")
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read(path), SolveOptions(model=model, tolerance=TOLERANCES.get(name, 0.05))


def predicted(folder: Path, name: str) -> dict[str, Any]:
    """Plan a scene; return model, body and cost."""
    found, planning = timed(plan, *scene_of(name, folder))
    return {
        "planning": planning, "model": found.model, "seconds": found.seconds,
        "memory": found.memory, "h": found.h, "size": (found.body.width, found.body.height),
        "symmetry": found.symmetry,
    }  # fmt: skip


def measured(folder: Path, name: str, planned: dict[str, Any]) -> tuple[float, float, float]:
    """Compute the response as planned; return its seconds, CPU seconds and memory in bytes."""
    scene, options = scene_of(name, folder)
    width, height = planned["size"]
    scene = replace(scene, body=replace(scene.body, width=width, height=height))
    options = replace(options, model=planned["model"], h=planned["h"])
    wall, own = time.perf_counter(), time.process_time()
    if named(options.model).is_reduced:
        found = answer(reduce_scene(scene, options, symmetry=planned["symmetry"]), scene)
    else:
        found = compute(scene, options.model, h=options.h, tolerance=options.tolerance)
    wall, own = time.perf_counter() - wall, time.process_time() - own
    assert len(found.times) == len(sample_times(scene))
    return wall, own, peak_memory()


def with_empty_cache(call: Callable[..., Any], *arguments: Any) -> Any:
    """Return the value of a call with a folder of its own, in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SKINWAVE_CACHE"] = folder
        return in_process(call, Path(folder), *arguments)


def compare(names: list[str]) -> None:
    """Print a table of predicted over measured cost."""
    row = table("scene", "model", "planning, s", "predicted, s", "measured, s", "CPU, s", "ratio",
                "GiB", "ratio")  # fmt: skip
    for name in names:
        planned = with_empty_cache(predicted, name)
        wall, own, memory = with_empty_cache(measured, name, planned)
        seconds = wall if named(planned["model"]).is_reduced else own
        row(name, planned["model"], f"{planned['planning']:.1f}", f"{planned['seconds']:.2f}",
            f"{wall:.2f}", f"{own:.1f}", f"{planned['seconds'] / seconds:.2f}",
            f"{memory / 2**30:.2f}", f"{planned['memory'] / memory:.2f}")  # fmt: skip


if __name__ == "__main__":
    os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m bench.costs")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SCENES))
    compare(parser.parse_args().names or [*SCENES])
