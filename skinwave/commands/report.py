"""One page of a scene or of a result folder: what was asked, modelled, found and trusted."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import (
    add_mesh,
    add_output,
    add_width,
    metre,
    progress_of,
    summarise,
    warn,
)

if TYPE_CHECKING:
    from skinwave.results.views import View
    from skinwave.system.effort import Progress

STYLES, FORMATS = ("report", "talk", "print"), ("svg", "pdf")
FILM_OPTIONS = ("camera", "frames")
MAP_OPTIONS = ("reach", "step", "depth")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "source", type=Path, metavar="SCENE|DIR",
        help="scene file, or a folder that run, compare or report wrote: then no model is run",
    )  # fmt: skip
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--film", action="store_true", help="a film alone, models side by side: .gif or .mp4 (-o)"
    )
    what.add_argument(
        "--map", action="store_true",
        help="a map alone: RMS of the quantity that the probes read, over the body at their depth",
    )  # fmt: skip
    parser.add_argument("--style", choices=STYLES, default="report")
    parser.add_argument(
        "--format", choices=FORMATS, action="append", default=[],
        help="of figures, beside PNG; may be given twice",
    )  # fmt: skip
    parser.add_argument(
        "--beside", type=lambda text: text.split(","), default=[], metavar="BODIES",
        help="on these bodies, too: paper-sheet, skin-slab or palm, with commas between",
    )  # fmt: skip
    add_width(parser)
    parser.add_argument(
        "--only", type=lambda text: text.split(","), default=[], metavar="COLUMNS",
        help="only these, as point-kernel,skin-slab",
    )  # fmt: skip
    parser.add_argument(
        "--quantity", metavar="NAME", help="of a film or map, instead of the scene's"
    )
    parser.add_argument("--camera", choices=("tilted", "front", "top"), help="of a film")
    parser.add_argument(
        "--frames", type=int, metavar="N",
        help="of a film; by default as many as its fastest strong component needs",
    )  # fmt: skip
    parser.add_argument("--reach", type=float, metavar="MM", help="of a map either way: 30")
    parser.add_argument("--step", type=float, metavar="MM", help="between places of a map: 1")
    parser.add_argument(
        "--depth", metavar="MM", help="of a map, instead of the scene's, or a receptor"
    )
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    for kind, names in (("film", FILM_OPTIONS), ("map", MAP_OPTIONS)):
        given = [name for name in names if getattr(options, name) is not None]
        if given and not getattr(options, kind):
            raise ValueError(f"--{given[0]} is of a {kind}; give --{kind}, too")
    if options.quantity is not None and not (options.film or options.map):
        raise ValueError("--quantity is of a film or map; give --film or --map, too")
    return _film(options) if options.film else _map(options) if options.map else _page(options)


def _page(options: argparse.Namespace) -> int:
    from skinwave.report.styles import style
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.scene.file import read
    from skinwave.studies.report import write_report

    chosen, command = style(options.style, options.width), record.of_command(options)
    source, made = options.source, options.source.is_dir()
    scene = None if made else read(source)
    out = options.out or (source / "report" if made else Path(f"{source.stem}-report"))
    inputs = [source, scene.body.file if scene else ""]
    # The report inside a result folder is this command's own, and made anew.
    anew = options.overwrite or (made and options.out is None)
    if made and options.out is None and out.is_symlink():
        raise ValueError(f"{out} is a link; remove it or name the folder to write with --out")
    with (
        output_folder(out, overwrite=anew, inputs=inputs) as folder,
        progress_of(options) as progress,
    ):
        if scene is not None:
            from skinwave.studies.album import make

            said = make(
                folder, scene, progress, h=metre(options.h), solver=options.solver,
                beside=options.beside,
            )  # fmt: skip
            warn(said)
        write_report(
            folder if scene is not None else source, folder, chosen, progress,
            formats=options.format, columns=options.only, command="" if made else command["typed"],
        )  # fmt: skip
        record.write(folder, command, scene=scene)
        size = (folder / "index.html").stat().st_size
    summary = {"out": str(out), "megabytes": round(size / 1e6, 2)}
    summarise(options, summary, f"{size / 1e6:.1f} MB; open {out}/index.html")
    return 0


def _map(options: argparse.Namespace) -> int:
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.results.surface import quantity_map
    from skinwave.scene.file import read
    from skinwave.scene.keys import depth_of
    from skinwave.studies.report import map_sentences, write_map

    if options.source.is_dir():
        raise ValueError(f"{options.source} is a folder; give the scene file of the map")
    scene = read(options.source)
    if options.quantity is not None:
        scene = replace(scene, quantity=options.quantity)
    scene = replace(
        scene, depth=scene.depths[0] if options.depth is None else depth_of(options.depth)
    )
    reach, step = (30.0 if options.reach is None else options.reach,
                   1.0 if options.step is None else options.step)  # fmt: skip
    out = options.out or Path(f"{options.source.stem}-map")
    inputs = [options.source, scene.body.file]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = quantity_map(
                scene, progress, reach=reach / 1e3, step=step / 1e3, h=metre(options.h),
                solver=options.solver,
            )  # fmt: skip
        write_map(folder, scene, found)
        record.write(folder, record.of_command(options), scene=scene)
    said = map_sentences(scene, found)
    summary = {"out": str(out), "sentences": said}
    summarise(options, summary, "\n".join([*said, f"open {out}/index.html"]))
    return 0


def _film(options: argparse.Namespace) -> int:
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
        camera = options.camera or "tilted"
        film(aside, views, style(options.style), progress, camera=camera)
    summary = {"out": str(out), "frames": len(views[0].times), "period_ms": 1e3 * views[0].period}
    summarise(options, summary, f"{len(views[0].times)} frames of {seam(views[0])}; wrote {out}")
    return 0


def _views(options: argparse.Namespace, progress: "Progress") -> "list[View]":
    """Motion to show: of a folder what it keeps, of a scene every model's response."""
    from skinwave.scene.file import read
    from skinwave.studies.album import open_album, shown_views

    if not options.source.is_dir():
        scene = read(options.source)
        if options.quantity is not None:
            scene = replace(scene, quantity=options.quantity)
        views, said = shown_views(
            replace(scene, depth=0.0),  # what is seen is the surface
            progress, h=metre(options.h), solver=options.solver, frames=options.frames,
            beside=options.beside,
        )  # fmt: skip
        warn(said)
        return views
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
