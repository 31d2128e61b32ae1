"""MATLAB files: up to version 7 by scipy, 7.3 by h5py, in a process of their own."""

import tempfile
from pathlib import Path

import numpy as np

from meshes import reading, subprocess_call
from meshes.tetmesh import MeshError
from skinwave.measure import named, skinsource, zigzag
from skinwave.measure.recording import Given, Recording

LARGEST = 2_000_000_000  # bytes
CHILD = Path(__file__).with_name("matlab_child.py")


def read(path: Path, given: Given) -> Recording:
    """The recording in a MATLAB file.

    Raises
    ------
    ValueError
        If it is none, or its arrays do not make a measurement.
    """
    with reading.opened(path, LARGEST) as file:
        if not file.read(1):
            raise ValueError("the file is empty; download or export it anew")
    skinsource.refuse_table(path)
    found = _arrays(path)
    if not found:
        raise ValueError("the file has no arrays of numbers; save the signals as such")
    return zigzag.recording(found, given) if zigzag.fits(found) else named.recording(found, given)


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrays by name, of a structure as "structure.field"."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        try:
            subprocess_call.read(CHILD, path, target, folder=folder)
        except subprocess_call.Refused as error:
            raise ValueError(str(error)) from None
        except MeshError as error:
            raise ValueError(
                "the file is damaged or no MATLAB file; save it anew with -v7"
            ) from error
        with np.load(target, allow_pickle=False) as kept:
            return {str(name): kept[f"array{k}"] for k, name in enumerate(kept["names"])}
