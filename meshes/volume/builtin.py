"""Built-in meshes, so that nothing ordinary needs the mesher, which differs from run to run.

`python -m meshes.volume.build_builtin FOLDER` makes them anew, with their checksums.
"""

import hashlib
import io
import json
from pathlib import Path

import numpy as np

from meshes.facets import seen_from_above, tag_boundary
from meshes.shapes.palm import Palm
from meshes.tetmesh import MeshError, TetMesh, quadratic
from meshes.volume.palm_mesh import curved_palm

HOME = Path(__file__).parent.parent / "data"
CHECKSUMS = "SHA256SUMS"


def builtin(name: str) -> TetMesh:
    """Built-in mesh of 10-node tetrahedra, which comes with the package.

    `palm` and `flat-palm` (elements of 5 mm) have the facet sets of `palm_mesh`; `slab` (60 x 60 x
    15 mm, elements of 4 mm) has `top`, `bottom`, `sides` and `surface`.

    Raises
    ------
    MeshError
        If there is none of that name, or its file is not what it was.
    """
    lines = (HOME / CHECKSUMS).read_text("ascii").splitlines()
    sums = {file: checksum for checksum, file in map(str.split, lines)}
    if f"{name}.npz" not in sums:
        known = ", ".join(sorted(Path(file).stem for file in sums))
        raise MeshError(f"there is no built-in mesh '{name}'; there are: {known}")
    content = (HOME / f"{name}.npz").read_bytes()
    if hashlib.sha256(content).hexdigest() != sums[f"{name}.npz"]:
        raise MeshError(
            f"the built-in mesh '{name}' is not what its checksum says; install the package again"
        )
    with np.load(io.BytesIO(content)) as stored:
        mesh = TetMesh(points=stored["points"], tets=stored["tets"])
        palm = json.loads(str(stored["palm"]))
    return curved_palm(Palm(**palm), mesh) if palm else _with_box_sides(quadratic(mesh))


def _with_box_sides(mesh: TetMesh) -> TetMesh:
    return tag_boundary(
        mesh,
        top=seen_from_above(mesh),
        bottom=lambda centroids, normals: normals[:, 2] < -0.5,
        sides=lambda centroids, normals: np.abs(normals[:, 2]) < 0.5,
    )
