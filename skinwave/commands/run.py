"""Run one model on one scene."""

import argparse

from skinwave.commands import common


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    model = ("--model", "--tolerance", "--dt", "--element-size", "--solver")
    common.add_options(parser, "scene", *model)
    parser.add_argument(
        "--samples", type=int, metavar="N",
        help="sample the uncertain numbers of the scene N times, for bands and percentiles",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, help="seed of the samples (default: 0)")
    common.add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.planning.simulate import solve_as_planned
    from skinwave.results import record
    from skinwave.results.run import Run
    from skinwave.scene.file import read
    from skinwave.scene.scene import body_name
    from skinwave.scene.spreads import spreads_of
    from skinwave.studies.pages import Gallery, begin_gallery, write_run_page
    from skinwave.studies.surfaces import begin_surface
    from skinwave.sweeps.sampling import check
    from skinwave.sweeps.uncertainty_page import write_ensemble
    from skinwave.system.effort import usable_cores
    from skinwave.system.processes import pool

    scene = read(options.scene)
    if options.samples is not None:
        check(spreads_of(scene), options.samples, options.seed)
    with (
        common.result_folder(options, f"{options.scene.stem}-out", scene) as (folder, progress),
        pool(1) as workers,
    ):
        moved = begin_surface(scene, common.solve_options(options, progress), workers)
        gallery = Gallery(workers=workers, progress=progress)
        if moved:
            gallery = begin_gallery(scene, moved, workers, progress)
        plan = common.plan_of_command(options, scene, progress)
        response = solve_as_planned(scene, plan)
        common.warn(w for w in response.effort.warnings if w not in plan.warnings)
        run = Run(tacton=scene.name, body=body_name(scene.body), scene=scene, response=response)
        more = [] if options.samples is None else write_ensemble(
            folder, scene, options.samples, model=run.model, progress=progress,
            h=plan.h or common.metre(options.h), solver=options.solver, seed=options.seed,
            workers=usable_cores(),
        )  # fmt: skip
        command = record.command_entry(options)
        write_run_page(folder, run, gallery, more=more, command=command["typed"], moved=moved)
        record.write(folder, command, scene=scene, response=response)
    effort = response.effort
    summary = {
        "out": str(options.out), "model": response.model, "dofs": effort.dofs,
        "solver": effort.solver, "seconds": round(sum(effort.seconds.values()), 2),
        **effort.errors.summary(), "warnings": list(effort.warnings),
    }  # fmt: skip
    wrote = f"{response.model}: wrote {options.out}/index.html"
    line = f"{wrote}; expected error {effort.errors.words}"
    return common.summarise(options, summary, [line], gallery.failures)
