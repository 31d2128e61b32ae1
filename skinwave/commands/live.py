"""Write one HTML file that computes in the browser how bodies move under Tactons."""

import argparse
from pathlib import Path

from skinwave.commands import common


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    common.add_scenes(parser, "skin-slab, paper-sheet and palm")
    parser.add_argument(
        "--no-selftest", dest="tests", action="store_const", const=0, default=60,
        help="leave out the data of live.html#selftest",
    )  # fmt: skip
    common.add_output(parser, "FILE", "file to write (default: live.html)")
    parser.set_defaults(out=Path("live.html"))


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.live.html_file import data_of, page, read_scene
    from skinwave.results.outputs import output_file

    scenes = [read_scene(path) for path in options.scenes]
    inputs = [*options.scenes, *(file for scene in scenes for file in scene.files)]
    with (
        output_file(options.out, overwrite=options.overwrite, inputs=inputs) as file,
        common.progress_of(options) as progress,
    ):
        data = data_of(scenes, progress, tests=options.tests)
        size = file.write(page(data).encode())
    bodies = [record["title"] for record in data["bodies"]]
    summary = {"out": str(options.out), "bytes": size, "bodies": bodies}
    wrote = f"wrote {options.out} ({size / 1e6:.1f} MB): {', '.join(bodies)}"
    return common.summarise(options, summary, [wrote], data["failures"])
