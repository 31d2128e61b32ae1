r"""
Convergence of quadratic elements
=================================

A column without lateral contraction under a pressure at 80 Hz has the closed form :math:`u(0) = p
\tan(k L) / E k` with :math:`k = \omega \sqrt{\rho / E}`. Elements of half the size reduce the
error at its end by a factor of 16 for ten-node tetrahedra (order 2p = 4, as for energies), and by
a factor of 4 for four-node tetrahedra (order 2).
"""

import matplotlib.pyplot as plt
import numpy as np

import fem
import meshes

length, width, hertz = 0.040, 0.010, 80.0  # m, m, Hz
foam = fem.Material(density=1000, shear_modulus=25e3, poisson=0.0, viscosity=2.0)
young = 2 * complex(foam.complex_modulus(2 * np.pi * hertz))
k = 2 * np.pi * hertz * np.sqrt(foam.density / young)
expected = np.tan(k * length) / (young * k)  # m/Pa

found, sizes = {}, np.array([0.005, 0.004, 0.0025])  # m
for order in (1, 2):
    errors = []
    for h in sizes:
        mesh = meshes.block((width, width, length), h, order=order)
        P = fem.pressure_operator(mesh)
        force = P @ np.ones(P.shape[1])  # N, of 1 Pa
        u = fem.harmonic(fem.assemble(mesh, foam), force, hertz)[0]
        errors.append(abs(force @ u / width**2 / expected - 1))
    found[order] = np.array(errors)

orders = {p: np.polyfit(np.log(sizes), np.log(errors), 1)[0] for p, errors in found.items()}
figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for p, nodes in ((1, "four"), (2, "ten")):
    ax.loglog(1e3 * sizes, found[p], "o-", label=f"{nodes} nodes: order {orders[p]:.2f}")
ax.set(xlabel="element size, mm", ylabel="relative error of the compliance", xticks=[])
ax.set_xticks(1e3 * sizes, [f"{1e3 * h:g}" for h in sizes], minor=False)
ax.minorticks_off()
ax.legend()

# %%
print(f"orders: {orders[1]:.2f} with four nodes, {orders[2]:.2f} with ten")
assert abs(orders[2] - 4) < 0.3
assert abs(orders[1] - 2) < 0.3
