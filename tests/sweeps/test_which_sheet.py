"""The example that asks which sheet was measured: its drive laws, its table, what it concludes."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "examples"))
import which_sheet
from which_sheet import fill, hypercube, information, nearest, share


def row_of(candidate):
    level = 1000 * candidate["loss_factor"] - 30
    values = {"M1": -40.0, "M2": 0.0, "M3": -30.0, "M4": level, "M5": level - 1}
    shown = dict.fromkeys(values, 1)
    shown |= {"M1": int(candidate["drive"] in ("clipped", "compressed")), "M4": int(level < 0)}
    return {
        **candidate, "sag_over_thickness": candidate["off_middle"] * 40,
        **{f"{claim}_{what}": of[claim] for claim in values
           for what, of in (("holds", shown), ("value", values))},
        "rival_line": "f_d",
    }  # fmt: skip


def test_only_devices_that_clip_or_compress_have_a_third_harmonic():
    M = np.sin(2 * np.pi * np.arange(4096) / 4096)
    for name, law in which_sheet.DRIVES.items():
        found = np.abs(np.fft.rfft(law(1.0, M, 0.8)))
        assert (found[3] > 1e-3 * found[1]) == (name in ("clipped", "compressed"))


def test_a_table_goes_on_and_refuses_other_candidates(tmp_path, monkeypatch):
    computed = []
    monkeypatch.setattr(which_sheet, "assess", lambda each: computed.append(each) or row_of(each))
    candidates = hypercube(6)
    first = fill(tmp_path / "table.csv", candidates[:4])
    rows = fill(tmp_path / "table.csv", candidates)
    assert computed == candidates
    assert rows[:4] == first
    assert rows[5]["loss_factor"] == candidates[5]["loss_factor"]
    with pytest.raises(ValueError, match="choose another"):
        fill(tmp_path / "table.csv", hypercube(6, seed=1))


def test_the_deciding_parameter_and_the_nearest_plausible_sheets():
    rows = [row_of(each) for each in hypercube(400)]
    m1, m4 = (which_sheet.holds(rows, claim) for claim in ("M1", "M4"))
    assert next(iter(information(rows, m1).items())) == ("drive", pytest.approx(1.0, abs=0.03))
    assert next(iter(information(rows, m4))) == "loss_factor"
    found = nearest(rows)
    assert found[0]["M1_holds"]
    assert found[0]["M4_value"] == min(r["M4_value"] for r in found if r["M1_holds"])
    assert max(row["sag_over_thickness"] for row in found) < 10
    # Clopper and Pearson: none of n is 0 to 1 - (alpha/2)^(1/n)
    assert share(np.zeros(2000, bool)) == f"0 % (0 to {100 * (1 - 0.025 ** (1 / 2000)):.2g} %)"
