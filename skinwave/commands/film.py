"""A period of motion as a film, models side by side."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_mesh, add_reporting, metre, progress_of, summarise, warn

if TYPE_CHECKING:
    from skinwave.results.views import View
    from skinwave.system.effort import Progress


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "source", type=Path, metavar="SCENE|DIR",
        help="scene file, or a folder that report wrote: then no model is run",
    )  # fmt: skip
    parser.add_argument("-o", "--out", type=Path, metavar="FILE", help=".gif (default) or .mp4")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
    parser.add_argument("--style", choices=("report", "talk", "print"), default="report")
    parser.add_argument("--camera", choices=("tilted", "front", "top"), default="tilted")
    parser.add_argument(
        "--frames", type=int, metavar="N",
        help="of a scene; by default as many as its fastest strong component needs",
    )  # fmt: skip
    parser.add_argument(
        "--beside", type=lambda text: text.split(","), default=[], metavar="BODIES",
        help="on these bodies, too: paper-sheet, skin-slab or palm, with commas between",
    )  # fmt: skip
    parser.add_argument(
        "--quantity", metavar="NAME",
        help="that colours the surface, instead of the scene's, such as largest_shear_strain",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    add_mesh(parser)
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.report.films import check_format, film, seam
    from skinwave.report.renderer import renderer
    from skinwave.report.styles import style
    from skinwave.results.outputs import output_path

    source = options.source
    out = options.out or Path(f"{source.resolve().stem}.gif")
    check_format(out)
    if options.frames is not None and not 2 <= options.frames <= 1000:
        raise ValueError(f"frames = {options.frames} is outside 2..1000; a film needs a few")
    if not renderer().found:
        raise ValueError(f"there is nothing to draw a film with: {renderer().said}")
    with (
        output_path(out, overwrite=options.overwrite, inputs=[source]) as aside,
        progress_of(options) as progress,
    ):
        views = _views(options, progress)
        film(aside, views, style(options.style), progress, camera=options.camera)
    summary = {"out": str(out), "frames": len(views[0].times), "period_ms": 1e3 * views[0].period}
    summarise(options, summary, f"{len(views[0].times)} frames of {seam(views[0])}; wrote {out}")
    return 0


def _views(options: argparse.Namespace, progress: "Progress") -> "list[View]":
    """Motion to show: of a folder what it keeps, of a scene every model's response."""
    from skinwave.studies.album import open_album

    if not options.source.is_dir():
        return _computed(options, progress)
    if options.quantity is not None:
        raise ValueError(
            f"{options.source} keeps the motion alone, not {options.quantity}; give its scene.toml"
        )
    if views := list(open_album(options.source).views.values()):
        return views
    raise ValueError(
        f"{options.source} keeps no motion of whole bodies; give its scene.toml, or a folder "
        "that skinwave report wrote"
    )


def _computed(options: argparse.Namespace, progress: "Progress") -> "list[View]":
    """Views of a scene, coloured by the quantity that is asked for."""
    from skinwave.scene.file import read
    from skinwave.studies.album import answers, coloured, plans_of, shown_scenes
    from skinwave.system.document import worst_warnings

    scene = read(options.source)
    if options.quantity is not None:
        scene = replace(scene, quantity=options.quantity)
    scene = replace(scene, depth=0.0)  # what is seen is the surface
    shown, h = shown_scenes(scene, options.beside), metre(options.h)
    plans = plans_of(shown, progress, h=h, solver=options.solver)
    found = list(answers(
        scene, shown, plans, progress, h=h, solver=options.solver, frames=options.frames
    ))  # fmt: skip
    views, said = coloured([(view, run.scene) for view, run in found if view])
    warn([*worst_warnings((run.body, run.response.effort) for _, run in found), *said])
    return views
