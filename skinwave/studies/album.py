"""A scene's responses by all models that pictures show side by side, in a folder.

scene.toml  plan.json  lines.csv
COLUMN/scene.toml  responses.npz  lines.csv  effort.json  record.json  view.npz  map.npz
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from simple_model import Response
from simple_model.choices import choose
from simple_model.quantities import DISPLACEMENT, QUANTITIES
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import named
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.planning.plan import plan
from skinwave.planning.record import Plan
from skinwave.planning.simulate import compute, solve
from skinwave.report import description
from skinwave.results import record, surface
from skinwave.results.files import write_lines, write_run
from skinwave.results.motion import BodyMotion, probe_response, waves
from skinwave.results.run import Run
from skinwave.results.speeds import repetition_frequencies, shown_part
from skinwave.results.surface import (
    SurfaceField,
    body_map,
    element_map,
    grid,
    has_wavenumber_integral,
)
from skinwave.results.views import (
    View,
    body_view,
    fastest_line,
    flat_view,
    kernel_view,
    load,
    save,
    shaded,
)
from skinwave.scene import paper15
from skinwave.scene.file import dumps, read
from skinwave.scene.scene import BODIES, Scene, body_name, check_load, with_body
from skinwave.system.document import worst_warnings
from skinwave.system.effort import Progress
from skinwave.system.json_kinds import EFFORT, PLAN, effort_of, fitting

KERNEL_REACH = np.array([BODIES["skin-slab"].width, BODIES["skin-slab"].height]) / 2
LARGER = 1.5  # times the default size: elements of pictures, for a fifth of the time
PLANNED = 0.05  # tolerance of the plan that stands on the page


@dataclass(frozen=True, kw_only=True, eq=False)
class Album:
    """Contents of a folder: runs, views by body and the plan, where these were saved, and `maps` of
    the quantity that the probes of each body read.
    """

    title: str
    scene: Scene
    runs: Sequence[Run]
    views: Mapping[str, View]
    planned: Mapping[str, Any] | None = None
    maps: Mapping[str, SurfaceField] = field(default_factory=dict)

    @property
    def groups(self) -> dict[str, list[Run]]:
        """Runs by Tacton."""
        groups: dict[str, list[Run]] = {}
        for run in self.runs:
            groups.setdefault(run.tacton, []).append(run)
        return groups


def shown_scenes(scene: Scene, beside: Sequence[str] = ()) -> dict[str, Scene]:
    """The scene by `Run.column`: by both point kernels and on its own body or, without one, on
    those of the paper sheet and the skin slab that its path and probes fit on; and on preset bodies
    `beside` it, a ValueError if one is unknown or too small. All but the published kernel receive
    the same load.
    """
    check_load(scene, "a film or report")
    bodies: dict[str, Scene] = {}
    if scene.body.of_kind.discretise:
        bodies[body_name(scene.body)] = scene
    for name in beside:
        choose("body", name, [n for n in BODIES if n != "none"])
        other = with_body(scene, BODIES[name])
        if bodies.setdefault(name, other) != other:
            raise ValueError(f"the scene's own body is shown as '{name}'; leave it out of --beside")
    for name in paper15.MEASURED_ON if not bodies else ():
        with suppress(ValueError):  # a path or probes that do not fit on it
            bodies[name] = with_body(scene, BODIES[name])
    return paper15.beside_kernels(scene) | bodies


def make(
    folder: Path,
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    frames: int | None = None,
    beside: Sequence[str] = (),
) -> list[str]:
    """Compute a scene's response by every model and fill a folder with it; the warnings of all. A
    ValueError if a model refuses the scene.
    """
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    runs, own, misfit = [], None, {}
    for view, run, planned in answers(
        scene, progress, h=h, solver=solver, frames=frames, beside=beside
    ):
        also = None if view is None else partial(keep_view, view)
        write_run(folder / run.column, run, also=also)
        runs.append(run)
        if run.scene == scene and planned:
            own = planned
            misfit = {"misfit": _misfit(run, view.moved)} if view and view.moved else {}
    write_lines(folder / "lines.csv", runs)
    own = own or plan(scene, SolveOptions(tolerance=PLANNED))
    table = own.table() | {"tolerance": PLANNED} | misfit
    (folder / "plan.json").write_text(json.dumps(table, indent=1), encoding="utf-8")
    return worst_warnings((run.body, run.response.effort) for run in runs)


def keep_view(view: View, folder: Path) -> None:
    """A view in a file and, of a body, the map of what its probes read."""
    save(folder / "view.npz", view)
    scene, moved, (x, y) = view.scene, view.moved, grid(view.scene)
    if scene.reading.is_plain and has_wavenumber_integral(scene):
        moved = None
    if moved is not None:
        surface.save(folder / "map.npz", element_map(scene, moved, x, y))
    elif scene.reading.is_plain and view.body != "none":
        surface.save(folder / "map.npz", body_map(scene, x, y))


def answers(
    scene: Scene,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    frames: int | None = None,
    beside: Sequence[str] = (),
) -> Iterator[tuple[View | None, Run, Plan | None]]:
    """The runs of `shown_scenes`, one at a time, each with its view and its plan; there is no view
    of the published kernel, whose load is another one. Raises what `make` does.

    Views of bodies are by finite elements that are larger than those of responses, or by the modes
    of a plate.
    """
    shown = shown_scenes(scene, beside)
    options = SolveOptions(tolerance=PLANNED, h=h, solver=solver, progress=progress)
    plans = {
        column: plan(its, options)
        for column, its in shown.items() if its.body.of_kind.discretise
    }  # fmt: skip
    moved = {
        body: waves(its, progress=progress, h=h or LARGER * default_size(its.body), solver=solver)
        for body, its in shown.items()
        if _has_elements(its, h) and not _is_plate(its, h)
    }
    tones = max(repetition_frequencies(scene.tacton).values(), default=0.0)
    fastest = max(map(fastest_line, moved.values()), default=tones)
    part = shown_part(scene.pressure, fastest, frames)  # the same for all, side by side
    for column, its in shown.items():
        progress(f"response of {column}", 0.0)
        if column not in plans:
            run = Run(tacton=scene.name, body="none", scene=its, response=compute(its, column))
            is_shown = column == SAME_LOAD.name
            yield kernel_view(its, KERNEL_REACH, part) if is_shown else None, run, None
            continue
        response = solve(its, plans[column])
        run = Run(tacton=scene.name, body=column, scene=its, response=response)
        progress(f"pictures of {column}", 0.0)
        if column in moved:
            view = body_view(its, column, moved[column], part)
        else:
            view = flat_view(run, KERNEL_REACH, part)
        yield view, run, plans[column]


def _has_elements(scene: Scene, h: float | None) -> bool:
    """Whether pictures are by elements: the body can be meshed, or has no model without a mesh. A
    ValueError if it must be meshed and cannot be.
    """
    if not scene.body.of_kind.discretise:
        return False
    try:
        check_mesh(scene.body, h or default_size(scene.body))
    except ValueError:
        if h or not takes(FLAT_BODY, scene):
            raise
        return False
    return True


def _is_plate(scene: Scene, h: float | None) -> bool:
    """Whether pictures are by the modes of a plate: of its displacement, unless the size of
    elements is asked for.
    """
    return h is None and scene.reading.is_plain and takes(FROM_REST, scene)


def shown_views(scene: Scene, progress: Progress, **options: Any) -> tuple[list[View], list[str]]:
    """Views of a scene on all that it is shown on, by the quantity that its probes read, and
    warnings. The point kernel is left out of other quantities than displacement, because it has
    none. Options and errors are those of `make`.
    """
    found = [(view, run) for view, run, _ in answers(scene, progress, **options) if view]
    said = worst_warnings((run.body, run.response.effort) for _, run in found)
    if scene.reading.record is DISPLACEMENT:
        return [view for view, _ in found], said
    if not any(len(view.tets) for view, _ in found):
        raise ValueError(f"{description.without_kernel(scene)}; give the scene a body")
    said += [description.without_kernel(scene)]
    return [shaded(view, run.scene) for view, run in found if len(view.tets)], said


def _misfit(run: Run, moved: BodyMotion) -> float:
    """How far the motion in pictures is from the response, over all probes, relative."""
    values = run.response.values
    away = probe_response(run.scene, moved).values - values
    return float(np.linalg.norm(away)) / (float(np.linalg.norm(values)) or 1.0)


def open_album(folder: Path) -> Album:
    """Results in a folder that `run`, `compare` or `report` wrote; a ValueError if there are none.
    No model is run.
    """
    scenes = (path.parent for path in folder.rglob("scene.toml"))
    found = [scene / record.RESPONSES for scene in scenes if (scene / record.RESPONSES).is_file()]
    runs = [_run(path) for path in sorted(found, key=_order)]
    if not runs:
        missing = f"{folder} holds no {record.RESPONSES}"
        raise ValueError(f"{missing}; give a scene file or a result folder")
    views = [load(path) for path in sorted(folder.glob("*/view.npz"), key=_order)]
    own, scenes_of = folder / "scene.toml", {run.column: run.scene for run in runs}
    kept = {path.parent.name: path for path in sorted(folder.glob("*/map.npz"), key=_order)}
    scene = read(own) if own.exists() else runs[-1].scene
    return Album(
        title=scene.name if own.exists() else folder.resolve().name, scene=scene, runs=runs,
        views={view.column: view for view in views}, planned=_json(folder / "plan.json", PLAN),
        maps={n: surface.load(path, scenes_of[n]) for n, path in kept.items() if n in scenes_of},
    )  # fmt: skip


def _order(path: Path) -> tuple[str, int, str]:
    """By Tacton, then the point kernels, then in the order in which bodies are named everywhere."""
    column, known = path.parent.name, [PUBLISHED.name, SAME_LOAD.name, *BODIES]
    place = known.index(column) if column in known else len(known)
    return str(path.parent.parent), place, column


def _run(path: Path) -> Run:
    scene = read(path.parent / "scene.toml")
    arrays = reading.load_arrays(path)
    effort = _json(path.parent / "effort.json", EFFORT) or {}
    expected = (_json(path.parent / record.FILE, {}) or {}).get("expected_error")
    try:
        if any(array.dtype.kind not in "fiu" for array in arrays.values()):
            raise ValueError("it has arrays of other things than numbers")
        model = next(n for n in arrays if n not in ("t", "probes", *QUANTITIES))
        response = Response(
            model=model, times=arrays["t"], probes=arrays["probes"], values=arrays[model],
            quantity=named(model).quantity or scene.quantity,
            effort=effort_of(effort, "effort.json"),
            expected_error=np.nan if expected is None else fitting(expected, float, "the error"),
        )  # fmt: skip
        if len(response.times) < 2 or not len(response.probes) or response.probes.shape[1] != 2:
            raise ValueError("it has no probe in a plane, or less than two samples")
    except (ValueError, KeyError, TypeError, StopIteration) as error:
        raise ValueError(f"{path} is no result ({error}); run its scene again") from None
    return Run(tacton=scene.name, body=body_name(scene.body), scene=scene, response=response)


def _json(path: Path, pattern: dict[str, Any]) -> dict[str, Any] | None:
    """Contents of a file, if there is one, as `fitting` takes it."""
    if not path.exists():
        return None
    found: dict[str, Any] = fitting(reading.load_json(path), pattern, str(path))
    return found


def only(album: Album, columns: Sequence[str]) -> Album:
    """An album with these columns alone, such as "point-kernel" and "skin-slab"; all of them if
    none is named. A ValueError if it has no such column.
    """
    known = list(dict.fromkeys(run.column for run in album.runs))
    for name in columns:
        choose("column", name, known)
    wanted = columns or known
    return replace(
        album,
        runs=[run for run in album.runs if run.column in wanted],
        views={name: view for name, view in album.views.items() if name in wanted},
        maps={name: found for name, found in album.maps.items() if name in wanted},
    )
