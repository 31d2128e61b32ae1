"""Write one page about a scene or a result folder; or only a film or a map."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands import common

if TYPE_CHECKING:
    from skinwave.results.views import View
    from skinwave.scene.scene import Scene
    from skinwave.system.effort import Progress

ONLY_WITH = {  # an option -> what it applies to
    "camera": ("film",), "frames": ("film",), "reach": ("map",), "step": ("map",),
    "depth": ("map",), "quantity": ("film", "map"),
}  # fmt: skip


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add(
        "source", type=Path, metavar="SCENE|DIR",
        help="scene file, or a folder that run, compare or report wrote; no model is run for a "
        "folder",
    )  # fmt: skip
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--film", action="store_true", help="write only a film of all models, .gif or .mp4"
    )
    what.add_argument(
        "--map", action="store_true",
        help="write only a map of the RMS over the body, of the quantity and at the depth of the "
        "probes",
    )  # fmt: skip
    add(
        "--style", choices=("report", "talk", "print"), default="report",
        help="style of figures (default: report)",
    )  # fmt: skip
    add(
        "--format", choices=("svg", "pdf"), action="append", default=[],
        help="format of figures besides PNG; may be repeated",
    )  # fmt: skip
    add(
        "--beside", type=lambda text: text.split(","), default=[], metavar="BODIES",
        help="add these bodies: paper-sheet, skin-slab or palm, separated by commas",
    )  # fmt: skip
    common.add_options(parser, "--width")
    add(
        "--only", type=lambda text: text.split(","), default=[], metavar="COLUMNS",
        help="show only these models, such as point-kernel,skin-slab",
    )  # fmt: skip
    add("--quantity", metavar="NAME", help="quantity of a film or map (default: that of the scene)")
    add("--camera", choices=("tilted", "front", "top"), help="camera of a film (default: tilted)")
    add(
        "--frames", type=int, metavar="N",
        help="frames of a film (default: enough for its fastest strong line)",
    )  # fmt: skip
    add("--reach", type=float, metavar="MM", help="half width of a map (default: 30 mm)")
    add("--step", type=float, metavar="MM", help="grid step of a map (default: 1 mm)")
    add(
        "--depth", metavar="MM",
        help="depth of a map in mm, or a receptor (default: that of the scene)",
    )  # fmt: skip
    common.add_options(parser, "--element-size", "--solver")
    common.add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    for name, kinds in ONLY_WITH.items():
        if getattr(options, name) is not None and not any(getattr(options, k) for k in kinds):
            raise ValueError(
                f"--{name} applies only to a {' or '.join(kinds)}; add --{' or --'.join(kinds)}, "
                f"or remove --{name}"
            )
    return _film(options) if options.film else _map(options) if options.map else _page(options)


def _page(options: argparse.Namespace) -> int:
    from skinwave.report.styles import style
    from skinwave.results import record
    from skinwave.studies.album import write_album
    from skinwave.studies.report import write_report

    chosen, command = style(options.style, options.width), record.command_entry(options)
    source, has_results = options.source, options.source.is_dir()
    scene = None if has_results else _scene(options)
    if has_results and options.out is None:
        # The report inside a result folder is made by this command alone, and replaced.
        options.out, options.overwrite = source / "report", True
        if options.out.is_symlink():
            raise ValueError(f"{options.out} is a link; remove it, or name a folder with --out")
    failures: dict[str, str] = {}
    with common.result_folder(options, f"{source.stem}-report", scene) as (folder, progress):
        if scene is not None:
            warnings, failures = write_album(
                folder, scene, common.solve_options(options, progress), beside=options.beside
            )
            common.warn(warnings)
        failures = write_report(
            folder if scene else source, folder, chosen, progress, formats=options.format,
            columns=options.only, command=command["typed"] if scene else "", failures=failures,
        )  # fmt: skip
        size = (folder / "index.html").stat().st_size / 1e6
    return common.summarise_page(
        options, [f"page of {size:.1f} MB"], failures, megabytes=round(size, 2)
    )


def _map(options: argparse.Namespace) -> int:
    from skinwave.results.surface import quantity_map
    from skinwave.scene.receptors import depth_of
    from skinwave.studies.report import map_sentences, write_map

    if options.source.is_dir():
        raise ValueError(f"{options.source} is a folder; name the scene file for the map")
    scene = _scene(options)
    depth = scene.depths[0] if options.depth is None else depth_of(options.depth)
    scene = replace(scene, depth=depth)
    reach = 30.0 if options.reach is None else options.reach  # mm
    step = 1.0 if options.step is None else options.step
    with common.result_folder(options, f"{options.source.stem}-map", scene) as (folder, progress):
        given = common.solve_options(options, progress)
        found = quantity_map(scene, given, reach=reach / 1e3, step=step / 1e3)
        write_map(folder, scene, found)
    return common.summarise_page(options, map_sentences(scene, found))


def _film(options: argparse.Namespace) -> int:
    from skinwave.report.films import check_format, film, played_text
    from skinwave.report.styles import style
    from skinwave.results.outputs import output_path

    source = options.source
    out = options.out or Path(f"{source.resolve().stem}.gif")
    check_format(out)
    if options.frames is not None and not 2 <= options.frames <= 1000:
        raise ValueError(f"--frames is {options.frames}; give a number from 2 to 1000")
    with (
        output_path(out, overwrite=options.overwrite, inputs=[source]) as aside,
        common.progress_of(options) as progress,
    ):
        views, failures = _views(options, progress)
        camera = options.camera or "tilted"
        film(aside, views, style(options.style), progress, camera=camera)
    frames = len(views[0].times)
    summary = {"out": str(out), "frames": frames, "period_ms": 1e3 * views[0].period}
    text = f"{frames} frames of {played_text(views[0])}; wrote {out}"
    return common.summarise(options, summary, [text], failures)


def _scene(options: argparse.Namespace) -> "Scene":
    """Read the scene file, with the quantity of a film or map."""
    from skinwave.scene.file import read

    scene = read(options.source)
    return scene if options.quantity is None else replace(scene, quantity=options.quantity)


def _views(
    options: argparse.Namespace, progress: "Progress"
) -> "tuple[list[View], dict[str, str]]":
    """Return the saved views of a result folder, or compute those of all models of a scene; also
    return the models that failed.
    """
    from skinwave.studies.album import open_album, quantity_views

    if not options.source.is_dir():
        views, warnings, failures = quantity_views(
            replace(_scene(options), depth=0.0),  # a film shows the surface
            common.solve_options(options, progress), frames=options.frames, beside=options.beside,
        )  # fmt: skip
        common.warn(warnings)
        return views, failures
    if options.quantity is not None:
        raise ValueError(
            f"{options.source} contains displacements only, not {options.quantity}; name its "
            "scene.toml instead"
        )
    if views := list(open_album(options.source).views.values()):
        return views, {}
    raise ValueError(
        f"{options.source} contains no motion of whole bodies; name its scene.toml, or a folder "
        "that skinwave report wrote"
    )
