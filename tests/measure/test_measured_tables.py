"""Tables as instruments and programs export them: frequency, amplitude and phase come back."""

import numpy as np
import pytest

from skinwave.measure.reading import read

RATE, COUNT, START = 10_000.0, 1200, -0.02
T = START + np.arange(COUNT) / RATE
TONE = 2.0 * np.sin(2 * np.pi * 140 * T + 0.3)  # mm/s, or what 1 stands for
OTHER = 0.5 * np.sin(2 * np.pi * 140 * T - 1.1)
MM_S = {"unit": "mm/s"}


def rows(*columns, sep=",", comma=False, tail="", digits="%.7g"):
    lines = [sep.join(digits % x for x in row) + tail for row in zip(*columns, strict=True)]
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


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
COUNTED = "".join(f"{k},{a:.6f},{b:.6f},,\n" for k, (a, b) in enumerate(zip(TONE, OTHER)))  # noqa: B905
SCOPY = ";Scopy version,48fb6a9\n;Device,M2K\n;Sample rate,10000\nSample,Time(S),CH1(V),CH2(V)\n"
SIGLENT = "Record Length,Analog:1200\nSample Interval,Analog:0.0001\nSource,CH1\nSecond,Volt\n"
TEKTRONIX = (
    "Model,TBS1102B\n\nHorizontal Units,S,\nSample Interval,0.0001,\n\nLabel,,\nTIME,CH1,CH2\n"
)
BESIDE = ["Record Length,1.2e+03,,", "Sample Interval,1e-04,,", "Horizontal Units,s,,"]
BOTH = MM_S | {"places": [(0.0, 0.0), (0.005, 0.0)]}
# Content of a file, options, and number of places.
TABLES = {
    "keysight": ("x-axis,1,2\nsecond,Volt,Volt\n" + TWO, BOTH, 2),
    "keysight, rate given": ("x-axis,1,2\nsecond,Volt,Volt\n" + TWO, BOTH | {"rate": RATE}, 2),
    "tektronix": (TEKTRONIX + TWO, BOTH, 2),
    "tektronix, rate given": ("TIME,CH1,CH2\n" + TWO, BOTH | {"rate": RATE}, 2),
    "tektronix, notes beside": (
        "".join((BESIDE[k] if k < 3 else ",,,") + row + ",\n"
                for k, row in enumerate(rows(T, TONE).splitlines())), MM_S, 1,
    ),
    "siglent": (SIGLENT + rows(T, TONE), MM_S, 1),
    "rigol": (
        "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-2.0e-02,1.0e-04\n" + COUNTED, BOTH, 2
    ),
    "rigol, start and step behind names": (
        "CH1V,CH2V,t0 =-2.0e-02, tInc = 1.0e-04,\n" + rows(TONE, OTHER, tail=",,"), BOTH, 2
    ),
    "scopy": (
        SCOPY + "".join(f"{k},{row}\n" for k, row in enumerate(TWO.splitlines())), BOTH, 2
    ),
    "picoscope": (
        "Time,Channel A,Channel B\n(ms),(mV),(mV)\n\n" + rows(1e3 * T, TONE, OTHER), BOTH, 2
    ),
    "german": ("Quelle:\tHandfläche.svd\n\n Zeit\tGeschwindigkeit\n[ s ]\t[ mm/s ]\n"
               + rows(T, TONE, sep="\t", comma=True), {}, 1),
    "latin-1": (("Zeit [s];Geschwindigkeit (Fläche) [mm/s]\n" + GERMAN).encode("cp1252"), {}, 1),
    "mark and french": (("Temps;Vitesse\n(s);(mm/s)\n" + GERMAN).encode("utf-8-sig"), {}, 1),
    "utf-16 without a mark": (("Zeit [s];v [mm/s]\n" + GERMAN).encode("utf-16-le"), {}, 1),
    "shift-jis": (("時間 [s];速度 [mm/s]\n" + GERMAN).encode("cp932"), {}, 1),
    "japanese": ("時間,速度\ns,mm/s\n" + rows(T, TONE), {}, 1),
    "name / unit": ("Time / s,Velocity / (mm/s)\n" + rows(T, TONE), {}, 1),
    "numpy's header": ("# t [s], v [mm/s]\n" + rows(T, TONE), {}, 1),
    "empty columns": ("t [s],v [mm/s],,\n" + rows(T, TONE, tail=",,"), {}, 1),
    "times twice": ("t1 [s],v1 [mm/s],t2 [s],v2 [mm/s]\n" + rows(T, TONE, T, OTHER), {}, 2),
    "count and temperature": ("No.,Time [ms],Velocity [mm/s],Temp [degC]\n" + "".join(
        f"{k},{row}\n" for k, row in enumerate(rows(1e3 * T, TONE, 0 * T).splitlines())), {}, 1),
    "no header": (TWO, MM_S | {"rate": RATE}, 2),
    "no header, ms": (rows(1e3 * T, TONE), MM_S | {"rate": RATE}, 1),
    "x and y": ("X;Y\n" + rows(T, TONE, sep=";"), MM_S | {"rate": RATE}, 1),
    "time last": ("a,zeitachse\n" + rows(TONE, T), MM_S | {"rate": RATE}, 1),
    "chosen by name": ("Time (s),A,B\n" + rows(T, OTHER, TONE), MM_S | {"columns": ["b"]}, 1),
    "chosen by number": ("Time (s),A,B\n" + rows(T, OTHER, TONE), MM_S | {"columns": ["3"]}, 1),
    "another unit given": (
        "t [s],v [m/s]\n" + rows(T, TONE), MM_S, 1
    ),
    "title in cells": ("My measurement,,\n\nt [s],v [mm/s],w [mm/s]\n" + TWO, {}, 2),
    "separator for a spreadsheet": ("sep=;\nZeit [s];v [mm/s]\n" + GERMAN, {}, 1),
    "decimal commas in quotes": ('"t [s]","v [mm/s]"\n' + "".join(
        '"{}","{}"\n'.format(*row.split(";")) for row in GERMAN.splitlines()), {}, 1),
    "full-width brackets": ("時間\uff08s\uff09,速度\uff08mm/s\uff09\n" + rows(T, TONE), {}, 1),
    "index of a data frame": (",t [s],v [mm/s]\n" + "".join(
        f"{k},{row}\n" for k, row in enumerate(rows(T, TONE).splitlines())), {}, 1),
    "samples from the trigger": (
        "".join(f"{k - 200},{a:.6f}\n" for k, a in enumerate(TONE)), MM_S | {"rate": RATE}, 1
    ),
    "uneven times, rate given": (
        rows(T + 3e-5 * np.sin(np.arange(COUNT) ** 2.0), TONE, digits="%.9g"),
        MM_S | {"rate": RATE}, 1,
    ),
    "direction chosen": ("Time (s),Velocity x (mm/s),Velocity z (mm/s)\n" + rows(T, OTHER, TONE),
                         {"direction": "z"}, 1),
    "quantity chosen": (
        "t [s],u [um],v [mm/s]\n" + rows(T, OTHER, TONE), {"quantity": "velocity"}, 1
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_table_of_an_instrument(tmp_path, name):
    content, given, places = TABLES[name]
    path = tmp_path / "a.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert_tone(read(path, **given), places)


@pytest.mark.parametrize(
    ("heads", "first"), [("time,CH1,CH2\ns,V,V", "CH1"), ("Time (s),1 (V),2 (V)", "1")]
)
def test_channels_in_volts_are_not_taken_as_places_of_motion(tmp_path, heads, first):
    path = tmp_path / "a.csv"
    path.write_text(f"{heads}\n{TWO}")
    with pytest.raises(ValueError, match="are channels in V, and one may be the drive; choose"):
        read(path, **MM_S)
    assert_tone(read(path, **MM_S, columns=[first]), 1)


def test_columns_without_a_unit_are_named_if_they_are_taken_as_places(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(f"TIME,CH1,CH2\n{TWO}")
    found = read(path, **MM_S, rate=RATE)
    assert_tone(found, 2)
    assert any("columns CH1, CH2 are taken as places; if one" in said for said in found.remarks)


# Tables without times before the first sample.
CLOCKED = {
    "clock": "timestamp,v [mm/s]\n" + "".join(
        f"{c},{a:.7g}\n" for c, a in zip(clock(T), TONE, strict=True)),
    "clock before noon": "time,v [mm/s]\n" + "".join(
        f"{c} AM,{a:.7g}\n" for c, a in zip(clock(T, "10:00:%09.6f"), TONE, strict=True)),
    "date and time in a cell": "Zeit;v [mm/s]\n" + "".join(
        f"05.01.2026 {c};{a:.7g}\n".replace(".", ",").replace("05,01,", "05.01.")
        for c, a in zip(clock(T, "10:00:%09.6f"), TONE, strict=True)),
    "iso clock": "time,v [mm/s]\n" + "".join(
        f"{c.replace(' ', 'T')}Z,{a:.7g}\n" for c, a in zip(clock(T), TONE, strict=True)),
    "date and time of day": "Datum;Uhrzeit;v [mm/s]\n" + "".join(
        f"05.01.2026;{c};{a:.7g}\n".replace(".", ",").replace("05,01,", "05.01.")
        for c, a in zip(clock(T, "10:00:%09.6f"), TONE, strict=True)),
    "clock of milliseconds, rate given": "time,v [mm/s]\n" + "".join(
        f"{c[:23]},{a:.7g}\n" for c, a in zip(clock(T), TONE, strict=True)),
    "seconds of an epoch": "t [s],v [mm/s]\n" + "".join(
        f"{1767607200 + x:.6f},{a:.7g}\n" for x, a in zip(T, TONE, strict=True)),
    "rate in the notes": "Operator: me\nSample Rate (kHz): 10\nUnit: mm/s\n\nCH1\n" + rows(TONE),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOCKED)
def test_table_of_clocks_and_of_no_times(tmp_path, name):
    (tmp_path / "a.csv").write_text(CLOCKED[name])
    given = {"rate": RATE} if name.endswith("rate given") else {}
    assert_tone(read(tmp_path / "a.csv", **given), first=0.0)


@pytest.mark.parametrize("shift", [0.0, 12.5, 150.0])
def test_times_of_seven_digits_are_even(tmp_path, shift):
    (tmp_path / "a.csv").write_text("t [s],v [mm/s]\n" + rows(T + shift, TONE))
    found = read(tmp_path / "a.csv")
    assert_tone(found, first=START + shift, tolerance=1e-2)
    assert np.ptp(np.diff(found.times)) < 1e-8


def gapped(first, last, value=None):
    """A table without the rows first to last, or with such a value in them."""
    lines = rows(T, TONE).splitlines()
    for k in range(first, last):
        lines[k] = None if value is None else f"{lines[k].split(',')[0]},{value}"
    return "t [s],v [mm/s]\n" + "\n".join(line for line in lines if line is not None)


@pytest.mark.parametrize("value", [None, "NaN", "", "--"])
@pytest.mark.parametrize("rate", [None, RATE])
def test_short_gaps_are_interpolated_at_their_times(tmp_path, value, rate):
    (tmp_path / "a.csv").write_text(gapped(500, 508, value))
    found = read(tmp_path / "a.csv", rate=rate)
    assert_tone(found)
    assert 1e3 * found.values[0, 500:508, 0] == pytest.approx(TONE[500:508], abs=0.02)
    assert any("8 samples are missing and interpolated" in said for said in found.remarks)


@pytest.mark.parametrize("rate", [None, RATE])
@pytest.mark.parametrize("last", [580, 700])
@pytest.mark.parametrize("value", [None, "NaN"])
def test_long_gaps_are_refused(tmp_path, last, value, rate):
    (tmp_path / "a.csv").write_text(gapped(500, last, value))
    with pytest.raises(ValueError, match="missing|lie between"):
        read(tmp_path / "a.csv", rate=rate)


@pytest.mark.parametrize("value", ["", "NaN"])
@pytest.mark.parametrize("places", [1, 2])
def test_gaps_without_times_keep_their_samples(tmp_path, value, places):
    """Of a line for each sample, an empty one is a sample that is missing."""
    lines = rows(*(TONE, OTHER)[:places]).splitlines()
    lines[500:504] = [",".join([value] * places)] * 4
    (tmp_path / "a.csv").write_text(
        "\n".join(["v [mm/s],w [mm/s]"[: 8 * places + 1].strip(","), *lines])
    )
    assert_tone(read(tmp_path / "a.csv", rate=RATE), places, first=0.0)


def test_a_motion_that_rises_evenly_beside_times_stays(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],a,b\n" + rows(T, TONE, 3 * T))
    found = read(tmp_path / "a.csv", unit="mm/s")
    assert 1e3 * found.values[0, :, 1] == pytest.approx(3 * T, abs=1e-6)
    assert any("rises evenly and is taken as motion" in said for said in found.remarks)


def test_polytec_spectrum_of_magnitude_and_phase(tmp_path):
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


def test_polytec_band_of_one_frequency(tmp_path):
    x, y = (k.ravel() * 5e-3 for k in np.mgrid[:4, :3])
    wave = 2e-3 * np.exp(-80j * x)
    text = "Band No.:\t1\nFrequency:\t140 Hz\n\nIndex\tX\tY\tZ\tReal\tImaginary\n"
    text += "\t[ m ]\t[ m ]\t[ m ]\t[ m/s ]\t[ m/s ]\n"
    text += rows(np.arange(1, 13), x, y, 0 * x, wave.real, wave.imag, sep="\t", digits="%.8g")
    (tmp_path / "a.txt").write_text(text)
    found = read(tmp_path / "a.txt")
    assert found.frequencies.tolist() == [140.0]
    assert found.places == pytest.approx(np.column_stack([x, y]))
    assert found.values[0, 0] == pytest.approx(wave, rel=1e-6)


# What would lose the times, or the size, of a motion.
REFUSED = {
    "channels at other times": (
        "t1 [s],v1 [mm/s],t2 [s],v2 [mm/s]\n" + rows(T, TONE, T + 1e-3, OTHER), {}, "differ, from"),
    "a clock of whole seconds": (
        "time,v [mm/s]\n" + "".join(f"{c[:19]},1\n" for c in clock(T)), {}, "repeat or fall"),
    "decimal commas between commas": (
        "t [s],v [mm/s]\n" + rows(T, TONE, comma=True), {}, "cells between"),
    "time without a unit": (TWO, MM_S, "no unit; write 't \\[s\\]', or give --rate"),
    "a count without a rate": ("Sample,v [mm/s]\n" + rows(np.arange(1200.0), TONE), {}, "--rate"),
    "times as text": (
        "time,v [mm/s]\n" + "".join(f"00:{a:.6f},1\n" for a in T + 0.02), {"rate": RATE},
        "holds text such as '00:0.000000'"),
    "units within cells": (
        "t,v\n" + "".join(f"{a:.6f} s,{b:.5f} mm/s\n" for a, b in zip(T, TONE, strict=True)),
        MM_S | {"rate": RATE}, "no number|holds text|no numbers"),
    "directions": ("t [s],X (mm/s),Y (mm/s)\n" + TWO, {}, "by --direction"),
    "time in metres": ("time [m],v [mm/s]\n" + rows(T, TONE), {}, "'m' is no unit of time"),
    "time and frequency": ("t [s],f [Hz],v [mm/s]\n" + TWO, {}, "of time and of frequency"),
    "volts and temperatures": ("t [s],A [V],Temp [degC]\n" + TWO, MM_S, "differ in unit: V, degC"),
    "an option of other formats": ("t [s],v [mm/s]\n" + TWO, {"variable": "v"}, "leave it out"),
    "voltages": ("t [s],CH1 [mV]\n" + rows(T, TONE), {}, "are in mV, and .* stands for 20 mm/s"),
    "magnitude alone": ("f [Hz],v [mm/s]\n" + rows(T + 1, TONE), {}, "or magnitude and phase"),
    "a channel that ends": (
        "t [s],v [mm/s],w [mm/s]\n" + rows(T[:600], TONE[:600], TONE[:600])
        + rows(T[600:], TONE[600:], tail=","), {}, "which ends early|lie between"),
    "beyond the range": (gapped(500, 502, "∞"), {}, "beyond the range"),
    "an unknown column": ("t [s],v [mm/s]\n" + rows(T, TONE), {"columns": ["w"]}, "columns are t"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_lost_times_and_sizes_are_refused(tmp_path, name):
    text, given, said = REFUSED[name]
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ValueError, match=said):
        read(tmp_path / "a.csv", **given)
