"""
Which focus speed moves skin most
=================================

A focus of constant pressure circles on the forearm. At the speed of the Rayleigh wave it travels
with the wave that it excites, and the motion is largest. The loss of skin makes this peak broad.
It also stiffens the skin slightly, which moves the peak to a higher speed.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.layers.compliance import half_space
from simple_model.layers.flat_body import steady_lines
from simple_model.layers.material import PRESETS

skin = PRESETS["forearm"]
speeds = np.arange(1.0, 6.1, 0.25)  # m/s

rms = []
for speed in speeds:
    path = Trajectory(shape="circle", size=0.040, speed=float(speed))
    load = MovingPressure(tacton=Tacton(trajectory=path))
    f, a = steady_lines(half_space(skin), load, [[0.020, 0.0]], threshold=1e-3)
    rms.append(np.sqrt((np.abs(a[f > 0]) ** 2).sum() / 2))

figure, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
ax.plot(speeds, 1e6 * np.array(rms), "o-")
ax.axvline(skin.rayleigh_speed, color="0.4", ls="--", label="Rayleigh wave, at rest")
ax.set(xlabel="speed of the focus, m/s", ylabel="RMS displacement, µm")
ax.legend()

# %%
best = speeds[int(np.argmax(rms))]
print(f"largest motion at {best:.1f} m/s, Rayleigh wave {skin.rayleigh_speed:.2f} m/s")
assert abs(best / skin.rayleigh_speed - 1) < 0.25
