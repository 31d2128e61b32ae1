"""Cached projections and bases of a body with free materials: arrays of an entry, and back."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.affine import KINDS, AffineOperators
from fem.line_basis import LineBasis
from fem.reduced_affine import AffineModel
from meshes.tetmesh import Floats

OF_A_BASIS = ("parts", "force", "outputs", "states")


def packed(model: AffineModel, bases: Sequence[LineBasis]) -> dict[str, np.ndarray]:
    """Arrays of projected matrices and of the bases of lines, end to end."""
    counts = [len(getattr(model.affine, kind)) for kind in KINDS]
    return {
        "matrices": model.parts,
        "counts": np.array([*counts, model.affine.n_dofs]),
        "free": model.affine.free,
        "sizes": np.array([basis.states.shape[1] for basis in bases]),
        **{
            f"basis_{name}": np.concatenate([getattr(basis, name).ravel() for basis in bases])
            for name in OF_A_BASIS
        },
    }


def unpacked(
    entry: Mapping[str, Any], outputs: Floats
) -> tuple[AffineOperators, Floats, tuple[LineBasis, ...]]:
    """Projected matrices of one geometry by their kinds and of all (g, q, r, r), and bases of an
    entry, with its outputs (g, p, r).
    """
    matrices, (*counts, n_dofs) = entry["matrices"], entry["counts"].tolist()
    groups = [tuple(part) for part in np.split(matrices[0], np.cumsum(counts)[:-1])]
    affine = AffineOperators(
        **dict(zip(KINDS, groups, strict=True)), free=entry["free"], n_dofs=n_dofs
    )
    (g, q), (p, r), sizes = matrices.shape[:2], outputs.shape[1:], entry["sizes"].tolist()
    shapes = {"parts": (g * q, -1, 0), "force": (g, 0), "outputs": (g, p, 0), "states": (r, 0)}
    columns = {name: _split(entry[f"basis_{name}"], sizes, shapes[name]) for name in OF_A_BASIS}
    each = (
        dict(zip(OF_A_BASIS, parts, strict=True)) for parts in zip(*columns.values(), strict=True)
    )
    return affine, matrices, tuple(LineBasis(**basis) for basis in each)


def _split(flat: Any, sizes: Sequence[int], shape: tuple[int, ...]) -> list[Any]:
    """Arrays of a shape in which m, a size, stands for 0 and -1."""
    shapes = [tuple(m if k < 1 else k for k in shape) for m in sizes]
    ends = np.cumsum([np.prod(each, dtype=int) for each in shapes])
    return [part.reshape(s) for part, s in zip(np.split(flat, ends[:-1]), shapes, strict=True)]
