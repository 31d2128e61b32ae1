"""The point kernel beside finite elements: the main job."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_mesh, add_output, metre, progress_of, summarise

TITLE = "The paper's 15 Tactons: point kernel, paper and skin"


def options(parser: argparse.ArgumentParser) -> None:
    """What a user may ask of it."""
    parser.add_argument(
        "scene", nargs="?", default="paper-15", metavar="SCENE",
        help="scene file, or paper-15, the 15 Tactons of Lim, Seifi and Park (default)",
    )  # fmt: skip
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Do it; the exit code."""
    from skinwave.files import folder_name, output_folder
    from skinwave.scene_file import read
    from skinwave.study import own_scenes, paper_scenes, run_study

    paper = options.scene == "paper-15"
    scene = None if paper else read(options.scene)
    scenes = paper_scenes() if scene is None else own_scenes(scene, folder_name(scene.name))
    out = options.out or Path("paper-15" if paper else f"{Path(options.scene).stem}-compared")
    with (
        output_folder(out, overwrite=options.overwrite) as folder,
        progress_of(options) as progress,
    ):
        outcome = run_study(
            scenes, folder, progress,
            title=TITLE if scene is None else scene.name,
            command=f"skinwave compare {options.scene}",
            h=metre(options.h), solver=options.solver,
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
    summarise(
        options,
        summary,
        f"{outcome.runs} of {outcome.planned} runs in {outcome.seconds:.0f} s, "
        f"{outcome.peak_memory / 2**30:.2f} GiB; {held} of {len(outcome.verdicts)} statements "
        f"hold; open {out}/index.html",
    )
    return 0 if outcome.runs == outcome.planned else 1
