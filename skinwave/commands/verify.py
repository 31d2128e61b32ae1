"""Verify against closed forms or published measurements, or check this installation."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, result_folder, summarise, summarise_page


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    subject = parser.add_mutually_exclusive_group()
    subject.add_argument(
        "--quick", action="store_true", help="run only cases that take a few seconds"
    )
    subject.add_argument(
        "--published", action="store_true", help="compare models with published measurements"
    )
    subject.add_argument(
        "--tradeoff", type=Path, metavar="SCENE", dest="scene",
        help="error and time of every model on a scene file (TOML)",
    )  # fmt: skip
    subject.add_argument(
        "--installation", action="store_true",
        help="list the software of this machine, and how to install missing packages",
    )  # fmt: skip
    parser.add_argument(
        "--hand", type=Path, metavar="FILE",
        help="with --published: also compute the decay along a finger of this hand by finite "
        "elements (takes minutes); the palm faces -x, as in examples/hand/generic-hand-right.glb "
        "of the repository",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    if options.hand and not options.published:
        raise ValueError("--hand needs --published; add it, or remove --hand")
    if options.installation:
        return _installation(options)
    if options.published:
        return _run_published(options)
    return _tradeoff(options) if options.scene else _cases(options)


def _cases(options: argparse.Namespace) -> int:
    from skinwave.verify import suite

    cases = [each for each in suite.CASES.values() if not (options.quick and each.slow)]
    with result_folder(options, "verification") as (folder, progress):
        results = suite.run_suite(cases, folder, progress, debug=options.debug)
    failures = suite.failures_of(results)
    is_incomplete = len(results) < len(cases)
    sentences = [suite.summary(results)]
    if is_incomplete:
        sentences.append(f"interrupted after {len(results)} of {len(cases)} cases")
    code = summarise_page(
        options, sentences, failures, passed=len(results) - len(failures), failed=len(failures),
        planned=len(cases), seconds=round(sum(result.seconds for result in results), 1),
    )  # fmt: skip
    return 1 if is_incomplete else code


def _run_published(options: argparse.Namespace) -> int:
    from skinwave.verify.validation import report, validate, verdict

    with result_folder(options, "validation") as (folder, progress):
        curves, rows = validate(progress, hand=options.hand)
        report(curves, rows).write(folder)
    return summarise_page(options, verdict(rows))


def _tradeoff(options: argparse.Namespace) -> int:
    from skinwave.scene.file import read
    from skinwave.studies.tradeoff import sentences, tradeoff, write

    scene, name = read(options.scene), f"{options.scene.stem}-tradeoff"
    with result_folder(options, name, scene) as (folder, progress):
        found = tradeoff(scene, progress)
        write(folder, scene, found)
    return summarise_page(options, sentences(found), found.failures, accepted=found.is_converged)


def _installation(options: argparse.Namespace) -> int:
    from skinwave.commands.installation import examine, text

    found = examine()
    return summarise(options, {"findings": found}, [text(found)])
