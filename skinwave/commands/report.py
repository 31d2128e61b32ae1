"""One page of a scene or of a result folder: what was asked, modelled, found and trusted."""

import argparse
import shlex
from pathlib import Path

from skinwave.commands.common import (
    add_mesh,
    add_output,
    add_width,
    metre,
    progress_of,
    summarise,
    warn,
)

STYLES, FORMATS = ("report", "talk", "print"), ("png", "svg", "pdf")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "source", type=Path, metavar="SCENE|DIR",
        help="scene file, or a folder that run, compare or report wrote: then no model is run",
    )  # fmt: skip
    parser.add_argument("--style", choices=STYLES, default="report")
    parser.add_argument(
        "--format", choices=FORMATS, action="append", default=["png"],
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
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.report.styles import style
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.scene.file import read
    from skinwave.studies.scene_report import write_report

    chosen = style(options.style, options.width)
    source, made = options.source, options.source.is_dir()
    scene = None if made else read(source)
    out = options.out or (source / "report" if made else Path(f"{source.stem}-report"))
    inputs = [source, scene.body.file if scene else ""]
    # The report inside a result folder is this command's own, and made anew.
    anew = options.overwrite or (made and options.out is None)
    if made and options.out is None and out.is_symlink():
        raise ValueError(f"{out} is a link; remove it or name the folder to write with --out")
    with (
        output_folder(out, overwrite=anew, inputs=inputs, report=_drawn(options)) as folder,
        progress_of(options) as progress,
    ):
        if scene is not None:
            from skinwave.studies.album import make
            from skinwave.verify.suite import quick_results

            said = make(
                folder, scene, progress, h=metre(options.h), solver=options.solver,
                beside=options.beside, command=_again(options), cases=quick_results(progress),
            )  # fmt: skip
            warn(said)
        write_report(
            folder if scene is not None else source, folder, chosen, progress,
            formats=options.format, columns=options.only,
        )  # fmt: skip
        record.write(folder, record.of_command(options), scene=scene)
        size = (folder / "index.html").stat().st_size
    summary = {"out": str(out), "megabytes": round(size / 1e6, 2)}
    summarise(options, summary, f"{size / 1e6:.1f} MB; open {out}/index.html")
    return 0


def _drawn(options: argparse.Namespace) -> list[str]:
    """The options by which it is drawn, where they are not the defaults."""
    words = [] if options.style == "report" else ["--style", options.style]
    words += ["--width", f"{options.width:g}"] if options.width else []
    words += ["--only", ",".join(options.only)] if options.only else []
    return words + [word for kind in options.format if kind != "png" for word in ("--format", kind)]


def _again(options: argparse.Namespace) -> str:
    """The command that makes the same report."""
    words = ["--beside", ",".join(options.beside)] if options.beside else []
    words += ["--element-size", f"{options.h:g}"] if options.h else []
    return shlex.join(["skinwave", "report", options.source.name, *words])
