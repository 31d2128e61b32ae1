"""Model hierarchy: effect and cost of dropping each assumption of the published model."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, add_size, closing, metre, result_folder, warn

BOTH = "paper-vs-skin"


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scene", metavar="SCENE",
        help=f"scene file (TOML), or {BOTH}: which mechanism makes which line of the 15 Tactons",
    )  # fmt: skip
    add_size(parser, help="element size of all steps, mm")
    parser.add_argument(
        "--update-rate", type=float, default=20.0, metavar="KHZ",
        help="how often the device moves its focus: 20 or 40 kHz",
    )  # fmt: skip
    parser.add_argument(
        "--points", type=int, metavar="N",
        help="how many points on the path the focus rests on, one after another; as many as the "
        "update rate allows",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.models.options import SolveOptions
    from skinwave.scene.file import read
    from skinwave.studies.assumptions import check_rate
    from skinwave.studies.relax import hierarchy_of, sentence, write
    from skinwave.system import document

    h = metre(options.h)
    SolveOptions(h=h)  # which refuses what is out of range
    rate = 1e3 * options.update_rate
    check_rate(rate)
    if options.scene == BOTH:
        return _paper_vs_skin(options)
    scene = read(options.scene)
    name, inputs = f"{Path(options.scene).stem}-relaxed", [options.scene, scene.body.file]
    with result_folder(options, name, inputs, scene) as (folder, progress):
        found = hierarchy_of(scene, progress, h=h, update_rate=rate, points=options.points)
        write(folder, found)
    warnings = document.worst_warnings(found.efforts)
    warn(warnings)
    sentences = [sentence(effect) for effect in found.effects()]
    failed = [f"'{step.name}' failed: {step.error}" for step in found.steps if step.error]
    closing(options, [*sentences, *failed], failed=failed, warnings=warnings)
    return 0


def _paper_vs_skin(options: argparse.Namespace) -> int:
    from skinwave.studies.paper_vs_skin import paper_vs_skin, report, sentences

    if options.points is not None:
        raise ValueError(f"--points is of a scene's path; leave it out with {BOTH}")
    with result_folder(options, BOTH) as (folder, progress):
        found = paper_vs_skin(progress, h=metre(options.h))
        report(found).write(folder)
    closing(options, [*sentences(found), *found.failed])
    return 0
