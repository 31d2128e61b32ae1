"""Compare the point kernel with bodies in which waves propagate: the main command."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands import common

if TYPE_CHECKING:
    from skinwave.measure.comparison import Measured
    from skinwave.scene.scene import Body

PAPER = "paper-15"


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add(
        "scene", nargs="?", default=PAPER, metavar="SCENE",
        help=f"scene file (TOML), or {PAPER} (default): the 15 Tactons of Lim, Seifi and Park",
    )  # fmt: skip
    add(
        "--body", metavar="BODY", help="replace the body: paper-sheet, skin-slab, palm, or a file "
        "with the surface of a hand (stl, ply, obj, glb, vtp) or a mesh (vtu, msh, inp, vtk)",
    )  # fmt: skip
    common.add_options(parser, "--unit", "--up")
    add("--measured", type=Path, metavar="FILE", help="compare with this measurement of the scene")
    add(
        "--delay", type=float, metavar="MS",
        help="delay of the measurement relative to the models in ms (default: fitted)",
    )  # fmt: skip
    add(
        "--gain", type=float, metavar="G",
        help="gain of the measurement relative to the body (default: fitted)",
    )  # fmt: skip
    common.add_options(parser, "--model", "--element-size", "--solver")
    common.add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.measure.comparison import at_measured_places
    from skinwave.report.palette import label
    from skinwave.results import record
    from skinwave.results.files import folder_name
    from skinwave.scene import paper15
    from skinwave.scene.file import read
    from skinwave.scene.scene import BODIES, with_body
    from skinwave.studies.first_screen import first_tacton
    from skinwave.studies.study import own_scenes, paper_scenes, run_study

    given = None if options.scene == PAPER else read(options.scene)
    bodies = _chosen_body(options)
    measured = _read_measurement(options)
    if given is None:
        scenes, out = paper_scenes(bodies or None), PAPER
        against = " and ".join(label(body) for body in bodies or paper15.MEASURED_ON)
        title = f"The paper's 15 Tactons: point kernel, {against}"
    else:
        scene = at_measured_places(given, measured.measurement) if measured else given
        for body in bodies.values():
            scene = with_body(scene, body)
        scenes, title = own_scenes(scene, folder_name(scene.name)), scene.name
        out = f"{Path(options.scene).stem}-compared"
    inputs = [body.file for body in bodies.values()] + [options.scene] * (given is not None)
    with common.result_folder(options, out, given, inputs) as (folder, progress):
        live = list(scenes[first_tacton(scenes)].values())
        if given is None:  # a palm takes minutes on the live page, a flat slab a second
            live.append(with_body(live[-1], BODIES["skin-slab"]))
        outcome = run_study(
            scenes, folder, common.solve_options(options, progress), title=title,
            command=record.command_entry(options)["typed"], measured=measured, live=live,
        )  # fmt: skip
    common.warn(outcome.warnings)
    claims = outcome.assessed_claims
    held, memory = sum(claim.holds for claim in claims), outcome.peak_memory / 2**30
    sentence = (
        f"{outcome.runs} of {outcome.planned} runs in {outcome.seconds:.0f} s, {memory:.2f} GiB; "
        f"{held} of {len(claims)} claims hold"
    )
    code = common.summarise_page(
        options, [*outcome.conclusions, sentence], outcome.failures, runs=outcome.runs,
        planned=outcome.planned, claims_held=held, claims_assessed=len(claims),
        warnings=outcome.warnings,
        seconds=round(outcome.seconds, 1), peak_memory_gib=round(memory, 2),
    )  # fmt: skip
    return code if outcome.runs == outcome.planned else 1


def _read_measurement(options: argparse.Namespace) -> "Measured | None":
    """Read the measurement to compare with, if one is given."""
    if options.measured is None:
        if options.delay is not None or options.gain is not None:
            raise ValueError("--delay and --gain apply to a measurement; add --measured FILE")
        return None
    if options.scene == PAPER:
        raise ValueError(
            f"--measured applies to one scene, but {PAPER} has 15; name the scene file of the "
            "measurement"
        )
    from skinwave.measure.comparison import Measured
    from skinwave.measure.reading import read_complete

    delay = None if options.delay is None else options.delay / 1e3
    return Measured(measurement=read_complete(options.measured), delay=delay, gain=options.gain)


def _chosen_body(options: argparse.Namespace) -> "dict[str, Body]":
    """Return the body of --body by its name; an empty dictionary if none is given."""
    from skinwave.scene.scene import BODIES, Body

    if not options.body:
        return {}
    if options.body in BODIES:
        return {options.body: BODIES[options.body]}
    if not Path(options.body).is_file():
        known = ", ".join(name for name in BODIES if name != "none")
        raise ValueError(
            f"--body {options.body} is neither a known body nor a file; give {known} or the name "
            "of a file"
        )
    file = str(Path(options.body).resolve())
    return {"hand": Body(kind="mesh", file=file, unit=options.unit, up=options.up)}
