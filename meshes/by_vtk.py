"""VTK's own readers."""

import warnings
from pathlib import Path
from typing import Any

from meshes.tetmesh import MeshError


def read_by_vtk(path: Path) -> Any:
    """What VTK makes of a file, without what it prints.

    Raises
    ------
    MeshError
        If it cannot read it.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return pyvista.read(path)
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(
            f"{path} cannot be read ({reason}); save it again from the program that it comes from"
        ) from None
    finally:
        vtkLogger.SetStderrVerbosity(verbosity)
