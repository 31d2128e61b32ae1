"""Arrays in MATLAB files by scipy and h5py, which crash on some damaged files: `read_mat` calls
`read_arrays` in a separate process.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

DAMAGED = "the file is damaged, too large or not a MATLAB file; save fewer arrays again with -v7"


class Unreadable(ValueError):
    """An array of a kind that only MATLAB can read."""


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays in a file by name, those of structures as "structure.field"."""
    warnings.simplefilter("ignore")  # of duplicate names
    header = 512  # bytes before hdf5 in a file of version 7.3
    hdf5 = b"\x89HDF\r\n\x1a\n"
    with path.open("rb") as file:
        head = file.read(header + len(hdf5))
    arrays: dict[str, np.ndarray] = {}
    try:
        for name, value in (_hdf5 if hdf5 in head else _mat)(path).items():
            _add(arrays, name, value, 0)
    except ImportError:
        raise ValueError(
            'MATLAB 7.3 files need h5py; pip install "skinwave[measure]", or save with -v7'
        ) from None
    except Unreadable:
        raise
    except Exception:  # whatever the libraries raise for damaged bytes
        raise ValueError(DAMAGED) from None
    return arrays


def _mat(path: Path) -> dict[str, Any]:
    """Return the variables of a file of version 4 to 7; structures as dictionaries."""
    from scipy.io import loadmat

    def convert(value: Any) -> Any:
        array = np.asarray(value)
        if array.dtype.names:
            return [{n: convert(one[n]) for n in array.dtype.names} for one in array.flat]
        return [convert(one) for one in array.flat] if array.dtype.kind == "O" else array

    return {name: convert(x) for name, x in loadmat(path).items() if not name.startswith("__")}


def _hdf5(path: Path) -> dict[str, Any]:
    """Return the variables of a file of version 7.3, which stores axes in reverse."""
    import h5py

    with h5py.File(path, "r") as file:

        def convert(node: Any) -> Any:
            if isinstance(node, h5py.Group):
                return {name: convert(one) for name, one in node.items()}
            if node.dtype == h5py.ref_dtype:
                return [convert(file[one]) for one in node[()].T.flat]
            return _dataset(node)

        return {name: convert(node) for name, node in file.items() if not name.startswith("#")}


def _dataset(node: Any) -> np.ndarray:
    """Return the array of a dataset as MATLAB shows it."""
    array = np.asarray(node[()])
    if "MATLAB_object_decode" in node.attrs:  # its numbers refer to hidden values
        kind = bytes(node.attrs.get("MATLAB_class", b"object")).decode(errors="replace")
        raise Unreadable(
            f"'{node.name.strip('/')}' is a {kind}, which only MATLAB reads; save arrays, such as "
            "by table2array"
        )
    if node.attrs.get("MATLAB_class", b"") == b"char":
        return np.array(["".join(map(chr, array.ravel()))])
    if array.dtype.names == ("real", "imag"):
        return np.asarray((array["real"] + 1j * array["imag"]).T)
    return array.T


def _add(arrays: dict[str, np.ndarray], name: str, value: Any, depth: int) -> None:
    """Add an array, the fields of a structure, or the stacked elements of a cell."""
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        value = {field: [one.get(field) for one in value] for field in value[0]}
    deepest = 4  # structures within each other
    if isinstance(value, dict) and depth < deepest:
        for field, one in value.items():
            _add(arrays, f"{name}.{field}", one, depth + 1)
    elif isinstance(value, list):
        value = _stack(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiucU":
        arrays[name] = value


def _stack(parts: list[Any]) -> np.ndarray | None:
    """Return arrays along a new first axis, nan at the end of shorter vectors, or None."""
    parts = [_stack(one) if isinstance(one, list) else one for one in parts]
    kinds = {one.dtype.kind if isinstance(one, np.ndarray) else "" for one in parts}
    if not kinds or (not kinds <= set("fiuc") and kinds != {"U"}):
        return None
    if kinds == {"U"} or all(one.size == 1 for one in parts):
        alike = all(np.array_equal(one, parts[0]) for one in parts)
        return parts[0] if alike else np.array([one.ravel()[0] for one in parts if one.size])
    if all(one.size == max(one.shape, default=0) for one in parts):
        length = max(one.size for one in parts)
        vectors = [one.ravel() for one in parts]
        if any(len(one) < length for one in vectors):
            vectors = [np.pad(one * 1.0, (0, length - len(one)), constant_values=np.nan)
                       for one in vectors]  # fmt: skip
        return np.stack(vectors)
    return np.stack(parts) if len({one.shape for one in parts}) == 1 else None
