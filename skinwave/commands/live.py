"""Write one HTML file that computes in the browser how bodies move under Tactons."""

import argparse
from pathlib import Path

from skinwave.commands.common import (
    add_output,
    add_scenes,
    progress_of,
    summarise,
    with_failures,
)

OUT = Path("live.html")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scenes(parser, "skin-slab, paper-sheet and palm")
    parser.add_argument(
        "--no-selftest", dest="tests", action="store_const", const=0, default=60,
        help="leave out the data of live.html#selftest",
    )  # fmt: skip
    add_output(parser, "FILE", f"file to write (default: {OUT})")
    parser.set_defaults(out=OUT)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.live.html_file import data_of, page, read_scene
    from skinwave.results.outputs import output_file

    scenes = [read_scene(path) for path in options.scenes]
    inputs = [*options.scenes, *(file for scene in scenes for file in scene.files)]
    with (
        output_file(options.out, overwrite=options.overwrite, inputs=inputs) as file,
        progress_of(options) as progress,
    ):
        data = data_of(scenes, progress, tests=options.tests)
        size = file.write(page(data).encode())
    bodies = [record["title"] for record in data["bodies"]]
    summary = {"out": str(options.out), "bytes": size, "bodies": bodies}
    wrote = f"wrote {options.out} ({size / 1e6:.1f} MB): {', '.join(bodies)}"
    summary["failures"] = data["failures"]
    summarise(options, summary, "\n".join(with_failures(data["failures"], [wrote])))
    return 1 if data["failures"] else 0
