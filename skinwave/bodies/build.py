"""A meshed body with its materials and boundary conditions, placed under the device."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from fem.assembly import Operators, assemble
from fem.boundary import Support, fixed_dofs
from fem.coat import Coat
from fem.plane_stiffness import SIDES, Tension
from meshes import TetMesh, half
from simple_model.layers.material import Material
from skinwave.bodies.body import Body
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sizes import check_element_size, default_size
from skinwave.bodies.supports import with_springs
from skinwave.typing import Bools, Floats, Ints

COMPARED = 4 / 3  # of the coarsest element size: limit of meshes that estimate errors


@dataclass(frozen=True, kw_only=True, eq=False)
class Build:
    """Meshed body, as arguments of `fem.assemble`.

    `fixed` are facet sets with their fixed components; `held` (n, 3) marks additional fixed
    components of nodes. `drag` (m,) in 1/s is that of the absorbing layer. `coat` and `support`
    belong to hands; `stiffener`, `tension` and `axes` (2, 3) along the sides belong to sheets.
    """

    mesh: TetMesh
    material: dict[int, Material]
    fixed: dict[str, str]
    absorbing: Ints | None
    coat: Coat | None = None
    drag: Floats | None = None
    support: Support | None = None
    symmetry: str = ""
    held: Bools | None = None
    tension: Tension | None = None
    stiffener: sparse.csr_array | None = None
    axes: Floats = field(default_factory=lambda: SIDES)

    @property
    def constraints(self) -> dict[str, str] | Bools:
        """All fixed components."""
        if self.held is None:
            return self.fixed
        return self.held | fixed_dofs(self.mesh, self.fixed).reshape(-1, 3)


def build(
    body: Body, h: float | None = None, symmetry: str = "", discretise: Discretise | None = None
) -> Build:
    """Mesh a body with its materials and boundary conditions.

    `h` is the element size in m, by default that of the body. `symmetry`, "x", "y" or "xy", meshes
    only the part at positive coordinates along these axes, with symmetry conditions. `discretise`
    replaces the function of the kind. Raises a ValueError if there is no such mesh.
    """
    size = check_element_size(body, h or default_size(body), COMPARED)
    discretise = discretise or body.of_kind.discretise
    assert discretise  # checked with the size
    made = discretise(body, size)
    mesh = made.mesh
    sides = {"sides": body.sides} if isinstance(body.sides, str) else body.sides.by_name
    ends = {"bottom": body.base, **sides}
    ends = {name: end for name, end in ends.items() if len(mesh.facets.get(name, ()))}
    if made.held:
        del ends["sides"]
    fixed = {name: "xyz" for name, end in ends.items() if end == "clamped"}
    for axis in symmetry:
        mesh = half(mesh, axis)
        fixed[f"mirror_{axis}"] = axis
    drag, support = made.drag and made.drag(mesh), made.support and made.support(mesh)
    held, stiffener = made.held and made.held(mesh), made.stiffener and made.stiffener(mesh)
    if ends.get("bottom") == "elastic":
        support = with_springs(support, mesh, mesh.facets["bottom"], body.base_stiffness)
    is_fixed = "xyz" in fixed.values() or held is not None
    if body.is_held and not is_fixed and not (support and support.stiffness.any()):
        raise ValueError(
            f"the sides are clamped, but {body.file} has no facet set 'sides' or 'cut'; clamp "
            "the base, or name the facets in the file"
        )
    mesh = replace(mesh, points=body.placement(mesh.points))
    leaky = [mesh.facets[name] for name, end in ends.items() if end == "absorbing"]
    return Build(
        mesh=mesh, material=dict(enumerate(made.materials)), fixed=fixed, held=held,
        absorbing=np.vstack(leaky) if leaky else None, drag=drag, support=support,
        coat=made.coat, tension=made.tension, stiffener=stiffener, symmetry=symmetry,
        axes=body.placement.rotation.T[:2],
    )  # fmt: skip


def operators(build: Build) -> Operators:
    """Return the stiffness, damping and mass of a meshed body."""
    return assemble(
        build.mesh, build.material, fixed=build.constraints, absorbing=build.absorbing,
        drag=build.drag, support=build.support, coat=build.coat, tension=build.tension,
        stiffener=build.stiffener, axes=build.axes,
    )  # fmt: skip
