"""Cached models of a body with free materials: arrays of an entry, and back."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.affine import KINDS
from fem.affine_model import AffineModel

OF_ALL = ("parts", "forces", "outputs")
OF_A_LINE = (*OF_ALL, "basis")


def packed(model: AffineModel, bases: Sequence[AffineModel]) -> dict[str, np.ndarray]:
    """Arrays of a model without its basis, and of those of lines in it, end to end."""
    return {
        "terms": np.array([(KINDS.index(kind), r) for kind, r in model.terms]),
        **{name: getattr(model, name) for name in OF_ALL},
        "sizes": np.array([line.basis.shape[1] for line in bases]),
        **{f"line_{name}": np.concatenate([getattr(line, name).ravel() for line in bases])
           for name in OF_A_LINE},
    }  # fmt: skip


def unpacked(entry: Mapping[str, Any]) -> tuple[AffineModel, tuple[AffineModel, ...]]:
    """Model of an entry, its basis without rows, and those of lines in it."""
    terms = tuple((KINDS[kind], r) for kind, r in entry["terms"].tolist())
    (g, q, r, _), p = entry["parts"].shape, entry["outputs"].shape[1]
    model = AffineModel(
        terms=terms, basis=np.zeros((0, r)), **{name: entry[name] for name in OF_ALL}
    )
    starts, lines = dict.fromkeys(OF_A_LINE, 0), []
    for m in entry["sizes"].tolist():
        shapes = {"parts": (g, q, m, m), "forces": (g, 1, m), "outputs": (g, p, m), "basis": (r, m)}
        arrays = {}
        for name, shape in shapes.items():
            start = starts[name]
            starts[name] += int(np.prod(shape))
            arrays[name] = entry[f"line_{name}"][start : starts[name]].reshape(shape)
        lines.append(AffineModel(terms=terms, **arrays))
    return model, tuple(lines)
