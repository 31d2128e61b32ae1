"""Where the values of elements are summed into sparse matrices."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from meshes import MeshError
from meshes.tetmesh import Floats, Ints

UPPER = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]  # components on and above the diagonal


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """Where each pair of element nodes is summed: CSR pattern on nodes and a slot per pair."""

    indptr: Ints
    indices: Ints
    slot: Ints  # (e, a, b)

    @staticmethod
    def of(tets: Ints, n_nodes: int) -> "Pattern":
        """The pattern of a mesh; one sort of pair number and origin packed into one integer."""
        key = (tets[:, :, None] * n_nodes + tets[:, None, :]).ravel()
        bits = int(key.size).bit_length()
        if int(n_nodes**2).bit_length() + bits > 63:
            raise MeshError(f"{len(tets)} tetrahedra are too many for one assembly; coarsen")
        packed = np.sort((key << bits) | np.arange(key.size))
        key, origin = packed >> bits, packed & ((1 << bits) - 1)
        first = np.append(True, key[1:] != key[:-1])
        slot = np.empty(key.size, np.int64)
        slot[origin] = np.cumsum(first) - 1
        rows, indices = np.divmod(key[first], n_nodes)
        indptr = np.searchsorted(rows, np.arange(n_nodes + 1))
        return Pattern(indptr=indptr, indices=indices, slot=slot.reshape(*tets.shape, -1))

    def mirrored(self) -> Ints:
        """The slot (slots,) of each pair taken the other way round."""
        n = len(self.indptr) - 1
        slots = sparse.csr_array(
            (np.arange(len(self.indices)), self.indices, self.indptr), shape=(n, n)
        )
        return slots.tocsc().data

    def sum(self, values: Floats) -> Floats:
        """Element values (e, a, b) summed into the slots."""
        summed = np.bincount(self.slot.ravel(), values.ravel(), len(self.indices))
        return summed.astype(np.float64, copy=False)


def from_blocks(pattern: Pattern, blocks: Floats) -> sparse.bsr_array:
    """Symmetric matrix (3 n, 3 n) of element blocks (k, e, a, b), components UPPER[k]."""
    data = np.empty((len(pattern.indices), 3, 3))
    mirrored = pattern.mirrored()
    for k, (i, j) in enumerate(UPPER):
        data[:, i, j] = component = pattern.sum(blocks[k])
        if i != j:
            data[:, j, i] = component[mirrored]
    n = 3 * (len(pattern.indptr) - 1)
    return sparse.bsr_array((data, pattern.indices, pattern.indptr), shape=(n, n))


def from_masses(pattern: Pattern, masses: Floats) -> sparse.csr_array:
    """The mass matrix of nodes, repeated for each of the three components."""
    nodal, lengths = pattern.sum(masses), np.repeat(np.diff(pattern.indptr), 3)
    indptr = np.concatenate([[0], np.cumsum(lengths)])
    # Entry k of a row comes from entry k of its node's row.
    source = np.arange(indptr[-1]) + np.repeat(
        np.repeat(pattern.indptr[:-1], 3) - indptr[:-1], lengths
    )
    component = np.repeat(np.tile(np.arange(3), len(pattern.indptr) - 1), lengths)
    return sparse.csr_array((nodal[source], 3 * pattern.indices[source] + component, indptr))
