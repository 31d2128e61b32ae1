"""
Which sheet was measured?
=========================

Lim, Seifi and Park publish five claims about lines that they measured on a sheet of paper (M1 to
M5). They do not publish the sheet (size, support, tension, grammage, moduli), the five points,
the quantity of the vibrometer, or the drive law of the device. `examples/which_sheet.py` samples
all of these with a Latin hypercube and counts the candidates that show each claim. This page
computes a few. The full design has 2,000 candidates; the findings are those of its first 319, in
open air.

Findings
--------

====== ====================== =============================
claim  319 candidates         decided by (share of entropy)
====== ====================== =============================
M1     32 % (27 to 37 %)      drive law (78 %)
M2     100 %                  always holds
M3     77 % (72 to 81 %)      drive law (99 %)
M4     0.94 % (0.19 to 2.7 %) no parameter
M5     none (below 1.1 %)     never holds
====== ====================== =============================

**No sheet shows all five claims.** M1 needs a third harmonic, which only a clipped or compressed
drive has. M3 needs a mean pressure, which the linear law lacks. M5 requires the multiples of f_AM
and f_d below -20 dB. Of the 23 candidates with a sag below half the thickness none shows M4. With
air as in a baffle, 2,000 candidates gave the same shares within their intervals.

`paper-sheet` is a candidate beyond these 319, A6 of 107 g/m² in a frame under 49 and 15 N/m. With
the compressed drive, linear and in open air, it shows M1 to M4: the strongest rival of f_AM, f_d,
is 7.7 dB below it. At large deflection under the squared pressure it loses M4, because the
vibration stiffens it and moves its modes.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skinwave

sys.path.append(str(Path(skinwave.__file__).parents[1] / "examples"))
from which_sheet import LIMITS, assess, findings, holds, hypercube

small = [each for each in hypercube(200) if each["size"] == "A6"]
rows = [assess(each) for each in small[:6]]
print(findings(rows))

# %%
# The levels that decide M4 and M5.
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
part = 100 * np.arange(1, len(rows) + 1) / len(rows)
for column, words, bar, colour in (
    ("M4_value", "strongest rival of f_AM", 0.0, "#0072B2"),
    ("M5_value", "strongest multiple of f_AM or f_d", LIMITS.much_lower, "#D55E00"),
):
    ax.step(np.sort([row[column] for row in rows]), part, where="post", label=words, c=colour)
    ax.axvline(bar, color=colour, ls=":", label=f"{column[:2]} holds below {bar:g} dB")
ax.set(xlabel="level, dB re f_AM", ylabel="candidates below it, %", xlim=(-30, 60))
ax.legend(frameon=False)

# %%
# A line at f_d needs a pressure with a mean. All drive laws except the linear one have it.
has_mean = np.array([row["drive"] != "linear" for row in rows])
assert (holds(rows, "M3") == has_mean).all()
assert not holds(rows, "M5").any()
