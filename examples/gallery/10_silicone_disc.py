"""
A silicone disc in three dimensions
===================================

A disc of silicone, 80 mm wide and 20 mm high, stands on a rigid base under a focus of 1 Pa at 200
Hz. Waves decay before they reach its free side. At the focus, the disc therefore moves like a
layer without sides, which has a closed solution at each wavenumber.
"""

import numpy as np
import pyvista as pv

import fem
from meshes.shapes.structured import disc
from simple_model.layers.compliance import slab
from simple_model.layers.wavenumber_integral import point_response

silicone = fem.Material(density=1070, shear_modulus=25e3, poisson=0.4999, viscosity=20.0)
width = 8e-3  # m, standard deviation of a focus that is broad enough for large elements
mesh = disc(0.080, 0.020, 0.006)
operators = fem.assemble(mesh, silicone, fixed="bottom")
P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)
force = P @ np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / width**2)  # N, of 1 Pa

# %%
# The steady state at the instant of the largest inward motion.
u = fem.harmonic(operators, force, 200.0)[0]
middle = (fem.probe_operator(mesh, [[0.0, 0.0]]) @ u)[0]
instant = (u * abs(middle) / middle).real.reshape(-1, 3)

grid = mesh.to_pyvista().scale(1e3)  # mm
grid["displacement"] = 1e9 * instant
grid["into the disc, nm"] = -1e9 * instant[:, 2]
limit = 1e9 * abs(middle)
view = grid.warp_by_vector("displacement", factor=4 / limit).clip("y", invert=False)

plotter = pv.Plotter(window_size=(1200, 640))
bar = {"color": "black", "vertical": True, "fmt": "%.0f"}
plotter.add_mesh(
    view, scalars="into the disc, nm", cmap="RdBu_r", clim=(-limit, limit), scalar_bar_args=bar
)
plotter.camera_position = [(25, -100, 55), (4, 15, -10), (0, 0, 1)]
plotter.show()

# %%
layer = point_response(slab(silicone, 0.020), [0.0], [2 * np.pi * 200.0], width)[0, 0]
print(f"middle of the disc over that of the layer: {abs(middle / layer):.4f}")
assert abs(middle / layer - 1) < 0.05
