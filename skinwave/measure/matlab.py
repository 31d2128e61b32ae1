"""Arrays in MATLAB files, by scipy's and h5py's readers, which crash on some damaged files:
`read_mat` calls them in a process of its own.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

DEEPEST = 4  # structures within each other
HDF5 = b"\x89HDF\r\n\x1a\n"
EARLIEST = 512  # bytes before which HDF5 begins in a file of version 7.3
DAMAGED = "the file is damaged, too large or no MATLAB file; save fewer arrays anew with -v7"
MISSING = (
    'MATLAB files of version 7.3 need h5py; pip install "skinwave[measure]", or save it with -v7'
)


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays in a file by name; raises a ValueError that says what is wrong with it."""
    warnings.simplefilter("ignore")  # of names that occur twice, and the like
    with path.open("rb") as file:
        head = file.read(EARLIEST + len(HDF5))
    try:
        return hdf5(path) if HDF5 in head else mat(path)
    except ImportError:
        raise ValueError(MISSING) from None
    except Unreadable:
        raise
    except Exception:  # whatever is made of spoilt bytes
        raise ValueError(DAMAGED) from None


class Unreadable(ValueError):
    """The arrays of a file are of a kind that only MATLAB reads."""


def mat(path: Path) -> dict[str, np.ndarray]:
    """Arrays by name of a file of version 4 to 7."""
    from scipy.io import loadmat

    arrays: dict[str, np.ndarray] = {}
    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            take(arrays, name, of_scipy(value), 0)
    return arrays


def of_scipy(value: Any) -> Any:
    """An array, a list of the elements of a cell, or a list of structures as dictionaries."""
    array = np.asarray(value)
    if array.dtype.names:
        return [{field: of_scipy(one[field]) for field in array.dtype.names} for one in array.flat]
    return [of_scipy(one) for one in array.flat] if array.dtype.kind == "O" else array


def hdf5(path: Path) -> dict[str, np.ndarray]:
    """Arrays by name of a file of version 7.3, whose axes HDF5 has in reverse."""
    import h5py

    arrays: dict[str, np.ndarray] = {}

    def read(node: Any) -> Any:
        if isinstance(node, h5py.Group):
            return {name: read(one) for name, one in node.items()}
        if node.dtype == h5py.ref_dtype:
            return [read(file[one]) for one in node[()].T.flat]
        return as_in_matlab(node)

    with h5py.File(path, "r") as file:
        for name, node in file.items():
            if not name.startswith("#"):
                take(arrays, name, read(node), 0)
    return arrays


def take(arrays: dict[str, np.ndarray], name: str, value: Any, depth: int) -> None:
    """Add an array, those of a structure as "structure.field", and those of the elements of a cell
    or an array of structures as one array whose first axis is that of the elements.
    """
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        value = {field: [one.get(field) for one in value] for field in value[0]}
    if isinstance(value, dict) and depth < DEEPEST:
        for field, one in value.items():
            take(arrays, f"{name}.{field}", one, depth + 1)
    elif isinstance(value, list):
        value = stacked(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiucU":
        arrays[name] = value


def stacked(parts: list[Any]) -> np.ndarray | None:
    """Arrays along a new first axis, vectors of other lengths with nan at their end; the one text
    or number if all are the same; None if they do not fit together.
    """
    inner = [stacked(one) if isinstance(one, list) else one for one in parts]
    found = [one for one in inner if isinstance(one, np.ndarray) and one.dtype.kind in "fiucU"]
    are_words = [one.dtype.kind == "U" for one in found]
    if not found or len(found) < len(inner) or (any(are_words) and not all(are_words)):
        return None
    if are_words[0] or all(one.size == 1 for one in found):
        alike = all(np.array_equal(one, found[0]) for one in found)
        return found[0] if alike else np.array([one.ravel()[0] for one in found if one.size])
    if all(one.size == max(one.shape, default=0) for one in found):
        length = max(one.size for one in found)
        if any(one.size < length for one in found):
            found = [np.pad(one.ravel() * 1.0, (0, length - one.size), constant_values=np.nan)
                     for one in found]  # fmt: skip
        return np.stack([one.ravel() for one in found])
    return np.stack(found) if len({one.shape for one in found}) == 1 else None


def as_in_matlab(node: Any) -> np.ndarray:
    """Array of a dataset as MATLAB shows it: transposed, text as text, complex as such."""
    array = np.asarray(node[()])
    if "MATLAB_object_decode" in node.attrs:  # its numbers stand for others
        kind = bytes(node.attrs.get("MATLAB_class", b"object")).decode(errors="replace")
        raise Unreadable(
            f"'{node.name.strip('/')}' is a {kind} of MATLAB, whose values cannot be read; save "
            "them as arrays, such as by table2array"
        )
    if node.attrs.get("MATLAB_class", b"") == b"char":
        return np.array(["".join(map(chr, array.ravel()))])
    if array.dtype.names == ("real", "imag"):
        return np.asarray((array["real"] + 1j * array["imag"]).T)
    return array.T
