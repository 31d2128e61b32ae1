"""Verification: closed forms, published measurements, cost of accuracy, or this installation."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, progress_of, summarise

HAND = Path("examples/hand/generic-hand-right.glb")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    subject = parser.add_mutually_exclusive_group()
    subject.add_argument("--quick", action="store_true", help="only cases of a few seconds each")
    subject.add_argument(
        "--published", action="store_true", help="models beside published measurements"
    )
    subject.add_argument(
        "--tradeoff", type=Path, metavar="SCENE", dest="scene",
        help="error and time of every model on a scene file (TOML)",
    )  # fmt: skip
    subject.add_argument(
        "--installation", action="store_true",
        help="what this machine has, and how to add what it lacks",
    )  # fmt: skip
    parser.add_argument(
        "--hand", type=Path, metavar="FILE",
        help="with --published, also the decay along a finger of this hand, its palm towards -x, "
        f"by finite elements, which takes minutes ({HAND} of the repository)",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    if options.hand and not options.published:
        raise ValueError("--hand is for --published; give both or neither")
    if options.installation:
        return _installation(options)
    if options.published:
        return _published(options)
    return _tradeoff(options) if options.scene else _cases(options)


def _cases(options: argparse.Namespace) -> int:
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.verify import suite

    cases = [each for each in suite.CASES.values() if not (options.quick and each.slow)]
    out = options.out or Path("verification")
    with (
        output_folder(out, overwrite=options.overwrite) as folder,
        progress_of(options) as progress,
    ):
        results = suite.run_suite(cases, folder, progress, debug=options.debug)
        record.write(folder, record.of_command(options))
    failed = [result.case.name for result in results if not result.passed]
    summary = {
        "out": str(out), "passed": len(results) - len(failed), "failed": len(failed),
        "planned": len(cases), "failures": failed,
        "seconds": round(sum(result.seconds for result in results), 1),
    }  # fmt: skip
    broken = len(results) < len(cases)
    state = f"interrupted after {len(results)} of {len(cases)} cases; " if broken else ""
    summarise(options, summary, f"{state}open {out}/index.html\n{suite.summary(results)}")
    return 1 if failed or broken else 0


def _published(options: argparse.Namespace) -> int:
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.verify.validation import report, validate, verdict

    out = options.out or Path("validation")
    inputs = [options.hand] if options.hand else []
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            curves, rows = validate(progress, hand=options.hand)
        report(curves, rows).write(folder)
        record.write(folder, record.of_command(options))
    sentences = verdict(rows)
    summary = {"out": str(out), "sentences": sentences}
    summarise(options, summary, "\n".join([*sentences, f"open {out}/index.html"]))
    return 0


def _tradeoff(options: argparse.Namespace) -> int:
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.scene.file import read
    from skinwave.studies.tradeoff import sentences, study, write

    scene = read(options.scene)
    out = options.out or Path(f"{options.scene.stem}-tradeoff")
    inputs = [options.scene, scene.body.file]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = study(scene, progress)
        write(folder, scene, found)
        record.write(folder, record.of_command(options), scene=scene)
    summary = {"out": str(out), "accepted": found.accepted, "sentences": sentences(found)}
    summarise(options, summary, "\n".join([*sentences(found), f"open {out}/index.html"]))
    return 0


def _installation(options: argparse.Namespace) -> int:
    from skinwave.commands.installation import examine, text

    found = examine()
    rows = [{"what": f.what, "value": f.value, "cure": f.cure} for f in found]
    summarise(options, {"findings": rows}, text(found))
    return 0
