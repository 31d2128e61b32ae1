"""XDMF files: included elements in their places, because VTK's reader crashes on them."""

import re
import tempfile
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from meshes.files.abaqus import include

KINDS = {"Tetrahedron_10": "Tet_10", "Triangle_6": "Tri_6"}  # of dolfinx, and of VTK


def read_xdmf(path: Path) -> tuple[Any, dict[str, bool]]:
    """Return the content of a file as VTK reads it, and the grids that have the points of another
    one, by name: whether they have cells of their own, as tags do.
    """
    import pyvista
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    root, shared = ElementTree.fromstring(path.read_bytes()), dict[str, bool]()
    own = [grid for grid in root.iter("Grid") if grid.find("Geometry") is not None]
    for outer in root.iter("Grid"):
        for step, grid in enumerate((outer, *outer.findall("Grid"))):  # of a collection, or none
            for link in [part for part in grid if part.tag.endswith("}include")]:
                target = link.get("xpointer", "")
                title = re.search(r"@Name=[\"'](.+?)[\"']", target)
                named = (g for g in own if title and g.get("Name") == title[1])
                parts = [part for part in next(named, own[0]) if part.tag in target]
                grid.extend(map(deepcopy, parts))
                grid.remove(link)
                if step < 2:  # VTK reads the first of a collection
                    names = (each.get("Name", "") for each in (outer, grid))
                    shared |= dict.fromkeys(names, len(parts) == 1)
    for cells in root.iter("Topology"):
        kind = cells.get("TopologyType", "")
        cells.set("TopologyType", KINDS.get(kind, kind))
    for item in root.iter("DataItem"):
        if item.get("Format", "XML").upper() != "XML":  # but HDF or Binary, in another file
            name, colon, inside = (item.text or "").strip().partition(":/")
            item.text = f"{include(path.absolute(), name)}{colon}{inside}"
    with tempfile.TemporaryDirectory() as folder:
        reader = vtkXdmfReader()  # pyvista's reader requires time steps
        reader.SetFileName(str(Path(folder, path.name)))
        Path(folder, path.name).write_bytes(ElementTree.tostring(root))
        reader.Update()
        return pyvista.wrap(reader.GetOutputDataObject(0)), shared
