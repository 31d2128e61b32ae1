"""
A fingertip with its bone
=========================

Soft tissue around a bone, on coarse elements, cut open. The example checks reciprocity (Maxwell
and Betti): the motion at point A under a force at B equals the motion at B under the same force
at A, for any materials.
"""

import numpy as np
import pyvista as pv

import fem
from meshes import Fingertip, fingertip_mesh

shape = Fingertip(
    breadth=0.016,
    length=0.025,
    thickness=0.013,
    bone_breadth=0.007,
    bone_thickness=0.004,
    cover=0.006,
    tip=0.004,
)  # m
mesh = fingertip_mesh(shape, 2e-3)
materials = {0: fem.PRESETS["palm"], 1: fem.PRESETS["bone"]}
operators = fem.assemble(mesh, materials, fixed="sides")

# %%
# A focus of 50 Pa at rest on the pad, and a second one 4 mm towards the tip.
P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)


def focus(y):
    """Nodal forces in N of 50 Pa in a Gaussian spot at (0, y) in metre."""
    return P @ (50 * np.exp(-(points[:, 0] ** 2 + (points[:, 1] - y) ** 2) / 2 / 2e-3**2))


forces = np.column_stack([focus(0.0), focus(0.004)])
u = fem.static(operators, forces)
moved = u[:, 0].reshape(-1, 3)

grid = mesh.to_pyvista().scale(1e3)  # mm
grid["displacement"], grid["µm"] = 1e6 * moved, 1e6 * np.linalg.norm(moved, axis=1)
grid.cell_data["bone"] = mesh.region
tissue, bone = (grid.extract_cells(np.flatnonzero(mesh.region == k)) for k in (0, 1))

plotter = pv.Plotter(window_size=(1200, 760))
half = tissue.warp_by_vector("displacement", factor=1 / grid["µm"].max()).clip("x", invert=False)
bar = {"color": "black", "vertical": True, "title": "motion, µm"}
plotter.add_mesh(half, scalars="µm", cmap="cividis", scalar_bar_args=bar)
plotter.add_mesh(bone.extract_surface(algorithm=None), color="ivory", smooth_shading=True)
plotter.camera_position = [(-45, 22, 22), (0, 4, -6), (0, 0, 1)]
plotter.show()

# %%
there, back = forces[:, 1] @ u[:, 0], forces[:, 0] @ u[:, 1]  # J
print(f"work of one load on the motion by the other: {there:.6e} J and {back:.6e} J")
assert abs(there / back - 1) < 1e-9
share = np.abs(moved[np.unique(mesh.tets[mesh.region == 1])]).max() / np.abs(moved).max()
print(f"largest motion of the bone: {100 * share:.2f} % of that of the skin")
