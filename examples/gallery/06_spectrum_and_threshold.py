r"""
Which lines are above the detection threshold
=============================================

The motion of skin at the focus under AM at 100 Hz. The drive law gives the line at 200 Hz a
quarter of the pressure of the line at 100 Hz, or -12 dB. The threshold of the Pacinian channel
also falls by 12 dB per octave. The compliance of skin decides which line is higher above the
threshold.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton, sensation_level, threshold
from simple_model.layers.compliance import slab
from simple_model.load.focus import spot_width
from skinwave import Body, Scene, simulate

load = MovingPressure(tacton=Tacton(am_frequency=100, duration=1.0))
scene = Scene(pressure=load, body=Body(kind="slab", material="palm"), probes=((0.0, 0.0),))
waves = simulate(scene, "flat-body", 0.1)
spectrum, lines = waves.spectrum(), waves.lines

hertz = np.linspace(15, 500, 400)
figure, ax = plt.subplots(figsize=(7, 3.8), layout="constrained")
ax.semilogy(spectrum.frequencies, 1e6 * spectrum.amplitudes[:, 0], label="displacement")
ax.semilogy(hertz, 1e6 * threshold(hertz), "m", label="detection threshold")
for f, a in zip(lines.frequencies, np.abs(lines.amplitudes[:, 0]), strict=True):
    if f > 0:
        ax.annotate(f"{sensation_level(a, f):+.1f} dB", (f + 6, 1e6 * a), va="bottom")
ax.set(xlim=(15, 400), ylim=(1e-3, 30), xlabel="frequency, Hz", ylabel="amplitude, µm")
ax.legend()

# %%
# The line at 200 Hz is checked by a sum over wavenumbers: the compliance of the slab times the
# transform of the focal spot.
layer, width = scene.body.solid, spot_width(load.height)
k = np.linspace(1.0, 1500.0, 6000)[None, :]  # rad/m
G = slab(layer, scene.body.depth)(k + 0j, np.array([[2 * np.pi * 200 + 0j]]))
spot = width**2 * np.exp(-((k * width) ** 2) / 2)
per_pressure = (G * spot * k).sum() * (k[0, 1] - k[0, 0])
expected = abs(per_pressure) * 50 / 8  # 50 Pa; the squared drive has an eighth of it at 2 f_AM
second = float(np.abs(lines["2f_AM"])[0])
print(f"line at 200 Hz: {1e6 * second:.4f} µm, integral {1e6 * expected:.4f} µm")
assert abs(second / expected - 1) < 0.005
