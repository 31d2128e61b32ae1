"""MATLAB files: up to version 7 by scipy, 7.3 by h5py."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measurements import named, skinsource, zigzag
from skinwave.measurements.recording import Given, Recording

LARGEST = 2_000_000_000  # bytes of the file, and of the arrays in it
DEEPEST = 4  # structures within each other
HDF5 = b"\x89HDF\r\n\x1a\n"
EARLIEST = 512  # bytes before which HDF5 does not begin in a MATLAB file of version 7.3
MISSING = (
    'MATLAB files of version 7.3 need h5py; pip install "skinwave[measure]", or save it with -v7'
)


def read(path: Path, given: Given) -> Recording:
    """The recording in a MATLAB file.

    Raises
    ------
    ValueError
        If it is none, or its arrays do not make a measurement.
    """
    with reading.opened(path, LARGEST) as file:
        head = file.read(EARLIEST + len(HDF5))
    if not head:
        raise ValueError("the file is empty; download or export it anew")
    skinsource.refuse_table(path)
    found = _hdf5(path) if HDF5 in head else _mat(path)
    if not found:
        raise ValueError("the file has no arrays of numbers; save the signals as such")
    return zigzag.recording(found) if zigzag.fits(found) else named.recording(found, given)


def _mat(path: Path) -> dict[str, Any]:
    """Arrays by name of a file of version 4 to 7."""
    from scipy.io import loadmat, whosmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of names that occur twice, and the like
            told = sum(8 * int(np.prod(shape, dtype=object)) for _, shape, _ in whosmat(path))
            if told > LARGEST:
                raise ValueError(f"it holds {told / 1e6:,.0f} MB of {LARGEST / 1e6:,.0f}")
            found = loadmat(path, struct_as_record=True, squeeze_me=False)
    except Exception as error:  # whatever is made of spoilt bytes
        said = " ".join(str(error).split())[:80] or type(error).__name__
        raise ValueError(f"no MATLAB file that can be read ({said}); save it anew") from None
    arrays: dict[str, Any] = {}
    for name, value in found.items():
        if not name.startswith("__"):
            _take(arrays, name, value, 0)
    return arrays


def _take(arrays: dict[str, Any], name: str, value: Any, depth: int) -> None:
    """Add an array, or those of a structure as "structure.field"."""
    array = np.asarray(value)
    if array.dtype.names and array.size == 1 and depth < DEEPEST:
        for field in array.dtype.names:
            _take(arrays, f"{name}.{field}", array.ravel()[0][field], depth + 1)
    elif array.dtype.kind in "fiucU":
        arrays[name] = array


def _hdf5(path: Path) -> dict[str, Any]:
    """Arrays by name of a file of version 7.3, whose axes HDF5 has in reverse."""
    try:
        import h5py
    except ImportError:
        raise ValueError(MISSING) from None
    arrays: dict[str, Any] = {}
    left = LARGEST

    def take(name: str, node: Any) -> None:
        nonlocal left
        if not isinstance(node, h5py.Dataset) or name.startswith("#") or "/#" in name:
            return
        left -= int(node.nbytes)
        if left < 0:
            raise ValueError(f"it holds more than {LARGEST / 1e6:,.0f} MB")
        array = _matlab_array(node)
        if array is not None:
            arrays[name.replace("/", ".")] = array

    try:
        with h5py.File(path, "r") as file:
            file.visititems(take)
    except Exception as error:  # whatever is made of spoilt bytes
        said = " ".join(str(error).split())[:80] or type(error).__name__
        raise ValueError(f"no MATLAB file that can be read ({said}); save it anew") from None
    return arrays


def _matlab_array(node: Any) -> np.ndarray | None:
    """Array of a dataset as MATLAB shows it: transposed, text as text; None of what is neither."""
    kind = node.attrs.get("MATLAB_class", b"")
    if kind == b"char":
        return np.array(["".join(map(chr, np.asarray(node[()]).ravel(order="C")))])
    array = np.asarray(node[()])
    if array.dtype.names == ("real", "imag"):
        array = array["real"] + 1j * array["imag"]
    return array.T if array.dtype.kind in "fiuc" else None
