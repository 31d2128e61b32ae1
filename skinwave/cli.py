"""The command line: `skinwave run`, `compare`, `tradeoff`, `plan` and `verify`.

Only argparse is imported before a command is known, so that help answers at once.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skinwave.effort import Progress
    from skinwave.plan import Plan
    from skinwave.scene import Scene

TITLE = "The paper's 15 Tactons: point kernel, paper and skin"
MODELS = ("point-kernel", "flat-body", "fem", "fem-harmonic", "fem-transient")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 if it succeeded, 1 if interrupted or refuted, 2 if its input was wrong."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.command(options))
    except KeyboardInterrupt:
        print("skinwave: interrupted; nothing was finished", file=sys.stderr)
        return 1
    except (ValueError, ArithmeticError, MemoryError, OSError) as error:
        if options.debug:
            raise
        said = " ".join(str(error).split()) or "not enough memory; take larger elements"
        print(f"skinwave: {said}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="skinwave", description="Waves in skin and paper under mid-air ultrasound haptics."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--out", type=Path, metavar="DIR", help="folder to write")
    common.add_argument("--overwrite", action="store_true", help="replace an existing folder")
    common.add_argument("--quiet", action="store_true", help="no progress, no summary")
    common.add_argument("--json", action="store_true", help="summary as JSON")
    common.add_argument("--debug", action="store_true", help="traceback of an error")

    knobs = argparse.ArgumentParser(add_help=False)
    knobs.add_argument("--h", type=float, metavar="MM", help="element size, mm (default: planned)")
    knobs.add_argument("--solver", default="auto", help="auto, pardiso, cholmod or superlu")

    run = commands.add_parser("run", parents=[common, knobs], help="one scene, one model")
    run.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    run.add_argument("--model", choices=("auto", *MODELS), default="auto")
    run.add_argument("--tolerance", type=float, default=0.05, help="relative error of waveforms")
    run.add_argument("--dt", type=float, metavar="S", help="time step of fem-transient, s")
    run.set_defaults(command=_run)

    compare = commands.add_parser(
        "compare",
        parents=[common, knobs],
        help="point kernel beside finite elements (the main job)",
    )
    compare.add_argument(
        "scene", nargs="?", default="paper-15", metavar="SCENE",
        help="scene file, or paper-15, the 15 Tactons of Lim, Seifi and Park (default)",
    )  # fmt: skip
    compare.set_defaults(command=_compare)

    trade = commands.add_parser(
        "tradeoff", parents=[common], help="what accuracy costs on a scene, measured"
    )
    trade.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    trade.set_defaults(command=_tradeoff)

    plan = commands.add_parser("plan", help="what a scene requires, and why")
    plan.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    plan.add_argument("--tolerance", type=float, default=0.05, help="relative error of waveforms")
    plan.add_argument("--model", choices=("auto", *MODELS), default="auto")
    plan.add_argument("--h", type=float, metavar="MM", help="element size, mm")
    plan.add_argument("--dt", type=float, metavar="S", help="time step of fem-transient, s")
    plan.add_argument("--json", action="store_true", help="the plan as JSON")
    plan.add_argument("--debug", action="store_true", help="traceback of an error")
    plan.set_defaults(command=_plan)

    verify = commands.add_parser(
        "verify", parents=[common], help="closed forms and series against what this program answers"
    )
    verify.add_argument("--quick", action="store_true", help="only cases of a few seconds each")
    verify.set_defaults(command=_verify)
    return parser


def _plan(options: argparse.Namespace) -> int:
    from dataclasses import asdict, replace

    from skinwave.scene_file import read

    required = _required(options, read(options.scene))
    if options.json:
        table = asdict(replace(required, prepared=None))
        print(json.dumps({key: value for key, value in table.items() if key != "prepared"}))
        return 0
    width = [max(len(getattr(row, f)) for row in required.rows) for f in ("what", "value")]
    for row in required.rows:
        print(f"{row.what:<{width[0]}}  {row.value:<{width[1]}}  {row.reason}")
    return 0


def _required(options: argparse.Namespace, scene: "Scene") -> "Plan":
    """The plan, with what the user has decided; what breaks the tolerance is warned of."""
    from skinwave.plan import plan
    from skinwave.simulation import check_knobs

    model, h = None if options.model == "auto" else options.model, _metre(options.h)
    check_knobs(getattr(options, "solver", "auto"), h=h, dt=options.dt)
    required = plan(scene, options.tolerance, model=model, h=h, dt=options.dt)
    for warning in required.warnings:
        print(f"skinwave: warning: {warning}", file=sys.stderr)
    return required


def _run(options: argparse.Namespace) -> int:
    from skinwave.claims import Run
    from skinwave.files import output_folder
    from skinwave.scene import BODIES
    from skinwave.scene_file import read
    from skinwave.simulation import simulate
    from skinwave.study import write_single

    scene = read(options.scene)
    known = (label for label, body in BODIES.items() if body == scene.body)
    out = options.out or Path(f"{options.scene.stem}-out")
    with output_folder(out, overwrite=options.overwrite) as folder:
        if options.model != "auto" or options.h or options.dt:
            _required(options, scene)
        with _progress(options) as progress:
            response = simulate(
                scene, options.model, options.tolerance, progress,
                h=_metre(options.h), dt=options.dt, solver=options.solver,
            )  # fmt: skip
        run = Run(
            tacton=scene.name, body=next(known, scene.body.kind), scene=scene, response=response
        )
        write_single(folder, run)
    summary = {
        "out": str(out),
        "model": response.model,
        "dofs": response.effort.dofs,
        "solver": response.effort.solver,
        "seconds": round(sum(response.effort.seconds.values()), 2),
    }
    _summarise(options, summary, f"{response.model}: wrote {out}/index.html")
    return 0


def _compare(options: argparse.Namespace) -> int:
    from skinwave.files import folder_name, output_folder
    from skinwave.scene_file import read
    from skinwave.study import own_scenes, paper_scenes, run_study

    paper = options.scene == "paper-15"
    scene = None if paper else read(options.scene)
    scenes = paper_scenes() if scene is None else own_scenes(scene, folder_name(scene.name))
    out = options.out or Path("paper-15" if paper else f"{Path(options.scene).stem}-compared")
    with output_folder(out, overwrite=options.overwrite) as folder, _progress(options) as progress:
        outcome = run_study(
            scenes, folder, progress,
            title=TITLE if scene is None else scene.name,
            command=f"skinwave compare {options.scene}",
            h=_metre(options.h), solver=options.solver,
        )  # fmt: skip
    held = sum(verdict.holds for verdict in outcome.verdicts)
    summary = {
        "out": str(out),
        "runs": outcome.runs,
        "planned": outcome.planned,
        "statements_held": held,
        "statements_judged": len(outcome.verdicts),
        "seconds": round(outcome.seconds, 1),
        "peak_memory_gib": round(outcome.peak_memory / 2**30, 2),
    }
    _summarise(
        options,
        summary,
        f"{outcome.runs} of {outcome.planned} runs in {outcome.seconds:.0f} s, "
        f"{outcome.peak_memory / 2**30:.2f} GiB; {held} of {len(outcome.verdicts)} statements "
        f"hold; open {out}/index.html",
    )
    return 0 if outcome.runs == outcome.planned else 1


def _tradeoff(options: argparse.Namespace) -> int:
    from skinwave.files import output_folder
    from skinwave.scene_file import read
    from skinwave.tradeoff import sentences, study, write

    scene = read(options.scene)
    out = options.out or Path(f"{options.scene.stem}-tradeoff")
    with output_folder(out, overwrite=options.overwrite) as folder:
        with _progress(options) as progress:
            found = study(scene, progress)
        write(folder, scene, found)
    summary = {"out": str(out), "accepted": found.accepted, "sentences": sentences(found)}
    _summarise(options, summary, "\n".join([*sentences(found), f"open {out}/index.html"]))
    return 0


def _verify(options: argparse.Namespace) -> int:
    from skinwave.files import output_folder
    from skinwave.verify.page import summary_table
    from skinwave.verify.suite import run_suite, suite

    entries = [entry for entry in suite() if not (options.quick and entry.slow)]
    out = options.out or Path("verification")
    with output_folder(out, overwrite=options.overwrite) as folder, _progress(options) as progress:
        results = run_suite(
            entries, folder, progress, left_out=len(suite()) - len(entries), debug=options.debug
        )
    failed = [result.entry.name for result in results if not result.case.passed]
    summary = {
        "out": str(out),
        "passed": len(results) - len(failed),
        "failed": len(failed),
        "planned": len(entries),
        "failures": failed,
        "seconds": round(sum(result.seconds for result in results), 1),
    }
    broken = len(results) < len(entries)
    state = f"interrupted after {len(results)} of {len(entries)} cases; " if broken else ""
    _summarise(options, summary, f"{state}open {out}/index.html\n{summary_table(results)}")
    return 1 if failed or broken else 0


def _summarise(options: argparse.Namespace, summary: dict[str, Any], sentence: str) -> None:
    if options.json:
        print(json.dumps(summary))
    elif not options.quiet:
        print(sentence)


def _metre(millimetre: float | None) -> float | None:
    return None if millimetre is None else millimetre / 1e3


@contextmanager
def _progress(options: argparse.Namespace) -> "Iterator[Progress]":
    """A bar with the phase named; on a pipe a line per phase; nothing if not wanted."""
    if options.quiet or options.json:
        yield lambda phase, fraction: None
        return
    if not sys.stderr.isatty():
        phases: list[str] = []

        def log(phase: str, fraction: float) -> None:
            if phase not in phases[-1:]:
                phases.append(phase)
                print(phase, file=sys.stderr, flush=True)

        yield log
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description:<36}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=1.0)

        def show(phase: str, fraction: float) -> None:
            if bar.tasks[task].description != phase:
                bar.reset(task, description=phase, total=1.0)
            bar.update(task, completed=min(max(fraction, 0.0), 1.0))

        yield show
