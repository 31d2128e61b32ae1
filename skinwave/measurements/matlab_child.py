"""Run by `matlab` in a process of its own: scipy's and h5py's readers of MATLAB files.

    python matlab_child.py FILE OUTPUT.npz

They crash on some damaged files. The arrays in FILE are written to OUTPUT.npz under their numbers,
with their names as `names`; what is wrong with the file is the last line of standard error.
"""

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes.subprocess_call import REFUSED

LARGEST = 2_000_000_000  # bytes of the arrays in a file
DEEPEST = 4  # structures within each other
HDF5 = b"\x89HDF\r\n\x1a\n"
EARLIEST = 512  # bytes before which HDF5 begins in a file of version 7.3
MISSING = (
    'MATLAB files of version 7.3 need h5py; pip install "skinwave[measure]", or save it with -v7'
)


def main() -> int:
    """Write the arrays in FILE to OUTPUT.npz."""
    source, target = sys.argv[1:]
    warnings.simplefilter("ignore")  # of names that occur twice, and the like
    with open(source, "rb") as file:
        head = file.read(EARLIEST + len(HDF5))
    try:
        found = hdf5(Path(source)) if HDF5 in head else mat(Path(source))
    except ImportError:
        print(MISSING, file=sys.stderr)
        return REFUSED
    except Exception as error:  # whatever is made of spoilt bytes
        said = " ".join(str(error).split())[:80] or type(error).__name__
        print(f"no MATLAB file that can be read ({said}); save it anew", file=sys.stderr)
        return REFUSED
    arrays: dict[str, Any] = {f"array{k}": array for k, array in enumerate(found.values())}
    np.savez(target, names=np.array(list(found), np.str_), **arrays)
    return 0


def mat(path: Path) -> dict[str, np.ndarray]:
    """Arrays by name of a file of version 4 to 7."""
    from scipy.io import loadmat, whosmat

    told = sum(8 * int(np.prod(shape, dtype=object)) for _, shape, _ in whosmat(path))
    if told > LARGEST:
        raise ValueError(f"it holds {told / 1e6:,.0f} MB, and the limit is {LARGEST / 1e6:,.0f}")
    arrays: dict[str, np.ndarray] = {}
    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            take(arrays, name, value, 0)
    return arrays


def take(arrays: dict[str, np.ndarray], name: str, value: Any, depth: int) -> None:
    """Add an array, or those of a structure as "structure.field"."""
    array = np.asarray(value)
    if array.dtype.names and array.size == 1 and depth < DEEPEST:
        for field in array.dtype.names:
            take(arrays, f"{name}.{field}", array.ravel()[0][field], depth + 1)
    elif array.dtype.kind in "fiucU":
        arrays[name] = array


def hdf5(path: Path) -> dict[str, np.ndarray]:
    """Arrays by name of a file of version 7.3, whose axes HDF5 has in reverse."""
    import h5py

    arrays: dict[str, np.ndarray] = {}
    left = LARGEST

    def visit(name: str, node: Any) -> None:
        nonlocal left
        if not isinstance(node, h5py.Dataset) or name.startswith("#"):
            return
        left -= int(node.nbytes)
        if left < 0:
            raise ValueError(f"it holds more than {LARGEST / 1e6:,.0f} MB")
        array = as_in_matlab(node)
        if array.dtype.kind in "fiucU":
            arrays[name.replace("/", ".")] = array

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return arrays


def as_in_matlab(node: Any) -> np.ndarray:
    """Array of a dataset as MATLAB shows it: transposed, text as text, complex as such."""
    array = np.asarray(node[()])
    if node.attrs.get("MATLAB_class", b"") == b"char":
        return np.array(["".join(map(chr, array.ravel()))])
    if array.dtype.names == ("real", "imag"):
        return np.asarray((array["real"] + 1j * array["imag"]).T)
    return array.T


if __name__ == "__main__":
    sys.exit(main())
