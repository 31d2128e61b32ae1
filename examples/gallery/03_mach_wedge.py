r"""
A focus faster than its waves
=============================

A focus that moves faster than the Rayleigh wave leaves a wedge behind it, like a boat. The angle
between wedge and path is :math:`\arcsin(c_R / v)`. This half-space has almost no loss, so all
waves have the same speed.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import Material, MovingPressure, Tacton, Trajectory
from simple_model.layers.compliance import half_space
from simple_model.layers.flat_body import steady_lines
from simple_model.load.spectrum import synthesise

gel = Material(density=1000, shear_modulus=6e3, poisson=0.4999, loss_factor=0.02)
speed = 2 * gel.rayleigh_speed  # m/s, so that the angle is 30 degrees
path = Trajectory(shape="line", size=0.060, speed=speed, sweep="one_way")
load = MovingPressure(tacton=Tacton(trajectory=path), height=0.1)

# %%
# Motion on one side of the path when the focus is at 24 mm.
x, y = 1e-3 * np.arange(-30.0, 31.0), 1e-3 * np.arange(0.0, 30.5, 1.0)
places = np.stack(np.meshgrid(x, y), axis=-1)
compliance = half_space(gel)
f, a = steady_lines(compliance, load, places.reshape(-1, 2), threshold=1e-3)
moving = f > 0
time = (0.024 + 0.030) / speed
u = synthesise(f[moving], a[moving], np.array([time])).reshape(len(y), len(x))

figure, ax = plt.subplots(figsize=(7, 5.4), layout="constrained")
both, limit = 1e6 * np.vstack([u[:0:-1], u]), 1e6 * np.abs(u).max()  # the other side is its mirror
image = ax.pcolormesh(
    1e3 * x, 1e3 * np.concatenate([-y[:0:-1], y]), both, cmap="RdBu_r", vmin=-limit, vmax=limit,
    shading="gouraud",
)  # fmt: skip
back = 24 - 20 / np.tan(np.pi / 6)
ax.plot([back, 24, back], [-20, 0, 20], "k--", label="arcsin(c/v) = 30°")
ax.plot(24, 0, "ko", label="focus")
ax.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
ax.legend(loc="upper left")
figure.colorbar(image, ax=ax, label="displacement into the body, µm", shrink=0.8)

# %%
# At each distance from the path, the front is the place of the largest inward motion.
rows = (y > 0.006) & (y < 0.014)
fine = np.linspace(-0.012, 0.022, 2000)
front = [fine[np.argmax(np.interp(fine, x, row))] for row in u[rows]]
slope = -np.polyfit(y[rows], front, 1)[0]
angle = np.degrees(np.arctan(1 / slope))
print(f"angle of the wedge: {angle:.1f} degrees")
assert abs(angle - 30) < 2
