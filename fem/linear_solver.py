"""Sparse direct solvers behind one interface: `factorise(A).solve(b)`.

All of them factorise symmetric matrices, real or complex. MKL PARDISO and CHOLMOD are used if
they are installed; SciPy's SuperLU needs nothing.
"""

from __future__ import annotations

import ctypes
import sys
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from fem.sparsity import starts_of_kept

Array = NDArray[Any]  # float64 or complex128
BACKENDS = ("pardiso", "cholmod", "superlu")
SPARSE = 0.1  # share of n^2 in the upper triangle; blocks of denser matrices may crash PARDISO
BLOCKS = 80  # %: how much alike the patterns of rows are that PARDISO takes as a block


@dataclass(frozen=True, kw_only=True, eq=False)
class Factor:
    """A factorised matrix: `solve(b)` for right-hand sides (n,) or (n, k)."""

    solve: Callable[[Array], Array]
    backend: str


def available(*, complex_valued: bool = False) -> tuple[str, ...]:
    """Installed backends for real or for complex matrices, the fastest first."""
    # CHOLMOD has no complex symmetric factorisation, only the Hermitian one.
    cholmod = _cholmod() is not None and not complex_valued
    found = {"pardiso": mkl() is not None, "cholmod": cholmod, "superlu": True}
    return tuple(name for name in BACKENDS if found[name])


def factorise(A: sparse.csr_array, *, backend: str = "auto") -> Factor:
    """Factorise a symmetric matrix A (n, n), positive definite if real.

    Parameters
    ----------
    A : sparse (n, n), float or complex
    backend : "auto" for the fastest that is installed, or one of `BACKENDS`

    Raises
    ------
    ValueError
        If the backend is unknown or not installed, or A is singular.
    """
    names = available(complex_valued=np.iscomplexobj(A.data))
    backend = names[0] if backend == "auto" else backend
    if backend not in names:
        kind = " for complex matrices" if np.iscomplexobj(A.data) else ""
        raise ValueError(
            f"solver '{backend}' is not installed{kind}; choose one of {', '.join(names)}"
        )
    A = sparse.csr_array(A)
    A.sort_indices()
    if not np.isfinite(A.data).all():
        raise ValueError("the matrix has entries that are not finite; check the material")
    complex_valued, only = np.iscomplexobj(A.data), [A]
    del A  # for PARDISO to free the whole of it, of which it needs half
    solver = {"pardiso": _pardiso, "cholmod": _cholmod_solve, "superlu": _superlu}[backend]
    solve = solver(only.pop())
    return Factor(solve=solve if complex_valued else _by_parts(solve), backend=backend)


def _by_parts(solve: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """A real factor's solution that takes complex right-hand sides, too."""

    def either(b: Array) -> Array:
        return solve(b.real) + 1j * solve(b.imag) if np.iscomplexobj(b) else solve(b)

    return either


def _singular(detail: object) -> ValueError:
    return ValueError(
        f"the matrix is singular or not positive definite ({detail}); "
        "is the body constrained anywhere, and are all its stiffnesses above 0?"
    )


def _superlu(A: sparse.csr_array) -> Callable[[Array], Array]:
    """SuperLU without pivoting, ordered by METIS, or by minimum degree where pymetis is missing.

    The factor by minimum degree has, over that by METIS, 0.93 times the entries for a sheet of
    93,000 dofs, 1.07 for a palm of 31,000, 1.26 and 1.54 for slabs of 40,000 and 78,000.
    """
    metis = find_spec("pymetis") is not None
    order = dissect(A) if metis else np.arange(A.shape[0])
    permuted = sparse.csc_array(A[order][:, order])
    ordering = "NATURAL" if metis else "MMD_AT_PLUS_A"
    options = {"SymmetricMode": True}
    try:
        lu = splu(permuted, permc_spec=ordering, diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise _singular(error) from None

    def solve(b: Array) -> Array:
        x = np.empty(b.shape, A.dtype)
        x[order] = lu.solve(np.ascontiguousarray(b[order], x.dtype))
        return x

    return solve


def dissect(A: sparse.csr_array) -> NDArray[np.int64]:
    """Fill-reducing ordering (n,) of a symmetric matrix: METIS's nested dissection of its graph.

    Degrees of freedom with the same neighbours, as the components of one node, are ordered as one.
    """
    import pymetis

    n = A.shape[0]
    marks = np.random.default_rng(0).random(n)
    pattern = sparse.csr_array((np.ones(A.nnz), A.indices, A.indptr), shape=A.shape)
    _, first, group = np.unique(pattern @ marks, return_index=True, return_inverse=True)
    members = sparse.csr_array((np.ones(n), (group, np.arange(n))), shape=(len(first), n))
    graph = sparse.csr_array(pattern[first] @ members.T)
    graph.setdiag(0)
    graph.eliminate_zeros()
    groups = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))[0]
    rank = np.empty(len(first), np.int64)
    rank[groups] = np.arange(len(first))
    return np.argsort(rank[group], kind="stable")


def _cholmod():  # type: ignore[no-untyped-def]
    try:
        from sksparse.cholmod import cholesky
    except ImportError:
        return None
    return cholesky


def _cholmod_solve(A: sparse.csr_array) -> Callable[[Array], Array]:
    return _cholmod()(sparse.csc_matrix(A))


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


def _pardiso(A: sparse.csr_array) -> Callable[[Array], Array]:
    """MKL PARDISO on the upper triangle: Cholesky if real, LDL^T if complex symmetric.

    It orders blocks of rows with similar patterns, as those of a node's components, which takes
    0.7 s instead of 2.8 for a slab of 128,000 dofs and a third of the memory. A factor in single
    precision saves nothing: for that slab, at a Poisson's ratio of 0.4999, it takes 2.2 s instead
    of 3.8, but a solution with the step of refinement that it needs 1.3 times as long; for a sheet
    of 0.1 mm refinement diverges.
    """
    n, kind = A.shape[0], 6 if np.iscomplexobj(A.data) else 2
    values, indices, indptr = _upper(A)
    del A
    # PARDISO perturbs pivots below an absolute bound: entries of about 1 make it a relative one.
    scale = 2.0 ** np.round(np.log2(np.abs(values).max(initial=1e-300)))
    values /= scale
    handle, settings = np.zeros(64, np.int64), np.zeros(64, np.int32)
    settings[0], settings[1], settings[7] = 1, 2, 0  # own settings, METIS, no refinement
    settings[9], settings[23] = 16, 1  # perturbation of pivots, two-level factorisation
    if len(values) < SPARSE * n * n:
        settings[36] = -BLOCKS  # blocks of variable size

    def call(phase: int, b: Array | None = None) -> Array:
        right = 1 if b is None or b.ndim == 1 else b.shape[1]
        b = np.zeros(1, values.dtype) if b is None else np.asfortranarray(b, values.dtype)
        x = np.zeros_like(b, order="F")
        error = ctypes.c_int32(0)
        pointer = ctypes.c_void_p
        mkl().pardiso(  # type: ignore[union-attr]
            handle.ctypes.data_as(pointer), *_integers(1, 1, kind, phase, n),
            values.ctypes.data_as(pointer), indptr.ctypes.data_as(pointer),
            indices.ctypes.data_as(pointer), None, *_integers(right),
            settings.ctypes.data_as(pointer), *_integers(0),
            b.ctypes.data_as(pointer), x.ctypes.data_as(pointer), ctypes.byref(error),
        )  # fmt: skip
        if error.value == -2:
            raise MemoryError(f"not enough memory to factorise {n} dofs; coarsen the mesh")
        if error.value:
            raise _singular(f"PARDISO error {error.value} in phase {phase}")
        return x

    call(12)
    if kind == 2:  # a Cholesky factor perturbs no pivots, and is solved with without the matrix
        values, indices, indptr = values[:1].copy(), indices[:1].copy(), indptr[:1].copy()

    def solve(b: Array) -> Array:
        x = call(33, b)
        x /= scale
        return x

    weakref.finalize(solve, call, -1)
    return solve


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
