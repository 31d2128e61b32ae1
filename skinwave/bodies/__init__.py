"""Bodies: one file for each kind, which registers a `BodyKind`, and what all kinds share.

Importing this package registers the built-in kinds in this order.
"""

from skinwave.bodies import sheet, slab, palm, mesh, finger, disc  # noqa: F401, I001
from skinwave.bodies.body import BODIES, KINDS, Body, BodyKind, body_name, kind_of, register
from skinwave.bodies.parts import FLAT, Layer, Phalanx, Placement, Relief, solid_of
from skinwave.bodies.supports import Mounting, Sides

__all__ = [
    "BODIES", "FLAT", "KINDS",
    "Body", "BodyKind", "Layer", "Mounting", "Phalanx", "Placement", "Relief", "Sides",
    "body_name", "kind_of", "register", "solid_of",
]  # fmt: skip
