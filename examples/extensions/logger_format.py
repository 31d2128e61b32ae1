"""Files .log4 of a logger: a line of JSON, then velocities as float32, one place after another."""

import json
from pathlib import Path

import numpy as np

from meshes.reading import read_bytes
from skinwave.measure import Given, Recording
from skinwave.system.formats import MEASUREMENTS, register


def read(path: Path, given: Given) -> Recording:
    """Return what the file contains, in its own units."""
    head, _, body = read_bytes(path, 100_000_000).partition(b"\n")
    try:
        about = json.loads(head)
        places = 1e-3 * np.array(about["places_mm"], float).reshape(-1, 2)
        samples = np.frombuffer(body, "<f4").reshape(len(places), -1)
        return Recording(
            values=samples.T[None].astype(float),  # (repetitions, times, places)
            rate=float(about["rate_hz"]), quantity="velocity", unit=about["unit"],
            places=places, sign=-1,  # positive is towards the laser, out of the body
        )  # fmt: skip
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"the file is no .log4 file ({error!r}); export it again") from None


register(MEASUREMENTS, ".log4", function=read, name="logger")
