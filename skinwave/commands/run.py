"""One scene, one model."""

import argparse
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

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


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_model(parser)
    add_mesh(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of Dask workers that share fem-harmonic's lines"
    )
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave import record
    from skinwave.outputs import output_folder
    from skinwave.run import Run
    from skinwave.scene import body_name
    from skinwave.scene_file import read
    from skinwave.simulation import follow
    from skinwave.studies.study_page import write_single

    scene = read(options.scene)
    out = options.out or Path(f"{options.scene.stem}-out")
    with output_folder(
        out, overwrite=options.overwrite, inputs=[options.scene, scene.body.file]
    ) as folder:
        with progress_of(options) as progress, _mapped(options.scheduler) as mapped:
            required = required_plan(options, scene, progress)
            response = follow(
                scene, required, options.tolerance, progress,
                h=metre(options.h), dt=options.dt, solver=options.solver, mapped=mapped,
            )  # fmt: skip
        warn(w for w in response.effort.warnings if w not in required.warnings)
        run = Run(tacton=scene.name, body=body_name(scene.body), scene=scene, response=response)
        write_single(folder, run)
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


def _mapped(scheduler: str | None) -> AbstractContextManager[Any]:
    """Map of a function over lines: here, or on the workers of a scheduler."""
    if scheduler is None:
        return nullcontext(map)
    from skinwave.sweeps import engine

    engine.check(scheduler)
    return engine.mapped_on(scheduler)
