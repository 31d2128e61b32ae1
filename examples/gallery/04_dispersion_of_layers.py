"""
Dispersion of layered tissue
============================

Surface waves on a soft layer over stiffer tissue are dispersive. Long waves reach below the layer
and travel as Rayleigh waves of the lower tissue. Short waves stay in the layer and travel as
Rayleigh waves of the layer. In between, the group speed is below both.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import Material, Stack
from simple_model.layers.dispersion import dispersion_curves

layer = Material(density=1000, shear_modulus=10e3, poisson=0.4999, loss_factor=1e-4)
below = Material(density=1000, shear_modulus=40e3, poisson=0.4999, loss_factor=1e-4)
tissue = Stack(materials=(layer, below), thicknesses=(3e-3, np.inf))  # m

frequencies = np.concatenate([[5.0, 50.0], np.linspace(100, 1000, 31), [2000.0]])  # Hz
curves = dispersion_curves(tissue, frequencies, most=2)
first, second = curves.modes

figure, ax = plt.subplots(figsize=(7, 3.8), layout="constrained")
ax.plot(frequencies, first.phase_speed, label="phase speed")
ax.plot(frequencies, first.group_speed, label="group speed")
ax.plot(frequencies, second.phase_speed, color="0.6", label="phase speed, second mode")
ax.axhline(below.rayleigh_speed, color="0.4", ls="--", label="Rayleigh wave, tissue below")
ax.axhline(layer.rayleigh_speed, color="0.4", ls=":", label="Rayleigh wave, layer")
ax.set(xlabel="frequency, Hz", ylabel="speed, m/s", xlim=(0, 1000), ylim=(0, 10))
ax.legend(ncols=2, loc="upper right")

# %%
slow = first.phase_speed[0] / below.rayleigh_speed
fast = first.phase_speed[-1] / layer.rayleigh_speed
print(f"over the Rayleigh speeds: {slow:.4f} at 5 Hz below, {fast:.4f} at 2 kHz in the layer")
assert abs(slow - 1) < 0.005
assert abs(fast - 1) < 0.005
