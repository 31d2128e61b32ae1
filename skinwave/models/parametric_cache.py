"""Cached projections and bases of a body with free materials: arrays of an entry, and back."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.affine import AffineOperators
from fem.line_basis import LineBasis
from meshes.tetmesh import Floats

KINDS = ("stiffness", "mass", "dashpots", "layer", "springs")
OF_A_BASIS = ("parts", "force", "outputs", "states")


def packed(affine: AffineOperators, bases: Sequence[LineBasis]) -> dict[str, np.ndarray]:
    """Arrays of projected matrices and of the bases of lines, end to end."""
    counts = [len(getattr(affine, kind)) for kind in KINDS]
    return {
        "matrices": np.stack(affine.parts),
        "counts": np.array([*counts, affine.n_dofs]),
        "free": affine.free,
        "sizes": np.array([len(basis.force) for basis in bases]),
        **{
            f"basis_{name}": np.concatenate([getattr(basis, name).ravel() for basis in bases])
            for name in OF_A_BASIS
        },
    }


def unpacked(
    entry: Mapping[str, Any], outputs: Floats
) -> tuple[AffineOperators, tuple[LineBasis, ...]]:
    """Projected matrices and bases of an entry, with its outputs (p, r)."""
    matrices, (*counts, n_dofs) = entry["matrices"], entry["counts"].tolist()
    groups = [tuple(part) for part in np.split(matrices, np.cumsum(counts)[:-1])]
    stiffness, mass, dashpots, layer, springs = groups
    affine = AffineOperators(
        stiffness=stiffness, mass=mass, dashpots=dashpots, layer=layer, springs=springs,
        free=entry["free"], n_dofs=n_dofs,
    )  # fmt: skip
    q, (p, r), sizes = len(matrices), outputs.shape, entry["sizes"].tolist()
    shapes = {"parts": (q, -1, 0), "force": (0,), "outputs": (p, 0), "states": (r, 0)}
    columns = {name: _split(entry[f"basis_{name}"], sizes, shapes[name]) for name in OF_A_BASIS}
    each = (
        dict(zip(OF_A_BASIS, parts, strict=True)) for parts in zip(*columns.values(), strict=True)
    )
    return affine, tuple(LineBasis(**basis) for basis in each)


def _split(flat: Any, sizes: Sequence[int], shape: tuple[int, ...]) -> list[Any]:
    """Arrays of a shape in which m, a size, stands for 0 and -1."""
    shapes = [tuple(m if k < 1 else k for k in shape) for m in sizes]
    ends = np.cumsum([np.prod(each, dtype=int) for each in shapes])
    return [part.reshape(s) for part, s in zip(np.split(flat, ends[:-1]), shapes, strict=True)]
