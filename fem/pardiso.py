"""Interface to MKL PARDISO for the upper triangle of symmetric matrices: Cholesky if real, LDL^T
if complex.

Rows with similar patterns, such as those of one node, are ordered as blocks: 0.7 s instead of 2.8 s
for a slab of 128,000 dofs, and a third of the memory. A factor larger than the free memory is kept
in files (out of core), which PARDISO writes and reads. Its size is known after the analysis, before
anything is factorised.
"""

import ctypes
import logging
import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from fem.memory import free_memory
from fem.sparsity import Index
from simple_model.typing import Array

log = logging.getLogger(__name__)


class PardisoError(ArithmeticError):
    """PARDISO failed; the message has the number of its error."""


@cache
def mkl() -> ctypes.CDLL | None:
    """Return the MKL runtime of the `mkl` wheel, or None if it is not installed."""
    for folder in ("lib", "Library/bin"):
        for path in sorted(Path(sys.prefix, folder).glob("*mkl_rt*")):
            try:
                return ctypes.CDLL(str(path))
            except OSError:
                continue
    return None


class Pardiso:
    """PARDISO on upper triangles of one pattern, which is analysed once.

    `indices` and `indptr` are columns and row starts, numbered from 1; `kind` 2 is real, 6 complex.
    A factor takes at most the share `in_core` of the free memory; vectors need the rest.
    """

    def __init__(
        self, indices: Index, indptr: Index, kind: int, *, single: bool = False,
        in_core: float = 0.8,
    ) -> None:  # fmt: skip
        self._indices, self._indptr, self._kind, self._n = indices, indptr, kind, len(indptr) - 1
        self._handle, self._settings = np.zeros(64, np.int64), np.zeros(64, np.int32)
        self._settings[[0, 1, 7]] = 1, 2, 0  # own settings, METIS, no refinement
        self._settings[[9, 23]] = 16, 1  # perturbation of pivots, factorisation in two levels
        self._settings[27] = single
        sparse = 0.1  # share of n^2: blocks of denser matrices may crash PARDISO
        blocks = 80  # %: similarity of the patterns of rows that PARDISO orders as a block
        if len(indices) < sparse * self._n**2:
            self._settings[36] = -blocks
        self._values: Array = np.zeros(0)
        self._scale, self._folders, self._in_core = 1.0, list[str](), in_core
        self._analysed, self._environment = False, partial(_environment, None, 0.0)
        state = self._handle, self._settings, kind, self._n
        weakref.finalize(self, _release, *state, self._folders)

    def factorise(self, values: Array) -> None:
        """Factorise a matrix; its values (nnz,) are scaled in place."""
        # PARDISO perturbs pivots below an absolute bound; entries near 1 make it relative.
        self._scale = 2.0 ** np.round(np.log2(np.abs(values).max(initial=1e-300)))
        values /= self._scale
        self._values = values
        if not self._analysed:
            self._analyse()
        with self._environment():
            self._run("factorise")

    def _analyse(self) -> None:
        self._run("analyse")
        self._analysed = True
        size = 1024.0 * (int(self._settings[15]) + int(self._settings[16]))
        limit = free_memory()
        if size <= self._in_core * limit:
            return
        self._folders.append(_folder(self._n, size, limit))
        self._run("release")
        # Out of core (59), two levels and blocks make some solutions 30 times slower.
        self._settings[[23, 36, 59]] = 0, 0, 2
        self._environment = partial(_environment, self._folders[0], self._in_core * limit)
        with self._environment():
            self._run("analyse")

    def free_matrix(self) -> None:
        """Free the matrix if the factor is in memory, because solving then does not need it."""
        if not self._folders:
            self._values = self._values[:1].copy()
            self._indices, self._indptr = self._indices[:1].copy(), self._indptr[:1].copy()

    def solve(self, b: Array) -> Array:
        """Return the solution (n,) or (n, k) of right-hand sides."""
        x = self._run("solve", b)
        x /= self._scale
        return x

    def _run(self, phase: str, b: Array | None = None) -> Array:
        matrix = self._values, self._indptr, self._indices
        return _call(self._handle, self._settings, self._kind, phase, self._n, matrix, b)


def _call(
    handle: Array,
    settings: Array,
    kind: int,
    phase: str,
    n: int,
    matrix: tuple[Array, Array, Array] | None = None,
    b: Array | None = None,
) -> Array:
    """Run a phase of PARDISO; return the solution (n, k) of right-hand sides b (n, k)."""
    values, indptr, indices = matrix or (np.zeros(1),) * 3
    right = 1 if b is None or b.ndim == 1 else b.shape[1]
    b = np.zeros(1, values.dtype) if b is None else np.asfortranarray(b, values.dtype)
    x = np.zeros_like(b, order="F")
    error = ctypes.c_int32(0)
    pointer = ctypes.c_void_p
    phases = {"analyse": 11, "factorise": 22, "solve": 33, "release": -1}
    mkl().pardiso(  # type: ignore[union-attr]
        handle.ctypes.data_as(pointer), *_integers(1, 1, kind, phases[phase], n),
        values.ctypes.data_as(pointer), indptr.ctypes.data_as(pointer),
        indices.ctypes.data_as(pointer), None, *_integers(right),
        settings.ctypes.data_as(pointer), *_integers(0),
        b.ctypes.data_as(pointer), x.ctypes.data_as(pointer), ctypes.byref(error),
    )  # fmt: skip
    if error.value == -2:
        raise MemoryError(f"not enough memory to factorise {n:,} dofs; use larger elements")
    if error.value:
        raise PardisoError(f"PARDISO error {error.value} in phase {phase}")
    return x


def _folder(n: int, size: float, limit: float) -> str:
    """Make a folder for the files of a factor of `size` bytes, if the disk has room for it."""
    folder = tempfile.mkdtemp(prefix="skinwave-factor-")
    needed, room = f"{size / 2**30:.2g} GiB", shutil.disk_usage(folder).free
    memory = f"{limit / 2**30:.2g} GiB of memory"
    if size > room:
        os.rmdir(folder)
        raise MemoryError(
            f"the factor of {n:,} dofs needs {needed}, but only {memory} and "
            f"{room / 2**30:.2g} GiB of disk under {tempfile.gettempdir()} are free; use larger "
            "elements, or set TMPDIR to a folder on a larger disk"
        )
    log.warning(
        "the factor of %s dofs needs %s, but only %s are free: it is kept in files under %s, which "
        "each solution reads", f"{n:,}", needed, memory, folder,
    )  # fmt: skip
    return folder


@contextmanager
def _environment(folder: str | None, memory: float) -> Iterator[None]:
    """Set the folder of PARDISO's files, if any, and the memory in bytes that it may use."""
    least_core = 500  # MB of memory that it needs besides the files
    core = max(least_core, round(memory / 2**20))
    wanted = {"MKL_PARDISO_OOC_PATH": folder, "MKL_PARDISO_OOC_MAX_CORE_SIZE": str(core)}
    before = {name: os.environ[name] for name in wanted if name in os.environ}
    os.environ.update({name: value for name, value in wanted.items() if folder and value})
    try:
        yield
    finally:
        for name in wanted if folder else ():
            del os.environ[name]
        os.environ.update(before)


def _release(handle: Array, settings: Array, kind: int, n: int, folders: list[str]) -> None:
    _call(handle, settings, kind, "release", n)
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)


def _integers(*values: int) -> list[Any]:
    return [ctypes.byref(ctypes.c_int32(value)) for value in values]
