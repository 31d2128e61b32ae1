"""NumPy archives: skinwave's own, and those of others by the names of their arrays."""

from pathlib import Path

import numpy as np

from meshes import reading
from skinwave.measurements import named
from skinwave.measurements.recording import Given, Recording

FORMAT = "skinwave measurement 1"


def read(path: Path, given: Given) -> Recording:
    """The recording in an .npz file; of skinwave's own everything is in SI.

    Raises
    ------
    ValueError
        If it is none, or its arrays do not make a measurement.
    """
    try:
        found = reading.arrays(path)
    except ValueError as error:
        raise ValueError(str(error).replace("make the result anew", "save it anew")) from None
    if str(found.get("format", "")) == FORMAT:
        return _own(found)
    return named.recording(found, given)


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
