"""Types of arrays."""

import numpy as np
from numpy.typing import NDArray

from simple_model.typing import Array, Bools, Complex, Floats, Ints

Index = NDArray[np.int32]  # columns and starts of rows of a sparse matrix

__all__ = ["Array", "Bools", "Complex", "Floats", "Index", "Ints"]
