"""Quantities as exporters write them: levels, units, counts, and the signs of excitations."""

import re
import struct
from dataclasses import replace

import measurement_files as files
import numpy as np
import pytest
import pyuff
from scipy.io import savemat, wavfile
from test_tables import COUNT, RATE, TONE, T, assert_tone, rows

from skinwave.measure.lines import lines_of
from skinwave.measure.reading import read
from skinwave.system.headings import parse_heading
from skinwave.system.units import motion_divisor, quantity_of, split_level

F = np.arange(100.0, 200.0, 5.0)
H = 4.0 / (1 + np.abs(F - 140) / 10) * -1j  # 4 at 140 Hz
PEAK, RMS, HALF = 4.0, 4.0 * 2**0.5, 2.0  # amplitudes of a level of 4
SPECTRUM = rows(F, np.abs(H), np.degrees(np.angle(H)))
GERMAN = rows(F, np.abs(H), np.degrees(np.angle(H)), sep=";", comma=True)
# Heading, options, amplitude at 140 Hz, and its unit in SI.
LEVELS = {
    "f [Hz],Velocity RMS [mm/s],Phase [deg]\n": ({}, RMS, 1e-3),
    "f [Hz],Displacement p-p [um],Phase [deg]\n": ({}, HALF, 1e-6),
    "f [Hz],Peak-to-Peak Displacement (um),Phase (deg)\n": ({}, HALF, 1e-6),
    "Frequency,Magnitude,Phase\nHz,m/s (rms),deg\n": ({}, RMS, 1.0),
    "Frequency,Magnitude,Phase\n[Hz],[um pk-pk],[deg]\n": ({}, HALF, 1e-6),
    "f_hz,v_rms_mm_s,phase_deg\n": ({}, RMS, 1e-3),
    "f [Hz],Acc [g rms],Phase [deg]\n": ({}, RMS, 9.80665),
    "f [Hz],Disp [mil pp],Phase [deg]\n": ({}, HALF, 25.4e-6),
    "f [Hz],Vel (ips pk),Phase [deg]\n": ({}, PEAK, 25.4e-3),
    "# Scaling: Peak-Peak\nf [Hz],abs u [um],phase u [deg]\n": ({}, HALF, 1e-6),
    "RMS spectrum of a palm\nf [Hz],abs u [um],phase u [deg]\n": ({}, RMS, 1e-6),
    "# Averaging: RMS\nf [Hz],abs u [um],phase u [deg]\n": ({}, PEAK, 1e-6),
    "f [Hz],Velocity RMS,Phase [deg]\n": ({"unit": "mm/s"}, RMS, 1e-3),
    "f [Hz],Velocity [mm/s],Phase [deg]\n": ({"unit": "mm/s rms"}, RMS, 1e-3),
    "f [Hz],Vel. RMS [mm/s],Phase [deg]\n": ({"unit": "mm/s peak"}, PEAK, 1e-3),
    "f [Hz],abs H rms [(mm/s)/N],phase H [deg]\n": ({}, PEAK, 1e-3),
    "Frequenz [Hz];Schnelle Effektivwert [mm/s];Phase [°]\n": ({}, RMS, 1e-3),
    "Frequenz [Hz];Weg Spitze-Spitze [µm];Phase [°]\n": ({}, HALF, 1e-6),
}
WHOLE = np.rint(TONE * 400).astype(np.int16)  # 0.0025 mm/s each
TIMED = rows(T, TONE)
LEVEL = rows(T, np.abs(TONE))
# Table, options, and what its refusal names.
REFUSED = [
    ("t [s],Velocity RMS [mm/s]\n" + LEVEL, {}, "not a waveform"),
    ("Zeit [s],Veff [mm/s]\n" + LEVEL, {}, "not a waveform"),
    ("t [s],v [mm/s],v RMS [mm/s]\n" + rows(T, TONE, abs(TONE)), {}, "--columns"),
    ("f [Hz],PSD [(mm/s)^2/Hz]\n" + rows(F, F), {"unit": "mm/s"}, "density"),
    ("f [Hz],abs v [g²/Hz],phase v [deg]\n" + SPECTRUM, {"unit": "g"}, "density"),
    ("f [Hz],Magnitude [dB],Phase [deg]\n" + SPECTRUM, {"unit": "mm/s"}, "'dB'"),
    ("f [Hz],Level [dB re 1e-9 m/s],Phase [deg]\n" + SPECTRUM, {"unit": "mm/s"}, "linear"),
    ("f [Hz],palm:+Z/force:+X [(mm/s)/N],phase [deg]\n" + SPECTRUM, {}, "--positive"),
    ("f [Hz],Vel/Force-Z [(mm/s)/N],phase [deg]\n" + SPECTRUM, {}, "--positive"),
    ("# scale factor: 0.0025\nt [s],v [mm/s]\n" + rows(T, WHOLE), {}, '--unit "0.0025 mm/s"'),
]  # fmt: skip


def at_140(found):
    return found.values[0, np.abs(found.frequencies - 140).argmin()]


def test_levels_in_headings_units_and_notes_give_amplitudes(tmp_path):
    for head, (given, level, unit) in LEVELS.items():
        (tmp_path / "a.csv").write_text(head + (GERMAN if ";" in head else SPECTRUM))
        found = read(tmp_path / "a.csv", **given)
        assert at_140(found) == pytest.approx(-1j * level * unit, rel=1e-6), head
        is_noted = any("which gives amplitudes" in remark for remark in found.remarks)
        assert is_noted == (level != PEAK), head


def test_what_is_no_waveform_or_spectrum_is_refused(tmp_path):
    for text, given, named in REFUSED:
        (tmp_path / "a.csv").write_text(text)
        with pytest.raises(ValueError, match=re.escape(named)):
            read(tmp_path / "a.csv", **given)
    (tmp_path / "a.csv").write_text("t [s],v [mm/s rms],RMS [mm/s]\n" + rows(T, TONE, abs(TONE)))
    assert_tone(read(tmp_path / "a.csv", columns=["v"], unit="mm/s peak"))
    (tmp_path / "a.csv").write_text("# scale factor: 0.0025\nt [s],v [mm/s]\n" + rows(T, WHOLE))
    assert_tone(read(tmp_path / "a.csv", unit="0.0025 mm/s"), tolerance=2e-3)


def test_signed_axes_of_motion_and_force_in_headings_give_the_sign(tmp_path):
    for heading, sign in {"H(1+Z,2-Z)": -1, "palm:+Z/force:+Z": 1, "palm Z-/Z-": 1}.items():
        (tmp_path / "a.csv").write_text(f"f [Hz],abs {heading} [(mm/s)/N],phase [deg]\n{SPECTRUM}")
        found = read(tmp_path / "a.csv")
        assert at_140(found) == pytest.approx(-4e-3j * sign)
        assert not any("gives no sign" in remark for remark in found.remarks)


def test_units_of_inches_and_their_levels():
    for unit, quantity, per in (
        ("in/s", "velocity", 1 / 0.0254), ("ips", "velocity", 1 / 0.0254),
        ("mils", "displacement", 1 / 25.4e-6), ("µin", "displacement", 1 / 25.4e-9),
        ("inch/sec^2", "acceleration", 1 / 0.0254), ("ft/s²", "acceleration", 1 / 0.3048),
        ("mil p-p", "displacement", 1 / 25.4e-6), ("grms", "acceleration", 1 / 9.80665),
    ):  # fmt: skip
        assert quantity_of(unit) == quantity, unit
        assert motion_divisor(unit, quantity) == pytest.approx(per, rel=1e-14), unit
    assert parse_heading("Re(v) [mm/s]") == replace(
        parse_heading("re v [mm/s]"), text="Re v [mm/s]"
    )
    for text in ("Phase [deg]", "speed [mm/s]", "upper [um]", "Temps [s]", "coeff", "palm p 3"):
        assert split_level(text) == (text, "")


def test_counts_are_refused_by_the_name_of_their_factor(tmp_path):
    kept = {"fs": RATE, "t0": T[0], "unit": "mm/s"}
    savemat(tmp_path / "a.mat", {"rec": {"v": WHOLE, "calibration_factor": 0.0025, **kept}})
    np.savez(tmp_path / "a.npz", v=WHOLE, scale=0.0025, **kept)
    for name in ("a.mat", "a.npz"):
        with pytest.raises(ValueError, match=r'(scale|calibration_factor).*--unit "0.0025 mm/s"'):
            read(tmp_path / name)
        assert_tone(read(tmp_path / name, unit="0.0025 mm/s"), tolerance=2e-3)
    np.savez(tmp_path / "b.npz", v=np.column_stack([WHOLE, WHOLE]), gain=[0.1, 0.2], **kept)
    with pytest.raises(ValueError, match="'gain' has several"):
        read(tmp_path / "b.npz")
    wavfile.write(tmp_path / "a.wav", int(RATE), WHOLE)
    assert "1 is full scale, 32,768 counts" in read(tmp_path / "a.wav", unit="mm/s").remarks
    comment = b"ICMT" + struct.pack("<I", 20) + b"scale=0.0025 mm/s\0\0\0"
    with (tmp_path / "a.wav").open("ab") as file:
        file.write(b"LIST" + struct.pack("<I", len(comment) + 4) + b"INFO" + comment)
    with pytest.raises(ValueError, match="scale=0.0025"):
        read(tmp_path / "a.wav", unit="mm/s")


def response(path, values, **changes):
    """A set 58 of a frequency response in (mm/s)/N at a driving point along +z."""
    kept = {
        "binary": 0, "func_type": 4, "rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3,
        "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "id1": "palm", "data": values, "x": F,
        "abscissa_spacing": 0, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": 11,
        "orddenom_spec_data_type": 13, "ordinate_axis_units_lab": "mm/s",
        "orddenom_axis_units_lab": "N",
    }  # fmt: skip
    return files.write_uff(path, [pyuff.prepare_58(**kept | changes)])


def sdynpy(path, values, x, kind, *places, **given):
    """Functions as SDynPy saves them, each with the (node, direction) of its ends."""
    form = [("abscissa", "f8", len(x)), ("ordinate", values.dtype, len(x)), ("comment1", "<U80"),
            ("coordinate", [("node", "u8"), ("direction", "i1")], len(places[0]))]  # fmt: skip
    data = np.zeros((len(places), 1), form)
    data["abscissa"], data["ordinate"] = x, values
    for one, ends in zip(data.ravel(), places, strict=True):
        one["coordinate"][:] = ends
    np.savez(path, data=data, function_type=kind)
    return read(path, unit="mm/s", **given)


def test_motion_and_excitation_into_the_body_have_the_same_sign(tmp_path):
    """Both directions along one axis: their product is the sign, whatever is out of the body."""
    mobility = np.abs(H) + 0j  # a driving point takes energy
    for at, by in ((3, 3), (3, -3), (-3, 3), (-3, -3)):
        sign = np.sign(at * by)
        found = read(response(tmp_path / "a.uff", mobility * sign, rsp_dir=at, ref_dir=by))
        assert at_140(found) == pytest.approx(4e-3)
        assert not any("energy" in remark for remark in found.remarks)
        found = sdynpy(tmp_path / "a.npz", mobility * sign, F, 4, [(1, at), (1, by)])
        assert at_140(found) == pytest.approx(4e-3)
    for given in ({}, {"ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "um"}):
        turn = -1j if given else 1  # of a displacement
        for sign in (1, -1):
            path = response(tmp_path / "b.uff", sign * turn * mobility, **given)
            assert any("gives energy" in said for said in read(path).remarks) == (sign < 0)


def test_excitations_along_another_axis_are_refused_or_left_out(tmp_path):
    with pytest.raises(ValueError, match="different axes"):
        read(response(tmp_path / "a.uff", H, ref_dir=1))
    assert at_140(read(response(tmp_path / "a.uff", H, ref_dir=1), sign=-1)) == pytest.approx(4e-3j)
    found = sdynpy(tmp_path / "a.npz", H, F, 4, [(1, 3), (9, 1)], [(1, 3), (9, 3)])
    assert at_140(found) == pytest.approx(-4e-3j)
    with pytest.raises(ValueError, match="references 8, 9"):
        sdynpy(tmp_path / "b.npz", H, F, 4, [(1, 3), (9, 3)], [(1, 3), (8, 3)])
    impedance = {"ordinate_spec_data_type": 13, "ordinate_axis_units_lab": "N"}
    for given in ({}, {"unit": "mm/s"}):
        with pytest.raises(ValueError, match="export motion"):
            read(response(tmp_path / "b.uff", H, orddenom_spec_data_type=11, **impedance), **given)


def test_waveforms_of_sdynpy(tmp_path):
    found = sdynpy(tmp_path / "a.npz", TONE, T, 1, [(1, 3)], [(2, 3)], [(2, 1)], sign=1)
    assert found.values.shape == (1, COUNT, 2)
    assert_tone(sdynpy(tmp_path / "b.npz", TONE, T, 1, [(1, -1)], direction="x", sign=-1))


@pytest.mark.parametrize("per_line", [3, 4])
@pytest.mark.parametrize("letter", ["E", "D"])
def test_uneven_sets_58_in_columns_of_one_width(tmp_path, per_line, letter):
    """As two exporters write them: frequencies, too, in E20.12 instead of E13.5."""
    lines = response(tmp_path / "a.uff", H).read_text().splitlines()
    numbers = [f"{x:20.12E}" for x in np.column_stack([F, H.real, H.imag]).ravel()]
    parts = range(0, len(numbers), per_line)
    body = "\n".join("".join(numbers[k : k + per_line]) for k in parts).replace("E", letter)
    (tmp_path / "b.uff").write_text("\n".join([*lines[:13], body, lines[-1], ""]))
    found = read(tmp_path / "b.uff")
    assert found.frequencies == pytest.approx(F, rel=1e-12)
    assert found.values[0, :, 0] == pytest.approx(H / 1e3, rel=1e-12)
    (tmp_path / "c.uff").write_text("\n".join([*lines[:13], body[:-25], lines[-1], ""]))
    with pytest.raises(ValueError, match="export it again"):
        read(tmp_path / "c.uff")


def test_levels_of_universal_files(tmp_path):
    for given, wanted in (
        ({"ordinate_axis_units_lab": "mm/s rms"}, RMS), ({"id2": "Scaling: RMS"}, RMS),
        ({"id3": "Spectrum p-p"}, HALF), ({}, PEAK),
    ):  # fmt: skip
        path = response(tmp_path / "a.uff", H, orddenom_axis_units_lab="NONE", **given)
        path.write_text(path.read_text().replace("    4         0    0", "   12         0    0"))
        assert at_140(read(path, sign=1)) == pytest.approx(-1e-3j * wanted)


def test_channels_of_several_rates_and_starts_are_chosen_first(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    own = {"wf_increment": 1 / RATE, "wf_start_offset": float(T[0]), "unit_string": "mm/s"}
    late = own | {"wf_start_time": np.datetime64("2026-01-05T10:00:05")}
    scaled = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
              "NI_Scale[0]_Linear_Slope": 0.0025, "NI_Scale[0]_Linear_Y_Intercept": 0.0,
              "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF}  # fmt: skip
    channels = {
        ("slow", "Temp"): (np.arange(40.0), {"wf_increment": 0.01}),
        ("fast", "LDV"): (TONE, own), ("again", "LDV"): (2 * TONE, late),
        ("fast", "raw"): (WHOLE, own | {"scale_factor": 0.0025}),
        ("fast", "ni"): (WHOLE, own | scaled),
    }  # fmt: skip
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject(*names, data, properties=properties)
                            for names, (data, properties) in channels.items()])  # fmt: skip
    with pytest.raises(ValueError, match="--columns"):
        read(path)
    for name in ("fast/LDV", "2", "ni"):
        assert_tone(read(path, columns=[name]), tolerance=2e-3)
    found = read(path, columns=["again/LDV"])
    assert lines_of(found, np.array([140.0])).mean[0, 0] == pytest.approx(
        -4e-3j * np.exp(0.3j), rel=1e-3
    )
    with pytest.raises(ValueError, match="'scale_factor of raw"):
        read(path, columns=["raw"])


def test_tests_beside_each_other_are_chosen_by_their_columns(tmp_path):
    short = rows(2 * T, 2 * TONE).splitlines()[:900]
    both = [f"{one},{other}" for one, other in zip(TIMED.splitlines(), short, strict=False)]
    both += [f"{one},," for one in TIMED.splitlines()[900:]]
    (tmp_path / "a.csv").write_text("\n".join(["t1 [s],v1 [mm/s],t2 [s],v2 [mm/s]", *both]))
    with pytest.raises(ValueError, match="--columns"):
        read(tmp_path / "a.csv")
    assert_tone(read(tmp_path / "a.csv", columns=["v1"]))
    found = read(tmp_path / "a.csv", columns=["4"])
    assert found.times == pytest.approx(2 * T[:900])
    assert 1e3 * found.values[0, :, 0] == pytest.approx(2 * TONE[:900], abs=1e-6)
    cells = [f"{row},{'∞' if k == 7 else 1}" for k, row in enumerate(TIMED.splitlines())]
    (tmp_path / "b.csv").write_text("\n".join(["t [s],v [mm/s],w [mm/s]", *cells]))
    assert_tone(read(tmp_path / "b.csv", columns=["v"]))
    with pytest.raises(ValueError, match="row 8 of column 'w"):
        read(tmp_path / "b.csv")


def test_structures_with_times_of_their_own(tmp_path):
    savemat(tmp_path / "a.mat", {
        "first": {"v": TONE, "t": T, "unit": "mm/s"},
        "second": {"v": TONE, "t": 3 * T, "unit": "um"},
    })  # fmt: skip
    assert_tone(read(tmp_path / "a.mat", variable="first.v"))
    scan = np.zeros(COUNT, [("time", "f8"), ("velocity", "f8"), ("temperature", "f8")])
    scan["time"], scan["velocity"] = T, TONE
    np.savez(tmp_path / "a.npz", scan=scan)
    assert_tone(read(tmp_path / "a.npz", unit="mm/s"))
    np.savez(tmp_path / "b.npz", f=F, v=np.abs(H), unit="mm/s")
    with pytest.raises(ValueError, match="no phase"):
        read(tmp_path / "b.npz")
