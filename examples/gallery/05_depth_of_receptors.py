r"""
Strain at the depth of receptors
================================

Under a slow focus, the vertical strain of an incompressible half-space is zero at the surface. It
is largest at a depth of about the width of the focus. At wavenumber :math:`k` the compliance is
:math:`(1 + kz) e^{-kz} / 2 \mu k`. The strain below the middle of a Gaussian pressure is
therefore

.. math:: \varepsilon_{zz}(z) = -\frac{p \sigma^2 z}{2 \mu}
          \int_0^\infty k^2 e^{-kz - k^2 \sigma^2 / 2} \, dk
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import quad

from simple_model import MovingPressure, Tacton, lines
from simple_model.load.focus import spot_width
from skinwave import Body, Scene, simulate

load = MovingPressure(tacton=Tacton(am_frequency=1.0, duration=10.0))  # slow: no inertia
body = Body(kind="slab", material="palm", depth=np.inf, base="absorbing")
depths = 1e-3 * np.array([0.2, 0.7, 1.5, 2.0, 4.0, 6.0, 9.0, 13.0])  # m
scene = Scene(
    pressure=load, body=body, probes=((0.0, 0.0),) * len(depths),
    depth=tuple(depths), quantity="strain_zz",
)  # fmt: skip
times = np.arange(0, 10, 0.05)
strain = lines(simulate(scene, "flat-body-harmonic", 0.2, times=times), [1.0])[0]

# %%
# At 1 Hz the line of the squared drive has half of the peak pressure.
width, mu = spot_width(load.height), body.solid.shear_modulus


def closed_form(z):
    """Strain at a depth in metre, for a Gaussian pressure of 25 Pa."""
    return 25 * width**2 * z / (2 * mu) * quad(
        lambda k: k**2 * np.exp(-k * z - (k * width) ** 2 / 2), 0, 20 / width
    )[0]  # fmt: skip


expected = np.array([closed_form(z) for z in depths])
fine = np.linspace(1e-5, 14e-3, 100)
figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
ax.plot([1e6 * closed_form(z) for z in fine], 1e3 * fine, label="closed form, at rest")
ax.plot(1e6 * strain, 1e3 * depths, "o", label="wavenumber integral, 1 Hz")
for name, depth in {"Meissner": 0.7, "Pacini": 2.0}.items():
    ax.axhline(depth, color="0.6", ls=":")
    ax.annotate(name, (215, depth), va="bottom", ha="right")
ax.set(xlabel="vertical strain, µm/m", ylabel="depth, mm", ylim=(14, 0), xlim=(0, 220))
ax.legend(loc="lower right")

# %%
error = np.abs(strain / expected - 1).max()
print(f"largest relative error: {error:.1e}")
assert error < 0.01
