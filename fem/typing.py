"""Types of arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Ints
from simple_model.typing import Complex, Floats

Bools = NDArray[np.bool_]
Index = NDArray[np.int32]  # columns and starts of rows of a sparse matrix
Array = NDArray[Any]  # of float64 or complex128

__all__ = ["Array", "Bools", "Complex", "Floats", "Index", "Ints"]
