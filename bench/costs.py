"""Predicted over measured cost of a first response: `python -m bench.costs [NAME ...]`.

Each scene is planned in one fresh process, and its response is computed as planned in another, both
with an empty cache and with one thread of linear algebra. Seconds are those of the response without
imports, plan and page. Predicted seconds are divided by CPU seconds, which other programs affect
less, and those that the plan measured by wall seconds. Memory is the largest resident size of the
process.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path

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

TACTON = """
[tacton]
am_frequency_hz = {am}
duration_s = {duration}
shape = "circle"
size_mm = {size}
speed_m_per_s = {speed}
"""
PATH = {"am": 140, "duration": 0.5, "size": 20, "speed": 12}
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
TWO_EDGES = PAPER + "[body.mounting]\nedges = ['left', 'right']\n"
FILE = "[body]\nkind = 'mesh'\nfile = '{file}'\n"


def scene_text(body: str, probes: object = FEW, **path: float) -> str:
    """Return a scene file with a circle that differs from `PATH`."""
    return TACTON.format(**PATH | path) + body + f"[probes]\npoints_mm = {probes}\n"


SCENES = {  # name -> scene file, model, and tolerance
    "skin slab": (scene_text(SKIN), "auto", 0.05),
    "skin slab, 2 s at 50 probes": (scene_text(SKIN, MANY, duration=2), "flat-body", 0.05),
    "skin slab, strain": (
        scene_text(SKIN) + "quantity = 'largest_shear_strain'\ndepth_mm = 2\n", "flat-body", 0.05,
    ),
    "layered skin": (scene_text(LAYERED), "flat-body", 0.05),
    "layered skin, steady": (scene_text(LAYERED, duration=1), "flat-body-harmonic", 0.05),
    "half-space": (scene_text(SKIN + "thickness_mm = inf\n"), "flat-body", 0.05),
    "half-space, steady": (scene_text(SKIN + "thickness_mm = inf\n"), "flat-body-harmonic", 0.05),
    "slow path on a half-space": (
        scene_text(SKIN + "thickness_mm = inf\n", speed=1, duration=1), "auto", 0.05,
    ),
    "layered skin, elements": (scene_text(LAYERED + "", size=10), "fem", 0.1),
    "palm": (scene_text("[body]\nkind = 'palm'\n"), "auto", 0.05),
    "finger": (scene_text("[body]\nkind = 'finger'\n", [[0, 0], [2, 0]], size=6), "auto", 0.05),
    "disc": (scene_text("[body]\nkind = 'disc'\n"), "auto", 0.05),
    "mesh from a file": (scene_text(FILE), "auto", 0.05),
    "small slab, line by line": (scene_text(SMALL), "fem-harmonic", 0.05),
    "small slab, step by step": (scene_text(SMALL, duration=0.03), "fem-transient", 0.05),
    "paper, linear": (scene_text(WEAK + PAPER), "plate-modes-transient", 0.05),
    "paper, steady": (scene_text(PAPER), "plate-modes", 0.05),
    "plastic film, infinite": (scene_text(FILM), "flat-body", 0.05),
    "paper, stretched": (scene_text(PAPER), "auto", 0.05),
    "paper on two edges": (scene_text(WEAK + TWO_EDGES), "plate-modes-transient", 0.05),
    "paper on two edges, stretched": (scene_text(TWO_EDGES, duration=0.2), "auto", 0.05),
    "small sheet, elements": (scene_text(WEAK + SHEET), "fem", 0.05),
    "small sheet, stretched elements": (scene_text(SHEET, duration=0.1), "fem-nonlinear", 0.05),
    "small sheet, stretched step by step": (
        scene_text(SHEET + "air = false\n", duration=0.008), "fem-nonlinear-transient", 0.05,
    ),
    "no body": (scene_text("[body]\nkind = 'none'\n"), "auto", 0.05),
    "no body, 5 s at 50 probes": (
        scene_text("[body]\nkind = 'none'\n", MANY, duration=5), "point-kernel", 0.05,
    ),
}  # fmt: skip


def scene_of(name: str, folder: Path) -> tuple[Scene, SolveOptions]:
    """Return a scene by its name, with its mesh file in a folder, and its options."""
    text, model, tolerance = SCENES[name]
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
    return read(path), SolveOptions(model=model, tolerance=tolerance)


def predicted(name: str, folder: Path) -> dict[str, object]:
    """Plan a scene; return model, body and cost."""
    scene, options = scene_of(name, folder)
    started = time.perf_counter()
    found = plan(scene, options)
    return {
        "planning": time.perf_counter() - started, "model": found.model, "seconds": found.seconds,
        "memory": found.memory, "h": found.h, "size": [found.body.width, found.body.height],
        "symmetry": found.symmetry,
    }  # fmt: skip


def measured(name: str, folder: Path, planned: dict[str, object]) -> dict[str, float]:
    """Compute the response as planned; return its seconds, CPU seconds and memory."""
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
    return {"seconds": wall, "cpu": own, "memory": peak_memory()}


def in_process(*arguments: str) -> dict[str, object]:
    """Run a function of this file in a fresh process with an empty cache."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run(
            [sys.executable, "-m", "bench.costs", "--one", folder, *arguments], check=True,
            env=os.environ | threads | {"SKINWAVE_CACHE": folder}, stdout=subprocess.PIPE,
        )  # fmt: skip
    return json.loads(made.stdout.splitlines()[-1])


def compare(names: list[str]) -> None:
    """Print a table of predicted over measured cost."""
    print(f"{'scene':<36}{'model':<24}planning  predicted  measured     CPU  ratio   GiB  ratio")
    for name in names:
        planned = in_process("predicted", name)
        done = in_process("measured", name, json.dumps(planned))
        is_measured = named(planned["model"]).is_reduced
        seconds = done["seconds"] if is_measured else done["cpu"]
        ratio = planned["seconds"] / seconds, planned["memory"] / done["memory"]
        print(
            f"{name:<36}{planned['model']:<24}"
            f"{planned['planning']:6.1f} s{planned['seconds']:9.2f} s"
            f"{done['seconds']:8.2f} s{done['cpu']:6.1f} s{ratio[0]:7.2f}"
            f"{done['memory'] / 2**30:6.2f}{ratio[1]:7.2f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        folder, function, name, *values = sys.argv[2:]
        made = {"predicted": predicted, "measured": measured}[function](
            name, Path(folder), *map(json.loads, values)
        )
        print(json.dumps(made))
    else:
        compare(sys.argv[1:] or list(SCENES))
