"""
Uncertainty bands
=================

The pressure of a device is known to a factor of 2, and so are the moduli of skin. Waves are
linear in the load. If only the pressure is uncertain, 90 % of the samples lie between half and
twice the median motion, on any body.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from skinwave import loads
from skinwave.sweeps.ensemble import propagate

scene = loads("""
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[focus]
peak_pressure_pa = { value = 50, factor = 2 }
[body]
kind = "slab"
material = "palm"
sides = "absorbing"
[probes]
points_mm = [[0, 0], [4, 0], [8, 0], [12, 0], [16, 0], [20, 0]]
""")
both = propagate(scene, 32)  # the preset's moduli are uncertain, too
known = replace(scene, body=replace(scene.body, material=scene.body.solid))
pressure_alone = propagate(known, 32)

# %%
away = [1e3 * x for x, _ in scene.probes]
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
for found, colour, name in (
    (both, "#E69F00", "pressure, moduli and losses"),
    (pressure_alone, "#0072B2", "pressure alone"),
):
    low, middle, high = np.percentile(1e6 * found.rms, [5, 50, 95], axis=0)
    ax.fill_between(away, low, high, color=colour, alpha=0.35, label=f"5 to 95 %: {name}")
    ax.plot(away, middle, color=colour)
ax.set(xlabel="distance from the focus, mm", ylabel="RMS displacement, µm", yscale="log")
ax.legend()

# %%
low, high = np.percentile(pressure_alone.rms[:, 0], [5, 95])
print(f"95th over 5th percentile, pressure alone: {high / low:.2f}")
assert abs(high / low / 4 - 1) < 0.1  # of 32 samples
