"""The point kernel beside finite elements: the main job."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_mesh, add_output, metre, progress_of, summarise, warn

if TYPE_CHECKING:
    from skinwave.scene import Body

TITLE = "The paper's 15 Tactons: point kernel, {}"


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scene", nargs="?", default="paper-15", metavar="SCENE",
        help="scene file, or paper-15, the 15 Tactons of Lim, Seifi and Park (default)",
    )  # fmt: skip
    parser.add_argument(
        "--body", metavar="BODY", help="on this body instead: paper-sheet, skin-slab, palm, or the "
        "file of a hand's surface (stl, ply, obj, glb, vtp) or mesh (vtu, msh, inp, vtk)",
    )  # fmt: skip
    parser.add_argument("--unit", default="m", help="of that file: m (default), cm, mm, um or in")
    parser.add_argument("--up", default="+z", help="its axis that points to the device")
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave import record
    from skinwave.files import folder_name
    from skinwave.outputs import output_folder
    from skinwave.pictures.figures import label
    from skinwave.scene import with_body
    from skinwave.scene_file import read
    from skinwave.studies import paper15
    from skinwave.studies.study import own_scenes, paper_scenes, run_study

    paper = options.scene == "paper-15"
    scene = None if paper else read(options.scene)
    asked = scene
    bodies = _chosen_body(options) if options.body else None
    if scene is None:
        scenes = paper_scenes(bodies)
    else:
        for body in (bodies or {}).values():
            scene = with_body(scene, body)
        scenes = own_scenes(scene, folder_name(scene.name))
    against = " and ".join(label(body) for body in bodies or paper15.MEASURED_ON)
    out = options.out or Path("paper-15" if paper else f"{Path(options.scene).stem}-compared")
    inputs = [] if paper else [options.scene]
    inputs += [body.file for body in (bodies or {}).values()]
    inputs += [scene.body.file] if scene else []
    with (
        output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder,
        progress_of(options) as progress,
    ):
        outcome = run_study(
            scenes, folder, progress,
            title=TITLE.format(against) if scene is None else scene.name,
            command=_again(options),
            h=metre(options.h), solver=options.solver,
        )  # fmt: skip
        record.write(folder, record.of_command(options), scene=asked)
    warn(outcome.warnings)
    held = sum(assessed.holds for assessed in outcome.assessed_claims)
    summary = {
        "out": str(out),
        "runs": outcome.runs,
        "planned": outcome.planned,
        "claims_held": held,
        "claims_assessed": len(outcome.assessed_claims),
        "warnings": outcome.warnings,
        "seconds": round(outcome.seconds, 1),
        "peak_memory_gib": round(outcome.peak_memory / 2**30, 2),
    }
    summarise(
        options,
        summary,
        f"{outcome.runs} of {outcome.planned} runs in {outcome.seconds:.0f} s, "
        f"{outcome.peak_memory / 2**30:.2f} GiB; {held} of {len(outcome.assessed_claims)} claims "
        f"hold; open {out}/index.html",
    )
    return 0 if outcome.runs == outcome.planned else 1


def _again(options: argparse.Namespace) -> str:
    """The command that makes the same comparison."""
    words = ["--body", options.body] if options.body else []
    if options.body and Path(options.body).is_file():
        words += ["--unit", options.unit, "--up", options.up]
    if options.h:
        words += ["--element-size", f"{options.h:g}"]
    return shlex.join(["skinwave", "compare", options.scene, *words])


def _chosen_body(options: argparse.Namespace) -> "dict[str, Body]":
    """By its name, the body that is asked for instead of paper and skin."""
    from skinwave.scene import BODIES, Body

    if options.body in BODIES:
        return {options.body: BODIES[options.body]}
    if not Path(options.body).is_file():
        known = ", ".join(name for name in BODIES if name != "none")
        raise ValueError(
            f"body '{options.body}' is no file and none of {known}; name one of these or a file"
        )
    file = str(Path(options.body).resolve())
    return {"hand": Body(kind="mesh", file=file, unit=options.unit, up=options.up)}
