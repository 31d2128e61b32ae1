"""MKL PARDISO on the upper triangle of symmetric matrices: Cholesky if real, LDL^T if complex.

It orders blocks of rows with similar patterns, as those of a node's components, which takes 0.7 s
instead of 2.8 for a slab of 128,000 dofs and a third of the memory. A factor in single precision
saves nothing: for that slab, at a Poisson's ratio of 0.4999, it takes 2.2 s instead of 3.8, but a
solution with the step of refinement that it needs 1.3 times as long; for a sheet of 0.1 mm
refinement diverges.

A factor that is larger than the memory that is free is kept in files (out of core), which PARDISO
itself writes and reads: its size is known after the analysis, before anything is factorised.
"""

import ctypes
import logging
import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fem.memory import free_memory
from fem.sparsity import starts_of_kept

log = logging.getLogger(__name__)

Array = NDArray[Any]  # float64 or complex128
SPARSE = 0.1  # share of n^2 in the upper triangle; blocks of denser matrices may crash PARDISO
BLOCKS = 80  # %: how much alike the patterns of rows are that PARDISO takes as a block
TWO_LEVELS, BY_BLOCKS, OUT_OF_CORE = 23, 36, 59  # of its settings; the last 2 for files
IN_CORE = 0.8  # of the memory that is free, at most, for a factor; vectors need the rest
LEAST_CORE = 500  # MB that it may use beside the files: with less it fails
PHASES = {"analyse": 11, "factorise": 22, "solve": 33, "release": -1}


class PardisoError(ArithmeticError):
    """Failure of PARDISO, by the number of its error."""


@cache
def mkl() -> ctypes.CDLL | None:
    """The MKL runtime of the `mkl` wheel, if it is installed."""
    for folder in ("lib", "Library/bin"):
        for path in sorted(Path(sys.prefix, folder).glob("*mkl_rt*")):
            try:
                return ctypes.CDLL(str(path))
            except OSError:
                continue
    return None


def solver(A: sparse.csr_array, memory: float | None = None) -> Callable[[Array], Array]:
    """Factorise a matrix.

    Parameters
    ----------
    A : sparse (n, n), with sorted indices
    memory : bytes that its factor may take; what is free if not given

    Returns
    -------
    solution (n,) or (n, k) of right-hand sides

    Raises
    ------
    MemoryError
        If the factor fits neither in memory nor on the disk.
    PardisoError
        If a pivot is not positive, or another step fails.
    """
    n, kind = A.shape[0], 6 if np.iscomplexobj(A.data) else 2
    values, indices, indptr = _upper(A)
    del A
    # PARDISO perturbs pivots below an absolute bound: entries of about 1 make it a relative one.
    scale = 2.0 ** np.round(np.log2(np.abs(values).max(initial=1e-300)))
    values /= scale
    handle, settings = np.zeros(64, np.int64), np.zeros(64, np.int32)
    settings[0], settings[1], settings[7] = 1, 2, 0  # own settings, METIS, no refinement
    settings[9], settings[TWO_LEVELS] = 16, 1  # perturbation of pivots
    if len(values) < SPARSE * n * n:
        settings[BY_BLOCKS] = -BLOCKS

    def call(phase: str, b: Array | None = None) -> Array:
        right = 1 if b is None or b.ndim == 1 else b.shape[1]
        b = np.zeros(1, values.dtype) if b is None else np.asfortranarray(b, values.dtype)
        x = np.zeros_like(b, order="F")
        error = ctypes.c_int32(0)
        pointer = ctypes.c_void_p
        mkl().pardiso(  # type: ignore[union-attr]
            handle.ctypes.data_as(pointer), *_integers(1, 1, kind, PHASES[phase], n),
            values.ctypes.data_as(pointer), indptr.ctypes.data_as(pointer),
            indices.ctypes.data_as(pointer), None, *_integers(right),
            settings.ctypes.data_as(pointer), *_integers(0),
            b.ctypes.data_as(pointer), x.ctypes.data_as(pointer), ctypes.byref(error),
        )  # fmt: skip
        if error.value == -2:
            raise MemoryError(f"not enough memory to factorise {n:,} dofs; coarsen the mesh")
        if error.value:
            raise PardisoError(f"PARDISO error {error.value}, {phase}")
        return x

    call("analyse")
    size, limit = 1024.0 * (int(settings[15]) + int(settings[16])), memory or free_memory()
    folder = _folder(n, size, limit) if size > IN_CORE * limit else None
    try:
        with _environment(folder, limit):
            if folder:  # with blocks and two levels some solutions take 30 times as long as others
                call("release")
                settings[[TWO_LEVELS, BY_BLOCKS]], settings[OUT_OF_CORE] = 0, 2
                call("analyse")
            call("factorise")
    except (ArithmeticError, MemoryError):
        _release(call, folder)
        raise
    if kind == 2 and not folder:  # a Cholesky factor perturbs no pivots, and is solved with alone
        values, indices, indptr = values[:1].copy(), indices[:1].copy(), indptr[:1].copy()

    def solve(b: Array) -> Array:
        x = call("solve", b)
        x /= scale
        return x

    weakref.finalize(solve, _release, call, folder)
    return solve


def _folder(n: int, size: float, limit: float) -> str:
    """New folder for the files of a factor of so many bytes, if the disk has room for it."""
    folder = tempfile.mkdtemp(prefix="skinwave-factor-")
    needed, room = f"{size / 2**30:.2g} GiB", shutil.disk_usage(folder).free
    memory = f"{limit / 2**30:.2g} GiB of memory"
    if size > room:
        os.rmdir(folder)
        raise MemoryError(
            f"the factor of {n:,} dofs takes {needed}, more than the {memory} that are free and "
            f"the {room / 2**30:.2g} GiB of disk under {tempfile.gettempdir()}; coarsen the mesh, "
            "or set TMPDIR to a folder of a larger disk"
        )
    log.warning(
        "the factor of %s dofs takes %s, more than the %s that are free: it is kept in files under "
        "%s, and each solution reads them", f"{n:,}", needed, memory, folder,
    )  # fmt: skip
    return folder


@contextmanager
def _environment(folder: str | None, limit: float) -> Iterator[None]:
    """Where PARDISO keeps its files, and how much memory it may use beside them."""
    core = max(LEAST_CORE, round(IN_CORE * limit / 2**20))
    wanted = {"MKL_PARDISO_OOC_PATH": folder, "MKL_PARDISO_OOC_MAX_CORE_SIZE": str(core)}
    before = {name: os.environ.get(name) for name in wanted}
    try:
        _set(wanted if folder else {})
        yield
    finally:
        _set(before if folder else {})


def _set(variables: dict[str, str | None]) -> None:
    for name, value in variables.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


def _release(call: Callable[[str], Array], folder: str | None) -> None:
    call("release")
    if folder:
        shutil.rmtree(folder, ignore_errors=True)


def _upper(A: sparse.csr_array) -> tuple[Array, NDArray[np.int32], NDArray[np.int32]]:
    """Values, and columns and starts of rows numbered from 1, of the upper triangle of a matrix
    with sorted indices.
    """
    n = A.shape[0]
    kept = A.indices >= np.repeat(np.arange(n, dtype=A.indices.dtype), np.diff(A.indptr))
    starts = starts_of_kept(kept, A.indptr)
    columns = A.indices[kept].astype(np.int32, copy=False)
    columns += 1
    starts += 1
    complex_valued = np.iscomplexobj(A.data)
    return A.data[kept].astype(np.complex128 if complex_valued else np.float64), columns, starts


def _integers(*values: int) -> list[Any]:
    return [ctypes.byref(ctypes.c_int32(value)) for value in values]
