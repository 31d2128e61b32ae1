"""
Fit a modulus to a measurement
==============================

The recording is simulated: waves in skin of 25 kPa, 5 % noise, and an unknown gain. The fit finds
the modulus and its interval from the phase and amplitude along a line.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton
from skinwave import Body, Scene, simulate
from skinwave.measure import Measurement
from skinwave.measure.fit import fit
from skinwave.scene.variation import with_values

places = tuple((1e-3 * x, 0.0) for x in (0, 4, 8, 12, 16))  # m
load = MovingPressure(tacton=Tacton(am_frequency=120, duration=0.2))
skin = Body(kind="slab", material="palm", sides="absorbing")
scene = Scene(pressure=load, body=replace(skin, material=skin.solid), probes=places)
times = np.arange(0.1, 0.2, 5e-4)
true = simulate(scene, "flat-body-harmonic", 0.2, times=times).values

noise = np.random.default_rng(1).normal(size=(3, *true.shape)) * 0.05 * np.ptp(true) / 2
measured = Measurement(
    quantity="displacement", places=places, times=times, values=0.7 * true + noise
)

# %%
key = "body.material.shear_modulus_pa"
start = with_values(scene, {key: 40e3})
found = fit(start, measured, [f"{key}=10e3:60e3", "gain=0.1:10"], kind="lines",
            model="flat-body-harmonic", starts=3)  # fmt: skip

fitted = found.values["gain"] * simulate(
    found.scene, "flat-body-harmonic", 0.2, times=times).values  # fmt: skip
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
for k, colour in ((0, "#0072B2"), (2, "#E69F00"), (4, "#009E73")):
    label = f"{1e3 * places[k][0]:.0f} mm"
    ax.plot(1e3 * times, 1e6 * measured.values[0, :, k], ".", ms=3, color=colour)
    ax.plot(1e3 * times, 1e6 * fitted[:, k], color=colour, label=label)
ax.set(xlabel="time, ms", ylabel="displacement, µm", xlim=(100, 140), ylim=(-1.2, 4.2))
ax.legend(title="dots measured, lines fitted", ncols=3, loc="upper center")

# %%
modulus = found.values[key]
print(f"shear modulus: {modulus / 1e3:.2f} kPa, gain {found.values['gain']:.3f}")
assert abs(modulus / 25e3 - 1) < 0.02
