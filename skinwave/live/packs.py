"""The pack of a body, by its kind."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from meshes import cache
from simple_model import MovingPressure, Tacton
from skinwave.bodies.analytic import has_exact_waves, is_laterally_infinite
from skinwave.live.elements import element_pack
from skinwave.live.radial import radial_pack
from skinwave.live.sheets import sheet_pack
from skinwave.models.limits import takes
from skinwave.models.plate_modes import MODES
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Progress, silent, versions

FORMAT = "live pack 4"  # of cached entries


def pack_of(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Return the pack of a body: of wavenumber integrals, of a sheet's modes, or of elements; a
    ValueError if it has none.
    """
    if not body.of_kind.discretise:
        raise ValueError(f"A body of kind '{body.kind}' does not move. Choose another body.")
    if is_laterally_infinite(body) and has_exact_waves(body):
        return radial_pack(body, progress)
    resting = Scene(pressure=MovingPressure(tacton=Tacton()), body=body, probes=((0.0, 0.0),))
    if takes(MODES, resting):
        return sheet_pack(body, progress)
    if body.of_kind.is_plate:
        raise ValueError(
            "A sheet that is curled or tilted has no pack. Lay it flat, or use skinwave run."
        )
    return _stored(body, progress)


def _stored(body: Body, progress: Progress) -> dict[str, Any]:
    """The pack of a body of elements, from the cache if it is there."""
    content = hashlib.sha256(Path(body.file).read_bytes()).hexdigest() if body.file else ""
    size = body.of_kind.interactive_size
    name = cache.key(FORMAT, body, content, size, versions())
    if (entry := cache.load(name)) is not None and "pack" in entry:
        found: dict[str, Any] = json.loads(entry["pack"].tobytes())
        return found
    pack = element_pack(body, size, progress)
    cache.store(name, {}, pack=np.frombuffer(json.dumps(pack).encode(), np.uint8))
    return pack
