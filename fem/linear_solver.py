"""Sparse direct solvers behind one interface: `factorise(A).solve(b)`.

Both backends factorise symmetric matrices, real or complex: MKL PARDISO, if it is installed, and
SciPy's SuperLU.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fem.pardiso import Pardiso, PardisoError, mkl
from fem.sparsity import on_one_pattern, upper_triangle
from simple_model.typing import Array, Ints

BACKENDS = ("pardiso", "superlu")


@dataclass(frozen=True, kw_only=True, eq=False)
class Factor:
    """Factorised matrix: `solve(b)` for right-hand sides (n,) or (n, k), and its `backend`."""

    solve: Callable[[Array], Array]
    backend: str


def available() -> tuple[str, ...]:
    """Return the installed backends, the fastest first."""
    return BACKENDS if mkl() is not None else BACKENDS[1:]


def factorise(A: sparse.csr_array, *, backend: str = "auto") -> Factor:
    """Factorise a symmetric matrix A (n, n), positive definite if real.

    Parameters
    ----------
    A : sparse (n, n), float or complex
    backend : "auto" for the fastest installed one, or one of `BACKENDS`

    Raises
    ------
    ValueError
        If the backend is unknown or not installed, or A is singular.
    MemoryError
        If the factor fits neither in memory nor on the disk.

    Examples
    --------
    >>> import fem, numpy as np
    >>> from scipy import sparse
    >>> A = sparse.csr_array([[2.0, 1.0], [1.0, 2.0]])
    >>> fem.factorise(A).solve(np.array([3.0, 3.0])).round(9)
    array([1., 1.])
    """
    names = available()
    backend = names[0] if backend == "auto" else backend
    if backend not in names:
        raise ValueError(f"solver '{backend}' is not installed; use {' or '.join(names)}")
    A = sparse.csr_array(A)
    A.sort_indices()
    _check_finite(A.data)
    complex_valued, only = np.iscomplexobj(A.data), [A]
    del A  # PARDISO frees the matrix after taking its upper half
    solve = (_pardiso if backend == "pardiso" else _superlu)(only.pop())
    return Factor(solve=solve if complex_valued else _real_and_imaginary(solve), backend=backend)


def _check_finite(values: Array) -> None:
    if not np.isfinite(values).all():
        raise ValueError("the matrix has entries that are not finite; check the material")


def _real_and_imaginary(solve: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Extend the solution of a real matrix to complex right-hand sides."""
    return lambda b: solve(b.real) + 1j * solve(b.imag) if np.iscomplexobj(b) else solve(b)


def _singular(detail: object) -> ValueError:
    return ValueError(
        f"the matrix is singular or not positive definite ({detail}); check that the body is "
        "constrained and that its stiffnesses are above 0"
    )


def _pardiso(A: sparse.csr_array) -> Callable[[Array], Array]:
    values, indices, indptr = upper_triangle(A)
    kind = 6 if np.iscomplexobj(values) else 2
    del A
    indices += 1
    indptr += 1
    matrix = Pardiso(indices, indptr, kind)
    _factorise_with(matrix, values)
    if kind == 2:
        del values, indices, indptr
        matrix.free_matrix()
    return matrix.solve


def _factorise_with(matrix: Pardiso, values: Array) -> None:
    try:
        matrix.factorise(values)
    except PardisoError as error:
        raise _singular(error) from None


class SumFactoriser:
    """Factorise complex weighted sums of real symmetric sparse matrices (n, n).

    PARDISO analyses the union of their patterns once. Factors are in single precision, with
    refinement in double precision, which needs half the memory and two thirds of the time. If
    refinement does not converge, as for thin sheets, this matrix and all later ones are factorised
    in double precision. `accuracy` is the largest residual over the right-hand side, `slowest` the
    largest residual over the last one for which refinement converges.
    """

    def __init__(
        self, matrices: Sequence[sparse.csr_array], *, backend: str = "auto",
        accuracy: float = 1e-10, slowest: float = 0.2,
    ) -> None:  # fmt: skip
        self._values, self._indices, self._indptr = on_one_pattern(matrices)
        self._backend, self._is_single = backend, True
        self._accuracy, self._slowest = accuracy, slowest
        self._matrix: Pardiso | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for other processes, without PARDISO's analysis."""
        return {**vars(self), "_matrix": None}

    def __call__(self, weights: Array) -> Factor:
        """Return the factor of a sum, valid until the next call. Raises the errors of
        `factorise`.
        """
        values = np.empty(self._values.shape[1], np.complex128)
        values.real, values.imag = weights.real @ self._values, weights.imag @ self._values
        if self._backend not in ("auto", "pardiso") or mkl() is None:
            upper = self._upper(values)
            whole = upper + sparse.triu(upper, 1, format="csr").T
            return factorise(whole, backend=self._backend)
        _check_finite(values)
        self._matrix = self._matrix or self._new_matrix()
        _factorise_with(self._matrix, values.astype(np.complex64) if self._is_single else values)
        return Factor(solve=partial(self._solve, self._matrix, values), backend="pardiso")

    def _solve(self, matrix: Pardiso, values: Array, b: Array) -> Array:
        if self._is_single:
            x = _refine(self._upper(values), matrix, b, self._accuracy, self._slowest)
            if x is not None:
                return x
            self._is_single = False
            self._matrix = self._new_matrix()
            _factorise_with(self._matrix, values)
        return (self._matrix or matrix).solve(b)

    def _upper(self, values: Array) -> sparse.csr_array:
        n = len(self._indptr) - 1
        return sparse.csr_array((values, self._indices, self._indptr), shape=(n, n))

    def _new_matrix(self) -> Pardiso:
        one = np.int32(1)
        return Pardiso(self._indices + one, self._indptr + one, 6, single=self._is_single)


def _refine(
    upper: sparse.csr_array, single: Pardiso, b: Array, accuracy: float, slowest: float
) -> Array | None:
    """Refine the solution by a single-precision factor; return None if that does not converge."""
    x, r, size = np.zeros_like(b), b, np.linalg.norm(b, axis=0)
    lower, diagonal, before = upper.T, upper.diagonal().reshape(-1, *[1] * (b.ndim - 1)), size
    while True:
        x = x + single.solve(r.astype(np.complex64))
        r = b - (upper @ x + lower @ x - diagonal * x)
        now = np.linalg.norm(r, axis=0)
        if (now <= accuracy * size).all():
            return x
        if not (now <= slowest * before).all():
            return None
        before = now


def _superlu(A: sparse.csr_array) -> Callable[[Array], Array]:
    """Use SuperLU without pivoting, ordered by METIS, or by minimum degree without pymetis."""
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


def dissect(A: sparse.csr_array) -> Ints:
    """Return a fill-reducing ordering (n,) of a symmetric matrix, by METIS's nested dissection.

    Degrees of freedom with the same neighbours, such as those of one node, are ordered as one.
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
