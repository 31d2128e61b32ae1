r"""
The drive law under AM
======================

A device modulates the amplitude of sound. The radiation pressure on the skin is proportional to
its square. The square of full amplitude modulation :math:`(1 + \cos \omega t)/2` is :math:`3/8 +
\cos(\omega t)/2 + \cos(2 \omega t)/8`. The line at twice the frequency therefore has a quarter of
the amplitude.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import DRIVES, MovingPressure, Tacton, lines, point_kernel

tacton = Tacton(am_frequency=100, duration=0.5)
times = np.arange(0, 0.5, 1e-4)
orders = 100.0 * np.arange(1, 5)  # Hz

found = {}
for name, law in DRIVES.items():
    load = MovingPressure(tacton=tacton, drive=law)
    found[name] = lines(point_kernel(load, [[0.0, 0.0]], times), orders)[:, 0]

figure, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
for k, (name, amplitudes) in enumerate(found.items()):
    ax.bar(orders + 22 * (k - 1), amplitudes, width=20, label=name.replace("_", " "))
ax.set(xlabel="frequency, Hz", ylabel="pressure at the focus, Pa", xticks=orders)
ax.legend(title="drive law")

# %%
ratio = found["pressure_squared"][1] / found["pressure_squared"][0]
print(f"pressure at 200 Hz over that at 100 Hz, squared drive: {ratio:.6f}")
assert abs(ratio - 1 / 4) < 1e-6
