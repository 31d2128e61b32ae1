"""Pictures of a sweep: any column over one or two varied keys."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_reporting, add_width, summarise

FORMATS = ("png", "svg", "pdf")
PRESETS = ("speed",)


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of a sweep")
    parser.add_argument(
        "--column", action="append", metavar="NAME",
        help="such as peak_um (default), level_db, f_AM_um[2] at one probe; may be repeated",
    )  # fmt: skip
    parser.add_argument("--x", metavar="KEY", help="along the axis (default: most values)")
    parser.add_argument("--by", metavar="KEY", help="a curve for each value (default: the next)")
    parser.add_argument("--heat", action="store_true", help="a map over --x and --by instead")
    parser.add_argument(
        "--preset", choices=PRESETS,
        help="speed: displacement and sensation level over drawing speed",
    )  # fmt: skip
    parser.add_argument("--format", choices=FORMATS, default="png")
    parser.add_argument("--style", default="report", help="report, talk or print")
    add_width(parser)
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="default: DIR/figures")
    parser.add_argument("--overwrite", action="store_true", help="replace figures in that folder")
    parser.add_argument("--quiet", action="store_true", help="no summary")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.sweeps import dataset, engine

    engine.check("threads")
    from skinwave.report.figures import drawn
    from skinwave.report.styles import style
    from skinwave.results.files import distinct_names
    from skinwave.results.outputs import output_file
    from skinwave.sweeps.sweep_figures import (
        SPEED,
        finished,
        heat_figure,
        line_figure,
        speed_figure,
        varied,
    )

    chosen = style(options.style, options.width)
    rows = finished(dataset.read(options.folder))
    keys = varied(rows)
    x = options.x or (SPEED if options.preset == "speed" else next(iter(keys), None))
    if x is None:
        raise ValueError(f"{options.folder} varies no key; name a column with --x")
    by = options.by or next((key for key in keys if key != x), None)
    figures = {}
    if options.preset == "speed":
        figures["speed"] = speed_figure(rows, by, chosen)
    for column in options.column or ([] if figures else ["peak_um"]):
        name = f"{column} over {x}" + (f" and {by}" if by else "")
        if not options.heat:
            figures[name] = line_figure(rows, column, x, by, chosen)
        elif by:
            figures[f"{name} map"] = heat_figure(rows, column, x, by, chosen)
        else:
            raise ValueError("a map needs two varied keys; leave out --heat or give --by")
    out = options.out or options.folder / "figures"
    names = distinct_names(name.replace(" ", "-") for name in figures)
    paths = [out / f"{name}.{options.format}" for name in names]
    # The figures inside a sweep's folder are this command's own, and drawn anew.
    own = [path.relative_to(options.folder).as_posix() for path in paths if options.out is None]
    for name in own if not options.overwrite else ():
        dataset.refuse_changed(options.folder, name)
    out.mkdir(parents=True, exist_ok=True)
    for path, figure in zip(paths, figures.values(), strict=True):
        with output_file(path, overwrite=options.overwrite or bool(own)) as file:
            file.write(drawn(figure, options.format, chosen.dpi))
    for name in own:
        dataset.enter(options.folder, name)
    said = "\n".join(f"wrote {path}" for path in paths)
    summarise(options, {"figures": [str(path) for path in paths], "runs": len(rows)}, said)
    return 0
