"""Packs: data from which the page computes the motion of bodies."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from meshes import cache
from skinwave.bodies.analytic import has_exact_waves, is_laterally_infinite
from skinwave.live.elements import element_pack
from skinwave.live.radial import radial_pack
from skinwave.live.sheets import sheet_pack
from skinwave.models.limits import takes
from skinwave.models.plate_modes import MODES
from skinwave.scene.scene import STILL, Body, Scene
from skinwave.system.effort import Progress, silent, versions

FORMAT = "live pack 6"  # of cached entries


def pack_method(body: Body) -> str:
    """Return the method by which the page computes a body: "radial" for wavenumber integrals,
    "modal" for the modes of a sheet, or "poles" for a reduced finite-element model.
    """
    if not body.of_kind.discretise:
        raise ValueError(f"A body of kind '{body.kind}' does not move. Choose another body.")
    if is_laterally_infinite(body) and has_exact_waves(body):
        return "radial"
    if takes(MODES, resting_scene(body)):
        return "modal"
    if body.of_kind.is_plate:
        raise ValueError(
            "The live page has no model of a sheet that is curled or tilted. Lay it flat, or use "
            "skinwave run."
        )
    return "poles"


def resting_scene(body: Body) -> Scene:
    """Return a scene of a body under a focus that rests at the origin."""
    return Scene(pressure=STILL, body=body, probes=((0.0, 0.0),))


def pack_of(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Return the pack of a body as a dict for JSON. Packs of finite-element bodies are cached."""
    method = pack_method(body)
    if method == "radial":
        return radial_pack(body, progress)
    if method == "modal":
        return sheet_pack(body, progress)
    content = hashlib.sha256(Path(body.file).read_bytes()).hexdigest() if body.file else ""
    size = body.of_kind.interactive_size
    key = cache.key(FORMAT, body, content, size, versions())
    if (entry := cache.load(key)) is not None and "pack" in entry:
        stored: dict[str, Any] = json.loads(entry["pack"].tobytes())
        return stored
    pack = element_pack(body, size, progress)
    cache.store(key, {}, {"pack": np.frombuffer(json.dumps(pack).encode(), np.uint8)})
    return pack
