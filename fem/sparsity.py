"""Sparse matrices: sparsity pattern of a mesh, assembly of element matrices, selection."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from meshes import MeshError
from simple_model.typing import Array, Bools, Floats, Ints

Index = NDArray[np.int32]  # columns and starts of rows
UPPER = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]  # components on and above the diagonal


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsityPattern:
    """CSR sparsity pattern on n nodes. Each pair of nodes of an element is summed in its `slot`;
    the slot beyond the last collects pairs that are left out.
    """

    indptr: Index
    indices: Index
    slot: Index  # (e, a, b)

    @staticmethod
    def of(nodes: Ints, n: int) -> "SparsityPattern":
        """Return the pattern of elements with nodes (e, a); nodes with the number n are left out.

        Pairs of nodes are sorted by first and second node without comparisons, by transposing
        sparse matrices twice.
        """
        a = nodes.shape[1]
        if nodes.size * a > np.iinfo(np.int32).max:
            raise MeshError(f"the mesh has {len(nodes)} elements, too many for one assembly; "
                            "use larger elements")  # fmt: skip
        each, local = nodes.astype(np.int32), np.arange(a, dtype=np.int32)
        places = np.arange(nodes.size + 1, dtype=np.int32)
        indptr, places, _ = _by_column(places[:-1], each, places[::a], n)
        element, second = np.divmod(places, np.int32(a))
        pairs = (a * a * element + second)[:, None] + a * local
        indptr, pairs, columns = _by_column(pairs, each[element], a * indptr, n)
        first = np.append(True, columns[1:] != columns[:-1])
        first[indptr[:-1][np.diff(indptr) > 0]] = True
        indices = columns[first]
        slot = np.full(nodes.size * a, len(indices), np.int32)
        slot[pairs] = np.cumsum(first, dtype=np.int32) - np.int32(1)
        return SparsityPattern(
            indptr=row_starts_of(first, indptr), indices=indices, slot=slot.reshape(-1, a, a)
        )

    def blocks(self, slabs: Iterable[tuple[slice, Floats]]) -> sparse.bsr_array:
        """Sum element matrices (6, e, a, b) of the components `UPPER` to a matrix (3 n, 3 n)."""
        n, summed = 3 * (len(self.indptr) - 1), np.zeros((len(self.indices) + 1, 3, 3))
        flat = summed.ravel()
        for slab, values in slabs:
            place = 9 * self.slot[slab].astype(np.intp)
            mirrored = place.swapaxes(1, 2).ravel()
            place = place.ravel()
            for part, (i, j) in zip(values, UPPER, strict=True):
                np.add.at(flat, place + (3 * i + j), part.ravel())
                if i != j:
                    np.add.at(flat, mirrored + (3 * j + i), part.ravel())
        return sparse.bsr_array((summed[:-1], self.indices, self.indptr), shape=(n, n))

    def nodal(self, slabs: Iterable[tuple[slice, Floats]]) -> sparse.csr_array:
        """Sum element matrices (e, a, b), given slab by slab, to a matrix (n, n)."""
        n, summed = len(self.indptr) - 1, np.zeros(len(self.indices) + 1)
        for slab, values in slabs:
            np.add.at(summed, self.slot[slab].ravel(), values.ravel())
        return sparse.csr_array((summed[:-1], self.indices, self.indptr), shape=(n, n))


def _by_column(entries: Index, columns: Index, indptr: Index, n: int) -> tuple[Index, Index, Index]:
    """Sort entries, given by rows that start at `indptr`, by column and then by row. Return the
    starts of columns 0 to n - 1, the entries, and their rows.
    """
    rows = sparse.csr_array(
        (entries.ravel(), columns.ravel(), indptr), shape=(len(indptr) - 1, n + 1)
    ).tocsc()
    kept = rows.indptr[n]
    return rows.indptr[:-1], rows.data[:kept], rows.indices[:kept]


def in_each_direction(A: sparse.csr_array) -> sparse.csr_array:
    """Return the matrix (3 n, 3 n) that applies a matrix (n, n) to each of three components."""
    lengths, component = np.diff(A.indptr), np.arange(3, dtype=np.int32)
    rows = np.repeat(lengths, 3)
    indptr = np.append(np.int32(0), np.cumsum(rows, dtype=np.int32))
    shift = (A.indptr[:-1, None] - indptr[:-1].reshape(-1, 3)).ravel()
    entry = np.arange(indptr[-1], dtype=np.int32) + np.repeat(shift, rows)
    columns = (3 * A.indices)[entry] + np.repeat(np.tile(component, len(lengths)), rows)
    shape = (3 * A.shape[0], 3 * A.shape[1])
    return sparse.csr_array((A.data[entry], columns, indptr), shape=shape)


def from_entries(values: Any, rows: Any, columns: Any, shape: tuple[int, int]) -> sparse.csr_array:
    """Return a matrix with entries at rows and columns, which broadcast; repeated entries add."""
    values, rows, columns = (each.ravel() for each in np.broadcast_arrays(values, rows, columns))
    return sparse.csr_array((values, (rows, columns)), shape=shape)


def dofs_of(nodes: NDArray[np.integer[Any]]) -> Index:
    """Return the degrees of freedom (..., 3) of nodes (...)."""
    return np.asarray(3 * nodes[..., None] + np.arange(3), np.int32)


def restrict(A: Any, free: Ints) -> sparse.csr_array:
    """Return the free rows and columns of a matrix, in ascending order."""
    return select(A.tocsr(), free, free)


def select(A: Any, rows: Ints, columns: Ints) -> Any:
    """Return ascending rows (r,) and columns (c,), for BSR matrices in blocks."""
    shape = np.array(A.shape) // getattr(A, "blocksize", 1)
    if (len(rows), len(columns)) == tuple(shape):
        return A
    number = np.full(shape[1], -1, A.indices.dtype)
    number[columns] = np.arange(len(columns))
    is_selected = np.zeros(shape[0], bool)
    is_selected[rows] = True
    places = number[A.indices]
    kept = (places >= 0) & np.repeat(is_selected, np.diff(A.indptr))
    starts = row_starts_of(kept, A.indptr)
    indptr = np.append(starts[rows], starts[-1])
    size = np.array([len(rows), len(columns)]) * A.shape // shape
    return type(A)((A.data[kept], places[kept], indptr), shape=tuple(size))


def upper_triangle(A: sparse.csr_array) -> tuple[Array, Index, Index]:
    """Return values, columns and row starts of the upper triangle, in double precision."""
    n, kind = A.shape[0], np.complex128 if np.iscomplexobj(A.data) else np.float64
    kept = A.indices >= np.repeat(np.arange(n, dtype=A.indices.dtype), np.diff(A.indptr))
    columns = A.indices[kept].astype(np.int32, copy=False)
    return A.data[kept].astype(kind, copy=False), columns, row_starts_of(kept, A.indptr)


def on_one_pattern(matrices: Sequence[sparse.csr_array]) -> tuple[Floats, Index, Index]:
    """Return values (j, nnz), columns and row starts of upper triangles on one pattern."""
    shape, values, patterns = matrices[0].shape, [], []
    for A in matrices:
        A.sort_indices()
        each, columns, indptr = upper_triangle(A)
        values.append(each)
        ones = np.ones(len(columns), np.int32)
        patterns.append(sparse.csr_array((ones, columns, indptr), shape=shape))
    union = sum(patterns[1:], start=patterns[0])
    numbered = sparse.csr_array(
        (np.arange(1, union.nnz + 1, dtype=np.int32), union.indices, union.indptr), shape=shape
    )
    on_union = np.zeros((len(values), union.nnz))
    for row, each, pattern in zip(on_union, values, patterns, strict=True):
        row[numbered.multiply(pattern).data - 1] = each
    return on_union, union.indices, union.indptr


def row_starts_of(kept: Bools, indptr: NDArray[np.integer[Any]]) -> Index:
    """Return row starts (n + 1,) of a matrix that keeps only some of its entries (nnz,)."""
    before = np.zeros(len(kept) + 1, np.int32)
    np.cumsum(kept, out=before[1:])
    return before[indptr]


def slabs(count: int, at_once: int = 256) -> list[slice]:
    """Return slices of `at_once` elements, whose temporaries stay in the processor's cache."""
    return [slice(start, start + at_once) for start in range(0, count, at_once)]
