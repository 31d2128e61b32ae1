"""Draw the picture of the README: one load on three models. It takes a minute."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton, Trajectory
from skinwave import BODIES, Scene
from skinwave.results.surface import body_map, grid, kernel_map

REACH, STEP = 0.044, 1e-3  # m
TITLES = {
    "kernel": "Point kernel\nno propagation",
    "paper-sheet": "Paper sheet in a frame\nbending waves",
    "palm": "Palm\nsurface waves",
}

circle = Trajectory(shape="circle", size=0.020, speed=4 * np.pi)  # m, m/s: 200 Hz
load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.5, trajectory=circle))

figure, axes = plt.subplots(1, 3, figsize=(7.2, 2.95), layout="constrained", sharey=True)
for ax, (name, title) in zip(axes, TITLES.items(), strict=True):
    body = BODIES["skin-slab" if name == "kernel" else name]
    scene = Scene(pressure=load, body=body, probes=((0.0, 0.0),))
    x, y = grid(scene, REACH, STEP)
    kernel = kernel_map(load, x, y).rms
    rms = kernel if name == "kernel" else body_map(scene, x, y).rms
    outside = kernel < 0.1 * kernel.max()  # where the kernel is below -20 dB
    share = np.nansum(rms[outside] ** 2) / np.nansum(rms**2)
    level = 20 * np.log10(np.maximum(rms / np.nanmax(rms), 1e-6))
    image = ax.pcolormesh(
        1e3 * x, 1e3 * y, level, cmap="cividis", vmin=-40, vmax=0, shading="nearest"
    )
    ax.contour(
        1e3 * x, 1e3 * y, kernel / kernel.max(), [0.1], colors="w", linestyles="--", linewidths=1
    )
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.plot(10 * np.cos(turn), 10 * np.sin(turn), color="w", linewidth=1)
    ax.text(0, -40, f"{share:.0%} outside", color="w" if name == "kernel" else "k", ha="center")
    ax.set(title=title, aspect="equal", xlim=(-44, 44), ylim=(-44, 44), xlabel="x, mm")
    ax.set(xticks=[-40, -20, 0, 20, 40], facecolor="0.92")
axes[0].set_ylabel("y, mm")
figure.colorbar(image, ax=axes, label="RMS, dB re largest", shrink=0.85)
figure.savefig(Path(__file__).with_suffix(".png"), dpi=222)
