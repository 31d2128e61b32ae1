"""Relax the assumptions of the published model one by one: effect and cost of each."""

import argparse
from pathlib import Path

from skinwave.commands.common import (
    add_output,
    metre,
    result_folder,
    summarise_page,
    warn,
)

BOTH = "paper-vs-skin"


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add(
        "scene", metavar="SCENE", help=f"scene file (TOML), or the word {BOTH}, which tells the "
        "mechanism of each line of the 15 Tactons",
    )  # fmt: skip
    add(
        "--element-size", dest="h", type=float, metavar="MM",
        help="element size of all models in mm (default: by the plan)",
    )  # fmt: skip
    add(
        "--update-rate", type=float, default=20.0, metavar="KHZ",
        help="update rate of the device's focus: 20 (default) or 40 kHz",
    )  # fmt: skip
    add(
        "--points", type=int, metavar="N",
        help="number of points on the path at which the focus rests (default: as many as the "
        "update rate allows)",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.models.options import SolveOptions
    from skinwave.scene.file import read
    from skinwave.studies.assumptions import check_rate
    from skinwave.studies.relax import hierarchy_of, sentence, unknown_text, write
    from skinwave.system import document

    h, rate = metre(options.h), 1e3 * options.update_rate
    SolveOptions(h=h)  # raises if it is out of range
    check_rate(rate)
    if options.scene == BOTH:
        return _paper_vs_skin(options)
    scene = read(options.scene)
    name = f"{Path(options.scene).stem}-relaxed"
    with result_folder(options, name, scene, [options.scene]) as (folder, progress):
        found = hierarchy_of(scene, progress, h=h, update_rate=rate, points=options.points)
        write(folder, found)
    warnings = document.worst_warnings(found.efforts)
    warn(warnings)
    effects = found.effects()
    sentences = [*filter(None, [unknown_text(found, effects)]), *map(sentence, effects)]
    return summarise_page(options, sentences, found.failures, warnings=warnings)


def _paper_vs_skin(options: argparse.Namespace) -> int:
    from skinwave.studies.paper_vs_skin import paper_vs_skin, report, sentences

    if options.points is not None:
        raise ValueError(f"--points applies to the path of one scene; remove it for {BOTH}")
    with result_folder(options, BOTH) as (folder, progress):
        found = paper_vs_skin(progress, h=metre(options.h))
        report(found).write(folder)
    return summarise_page(options, sentences(found), found.failures)
