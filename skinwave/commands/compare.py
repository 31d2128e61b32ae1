"""The point kernel beside bodies whose waves propagate: the main job."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_mesh, add_output, metre, progress_of, summarise, warn
from skinwave.models import names

if TYPE_CHECKING:
    from skinwave.measure.comparison import Measured
    from skinwave.scene.scene import Body

LIVE = "live.html"
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
    parser.add_argument(
        "--measured", type=Path, metavar="FILE", help="a measurement of that scene to compare with"
    )
    parser.add_argument(
        "--delay",
        type=float,
        metavar="MS",
        help="of the record behind the models (default: fitted)",
    )
    parser.add_argument(
        "--gain", type=float, metavar="G", help="of the record over the body (default: fitted)"
    )
    parser.add_argument(
        "--model", choices=("auto", *names()), default="auto",
        help="of the bodies: the one that a plan takes (default), or one by name, such as fem",
    )  # fmt: skip
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.live.data import comparison_page
    from skinwave.measure.comparison import at_measured
    from skinwave.report.palette import label
    from skinwave.results import record
    from skinwave.results.files import folder_name
    from skinwave.results.outputs import output_folder
    from skinwave.scene import paper15
    from skinwave.scene.file import read
    from skinwave.scene.scene import with_body
    from skinwave.studies.study import own_scenes, paper_scenes, run_study
    from skinwave.system import document

    paper = options.scene == "paper-15"
    scene = None if paper else read(options.scene)
    asked = scene
    bodies = _chosen_body(options) if options.body else None
    measured = _measured(options)
    if scene is None:
        scenes = paper_scenes(bodies)
    else:
        if measured:
            scene = at_measured(scene, measured.measurement)
        for body in (bodies or {}).values():
            scene = with_body(scene, body)
        scenes = own_scenes(scene, folder_name(scene.name))
    against = " and ".join(label(body) for body in bodies or paper15.MEASURED_ON)
    out = options.out or Path("paper-15" if paper else f"{Path(options.scene).stem}-compared")
    inputs = [] if paper else [options.scene]
    inputs += [body.file for body in (bodies or {}).values()]
    inputs += [scene.body.file] if scene else []
    inputs += [options.measured] if options.measured else []
    with (
        output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder,
        progress_of(options) as progress,
    ):
        live = comparison_page(next(iter(scenes.values())).values())
        if live:
            (folder / LIVE).write_text(live, encoding="utf-8")
        outcome = run_study(
            scenes, folder, progress,
            title=TITLE.format(against) if scene is None else scene.name,
            command=record.of_command(options)["typed"],
            model=options.model, h=metre(options.h), solver=options.solver, measured=measured,
            more=[document.live_link(LIVE)] if live else [],
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


def _measured(options: argparse.Namespace) -> "Measured | None":
    """The measurement to compare with, if there is one."""
    if options.measured is None:
        if options.delay is not None or options.gain is not None:
            raise ValueError("--delay and --gain are of a measurement; give --measured FILE, too")
        return None
    if options.scene == "paper-15":
        raise ValueError("--measured is of one scene, and paper-15 has 15; name its scene file")
    from skinwave.measure.comparison import Measured
    from skinwave.measure.reading import read_alone

    delay = None if options.delay is None else options.delay / 1e3
    return Measured(measurement=read_alone(options.measured), delay=delay, gain=options.gain)


def _chosen_body(options: argparse.Namespace) -> "dict[str, Body]":
    """By its name, the body that is asked for instead of paper and skin."""
    from skinwave.scene.scene import BODIES, Body

    if options.body in BODIES:
        return {options.body: BODIES[options.body]}
    if not Path(options.body).is_file():
        known = ", ".join(name for name in BODIES if name != "none")
        raise ValueError(
            f"body '{options.body}' is no file and none of {known}; name one of these or a file"
        )
    file = str(Path(options.body).resolve())
    return {"hand": Body(kind="mesh", file=file, unit=options.unit, up=options.up)}
