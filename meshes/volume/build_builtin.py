"""Build the meshes that come with the package: `python -m meshes.volume.build_builtin FOLDER`.

They differ from run to run, by what the mesher finds.
"""

import hashlib
import io
import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from meshes.shapes.palm import EPSILON, Palm, surface
from meshes.shapes.structured import block
from meshes.surface.repair import repaired
from meshes.tetmesh import TetMesh, boundary_facets
from meshes.volume.builtin import CHECKSUMS
from meshes.volume.tetrahedralise import tetrahedralise

FLAT = Palm(cup_depth=0.0, thenar_height=0.0, hypothenar_height=0.0, pad_height=0.0)
PALMS = {"palm": (Palm(), 5e-3), "flat-palm": (FLAT, 5e-3)}  # and their element sizes, metre
SLAB, SLAB_SIZE = (0.06, 0.06, 0.015), 4e-3  # metre


def make(folder: Path) -> None:
    """Mesh all of them into a folder, with their checksums."""
    folder.mkdir(parents=True, exist_ok=True)
    sums = []
    for name, (palm, h) in PALMS.items():
        body = surface(palm, h / 2)
        mesh = tetrahedralise(body, h, epsilon=EPSILON * h)
        sums.append(_store(folder / f"{name}.npz", mesh, asdict(palm)))
    box = block(SLAB, max(SLAB), order=1)
    body, _ = repaired(box.points, boundary_facets(box.tets))
    mesh = tetrahedralise(body, SLAB_SIZE)
    sums.append(_store(folder / "slab.npz", _flattened(mesh), {}))
    (folder / CHECKSUMS).write_text("".join(sums), "ascii")


def _flattened(mesh: TetMesh) -> TetMesh:
    """The slab with the nodes near its sides exactly on them; the mesher leaves them wavy."""
    points, outer = np.array(mesh.points), np.unique(mesh.facets["surface"])
    x, y, depth = SLAB
    for axis, low, high in ((0, -x / 2, x / 2), (1, -y / 2, y / 2), (2, -depth, 0.0)):
        for side in (low, high):
            near = np.abs(points[outer, axis] - side) < 0.1 * SLAB_SIZE
            points[outer[near], axis] = side
    return TetMesh(points=points, tets=mesh.tets)


def _store(path: Path, mesh: TetMesh, palm: dict[str, float]) -> str:
    """Write a mesh of 4-node tetrahedra; its line of the checksums."""
    content = io.BytesIO()
    np.savez_compressed(
        content, points=mesh.points, tets=mesh.tets.astype(np.int32), palm=json.dumps(palm)
    )
    path.write_bytes(content.getvalue())
    return f"{hashlib.sha256(content.getvalue()).hexdigest()}  {path.name}\n"


if __name__ == "__main__":
    make(Path(sys.argv[1]))
