"""The data of a page: records of its bodies, values to begin with, presets, self-test."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from skinwave.live import values
from skinwave.live.packs import pack_of
from skinwave.live.page import page
from skinwave.live.records import record_of, title_of
from skinwave.live.selftest import has_exact_lines, selftest
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import BODIES, Body, Scene, body_name
from skinwave.system.effort import Progress, silent

ERROR = 0.01  # relative, of a line, of packs that state none
BODIES_SHOWN = ("skin-slab", "paper-sheet", "palm")  # of a page without scenes


def data_of(
    scenes: Sequence[Scene] = (),
    progress: Progress = silent,
    *,
    bodies: Sequence[str] = BODIES_SHOWN,
    test: bool = True,
) -> dict[str, Any]:
    """Return the data of a page of scenes, or of preset bodies, as a dict for JSON; `test` includes
    the data of the self-test. A ValueError if a scene has what no control sets.
    """
    names = named([scene.body for scene in scenes] or [BODIES[name] for name in bodies])
    own = [values.values_of(scene, names[scene.body]) for scene in scenes]
    records, tests = [], []
    for body, name in names.items():
        before = f"{title_of(body)}: " if len(names) > 1 else ""
        pack = pack_of(body, partial(_named, progress, before))
        records.append(record_of(body, pack, name))
        if test:
            lowest, error = pack["lowest_height_mm"] / 1e3, pack.get("error", ERROR)
            tests += selftest(body, name, -(-20 // len(names)), lowest, error)
    return {
        "bodies": records, "start": own[0] if own else {"body": records[0]["name"]},
        "presets": _own_presets(scenes, own) + values.presets(),
        "selftest": tests, "api": None,
    }  # fmt: skip


def comparison_page(scenes: Iterable[Scene]) -> str | None:
    """Return the page of those scenes whose body has a pack within seconds; None if it cannot show
    them.
    """
    quick = [scene for scene in scenes if has_exact_lines(scene)]
    try:
        return page(data_of(quick, test=False)) if quick else None
    except (ValueError, ArithmeticError):
        return None


def named(bodies: Sequence[Body]) -> dict[Body, str]:
    """Return each of the bodies once, with a name of its own."""
    found: dict[Body, str] = {}
    for body in dict.fromkeys(bodies):
        name = body_name(body)
        found[body] = f"{name}-{len(found) + 1}" if name in found.values() else name
    return found


def _own_presets(scenes: Sequence[Scene], own: Sequence[values.Values]) -> list[dict[str, Any]]:
    """Presets of scenes, without those of the paper and of the same Tacton on other bodies."""
    found: dict[str, dict[str, Any]] = {}
    for scene, each in zip(scenes, own, strict=True):
        tacton = {key: value for key, value in each.items() if key != "body"}
        if scene.name not in dict(tactons()) and tacton not in found.values():
            title = f"{scene.name} ({len(found) + 1})" if scene.name in found else scene.name
            found[title] = tacton
    return [{"title": title, "values": each} for title, each in found.items()]


def read_scene(path: Path) -> Scene:
    """Read a scene for the page, which is named after its file if it has no name."""
    from skinwave.scene.file import read

    scene = read(path)
    return scene if scene.name != Scene.name else replace(scene, name=path.stem)


def _named(progress: Progress, before: str, phase: str, fraction: float) -> None:
    progress(f"{before}{phase}", fraction)
