r"""
Modes of a clamped sheet
========================

Office paper in a square frame. In vacuum, the lowest natural frequency of a clamped square plate
is :math:`35.985 / 2 \pi a^2 \cdot \sqrt{D / m}` (Leissa, *Vibration of Plates*, 1969, table
4.22). The mass of the air around the sheet lowers it.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model.plates.modes import Plate, plate_modes

side, D, mass, nu = 0.15, 2e-4, 0.080, 0.3  # m, N m, kg/m2
paper = Plate(
    size_x=side, size_y=side, d11=D, d22=D, d12=nu * D, d66=(1 - nu) * D / 2,
    mass_per_area=mass, air_density=0.0,
)  # fmt: skip
found = plate_modes(paper, finest=120.0)

# %%
x = np.linspace(-side / 2, side / 2, 61)
shapes = found.on_grid(x, x)[:, np.argsort(found.squared)]
figure, axes = plt.subplots(2, 3, figsize=(7.5, 5.2), layout="constrained")
for k, ax in enumerate(axes.flat):
    shape = shapes[:, k].reshape(61, 61).T
    ax.pcolormesh(x, x, shape / np.abs(shape).max(), cmap="RdBu_r", vmin=-1, vmax=1)
    ax.set(title=f"{found.frequencies[k]:.1f} Hz", xticks=[], yticks=[], aspect="equal")

# %%
leissa = 35.985 / (2 * np.pi * side**2) * np.sqrt(D / mass)
print(f"lowest mode {found.frequencies[0]:.3f} Hz, Leissa {leissa:.3f} Hz")
assert abs(found.frequencies[0] / leissa - 1) < 1e-3
