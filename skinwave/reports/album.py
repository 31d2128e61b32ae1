"""A scene's answers by every model that pictures put side by side, kept in a folder.

scene.toml  plan.json  trust.json  lines.csv
BODY/scene.toml  responses.npz  lines.csv  effort.json  view.npz  probes.csv  probes.npz
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Effort, Response, point_kernel
from skinwave import record
from skinwave.document import worst_warnings
from skinwave.effort import Progress
from skinwave.files import fill, write_lines
from skinwave.models.prepared import answer, sample_times
from skinwave.pictures.motion import assessed_probes, waves
from skinwave.pictures.views import FRAMES, View, body_view, kernel_view, load, save
from skinwave.planning.plan import Plan, plan
from skinwave.run import Run
from skinwave.scene import BODIES, Scene, with_body
from skinwave.scene_file import dumps, read
from skinwave.simulation import compute
from skinwave.verify.suite import suite

PUBLISHED = {"drive": "linear", "focus": "main_lobe"}
PHYSICAL = {"drive": "pressure_squared", "focus": "gaussian"}
PLANNED = 0.05  # tolerance of the plan that stands on the page
CASES = ("patch", "in-plane-shear", "moving-force-0.5", "thin-sheets")  # a second or two in all


@dataclass(frozen=True, kw_only=True, eq=False)
class Album:
    """What a folder holds: runs; views by body, where there are any; what was planned, how far
    that agrees with the pictures, and the command that made it, where these were kept.
    """

    title: str
    scene: Scene
    runs: Sequence[Run]
    views: Mapping[str, View]
    planned: Mapping[str, Any] | None
    trust: Mapping[str, Any] | None


def shown_scenes(scene: Scene) -> dict[str, Scene]:
    """The scene as published, on a sheet and on a slab, by body name; its own body among them.

    A preset body that the scene's path or probes do not fit on is left out.
    """
    found = {"none": with_body(scene, BODIES["none"], **PUBLISHED)}
    own = next((name for name, body in BODIES.items() if body == scene.body), scene.body.kind)
    physical = PHYSICAL if scene.body.kind == "none" else {}
    for name in ("paper-sheet", "skin-slab"):
        if BODIES[name].kind == scene.body.kind:
            found[own] = scene
            continue
        try:
            found[name] = with_body(scene, BODIES[name], **physical)
        except ValueError:
            continue
    if scene.body.kind not in ("none", "sheet", "slab"):
        found[own] = scene
    return found


def make(
    folder: Path,
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    frames: int = FRAMES,
    command: str = "",
) -> list[str]:
    """Answer a scene by every model and fill a folder with it; the warnings of all of them.

    Raises
    ------
    ValueError
        If a model refuses the scene.
    """
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    runs = []
    for view, run in answers(scene, progress, h=h, solver=solver, frames=frames):
        (folder / run.body).mkdir()
        fill(folder / run.body, run, by="waves")
        save(folder / run.body / "view.npz", view)
        runs.append(run)
    write_lines(folder / "lines.csv", runs)
    _plan(folder, scene, runs, progress, solver, command)
    return worst_warnings((run.body, run.response.effort) for run in runs)


def answers(
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    frames: int = FRAMES,
) -> Iterator[tuple[View, Run]]:
    """A scene's view and run by every model, one at a time; raises what `make` does."""
    for body, its in shown_scenes(scene).items():
        progress(f"answer on {body}", 0.0)
        view, response = _answer(its, body, progress, h, solver, frames)
        yield view, Run(tacton=scene.name, body=body, scene=its, response=response)


def _answer(
    scene: Scene, body: str, progress: Progress, h: float | None, solver: str, frames: int
) -> tuple[View, Response]:
    if scene.body.kind == "none":
        reach = np.array([BODIES["skin-slab"].width, BODIES["skin-slab"].height]) / 2
        response = point_kernel(scene.pressure, scene.probe_points, sample_times(scene))
        return kernel_view(scene, reach, frames), response

    def named(phase: str, fraction: float) -> None:
        progress(f"{body}: {phase}", fraction)

    moved = waves(scene, progress=named, h=h, solver=solver)
    named("compare with a coarser mesh", 0.0)
    response = assessed_probes(scene, moved, h, PLANNED, solver)
    return body_view(scene, body, moved, frames), response


def _plan(
    folder: Path, scene: Scene, runs: Sequence[Run], progress: Progress, solver: str, command: str
) -> None:
    """What `plan` requires of the scene, and how far its answer agrees with what was drawn."""
    progress("plan", 0.0)
    required = plan(scene, PLANNED, solver=solver)
    table = asdict(replace(required, prepared=None)) | {"tolerance": PLANNED}
    (folder / "plan.json").write_text(json.dumps(table, indent=1), encoding="utf-8")
    trust: dict[str, Any] = {"command": command, "model": required.model}
    drawn = [run for run in runs if run.scene == scene]
    if drawn and scene.body.kind != "none":
        trust["misfit"] = _misfit(_planned_answer(scene, required, solver), drawn[0].response)
    trust["cases"] = _verified(progress)
    (folder / "trust.json").write_text(json.dumps(trust, indent=1), encoding="utf-8")


def _verified(progress: Progress) -> list[dict[str, Any]]:
    """A few quick cases of the verification suite, as this installation answers them."""
    progress("verify", 0.0)
    cases = [entry.run() for entry in suite() if entry.name in CASES]
    return [
        {"title": case.title, "source": case.source, "passed": case.passed, **asdict(case.worst)}
        for case in cases
    ]


def _planned_answer(scene: Scene, required: Plan, solver: str) -> Response:
    if required.prepared:
        return answer(required.prepared, scene)
    return compute(scene, required.model, PLANNED, h=required.h, solver=solver)


def _misfit(planned: Response, drawn: Response) -> float:
    """Relative difference of two answers over all probes."""
    size = float(np.linalg.norm(planned.displacement))
    return float(np.linalg.norm(drawn.displacement - planned.displacement)) / (size or 1.0)


def open_album(folder: Path) -> Album:
    """What a folder holds that `run`, `compare` or `report` wrote; no model is run.

    Raises
    ------
    ValueError
        If there is no result in it.
    """
    scenes = (path.parent for path in folder.rglob("scene.toml"))
    found = [path for path in map(record.responses, scenes) if path]
    runs = [_run(path) for path in sorted(found, key=_order)]
    if not runs:
        raise ValueError(
            f"{folder} holds no {record.RESPONSES[0]}; give a scene file or a result folder"
        )
    views = {path.parent.name: load(path) for path in sorted(folder.glob("*/view.npz"), key=_order)}
    own = folder / "scene.toml"
    scene = read(own) if own.exists() else runs[-1].scene
    return Album(
        title=scene.name if own.exists() else folder.resolve().name, scene=scene, runs=runs,
        views=views, planned=_json(folder / "plan.json"), trust=_json(folder / "trust.json"),
    )  # fmt: skip


def _order(path: Path) -> tuple[str, int, str]:
    """By Tacton, then in the order in which bodies are named everywhere."""
    body, known = path.parent.name, list(BODIES)
    return str(path.parent.parent), known.index(body) if body in known else len(known), body


def _run(path: Path) -> Run:
    scene = read(path.parent / "scene.toml")
    try:
        with np.load(path) as file:
            model = next(n for n in file.files if n not in ("t", "probes", "displacement"))
            times, probes, motion = file["t"], file["probes"], file[model]
    except (OSError, ValueError, KeyError, StopIteration) as error:
        raise ValueError(f"{path} is no result ({error}); run its scene again") from None
    effort, kept = _json(path.parent / "effort.json"), _json(path.parent / record.FILE) or {}
    response = Response(
        model=model, times=times, probes=probes, displacement=motion,
        unit="Pa" if model == "point-kernel" else "m",
        effort=Effort(**effort) if effort else Effort(),
        expected_error=np.nan if kept.get("expected_error") is None else kept["expected_error"],
    )  # fmt: skip
    known = (name for name, body in BODIES.items() if body == scene.body)
    return Run(tacton=scene.name, body=next(known, scene.body.kind), scene=scene, response=response)


def _json(path: Path) -> dict[str, Any] | None:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
