"""The pack of a body, by its kind."""

from typing import Any

from simple_model import MovingPressure, Tacton
from skinwave.bodies.analytic import has_exact_waves, is_laterally_infinite
from skinwave.effort import Progress, silent
from skinwave.live.elements import element_pack
from skinwave.live.radial import radial_pack
from skinwave.live.sheets import sheet_pack
from skinwave.models.advice import takes
from skinwave.models.plate_modes import MODES
from skinwave.scene import Body, Scene


def pack_of(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Return the pack of a body: of wavenumber integrals, of a sheet's modes, or of elements.

    Raises
    ------
    ValueError
        If the body has none.
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
    return element_pack(body, body.of_kind.interactive_size, progress)
