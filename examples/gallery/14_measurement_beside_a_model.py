"""
Compare a measurement with a model
==================================

The script writes a CSV file as an analyser exports it: velocity in mm/s at three places, with
noise, a delay of 1.2 ms and another gain. The lines of the load give delay and gain with standard
errors.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from simple_model import MovingPressure, Tacton
from simple_model.load.spectrum import synthesise
from skinwave import Body, Scene, simulate
from skinwave.measure.alignment import align
from skinwave.measure.lines import lines_of
from skinwave.measure.reading import read

places = ((0.0, 0.0), (0.005, 0.0), (0.010, 0.0))  # m
load = MovingPressure(tacton=Tacton(am_frequency=97, duration=0.3))
scene = Scene(
    pressure=load, body=Body(kind="slab", material="palm"), probes=places, quantity="velocity"
)
model = simulate(scene, "flat-body-harmonic", 0.2, times=np.arange(0, 0.3, 2e-4))

# %%
# The file has a column of times in s and one column for each place.
lines, late, gain = model.lines, 1.2e-3, 1.8
turned = np.exp(2j * np.pi * np.outer(model.times - late, lines.frequencies))
record = 1e3 * gain * (turned @ lines.amplitudes).real  # mm/s
record += np.random.default_rng(3).normal(size=record.shape) * 0.1 * record.std()
file = Path(tempfile.mkdtemp()) / "vibrometer.csv"
head = "time (s)," + ",".join(f"velocity {1e3 * x:g} mm (mm/s)" for x, _ in places)
np.savetxt(file, np.column_stack([model.times, record]), delimiter=",", header=head, comments="")

# %%
# Read the file, and align it by the lines of the load above 0 Hz.
measured = read(file, sign=1, places=places)
moving = lines.frequencies > 0
hertz, amplitudes = lines.frequencies[moving], lines.amplitudes[moving]
found = align(lines_of(measured, hertz), amplitudes, window=0.010)

fitted = synthesise(hertz, found.applied(hertz, amplitudes), measured.times)
figure, axes = plt.subplots(3, 1, figsize=(7, 4.6), sharex=True, layout="constrained")
for k, ax in enumerate(axes):
    ax.plot(1e3 * measured.times, 1e3 * measured.mean[:, k], ".", ms=3, label="measured")
    ax.plot(1e3 * measured.times, 1e3 * fitted[:, k], label="model, aligned")
    ax.set(xlim=(100, 150), title=f"{1e3 * places[k][0]:g} mm from the focus")
axes[1].set_ylabel("velocity into the body, mm/s")
axes[2].set_xlabel("time, ms")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)

# %%
print(f"delay {1e3 * found.delay:.4f} ± {1e3 * found.delay_error:.4f} ms, gain {found.gain:.3f}")
assert abs(found.delay - late) < 4 * found.delay_error < 1e-4
assert abs(found.gain / gain - 1) < 0.02
