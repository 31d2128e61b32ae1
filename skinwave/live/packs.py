"""The pack of a body, by its kind."""

from typing import Any

from skinwave.bodies.analytic import has_exact_waves, is_laterally_infinite
from skinwave.effort import Progress, silent
from skinwave.live.radial import radial_pack
from skinwave.scene import Body


def pack_of(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Return the pack of a body.

    Raises
    ------
    ValueError
        If the body has none.
    """
    if is_laterally_infinite(body) and has_exact_waves(body):
        return radial_pack(body, progress)
    raise ValueError(f"A body of kind '{body.kind}' has no pack. Use a slab with absorbing sides.")
