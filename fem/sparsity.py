"""Sparsity pattern of a mesh, and the assembly of element matrices into sparse ones."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from meshes import MeshError
from meshes.tetmesh import Floats, Ints

SLAB = 1024  # elements at a time: their temporaries stay near the processor
UPPER = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]  # components on and above the diagonal


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsityPattern:
    """CSR sparsity pattern on nodes, with the slot that each pair of element nodes is summed in."""

    indptr: Ints
    indices: Ints
    slot: Ints  # (e, a, b)

    @staticmethod
    def of(tets: Ints, n_nodes: int) -> "SparsityPattern":
        """The pattern of a mesh; one sort of pair number and origin packed into one integer."""
        key = (tets[:, :, None] * n_nodes + tets[:, None, :]).ravel()
        bits = int(key.size).bit_length()
        if int(n_nodes**2).bit_length() + bits > 63:
            raise MeshError(f"{len(tets)} tetrahedra are too many for one assembly; coarsen")
        # In place: memory that is touched for the first time costs more than the sums.
        key <<= bits
        key |= np.arange(key.size)
        key.sort()
        index = _index(key.size)
        origin = (key & ((1 << bits) - 1)).astype(index)
        key >>= bits
        first = np.append(True, key[1:] != key[:-1])
        rows, indices = np.divmod(key[first], n_nodes)
        slot = np.empty(key.size, index)
        slot[origin] = np.cumsum(first, dtype=index) - index(1)
        indptr = np.searchsorted(rows, np.arange(n_nodes + 1))
        return SparsityPattern(indptr=indptr, indices=indices, slot=slot.reshape(*tets.shape, -1))

    def sum(self, slabs: Iterable[tuple[slice, Floats]], parts: int) -> Floats:
        """Assemble element matrices (parts, e, a, b), some at a time, into slots (parts, slots)."""
        summed = np.zeros((parts, len(self.indices)))
        for slab, values in slabs:
            slots = self.slot[slab].ravel()
            for total, part in zip(summed, values, strict=True):
                np.add.at(total, slots, part.ravel())
        return summed

    def mirrored(self) -> Ints:
        """The slot (slots,) of each transposed pair."""
        n = len(self.indptr) - 1
        slots = sparse.csr_array(
            (np.arange(len(self.indices)), self.indices, self.indptr), shape=(n, n)
        )
        return slots.tocsc().data

    def rows(self) -> tuple[Callable[[int], Ints], Ints]:
        """Row layout with three components per node: positions (slots,) in the row of a component,
        and the rows' indptr (3 n + 1,).
        """
        lengths = np.diff(self.indptr)
        first = np.arange(len(self.indices)) + 2 * np.repeat(self.indptr[:-1], lengths)
        further = np.repeat(lengths, lengths)
        starts = 3 * self.indptr[:-1, None] + lengths[:, None] * np.arange(3)
        return lambda i: first + i * further, np.append(starts.ravel(), 3 * self.indptr[-1])


def from_components(pattern: SparsityPattern, summed: Floats) -> sparse.csr_array:
    """Symmetric matrix (3 n, 3 n) of slots (6, slots) for the components UPPER."""
    mirrored, (places, indptr) = pattern.mirrored(), pattern.rows()
    n, slots, index = len(indptr) - 1, len(mirrored), _index(9 * len(mirrored))
    data, columns = np.empty((3 * slots, 3)), np.empty((3 * slots, 3), index)
    for component, (i, j) in zip(summed, UPPER, strict=True):
        data[places(i), j] = component
        if i != j:
            data[places(j), i] = component[mirrored]
    for i in range(3):
        columns[places(i)] = 3 * pattern.indices[:, None].astype(index) + np.arange(3, dtype=index)
    indptr = (3 * indptr).astype(index)
    return sparse.csr_array((data.ravel(), columns.ravel(), indptr), shape=(n, n))


def from_blocks(pattern: SparsityPattern, summed: Floats) -> sparse.bsr_array:
    """The matrix of `from_components` in blocks of 3 by 3, of which others are a cheaper sum."""
    blocks = np.empty((len(pattern.indices), 3, 3))
    for component, (i, j) in zip(summed, UPPER, strict=True):
        blocks[:, i, j] = component
        if i != j:
            blocks[:, j, i] = component[pattern.mirrored()]
    index, n = _index(9 * len(blocks)), 3 * (len(pattern.indptr) - 1)
    places = pattern.indices.astype(index), pattern.indptr.astype(index)
    return sparse.bsr_array((blocks, *places), shape=(n, n))


def from_nodal(pattern: SparsityPattern, summed: Floats) -> sparse.csr_array:
    """The matrix (3 n, 3 n) of slots (slots,), the same for each of the three components."""
    places, indptr = pattern.rows()
    n, slots, index = len(indptr) - 1, len(summed), _index(3 * len(summed))
    data, columns = np.empty(3 * slots), np.empty(3 * slots, index)
    for i in range(3):
        data[places(i)], columns[places(i)] = summed, 3 * pattern.indices + i
    return sparse.csr_array((data, columns, indptr.astype(index)), shape=(n, n))


def starts_of_kept(kept: NDArray[np.bool_], indptr: Ints) -> NDArray[np.int32]:
    """Starts (n + 1,) of the rows of a matrix of which some entries (nnz,) are kept."""
    before = np.zeros(len(kept) + 1, np.int32)
    np.cumsum(kept, out=before[1:])
    return before[indptr]


def slabs(count: int) -> list[slice]:
    """Slices of elements, `SLAB` at a time."""
    return [slice(start, start + SLAB) for start in range(0, count, SLAB)]


def _index(entries: int) -> type[np.signedinteger]:
    """The smallest type that numbers so many entries, which every later product reads."""
    return np.int32 if entries <= np.iinfo(np.int32).max else np.int64
