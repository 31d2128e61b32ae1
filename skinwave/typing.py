"""Types of arrays."""

from simple_model.typing import Array, Bools, Complex, Floats, Ints

__all__ = ["Array", "Bools", "Complex", "Floats", "Ints"]
