"""
What propagation changes
========================

A focus draws a circle of 20 mm on skin at 12 m/s, modulated at 140 Hz. In the point kernel
nothing propagates, so stimulation stays at the path. Under the same load, waves carry motion
beyond it. Propagation moves energy in space, not in frequency: a linear body vibrates only at the
spectral lines of its load.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton, Trajectory
from skinwave import Body, Scene, simulate
from skinwave.results.surface import body_map, grid, kernel_map

circle = Trajectory(shape="circle", size=0.020, speed=4 * np.pi)  # m, m/s: 200 Hz
load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.5, trajectory=circle))
scene = Scene(pressure=load, body=Body(kind="slab", material="palm"), probes=((0.0, 0.0),))

# %%
# RMS motion over the surface, each model relative to its largest value.
x, y = grid(scene, 0.04, 1e-3)
maps = {"point kernel": kernel_map(load, x, y), "waves in skin": body_map(scene, x, y)}
figure, axes = plt.subplots(1, 2, figsize=(8, 3.8), layout="constrained", sharey=True)
for ax, (name, found) in zip(axes, maps.items(), strict=True):
    level = 20 * np.log10(np.maximum(found.rms / found.rms.max(), 1e-3))
    image = ax.pcolormesh(1e3 * x, 1e3 * y, level, cmap="cividis", vmin=-30, vmax=0)
    ax.contour(1e3 * x, 1e3 * y, level, [-20], colors="white", linestyles="dashed")
    ax.set(title=name, xlabel="x, mm", aspect="equal")
axes[0].set_ylabel("y, mm")
figure.colorbar(image, ax=axes, label="RMS motion, dB re largest")

# %%
# After the transient, only multiples and sums of 140 and 200 Hz remain. All other bins of the
# spectrum, 20 Hz wide, are empty.
waves = simulate(scene, "flat-body", 0.2, times=np.arange(0, 0.3, 1e-4))
amplitude = np.abs(np.fft.rfft(waves.values[-500:, 0]))
hertz = np.fft.rfftfreq(500, 1e-4).round().astype(int)
of_load = {abs(200 * n + 140 * m) for n in range(-25, 26) for m in range(-2, 3)}
others = np.array([f not in of_load for f in hertz])
share = amplitude[others].max() / amplitude.max()
print(f"strongest other line: {share:.1e} of the largest")
assert others.sum() > 20
assert share < 1e-3
