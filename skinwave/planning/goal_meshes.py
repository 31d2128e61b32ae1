"""Records of goal-oriented meshes: what structured and unstructured ones share."""

from collections.abc import Callable
from dataclasses import dataclass

from meshes.shapes.equidistributed import Lines
from meshes.tetmesh import Floats
from meshes.volume.size_field import SizeField
from skinwave.bodies.discretised import Discretise

PER_WAVELENGTH = 2  # elements at least
SPOT = 1.8  # standard deviations of the focal spot that an element which it passes is at most wide


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalMesh:
    """Goal-oriented mesh, or the coarse one before it.

    `discretise` of its body, None for that of its kind; the grid lines, three (n,) in metre, or the
    size field that its elements follow; its error over that of the coarse mesh as predicted, a
    `ratio`; its element sizes in `words`; and the `widest` in metre that the focus passes.
    """

    discretise: Discretise | None = None
    follows: Lines | SizeField | None = None
    ratio: float = 1.0
    words: str = ""
    widest: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimated:
    """Estimated relative `error` of the coarse mesh at the worst probe; and `finer`: the mesh of
    the fewest degrees of freedom that is predicted to have an error ratio, and is finer than a mesh
    before and not much larger than a number of degrees of freedom.
    """

    error: float
    finer: Callable[[float, GoalMesh, float], GoalMesh]


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """Goal-oriented meshes of a body: the `coarse` one of elements of a `size` in metre; the factor
    of `safety` on errors that are extrapolated by predicted ratios; and what the coarse mesh is
    `estimated` to leave, at frequencies (f,) in Hz and relative to motion (p,) of the probes, with
    so many degrees of freedom.
    """

    coarse: GoalMesh
    size: float
    safety: float
    estimated: Callable[[Floats, Floats, int], Estimated]
