"""Models beside published measurements: waves, speed of the focus, harmonics, zigzag, finger."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, progress_of, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "--hand", type=Path, nargs="?", const=Path(), metavar="FILE",
        help="also the decay along a finger of this hand, its palm towards -x, by finite elements, "
        "which takes minutes (default: examples/hand of the repository)",
    )  # fmt: skip
    parser.add_argument(
        "--zigzag", nargs=2, action="append", default=[], metavar=("FILE", "M_PER_S"),
        help="a recording of the published zigzag and its longitudinal speed; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--skinsource",
        type=Path,
        metavar="FOLDER",
        help="SkinSource's folder impulse-responses, for the decay along its fingers",
    )
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.verify.compared import tallies
    from skinwave.verify.finger import EXAMPLE
    from skinwave.verify.validation import sentences, validate
    from skinwave.verify.validation_page import write

    zigzags = [(Path(file), _speed(speed)) for file, speed in options.zigzag]
    if options.hand == Path():
        options.hand = EXAMPLE  # which the record names
    hand = options.hand
    out = options.out or Path("validation")
    inputs = [file for file, _ in zigzags] + [p for p in (hand, options.skinsource) if p]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = validate(progress, hand=hand, zigzags=zigzags, skinsource=options.skinsource)
        write(folder, found)
        record.write(folder, record.of_command(options))
    said = sentences(found)
    sets = [
        {"set": t.rows[0].published.name, "body": t.rows[0].body, "claim": t.words,
         "preset_made_from_it": t.rows[0].is_built}
        for t in tallies(found.rows)
    ]  # fmt: skip
    summary = {"out": str(out), "sentences": said, "sets": sets}
    summarise(options, summary, "\n".join([*said, f"open {out}/index.html"]))
    return 0


def _speed(text: str) -> float:
    """Longitudinal speed in m/s of a word of the command line."""
    from skinwave.verify.zigzag import SPEEDS

    known = ", ".join(f"{v:g}" for v in SPEEDS)
    try:
        speed = float(text)
    except ValueError:
        raise ValueError(f"--zigzag has '{text[:40]}', no speed in m/s; give {known}") from None
    if speed not in SPEEDS:
        raise ValueError(f"--zigzag has {text[:40]} m/s, none of the drawn speeds; give {known}")
    return speed
