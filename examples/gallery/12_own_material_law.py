r"""
A modulus law of your own
=========================

A material can have any passive and causal complex modulus, as a function of angular frequency. In
the steady state, a line depends only on the modulus at its own frequency. A Kelvin-Voigt solid
with the same modulus at 140 Hz gives the same motion at 140 Hz, and a different one at 280 Hz.
"""

import matplotlib.pyplot as plt
import numpy as np

from simple_model import Material, MovingPressure, Tacton, lines
from skinwave import Body, Scene, simulate


def springpot(w):
    """Complex shear modulus in Pa of a spring and a springpot in parallel."""
    return 15e3 * (1 + (1e-3j * w) ** 0.4)


w = 2 * np.pi * 140
gel = Material(density=1000, poisson=0.49, shear_modulus=15e3, law=springpot)
twin = Material(
    density=1000, poisson=0.49, shear_modulus=springpot(w).real, viscosity=springpot(w).imag / w
)
load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.2))
probes = tuple((1e-3 * x, 0.0) for x in range(0, 31, 2))  # m

found, times = {}, np.arange(0, 0.2, 5e-4)
for name, material in {"springpot": gel, "Kelvin-Voigt": twin}.items():
    body = Body(kind="slab", material=material, sides="absorbing")
    scene = Scene(pressure=load, body=body, probes=probes)
    waves = simulate(scene, "flat-body-harmonic", 0.2, times=times)
    found[name] = lines(waves, [140.0, 280.0])

figure, ax = plt.subplots(figsize=(7, 3.8), layout="constrained")
for name, style in {"springpot": "o", "Kelvin-Voigt": "-"}.items():
    for k, (hertz, colour) in enumerate(((140, "#0072B2"), (280, "#D55E00"))):
        away = [1e3 * x for x, _ in probes]
        ax.semilogy(away, 1e6 * found[name][k], style, color=colour, label=f"{name}, {hertz} Hz")
ax.set(xlabel="distance from the focus, mm", ylabel="amplitude, µm")
ax.legend(ncols=2)

# %%
same = np.abs(found["springpot"][0] / found["Kelvin-Voigt"][0] - 1).max()
print(f"largest difference at 140 Hz: {same:.1e}")
assert same < 1e-4
