"""One HTML file that computes in the browser how bodies move under Tactons."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_reporting, progress_of, summarise

OUT = Path("live.html")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scenes", nargs="*", type=Path, metavar="SCENE",
        help="scene files (TOML) whose bodies and Tactons the page has; without any, the bodies "
        "skin-slab, paper-sheet and palm",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--out", type=Path, default=OUT, metavar="FILE", help=f"(default: {OUT})"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
    parser.add_argument(
        "--no-selftest", action="store_true", help="leave out the data of live.html#selftest"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.live.data import data_of, read_scene
    from skinwave.live.page import page
    from skinwave.results.outputs import output_file

    scenes = [read_scene(path) for path in options.scenes]
    inputs = [*options.scenes, *(scene.body.file for scene in scenes if scene.body.file)]
    with (
        output_file(options.out, overwrite=options.overwrite, inputs=inputs) as file,
        progress_of(options) as progress,
    ):
        data = data_of(scenes, progress, test=not options.no_selftest)
        size = file.write(page(data).encode())
    bodies = [record["title"] for record in data["bodies"]]
    summary = {"out": str(options.out), "bytes": size, "bodies": bodies}
    summarise(options, summary, f"{', '.join(bodies)}; wrote {options.out} ({size / 1e6:.1f} MB)")
    return 0
