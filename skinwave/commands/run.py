"""One scene, one model."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_output,
    add_scene,
    metre,
    progress_of,
    required_plan,
    summarise,
    told,
    warn,
)

if TYPE_CHECKING:
    from skinwave.results.run import Run
    from skinwave.system.document import Part


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_model(parser)
    add_mesh(parser)
    parser.add_argument(
        "--samples", type=int, metavar="N",
        help="samples of the scene's uncertain numbers, for bands and percentiles",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, help="of the samples")
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.planning.simulate import solve
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.results.run import Run
    from skinwave.scene.file import read
    from skinwave.scene.scene import body_name
    from skinwave.scene.spreads import spreads_of
    from skinwave.studies.pages import write_run_page
    from skinwave.sweeps.sampling import check

    scene = read(options.scene)
    if options.samples is not None:
        check(spreads_of(scene), options.samples, options.seed)
    out = options.out or Path(f"{options.scene.stem}-out")
    with output_folder(
        out, overwrite=options.overwrite, inputs=[options.scene, scene.body.file]
    ) as folder:
        with progress_of(options) as progress:
            required = required_plan(options, scene, progress=progress)
            response = solve(scene, required)
        warn(w for w in response.effort.warnings if w not in required.warnings)
        run = Run(tacton=scene.name, body=body_name(scene.body), scene=scene, response=response)
        more = _uncertainty(options, run, required.h, folder) if options.samples else []
        write_run_page(folder, run, more)
        record.write(folder, record.of_command(options), scene=scene, response=response)
    summary = {
        "out": str(out),
        "model": response.model,
        "dofs": response.effort.dofs,
        "solver": response.effort.solver,
        "seconds": round(sum(response.effort.seconds.values()), 2),
        **told(response),
    }
    summarise(options, summary, f"{response.model}: wrote {out}/index.html")
    return 0


def _uncertainty(
    options: argparse.Namespace, run: "Run", h: float | None, folder: Path
) -> "list[Part]":
    """Bands over samples of the uncertain numbers: their tables in the folder, parts of a page."""
    from skinwave.sweeps.uncertainty_page import write_ensemble
    from skinwave.system.effort import usable_cores

    with progress_of(options) as progress:
        return write_ensemble(
            folder, run.scene, options.samples, model=run.model, progress=progress,
            h=h or metre(options.h), solver=options.solver, seed=options.seed,
            workers=usable_cores(),
        )  # fmt: skip
