"""NumPy archives: skinwave's own, and those of others by the names of their arrays."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.quantities import QUANTITIES
from skinwave.measure import named
from skinwave.measure.recording import Given, Recording
from skinwave.models import named as model_named
from skinwave.models import names

FORMAT = "skinwave measurement 1"


def read(path: Path, given: Given) -> Recording:
    """The recording in an .npz file; of skinwave's own everything is in SI.

    Raises
    ------
    ValueError
        If it is none, or its arrays do not make a measurement.
    """
    with reading.opened(path):
        pass
    try:
        found = reading.arrays(path)
    except ValueError:
        raise ValueError(
            "the file cannot be read: it is damaged, too large, holds objects, or is no .npz; save "
            "arrays of numbers by numpy.savez"
        ) from None
    if str(found.get("format", "")) == FORMAT:
        return _own(found)
    if quantity := _of_response(found):
        alone = {name: found[name] for name in ("t", "probes", quantity)}
        read = named.recording(alone, replace(given, variable=""))
        return replace(read, unit=QUANTITIES[quantity].unit, sign=1)
    return named.recording(found, given)


def _of_response(found: dict[str, np.ndarray]) -> str:
    """Quantity of the responses that a file of skinwave's holds; "" if it is none.

    Raises
    ------
    ValueError
        If they are of a point kernel, which has no motion.
    """
    own = [name for name in found if name in QUANTITIES]
    models = found.keys() - {"t", "probes", *own}
    if not {"t", "probes"} <= found.keys() or len(own) != 1 or not models <= set(names()):
        return ""
    kernels = [name for name in models if not model_named(name).needs_body]
    if kernels or not QUANTITIES[own[0]].of_body:
        raise ValueError(
            "the file holds the pressure of a point kernel, which is no motion; give the "
            "response of a body"
        )
    return own[0]


def _own(found: dict[str, np.ndarray]) -> Recording:
    if missing := {"quantity", "unit", "values", "places", "times", "frequencies"} - found.keys():
        raise ValueError(f"the array '{min(missing)}' is missing; write the measurement anew")
    if found["values"].ndim != 3 or found["values"].dtype.kind not in "fc":
        raise ValueError(
            f"values have the shape {found['values'].shape} and are of {found['values'].dtype}; "
            "write the measurement anew"
        )
    return Recording(
        quantity=str(found["quantity"]), unit=str(found["unit"]), places=found["places"],
        times=found["times"], frequencies=found["frequencies"], values=found["values"],
        drive=found.get("drive", np.empty(0)), sign=1, name=str(found.get("name", "")),
        remarks=tuple(map(str, found.get("remarks", ()))),
    )  # fmt: skip
