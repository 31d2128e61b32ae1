"""Albums: a scene's responses by all models for pictures, in a folder.

scene.toml  plan.json  lines.csv
COLUMN/scene.toml  responses.npz  lines.csv  effort.json  record.json  view.npz  map.npz
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
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
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.report import description
from skinwave.results import record, surface, views
from skinwave.results.files import write_lines, write_run
from skinwave.results.motion import REDUCTION_TOLERANCE, BodyMotion, probe_response, whole_motion
from skinwave.results.playback import played_part
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField, has_wavenumber_integral
from skinwave.results.views import View
from skinwave.scene import paper15
from skinwave.scene.file import dumps, read
from skinwave.scene.scene import BODIES, Scene, body_name, check_load, with_body
from skinwave.system.document import worst_warnings
from skinwave.system.effort import silent
from skinwave.system.failures import failure_text, or_failed
from skinwave.system.json_kinds import EFFORT, PLAN, effort_of, fitting
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Album:
    """Contents of a folder: runs, saved views and maps by column, and the saved plan."""

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


def scene_columns(scene: Scene, beside: Sequence[str] = ()) -> dict[str, Scene]:
    """Return scenes by `Run.column`: both point kernels, the scene's own body and other presets.

    A scene without a body is computed on the bodies of `paper15.MEASURED_ON` that its path and
    probes fit. All but the published kernel receive the same load. Raises a ValueError if the load
    is not a pressure, or if a body in `beside` is unknown or does not fit.
    """
    check_load(scene, "a comparison with the point kernel")
    bodies: dict[str, Scene] = {}
    if scene.body.of_kind.discretise:
        bodies[body_name(scene.body)] = scene
    for name in beside:
        choose("body", name, [n for n in BODIES if n != "none"])
        other = with_body(scene, BODIES[name])
        if bodies.setdefault(name, other) != other:
            raise ValueError(
                f"the scene's own body already has the name '{name}'. Remove it from --beside"
            )
    for name in paper15.MEASURED_ON if not bodies else ():
        with suppress(ValueError):
            bodies[name] = with_body(scene, BODIES[name])
    return paper15.beside_kernels(scene) | bodies


def write_album(
    folder: Path, scene: Scene, options: SolveOptions, *, frames: int | None = None,
    beside: Sequence[str] = (),
) -> tuple[list[str], dict[str, str]]:  # fmt: skip
    """Compute a scene by every model, and write the results into a folder. Return the warnings, and
    the reasons of bodies and maps that failed.

    Raises a ValueError if a model cannot compute the scene, or if every body fails.
    """
    failures: dict[str, str] = {}
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    runs, own, misfit = [], None, {}
    for view, run, planned in compute_views(scene, options, failures, frames=frames, beside=beside):
        write = partial(write_view, view, failures=failures) if view else None
        write_run(folder / run.column, run, also=write)
        runs.append(run)
        if run.scene == scene and planned:
            own = planned
            misfit = {"misfit": _misfit(run, view.moved)} if view and view.moved else {}
    write_lines(folder / "lines.csv", runs)
    own = own or plan(scene, SolveOptions())
    table = own.table() | {"tolerance": own.options.tolerance} | misfit
    (folder / "plan.json").write_text(json.dumps(table, indent=1), encoding="utf-8")
    return worst_warnings((run.body, run.response.effort) for run in runs), failures


def write_view(view: View, folder: Path, failures: dict[str, str]) -> None:
    """Write a view and, for a body, the map of the probes' quantity unless it fails."""
    views.save(folder / "view.npz", view)
    scene, moved, (x, y) = view.scene, view.moved, surface.grid(view.scene)
    with or_failed(failures, f"map of {view.column}"):
        if moved and not (scene.reading.is_plain and has_wavenumber_integral(scene)):
            surface.save(folder / "map.npz", surface.element_map(scene, moved, x, y))
        elif scene.reading.is_plain and view.body != "none":
            surface.save(folder / "map.npz", surface.body_map(scene, x, y))


def compute_views(
    scene: Scene, options: SolveOptions, failures: dict[str, str], *, frames: int | None = None,
    beside: Sequence[str] = (),
) -> Iterator[tuple[View | None, Run, Plan | None]]:  # fmt: skip
    """Yield view, run and plan of each of `scene_columns`; the published kernel has no view.

    Views use larger elements than responses, or modes of a plate. Adds the reasons of missing
    responses and views to the failures. Raises a ValueError if all bodies fail.
    """
    columns, progress = scene_columns(scene, beside), options.progress
    meshed = {c: each for c, each in columns.items() if _has_elements(each, options.h)}
    moved: dict[str, BodyMotion] = {}
    with ThreadPoolExecutor(1) as beside_plans:
        moving = {
            c: beside_plans.submit(_coarse_motion, each, options) for c, each in meshed.items()
        }
        plans = {
            column: plan(each, options)
            for column, each in columns.items() if each.body.of_kind.discretise
        }  # fmt: skip
        for column, future in moving.items():
            progress(pictured := f"pictures of {column}", 0.0)
            with or_failed(failures, pictured):
                moved[column] = future.result()
    fastest = max(map(views.fastest_line, moved.values()), default=None)
    part = played_part(scene.pressure, fastest, frames)  # all views play the same part
    reach = _reach(columns, moved)
    for column, each in columns.items():
        progress(f"response of {column}", 0.0)
        if column not in plans:
            run = Run(tacton=scene.name, body="none", scene=each, response=compute(each, column))
            is_shown = column == SAME_LOAD.name
            yield views.kernel_view(each, reach, part) if is_shown else None, run, None
            continue
        own: Run | None = None
        with or_failed(failures, f"response of {column}"):
            response = solve_as_planned(each, plans[column])
            own = Run(tacton=scene.name, body=column, scene=each, response=response)
        if own is None:
            continue
        progress(pictured := f"pictures of {column}", 0.0)
        view = None
        if pictured not in failures:
            with or_failed(failures, pictured):
                view = (
                    views.body_view(each, column, moved[column], part) if column in moved
                    else views.flat_view(own, reach, part)
                )  # fmt: skip
        yield view, own, plans[column]
    if plans and all(f"response of {column}" in failures for column in plans):
        raise ValueError(failure_text(failures))


def _coarse_motion(scene: Scene, options: SolveOptions) -> BodyMotion:
    """Return the motion of a body for pictures."""
    larger = 1.5  # element size of pictures over the default one, at a fifth of the time
    size = options.h or larger * default_size(scene.body)
    return whole_motion(
        scene, replace(options, tolerance=REDUCTION_TOLERANCE, h=size, progress=silent)
    )


def _reach(columns: Mapping[str, Scene], moved: Mapping[str, BodyMotion]) -> Floats:
    """Return the half sides (2,) in m of a flat view, which is as large as the largest body."""
    half = [[each.body.width / 2, each.body.height / 2]
            for each in columns.values() if each.body.of_kind.is_bounded]  # fmt: skip
    for column in (name for name in moved if not columns[name].body.of_kind.is_bounded):
        mesh = moved[column].mesh
        half.append(np.abs(mesh.points[np.unique(mesh.facets["top"]), :2]).max(axis=0))
    return np.max(half, axis=0)


def _has_elements(scene: Scene, h: float | None) -> bool:
    """Whether pictures are drawn by finite elements.

    Unless an element size is given, plates are drawn from their modes, and layers that cannot be
    meshed from their wavenumber integral. Raises a ValueError if other bodies cannot be meshed.
    """
    if not scene.body.of_kind.discretise:
        return False
    if h is None and scene.reading.is_plain and takes(FROM_REST, scene):
        return False
    try:
        check_mesh(scene.body, h or default_size(scene.body))
    except ValueError:
        if h or not takes(FLAT_BODY, scene):
            raise
        return False
    return True


def quantity_views(
    scene: Scene, options: SolveOptions, *, frames: int | None = None, beside: Sequence[str] = ()
) -> tuple[list[View], list[str], dict[str, str]]:
    """Return views of a scene coloured by the probes' quantity, warnings, and failures.

    The point kernel is included only for displacement. Raises the errors of `write_album`.
    """
    failures: dict[str, str] = {}
    found = compute_views(scene, options, failures, frames=frames, beside=beside)
    computed = [(view, run) for view, run, _ in found if view]
    warnings = worst_warnings((run.body, run.response.effort) for _, run in computed)
    if scene.reading.record is DISPLACEMENT:
        return [view for view, _ in computed], warnings, failures
    missing = description.no_kernel_text(scene)
    shaded = []
    for view, run in computed:
        with or_failed(failures, f"{scene.quantity} of {view.column}"):
            shaded += [views.with_shade(view, run.scene)] if len(view.tets) else []
    if not shaded:
        raise ValueError(failure_text(failures) or f"{missing}. Give the scene a body")
    return shaded, [*warnings, missing], failures


def _misfit(run: Run, moved: BodyMotion) -> float:
    """Return the relative difference between the motion in pictures and the response."""
    values = run.response.values
    difference = probe_response(run.scene, moved).values - values
    return float(np.linalg.norm(difference)) / (float(np.linalg.norm(values)) or 1.0)


def open_album(folder: Path, columns: Sequence[str] = ()) -> Album:
    """Read the results in a folder of `run`, `compare` or `report`, without any computation.

    `columns` select models, such as "point-kernel"; all by default. Raises a ValueError if the
    folder has no results or no such column.
    """
    scenes = (path.parent for path in folder.rglob("scene.toml"))
    responses = [path for home in scenes if (path := home / record.RESPONSES).is_file()]
    runs = [_read_run(path) for path in sorted(responses, key=_order)]
    if not runs:
        raise ValueError(
            f"{folder} contains no {record.RESPONSES}. Give a scene file or a result folder"
        )
    own, scene_of = folder / "scene.toml", {run.column: run.scene for run in runs}
    scene = read(own) if own.exists() else runs[-1].scene
    for name in columns:
        choose("column", name, scene_of)
    shown = {name: each for name, each in scene_of.items() if name in (columns or scene_of)}
    saved = [views.load(path) for path in sorted(folder.glob("*/view.npz"), key=_order)]
    maps = {
        name: surface.load(path, shown[name])
        for path in sorted(folder.glob("*/map.npz"), key=_order)
        if (name := path.parent.name) in shown
    }
    return Album(
        title=scene.name if own.exists() else folder.resolve().name, scene=scene, maps=maps,
        runs=[run for run in runs if run.column in shown],
        views={view.column: view for view in saved if view.column in shown},
        planned=_read_json(folder / "plan.json", PLAN),
    )  # fmt: skip


def _order(path: Path) -> tuple[str, int, str]:
    """Return a sort key: Tacton, then point kernels, then bodies in the usual order."""
    column, known = path.parent.name, [PUBLISHED.name, SAME_LOAD.name, *BODIES]
    place = known.index(column) if column in known else len(known)
    return str(path.parent.parent), place, column


def _read_run(path: Path) -> Run:
    scene = read(path.parent / "scene.toml")
    arrays = reading.load_arrays(path)
    effort = _read_json(path.parent / "effort.json", EFFORT) or {}
    errors = (_read_json(path.parent / record.FILE, {}) or {}).get("errors", [])
    try:
        if any(array.dtype.kind not in "fiu" for array in arrays.values()):
            raise ValueError("it has arrays that are not numbers")
        model = next(n for n in arrays if n not in ("t", "probes", *QUANTITIES))
        response = Response(
            model=model, times=arrays["t"], probes=arrays["probes"], values=arrays[model],
            quantity=named(model).quantity or scene.quantity,
            effort=effort_of(effort, errors, "effort.json"),
        )  # fmt: skip
        if len(response.times) < 2 or not len(response.probes) or response.probes.shape[1] != 2:
            raise ValueError("it has fewer than two samples, or no probe in a plane")
    except (ValueError, KeyError, TypeError, StopIteration) as error:
        raise ValueError(
            f"{path} is not a result of skinwave ({error}). Run its scene again"
        ) from None
    return Run(tacton=scene.name, body=body_name(scene.body), scene=scene, response=response)


def _read_json(path: Path, pattern: dict[str, Any]) -> dict[str, Any] | None:
    """Return the contents of a file, checked against a pattern, or None without a file."""
    if not path.exists():
        return None
    content: dict[str, Any] = fitting(reading.load_json(path), pattern, str(path))
    return content
