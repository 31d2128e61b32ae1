"""
Which sheet was measured?
=========================

Lim, Seifi and Park publish five claims about lines that they measured on a sheet of paper (M1 to
M5). They do not publish the sheet (size, support, tension, grammage, moduli), the five points,
the quantity of the vibrometer, or the drive law of the device. `examples/which_sheet.py` samples
all of these with a Latin hypercube and counts the candidates that show each claim. This page
computes a few; the full design has 2,000 candidates and takes half an hour.

Findings of the full design
---------------------------

====== =================== ================================= =============================
claim  all 2,000           143 with a sag < thickness / 2    decided by (share of entropy)
====== =================== ================================= =============================
M1     34 % (32 to 36 %)   31 % (24 to 40 %)                 drive law (75 %)
M2     100 %               100 %                             always holds
M3     80 % (78 to 82 %)   75 % (67 to 82 %)                 drive law (100 %)
M4     1.5 % (1.0 to 2.1%) 5.6 % (2.4 to 11 %)               no parameter (drive law, 7 %)
M5     none (below 0.18 %) none (below 2.5 %)                never holds
====== =================== ================================= =============================

**No sheet shows all five claims.** M1 needs a third harmonic, which only a clipped or compressed
drive has. M3 needs a mean pressure, which the linear law lacks. The strongest line besides f_AM is
f_d - f_AM in 35 % of the candidates. In 82 % it occurs on the path of 30 mm. Its level relative to
f_AM is +20.4 dB in the median and at least -9.0 dB. M5 requires the multiples of f_AM and f_d
below -20 dB; the lowest value is -10.7 dB. If "much lower" means 10 dB, one candidate shows all
five claims; if it means 6 dB, three do. The drive law decides most. Every other single parameter,
including size and support, gives at most 0.01 bits of information.

The nearest sheets show M1 to M4: A3 of 109 g/m² in a frame, A6 of 107 g/m² in a frame, and A3 of
106 g/m² clamped at its short edges. At large deflection (`fem-nonlinear`) the first two lose M4,
because the vibration stiffens them and moves their modes away from f_AM.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skinwave

sys.path.append(str(Path(skinwave.__file__).parents[1] / "examples"))
from which_sheet import MUCH_LOWER, assess, findings, holds, hypercube

small = [each for each in hypercube(200) if each["size"] == "A6"]
rows = [assess(each) for each in small[:6]]
print(findings(rows))

# %%
# The levels that decide M4 and M5.
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
part = 100 * np.arange(1, len(rows) + 1) / len(rows)
for column, words, bar, colour in (
    ("M4_value", "strongest rival of f_AM", 0.0, "#0072B2"),
    ("M5_value", "strongest multiple of f_AM or f_d", MUCH_LOWER, "#D55E00"),
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
