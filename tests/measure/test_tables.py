"""Tables as instruments and programs export them: frequency, amplitude and phase come back."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from skinwave.measure.reading import parse_places, read
from skinwave.system.text_table import parse_table

RATE, COUNT, START = 10_000.0, 1200, -0.02
T = START + np.arange(COUNT) / RATE
UNEVEN = T + 3e-5 * np.sin(np.arange(COUNT) ** 2.0)
TONE = 2.0 * np.sin(2 * np.pi * 140 * T + 0.3)  # mm/s, or what 1 stands for
OTHER = 0.5 * np.sin(2 * np.pi * 140 * T - 1.1)
MM_S = {"unit": "mm/s"}
SCOPY = ";Scopy version,48fb6a9\n;Device,M2K\n;Sample rate,10000\nSample,Time(S),CH1(V),CH2(V)\n"
SIGLENT = "Record Length,Analog:1200\nSample Interval,Analog:0.0001\nSource,CH1\nSecond,Volt\n"
TEKTRONIX = "Model,T\n\nHorizontal Units,S,\nSample Interval,0.0001,\n\nLabel,,\nTIME,CH1,CH2\n"
RIGOL = "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-2.0e-02,1.0e-04\n"
BESIDE = ["Record Length,1.2e+03,,", "Sample Interval,1e-04,,", "Horizontal Units,s,,"]
BOTH = MM_S | {"places": [(0.0, 0.0), (0.005, 0.0)]}
TWO_BY_TWO = [[[0.0015, 0.002], [0.003, 0.004]]]  # m/s
HEADERS = (
    "t [s] v(0,0) [mm/s] v(5,0) [mm/s]\n0 1.5 2\n0.5 3 4\n",
    "Time (s);Left (mm/s);Right (mm/s)\n0,0;1,5;2\n0,5;3;4\n",
    '# note\n"t [s]","v(0,0) [m/s]","v(5,0) [m/s]"\n"0","0.0015","0.002"\n0.5,0.003,"0.004"\n',
    "t_ms,velocity_mm_s,velocity_mm_s\n0,1.5,2\n# a pause\n500,3,4\n",
    "t [s],x [mm],y [mm],v [mm/s]\n0,0,0,1.5\n0.5,0,0,3\n0.5,5,0,4\n0,5,0,2\n",
)


def rows(*columns, sep=",", comma=False, tail="", digits="%.7g"):
    lines = [sep.join(digits % x for x in row) + tail for row in zip(*columns, strict=True)]
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


def numbered(text):
    return "".join(f"{k},{row}\n" for k, row in enumerate(text.splitlines()))


def amplitude(found, place=0):
    """Complex amplitude in mm/s of the line at 140 Hz, of the phase at the time 0."""
    arm = np.exp(2j * np.pi * 140 * found.times)
    basis = np.column_stack([arm.real, -arm.imag])
    fitted = np.linalg.lstsq(basis, 1e3 * found.values[0, :, place], rcond=None)[0]
    return complex(*fitted)


def assert_tone(found, places=1, first=START, tolerance=1e-3):
    """A sine of 2 mm/s and 0.3 rad; the second place has 0.5 mm/s and -1.1 rad."""
    assert found.quantity == "velocity"
    assert found.values.shape == (1, COUNT, places)
    assert found.rate == pytest.approx(RATE, rel=1e-6)
    assert found.times[0] == pytest.approx(first, abs=1e-7)
    turn = np.exp(2j * np.pi * 140 * (START - first))
    assert amplitude(found) == pytest.approx(-2j * np.exp(0.3j) * turn, abs=tolerance)
    if places == 2:
        assert amplitude(found, 1) == pytest.approx(-0.5j * np.exp(-1.1j) * turn, abs=tolerance)


def clock(t, text="2026-01-05 10:00:%09.6f"):
    return [text % x for x in t - START]


TWO = rows(T, TONE, OTHER)
GERMAN = rows(T, TONE, sep=";", comma=True)
# Content of a file, options, and number of places.
TABLES = {
    "keysight": ("x-axis,1,2\nsecond,Volt,Volt\n" + TWO, BOTH | {"rate": RATE}, 2),
    "tektronix": (TEKTRONIX + TWO, BOTH, 2),
    "tektronix, notes beside": (
        "".join((BESIDE[k] if k < 3 else ",,,") + row + ",\n"
                for k, row in enumerate(rows(T, TONE).splitlines())), MM_S, 1,
    ),
    "siglent": (SIGLENT + rows(T, TONE), MM_S, 1),
    "rigol": (RIGOL + numbered(rows(TONE, OTHER, tail=",,")), BOTH, 2),
    "rigol, start and step behind names": (
        "CH1V,CH2V,t0 =-2.0e-02, tInc = 1.0e-04,\n" + rows(TONE, OTHER, tail=",,"), BOTH, 2
    ),
    "scopy": (SCOPY + numbered(TWO), BOTH, 2),
    "picoscope": (
        "Time,Channel A,Channel B\n(ms),(mV),(mV)\n\n" + rows(1e3 * T, TONE, OTHER), BOTH, 2
    ),
    "german": ("Quelle:\tHandfläche.svd\n\n Zeit\tGeschwindigkeit\n[ s ]\t[ mm/s ]\n"
               + rows(T, TONE, sep="\t", comma=True), {}, 1),
    "mark and french": (("Temps;Vitesse\n(s);(mm/s)\n" + GERMAN).encode("utf-8-sig"), {}, 1),
    "utf-16 without a mark": (("Zeit [s];v [mm/s]\n" + GERMAN).encode("utf-16-le"), {}, 1),
    "shift-jis": (("時間 [s];速度 [mm/s]\n" + GERMAN).encode("cp932"), {}, 1),
    "name / unit": ("Time / s,Velocity / (mm/s)\n" + rows(T, TONE), {}, 1),
    "numpy's header": ("# t [s], v [mm/s]\n" + rows(T, TONE), {}, 1),
    "times twice": ("t1 [s],v1 [mm/s],t2 [s],v2 [mm/s]\n" + rows(T, TONE, T, OTHER), {}, 2),
    "count and temperature": (
        "No.,Time [ms],Velocity [mm/s],Temp [degC]\n" + numbered(rows(1e3 * T, TONE, 0 * T)), {}, 1
    ),
    "no header": (TWO, MM_S | {"rate": RATE}, 2),
    "time last, chosen by name": (
        "A,b,zeitachse\n" + rows(OTHER, TONE, T), MM_S | {"columns": ["b"], "rate": RATE}, 1
    ),
    "title in cells": ("My measurement,,\n\nt [s],v [mm/s],w [mm/s]\n" + TWO, {}, 2),
    "decimal commas in quotes": ('sep=,\n"t [s]","v [mm/s]"\n' + "".join(
        '"{}","{}"\n'.format(*row.split(";")) for row in GERMAN.splitlines()), {}, 1),
    "index of a data frame": (",t [s],v [mm/s]\n" + numbered(rows(T, TONE)), {}, 1),
    "uneven times, rate given": (rows(UNEVEN, TONE, digits="%.9g"), MM_S | {"rate": RATE}, 1),
    "quantity chosen": (
        "t [s],u [um],v [mm/s]\n" + rows(T, OTHER, TONE), {"quantity": "velocity"}, 1
    ),
}  # fmt: skip


def test_tables_of_instruments(tmp_path):
    for name, (content, given, places) in TABLES.items():
        path = tmp_path / f"{name.replace('/', ' ')}.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        assert_tone(read(path, **given), places)


# Tables without times before the first sample.
CLOCKED = {
    "clock": "timestamp,v [mm/s]\n" + "".join(
        f"{c},{a:.7g}\n" for c, a in zip(clock(T), TONE, strict=True)),
    "date and time of day": "Datum;Uhrzeit;v [mm/s]\n" + "".join(
        f"05.01.2026;{c};{a:.7g}\n".replace(".", ",").replace("05,01,", "05.01.")
        for c, a in zip(clock(T, "10:00:%09.6f"), TONE, strict=True)),
    "seconds of an epoch": "t [s],v [mm/s]\n" + "".join(
        f"{1767607200 + x:.6f},{a:.7g}\n" for x, a in zip(T, TONE, strict=True)),
    "rate in the notes": "Operator: me\nSample Rate (kHz): 10\nUnit: mm/s\n\nCH1\n" + rows(TONE),
}  # fmt: skip


def test_tables_of_clocks_and_of_no_times(tmp_path):
    for name, text in CLOCKED.items():
        (tmp_path / f"{name}.csv").write_text(text)
        assert_tone(read(tmp_path / f"{name}.csv"), first=0.0)


@pytest.mark.parametrize("hour", [9, 23])
def test_clocks_go_on_after_a_full_hour_and_after_midnight(hour):
    times = 0.025 * np.arange(40)
    first = datetime(2026, 1, 5, hour, 59, 59, 500_000)
    rows = (f"{(first + timedelta(seconds=t)).isoformat(timespec='microseconds')},1" for t in times)
    table = parse_table("\n".join(["time,v [mm/s]", *rows]), "")
    np.testing.assert_allclose(table.numbers[:, 0], times, atol=1e-9)


def test_a_given_rate_counts_the_samples_before_the_first_too(tmp_path):
    rows = "".join(f"{2 + k / 1e3:.3f},{k % 7}\n" for k in range(100))
    (tmp_path / "a.csv").write_text(f"time [s],v [mm/s]\n{rows}")
    found = read(tmp_path / "a.csv", rate=500.0)
    np.testing.assert_allclose(found.times[[0, -1]], [4.0, 4.198])


def test_channels_in_volts_are_not_taken_as_places_of_motion(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(f"time,CH1,CH2\ns,V,V\n{TWO}")
    with pytest.raises(ValueError, match="--columns"):
        read(path, **MM_S)
    assert_tone(read(path, **MM_S, columns=["CH1"]), 1)


def test_times_of_seven_digits_are_even(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],v [mm/s]\n" + rows(T + 150, TONE))
    found = read(tmp_path / "a.csv")
    assert_tone(found, first=START + 150, tolerance=1e-2)
    assert np.ptp(np.diff(found.times)) < 1e-8


def gapped(first, last, value=None):
    """A table without the rows first to last, or with such a value in them."""
    lines = rows(T, TONE).splitlines()
    for k in range(first, last):
        lines[k] = None if value is None else f"{lines[k].split(',')[0]},{value}"
    return "t [s],v [mm/s]\n" + "\n".join(line for line in lines if line is not None)


@pytest.mark.parametrize(("value", "rate"), [(None, None), ("NaN", RATE)])
def test_short_gaps_are_interpolated_at_their_times_and_long_ones_refused(tmp_path, value, rate):
    (tmp_path / "a.csv").write_text(gapped(500, 508, value))
    found = read(tmp_path / "a.csv", rate=rate)
    assert_tone(found)
    assert 1e3 * found.values[0, 500:508, 0] == pytest.approx(TONE[500:508], abs=0.02)
    assert any("8 samples are missing and interpolated" in said for said in found.remarks)
    for last in (580, 700):
        (tmp_path / "b.csv").write_text(gapped(500, last, value))
        with pytest.raises(ValueError, match="missing|lie between"):
            read(tmp_path / "b.csv", rate=rate)


def test_gaps_without_times_keep_their_samples(tmp_path):
    lines = rows(TONE, OTHER).splitlines()
    lines[500:504] = [","] * 4
    (tmp_path / "a.csv").write_text("\n".join(["v [mm/s],w [mm/s]", *lines]))
    assert_tone(read(tmp_path / "a.csv", rate=RATE), 2, first=0.0)


def test_a_motion_that_rises_evenly_beside_times_stays(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],a,b\n" + rows(T, TONE, 3 * T))
    found = read(tmp_path / "a.csv", unit="mm/s")
    assert 1e3 * found.values[0, :, 1] == pytest.approx(3 * T, abs=1e-6)


def test_spectra_and_bands_of_a_scanning_vibrometer(tmp_path):
    f = np.arange(0, 1000, 5.0)
    magnitude = 2e-3 * np.exp(-(((f - 140) / 8) ** 2))
    text = "Point Index:\t17\nSignal:\tFFT - Vib Velocity - Magnitude & Phase\n\n"
    text += " Frequency\tMagnitude\tPhase\n[ Hz ]\t[ m/s ]\t[ ° ]\n"
    text += rows(f, magnitude, np.full_like(f, -30.0), sep="\t", digits="%.6E")
    (tmp_path / "a.txt").write_bytes(text.encode("cp1252"))
    found = read(tmp_path / "a.txt")
    assert found.quantity == "velocity"
    assert found.frequencies == pytest.approx(f)
    assert found.values[0, :, 0] == pytest.approx(magnitude * np.exp(-1j * np.pi / 6), abs=1e-9)
    x, y = (k.ravel() * 5e-3 for k in np.mgrid[:4, :3])
    wave = 2e-3 * np.exp(-80j * x)
    text = "Band No.:\t1\nFrequency:\t140 Hz\n\nIndex\tX\tY\tZ\tReal\tImaginary\n"
    text += "\t[ m ]\t[ m ]\t[ m ]\t[ m/s ]\t[ m/s ]\n"
    text += rows(np.arange(1, 13), x, y, 0 * x, wave.real, wave.imag, sep="\t", digits="%.8g")
    (tmp_path / "b.txt").write_text(text)
    found = read(tmp_path / "b.txt")
    assert found.frequencies.tolist() == [140.0]
    assert found.places == pytest.approx(np.column_stack([x, y]))
    assert found.values[0, 0] == pytest.approx(wave, rel=1e-6)


# What would lose the times, or the size, of a motion.
REFUSED = {
    "channels at other times": (
        "t1 [s],v1 [mm/s],t2 [s],v2 [mm/s]\n" + rows(T, TONE, T + 1e-3, OTHER), {}),
    "a clock of whole seconds": (
        "time,v [mm/s]\n" + "".join(f"{c[:19]},1\n" for c in clock(T)), {}),
    "decimal commas between commas": ("t [s],v [mm/s]\n" + rows(T, TONE, comma=True), {}),
    "time without a unit": (TWO, MM_S),
    "a count without a rate": ("Sample,v [mm/s]\n" + rows(np.arange(1200.0), TONE), {}),
    "times as text": (
        "time,v [mm/s]\n" + "".join(f"00:{a:.6f},1\n" for a in T + 0.02), {"rate": RATE}),
    "directions": ("t [s],X (mm/s),Y (mm/s)\n" + TWO, {}),
    "time in metres": ("time [m],v [mm/s]\n" + rows(T, TONE), {}),
    "volts and temperatures": ("t [s],A [V],Temp [degC]\n" + TWO, MM_S),
    "an option of other formats": ("t [s],v [mm/s]\n" + TWO, {"variable": "v"}),
    "voltages": ("t [s],CH1 [mV]\n" + rows(T, TONE), {}),
    "beyond the range": (gapped(500, 502, "∞"), {}),
}  # fmt: skip


def test_lost_times_and_sizes_are_refused(tmp_path):
    for name, (text, given) in REFUSED.items():
        (tmp_path / f"{name}.csv").write_text(text)
        with pytest.raises(ValueError, match=r"\.csv: "):
            read(tmp_path / f"{name}.csv", **given)


def test_headers_of_many_programs(tmp_path):
    for text in HEADERS:
        (tmp_path / "a.txt").write_text(text)
        found = read(tmp_path / "a.txt")
        assert found.quantity == "velocity"
        assert found.values.tolist() == TWO_BY_TWO
        assert found.times.tolist() == [0, 0.5]


def test_a_rate_that_holds_no_vibration_and_a_place_without_a_signal_are_said(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],v(0,0) [mm/s],v(5,0) [mm/s]\n" + rows(T, TONE, 0 * T + 0.003))
    assert any("place 2 has the same value throughout" in said for said in read(path).remarks)
    path.write_text("t [s],v(0,0) [mm/s]\n" + rows(T * RATE, TONE))
    assert any("samples at 1 Hz show no vibration" in said for said in read(path).remarks)


def test_places_are_pairs_in_millimetre(tmp_path):
    heads = ("x [mm],y [mm]\n0,0\n5,-2.5\n", "0 0\n5 -2.5\n", "x_m,y_m,z_m\n0,0,1\n.005,-.0025,1")
    for text in heads:
        (tmp_path / "a.csv").write_text(text)
        assert np.array_equal(parse_places(str(tmp_path / "a.csv")), [[0, 0], [0.005, -0.0025]])
    (tmp_path / "a.csv").write_text("x [mm],z [mm]\n0,0\n")
    assert np.array_equal(parse_places("0,0 (5,-2.5)"), [[0, 0], [0.005, -0.0025]])
    for wrong in (str(tmp_path / "a.csv"), "", "5", "a,b", "1,2,3", "nan,0"):
        with pytest.raises(ValueError, match="mm"):
            parse_places(wrong)
