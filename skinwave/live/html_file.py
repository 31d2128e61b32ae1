"""The live page: one self-contained HTML file of template, styles, ES modules and data."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from skinwave.live import values
from skinwave.live.packs import pack_method, pack_of
from skinwave.live.records import record_of, title_of
from skinwave.live.selftest import selftest
from skinwave.results.propagation import distance_from_path
from skinwave.scene.paper15 import tactons
from skinwave.scene.scene import BODIES, Body, Scene, body_name
from skinwave.system.effort import Progress, silent
from skinwave.system.failures import failure_text, or_failed
from skinwave.system.formats import MEASUREMENTS, suffixes
from skinwave.system.scripts import bundle, digest, json_for_script
from skinwave.system.templates import render


def page(data: Mapping[str, Any]) -> str:
    """Return the live page as HTML, with data from `data_of`."""
    static = resources.files("skinwave") / "static"
    script = "\n" + bundle(static, "page.js")
    return render(
        "live.html", script=script, worker=bundle(static, "worker.js"),
        css=(static / "page.css").read_text(encoding="utf-8"),
        data=json_for_script(data), policy=policy(script, served=bool(data.get("api"))),
        failed=failure_text(data.get("failures", {})), measured=suffixes(MEASUREMENTS),
    )  # fmt: skip


def policy(script: str, *, served: bool = False) -> str:
    """Return the content security policy: one script, requests only to the page's own server."""
    own = "'self'" if served else "'none'"
    return (
        f"default-src 'none'; script-src {digest(script)}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src data: blob:; worker-src blob:; "
        f"connect-src {own}; base-uri 'none'; form-action 'none'"
    )


def data_of(
    scenes: Sequence[Scene] = (),
    progress: Progress = silent,
    *,
    bodies: Sequence[str] = ("skin-slab", "paper-sheet", "palm"),
    tests: int = 60,
) -> dict[str, Any]:
    """Return the data of a page of scenes, or of preset bodies, as a dict for JSON.

    The point of the page is the probe nearest to the path. The self-test has at least `tests`
    random Tactons. A body that fails is left out, with its reason in "failures". Raises ValueError
    if all fail, or if no control of the page can set a scene.
    """
    scenes = [replace(scene, probes=(_nearest(scene),)) for scene in scenes]
    names = unique_names([scene.body for scene in scenes] or [BODIES[name] for name in bodies])
    own = [values.control_values(scene, names[scene.body]) for scene in scenes]
    records, tested, failures = [], [], dict[str, str]()

    def on_body(prefix: str, phase: str, fraction: float) -> None:
        progress(f"{prefix}{phase}", fraction)

    for body, name in names.items():
        prefix = f"{title_of(body)}: " if len(names) > 1 else ""
        with or_failed(failures, title_of(body)):
            pack = pack_of(body, partial(on_body, prefix))
            records.append(record_of(body, pack, name))
            if count := -(-tests // len(names)):
                lowest = pack["lowest_height_mm"] / 1e3
                tested += selftest(body, name, count, lowest, pack["error"])
    if not records:
        raise ValueError("; ".join(dict.fromkeys(failures.values())))
    known = {record["name"] for record in records}
    kept = [k for k, scene in enumerate(scenes) if names[scene.body] in known]
    scenes, own = [scenes[k] for k in kept], [own[k] for k in kept]
    return {
        "bodies": records, "start": own[0] if own else {"body": records[0]["name"]},
        "presets": _own_presets(scenes, own) + values.presets(),
        "selftest": tested, "api": None, "failures": failures,
    }  # fmt: skip


def comparison_page(scenes: Iterable[Scene]) -> tuple[str, dict[str, str]]:
    """Return a page of those scenes that it can set and whose packs are quick, skin first.

    It is "" if there are no such scenes. Also return the reasons of bodies that failed. Raises
    ValueError if all fail.
    """
    quick = sorted(filter(_is_quick, scenes), key=lambda scene: not scene.body.is_skin)
    if not quick:
        return "", {}
    data = data_of(quick, tests=6)
    return page(data), {f"live page of {name}": why for name, why in data["failures"].items()}


def _nearest(scene: Scene) -> tuple[float, float]:
    """Return the probe of a scene that is nearest to its path."""
    distances = distance_from_path(scene, np.array(scene.probes))
    return scene.probes[int(distances.argmin())]


def _is_quick(scene: Scene) -> bool:
    try:
        return pack_method(scene.body) != "poles" and bool(values.control_values(scene, ""))
    except ValueError:
        return False


def unique_names(bodies: Sequence[Body]) -> dict[Body, str]:
    """Return each of the different bodies with a name of its own."""
    names: dict[Body, str] = {}
    for body in dict.fromkeys(bodies):
        name = body_name(body)
        names[body] = f"{name}-{len(names) + 1}" if name in names.values() else name
    return names


def _own_presets(scenes: Sequence[Scene], own: Sequence[values.Values]) -> list[dict[str, Any]]:
    """Presets of scenes, without the Tactons of the paper and without duplicates."""
    presets: dict[str, dict[str, Any]] = {}
    for scene, each in zip(scenes, own, strict=True):
        tacton = {key: value for key, value in each.items() if key != "body"}
        if scene.name not in dict(tactons()) and tacton not in presets.values():
            title = f"{scene.name} ({len(presets) + 1})" if scene.name in presets else scene.name
            presets[title] = tacton
    return [{"title": title, "values": each} for title, each in presets.items()]


def read_scene(path: Path) -> Scene:
    """Read a scene for the page. A scene without a name is named after its file."""
    from skinwave.scene.file import read

    scene = read(path)
    return scene if scene.name != Scene.name else replace(scene, name=path.stem)
