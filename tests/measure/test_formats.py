"""Measurements in files that other libraries wrote, and in our own: the same numbers, exactly."""

import itertools
import wave

import h5py
import measurement_files as files
import numpy as np
import pytest
import pyuff
from measurement_files import DRIVE, MM_S, PLACES_MM, RATE, UM, F
from scipy.io import savemat
from test_tables import COUNT, OTHER, TONE, T, amplitude, assert_tone, rows

from simple_model import Response
from skinwave.measure import Measurement
from skinwave.measure.reading import read
from skinwave.measure.writing import write
from skinwave.results.exports import write_probes
from skinwave.system.units import canonical, motion_divisor, quantity_of

SAMPLES = 10_000.0  # Hz, of the tone
X = np.arange(4) * 5e-3  # m
XYZ = np.column_stack([X, 0 * X, 0 * X])
PHASE = -80.0 * X  # rad, of a wave of 80 rad/m
WAVE = 2.0 * np.cos(2 * np.pi * 140 * T[:, None] + PHASE)  # mm/s
FORCE = {"ordinate_spec_data_type": 13, "ordinate_axis_units_lab": "N", "id1": "Reference Time"}
IN_F = {"func_type": 4, "abscissa_spec_data_type": 18}
LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t{sign}
Multi_Headings\tNo
X_Columns\t{columns}
Time_Pref\tRelative
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t1200\t1200\t
Y_Unit_Label\t{unit}
X_Dimension\tTime\tTime\t
X0\t-2{sign}0E-2\t-2{sign}0E-2\t
Delta_X\t1{sign}0E-4\t1{sign}0E-4\t
***End_of_Header***\t\t\t
"""
LVM_COLUMNS = {
    "One": (".", "left\tright", (T, TONE, OTHER), "lvm"),
    "Multi": (".", "left\tX_Value\tright", (T, TONE, T, OTHER), "txt"),
    "No": (",", "left\tright", (TONE, OTHER), "lvm"),
}  # fmt: skip


def assert_same_motion(found, values, places=PLACES_MM):
    assert found.quantity == "velocity"
    assert np.array_equal(found.values, values / 1e3)
    assert np.array_equal(found.places, places / 1e3)
    assert found.times == pytest.approx(files.T, abs=1e-15)


def assert_wave(found, tolerance=1e-3):
    """Amplitudes at each place relative to the first."""
    each = np.array([amplitude(found, p) for p in range(len(X))])
    assert np.abs(each) == pytest.approx(2.0, abs=tolerance)
    assert each / each[0] == pytest.approx(np.exp(1j * PHASE), abs=tolerance)
    assert found.places == pytest.approx(XYZ[:, :2])


def test_both_repetitions_of_a_recording_are_read_exactly(tmp_path):
    for name in ("wide_csv", "long_tsv", "numpy_npz", "matlab_5", "matlab_73"):
        path = tmp_path / ("file." + {"5": "mat", "73": "mat"}.get(name[7:], name[-3:]))
        getattr(files, name)(path)
        found = read(path)
        assert_same_motion(found, MM_S)
        if name in ("wide_csv", "numpy_npz"):
            assert np.array_equal(found.drive, DRIVE)


def test_spectra_in_columns(tmp_path):
    files.spectrum_csv(tmp_path / "a.csv")
    found = read(tmp_path / "a.csv")
    assert found.quantity == "displacement"
    assert np.array_equal(found.values, UM / 1e6)
    assert np.array_equal(found.frequencies, F)
    text = ["f [kHz], abs v(0,0) [mm/s], phase v(0,0) [deg]", "0.1, 2, 90", "0.2, 4, -180"]
    (tmp_path / "b.csv").write_text("\n".join(text))
    found = read(tmp_path / "b.csv")
    assert found.values[0, :, 0] == pytest.approx([2e-3j, -4e-3])
    assert found.frequencies == pytest.approx([100, 200])


def test_wav_of_whole_numbers_and_of_floats(tmp_path):
    files.wav_16(tmp_path / "a.wav")
    found = read(tmp_path / "a.wav", unit="20 mm/s", places=PLACES_MM[:2] / 1e3, sign=-1)
    assert np.array_equal(found.values[0], -files.samples_16() / 32768 / 50)
    assert found.rate == pytest.approx(RATE)
    files.wav_float(tmp_path / "b.wav")
    found = read(tmp_path / "b.wav", unit="um", quantity="displacement")
    assert np.array_equal(found.values[0], MM_S[0].astype(np.float32).astype(float) / 1e6)
    assert np.isnan(found.places).all()
    assert read(tmp_path / "b.wav", unit="m", columns=["3", "channel 1"]).values.shape[2] == 2


def test_wav_of_24_bits(tmp_path):
    levels = np.array([0, 1, -1, 2**23 - 1, -(2**23)])
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setparams((1, 3, 1000, 0, "NONE", ""))
        file.writeframes(b"".join(int(x).to_bytes(3, "little", signed=True) for x in levels))
    assert read(tmp_path / "a.wav", unit="m/s").values.ravel() == pytest.approx(levels / 2**23)


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_file_of_waveforms(tmp_path, binary):
    path = tmp_path / "a.uff"
    files.universal(path, binary=binary)
    found = read(path)
    # Along +z is out of the body. In text pyuff writes twelve digits.
    assert found.values == pytest.approx(-MM_S / 1e3, rel=1e-11)
    assert np.array_equal(found.places, PLACES_MM / 1e3)
    assert found.times == pytest.approx(files.T, abs=1e-12)
    assert np.array_equal(read(path, sign=1).values, -found.values)
    files.universal(path, binary=binary, rsp_dir=-3, ordinate_axis_units_lab="NONE")
    found = read(path)  # in its unit of length
    assert found.values == pytest.approx(MM_S / 1e3, rel=1e-11)
    assert any("0.001 m/s is assumed" in remark for remark in found.remarks)


def test_universal_file_of_spectra(tmp_path):
    files.universal(tmp_path / "a.unv", complex_=True)
    found = read(tmp_path / "a.unv")
    assert found.quantity == "displacement"
    assert np.allclose(found.values, -UM / 1e6, rtol=1e-11, atol=0)
    assert found.frequencies == pytest.approx(F)


def uff(path, sets):
    """A file of nodes along x and of sets, whose defaults are those of a time response along z."""
    kept = {
        "binary": 0, "func_type": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "x": T - T[0],
        "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 11, "orddenom_spec_data_type": 0,
        "ordinate_axis_units_lab": "mm/s", "id1": "Response Time Trace",
    }  # fmt: skip
    every = [pyuff.prepare_58(**kept | one) for one in sets]
    return files.write_uff(path, [files.uff_nodes(X, 0 * X), *every])


def each(motion, **changes):
    return [{"rsp_node": p + 1, "data": motion[:, p]} | changes for p in range(len(X))]


def test_places_measured_one_after_the_other_are_aligned_by_their_references(tmp_path):
    starts = np.array([0, 137, 61, 330]) / SAMPLES + np.array([0, 3, -2, 1]) * 1e-5
    burst = np.exp(-((T[:, None] + 0.02 + starts - 0.06) ** 2) / 2e-4)
    shown = T[:, None] + starts
    drive = np.sin(2 * np.pi * 140 * shown) * burst
    late = 2.0 * np.cos(2 * np.pi * 140 * shown + PHASE)
    found = read(uff(tmp_path / "a.uff", [*each(late), *each(drive, **FORCE)]), sign=1)
    assert_wave(found, 2e-3)
    assert len(found.drive) == len(found.times)


def test_places_without_references_have_a_remark(tmp_path):
    found = read(uff(tmp_path / "a.uff", each(WAVE)), sign=1)
    assert_wave(found)
    assert any("no reference" in remark for remark in found.remarks)
    noise = np.random.default_rng(0).normal(size=(COUNT, 4))
    found = read(uff(tmp_path / "b.uff", [*each(WAVE), *each(noise, **FORCE)]), sign=1)
    assert any("not aligned" in remark for remark in found.remarks)
    one = {"rsp_node": 1, "data": noise[:, 0], **FORCE}
    assert read(uff(tmp_path / "c.uff", [*each(WAVE), one])).drive == pytest.approx(noise[:, 0])


def test_spectra_are_turned_by_the_phases_of_their_references(tmp_path):
    f, turn = np.arange(100.0, 200.0, 10), np.exp(1j * np.array([0.0, 1, 2, 3]))
    motion, force = (np.ones((10, 1)) * a for a in (2 * np.exp(1j * PHASE) * turn, turn))
    path = uff(tmp_path / "a.uff", [*each(motion, x=f, **IN_F), *each(force, x=f, **FORCE, **IN_F)])
    path.write_text(path.read_text().replace("    4         0    0", "   12         0    0"))
    found = read(path, sign=1)
    assert 1e3 * found.values[0, 4] == pytest.approx(2 * np.exp(1j * PHASE), abs=1e-9)
    real = [{"rsp_node": 1, "data": np.ones(10), "x": f, **IN_F}]
    with pytest.raises(ValueError, match="phase"):
        read(uff(tmp_path / "b.uff", real))
    several = [{"rsp_node": node, "ref_node": shaker, "ref_dir": 3, "x": f, "data": turn[0] * f,
                **IN_F} for node in (1, 2) for shaker in (101, 102)]  # fmt: skip
    with pytest.raises(ValueError, match="101, 102"):
        read(uff(tmp_path / "c.uff", several))


def test_quantity_direction_and_unit_are_chosen_in_a_universal_file(tmp_path):
    unknown = {"ordinate_spec_data_type": 0, "ordinate_axis_units_lab": "V", "id1": "time"}
    path = uff(tmp_path / "a.uff", each(WAVE, **unknown))
    with pytest.raises(ValueError, match="--unit"):
        read(path)
    assert_wave(read(path, unit="mm/s"))
    more = {"ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "g", "rsp_dir": 1}
    path = uff(tmp_path / "b.uff", [*each(WAVE, rsp_dir=1), *each(5 + WAVE, **more)])
    with pytest.raises(ValueError, match="--direction"):
        read(path)
    with pytest.raises(ValueError, match="--quantity"):
        read(path, direction="x")
    assert_wave(read(path, direction="x", quantity="velocity"))
    assert_wave(read(uff(tmp_path / "c.uff", [*each(WAVE), *each(OTHER[:, None] + WAVE, **more)])))


def test_channels_of_no_node_are_places_and_sets_of_one_node_repetitions(tmp_path):
    sets = [{"rsp_node": 0, "data": WAVE[:, p], "id1": f"channel {p}"} for p in range(4)]
    assert read(uff(tmp_path / "a.uff", sets)).values.shape == (1, COUNT, 4)
    found = read(uff(tmp_path / "b.uff", [one | {"rsp_node": 7} for one in sets]))
    assert found.values.shape == (4, COUNT, 1)


def matlab_5(path, scan, **more):
    array = np.zeros((1, len(scan)), [(name, object) for name in scan[0]])
    for k, one in enumerate(scan):
        for name, value in one.items():
            array[0, k][name] = value
    savemat(path, {"scan": array} | more)


def matlab_73(path, scan, **more):
    """As MATLAB has it: each field of an array of structures is an array of references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in scan[0]:
            refs = np.empty((len(scan), 1), h5py.ref_dtype)
            for k, one in enumerate(scan):
                part = f"#refs#/{name}{k}"
                file[part] = np.transpose(one[name])
                refs[k, 0] = file[part].ref
            file.create_dataset(f"scan/{name}", data=refs, dtype=h5py.ref_dtype)
        for name, value in more.items():
            file[name] = np.atleast_2d(value).T


def test_structures_of_places(tmp_path):
    scan = [{"v": WAVE[:, [p]], "xyz": XYZ[[p]], "t": T[:, None]} for p in range(4)]
    matlab_5(tmp_path / "a.mat", scan)
    found = read(tmp_path / "a.mat", unit="mm/s", variable="scan.v")
    assert_wave(found)
    assert found.times == pytest.approx(T)
    begin, drive = np.array([0, 20, 50, 10]), np.random.default_rng(0).normal(size=COUNT)
    parts = [slice(k, 1000 + k) for k in begin]
    scan = [{"v": WAVE[part, [p]][:, None], "t": T[part, None]} for p, part in enumerate(parts)]
    matlab_73(tmp_path / "b.mat", scan, places_mm=1e3 * XYZ)
    with pytest.raises(ValueError, match="differ from place to place"):
        read(tmp_path / "b.mat", unit="mm/s")
    scan = [{"v": one["v"], "ref": drive[part, None]}
            for one, part in zip(scan, parts, strict=True)]  # fmt: skip
    matlab_73(tmp_path / "c.mat", scan, places_mm=1e3 * XYZ, fs=SAMPLES)
    assert_wave(read(tmp_path / "c.mat", unit="mm/s"))


def test_cells_and_objects_of_matlab(tmp_path):
    cell = np.empty((1, 4), object)
    for p in range(4):
        cell[0, p] = WAVE[:, p]
    savemat(tmp_path / "a.mat", {"velocity": cell, "t": T, "places": XYZ})
    assert_wave(read(tmp_path / "a.mat", unit="mm/s"))
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file["scan"] = np.array([[3707764736, 2, 1, 1, 1, 1]], np.uint32)
        file["scan"].attrs["MATLAB_class"] = np.bytes_("table")
        file["scan"].attrs["MATLAB_object_decode"] = np.int32(3)
    with pytest.raises(ValueError, match="'scan' is a table"):
        read(tmp_path / "b.mat", unit="mm/s")


def test_times_within_a_matrix_and_beside_it(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, data=np.column_stack([T, TONE]))
    with pytest.raises(ValueError, match="--rate"):
        read(path, unit="mm/s")
    assert_tone(read(path, unit="mm/s", rate=SAMPLES))
    np.savez(path, t_ms=1e3 * T, v=TONE)
    assert_tone(read(path, unit="mm/s"))
    np.savez(path, fs=SAMPLES, t0=T[0], v=TONE)
    assert_tone(read(path, unit="mm/s"))


def test_places_of_arrays_are_distinguished_from_samples(tmp_path):
    places = np.random.default_rng(0).uniform(-0.1, 0.1, (300, 2))
    motion = np.sin(2 * np.pi * 140 * np.arange(200) / RATE)[:, None] * np.ones(300)
    np.savez(tmp_path / "a.npz", v=motion, places=places, fs=RATE)
    assert np.array_equal(read(tmp_path / "a.npz", unit="m/s").values[0], motion)
    np.savez(tmp_path / "b.npz", t=files.T, v=MM_S[0], Points=PLACES_MM + 50)
    with pytest.raises(ValueError, match="--places"):
        read(tmp_path / "b.npz", unit="mm/s")
    assert_same_motion(read(tmp_path / "b.npz", unit="mm/s", places=PLACES_MM / 1e3), MM_S[:1])


def test_labview_measurement(tmp_path):
    for columns, (sign, names, shown, suffix) in LVM_COLUMNS.items():
        unit = "mm/s\t\tmm/s\t" if columns == "Multi" else "mm/s\tmm/s\t"
        text = LVM.format(sign=sign, columns=columns, unit=unit) + f"X_Value\t{names}\tComment\n"
        body = rows(*shown, sep="\t", comma=sign == ",")
        text += body if columns != "No" else "".join(f"\t{line}\n" for line in body.splitlines())
        (tmp_path / f"a.{suffix}").write_text(text)
        assert_tone(read(tmp_path / f"a.{suffix}"), 2)


def test_tdms_of_waveforms(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    start = float(T[0])
    shown = {"wf_increment": 1 / SAMPLES, "wf_start_offset": start, "unit_string": "mm/s"}
    for offset in (0.0, 0.01):
        late = shown | {"wf_start_offset": start + offset}
        channels = [nptdms.ChannelObject("scan", "left", TONE, properties=shown),
                    nptdms.ChannelObject("scan", "right", OTHER, properties=late)]  # fmt: skip
        with nptdms.TdmsWriter(tmp_path / f"{offset}.tdms") as file:
            file.write_segment(channels)
    assert_tone(read(tmp_path / "0.0.tdms"), 2)
    with pytest.raises(ValueError, match="simultaneous"):
        read(tmp_path / "0.01.tdms")


def both_kinds():
    rng = np.random.default_rng(1)
    places = np.array([[0.1, 1 / 3], [-1e-9, 2e-3], [np.nan, np.nan]])
    real = rng.normal(size=(2, 20, 3)) * 10.0 ** rng.integers(-12, 3, size=(2, 20, 3))
    more = {"places": places, "name": "one, two", "remarks": ("first", "second; third")}
    yield Measurement(quantity="acceleration", times=np.arange(20) / 1300, values=real,
                      drive=real[0, :, 0], **more)  # fmt: skip
    yield Measurement(quantity="strain_xx", frequencies=np.sort(rng.uniform(1, 500, 20)),
                      values=real + 1j * rng.normal(size=real.shape),
                      drive=1j * real[0, :, 1], **more)  # fmt: skip


def test_what_is_written_is_read_to_the_last_bit(tmp_path):
    for measured, suffix in itertools.product(both_kinds(), (".npz", ".csv")):
        path = tmp_path / f"{measured.quantity}{suffix}"
        write(measured, path)
        found = read(path)
        for name in ("values", "places", "times", "frequencies", "drive"):
            assert np.array_equal(getattr(found, name), getattr(measured, name), equal_nan=True)
        assert (found.quantity, found.name) == (measured.quantity, measured.name)
        assert found.remarks[:2] == measured.remarks
        with pytest.raises(ValueError, match="exists"):
            write(measured, path)


def test_exported_responses_are_read_as_they_were(tmp_path):
    quantity = "velocity"
    response = Response(
        model="fem", times=np.arange(40) / 1e4, probes=np.array([[0, 0], [7.5e-3, -3e-3]]),
        values=1e-6 * np.random.default_rng(0).normal(size=(40, 2)), quantity=quantity,
    )  # fmt: skip
    write_probes(tmp_path / "probes", response)
    arrays = {"t": response.times, "probes": response.probes, quantity: response.values}
    np.savez(tmp_path / "responses.npz", **arrays, fem=response.values)
    for name in ("probes.csv", "probes.npz", "responses.npz"):
        found = read(tmp_path / name)
        assert found.quantity == quantity
        assert found.places == pytest.approx(response.probes)
        assert found.mean == pytest.approx(response.values, rel=1e-8, abs=1e-18)
    np.savez(tmp_path / "kernel.npz", **arrays, **{"point-kernel": response.values})
    with pytest.raises(ValueError, match="not motion"):
        read(tmp_path / "kernel.npz")


def test_published_sets(tmp_path):
    values = files.skinsource(tmp_path / "model-2-location-07.f32")
    found = read(tmp_path / "model-2-location-07.f32")
    assert np.array_equal(found.values[0], values[:, :, 2].astype(float))
    assert found.rate == pytest.approx(1300)
    assert found.drive.tolist() == [1] + [0] * 521
    begun, lag = files.zigzag(tmp_path / "v7_distal.mat")
    found = read(tmp_path / "v7_distal.mat")
    left = 400 - np.ptp(lag)
    assert found.values.shape == (2, left, 4)
    for n, k in np.ndindex(4, 2):  # all begin where the place that began last does
        assert np.array_equal(found.values[k, :, n], begun[n, lag.max() : lag.max() + left, k])
    assert found.places[:, 0] == pytest.approx(np.arange(4) * 1e-2)
    assert found.rate == pytest.approx(5000)


def test_units_of_motion():
    for unit, kind, per in (
        ("µm", "displacement", 1e6), ("μm", "displacement", 1e6), ("nm", "displacement", 1e9),
        ("mm/s", "velocity", 1e3), ("mm s^-1", "velocity", 1e3), ("m·s⁻¹", "velocity", 1.0),
        ("m/s²", "acceleration", 1.0), ("m/s^2", "acceleration", 1.0),
        ("m/s/s", "acceleration", 1.0), ("g", "acceleration", 1 / 9.80665),
        ("mg", "acceleration", 1e3 / 9.80665),
        ("20 mm/s", "velocity", 50.0), ("1e-3 m/s", "velocity", 1e3),
    ):  # fmt: skip
        assert quantity_of(unit) == kind, unit
        assert motion_divisor(unit, kind) == pytest.approx(per, rel=1e-15), unit
    assert canonical(" [mm/s] ") == "mm/s"
    for unit in ("dB", "dB re 1 m/s", "V", "um"):
        with pytest.raises(ValueError, match=unit):
            motion_divisor(unit, "velocity")


def waveforms(**changes):
    t = np.arange(50) / 1000
    values = np.sin(2 * np.pi * 100 * t)[None, :, None] * np.array([1.0, 2.0])
    given = {"quantity": "velocity", "places": [[0, 0], [0.01, 0]], "times": t, "values": values}
    return Measurement(**given | changes)


def test_a_measurement_has_waveforms_or_spectra_that_cannot_be_written_to():
    values = np.zeros((1, 50, 2))
    measured = waveforms(values=values)
    values[:] = 1
    assert not measured.values.any()
    with pytest.raises(ValueError, match="read-only"):
        measured.values[:] = 1
    assert measured.rate == pytest.approx(1000)
    assert measured.mean.shape == (50, 2)
    spectra = waveforms(times=[], frequencies=[100.0, 200.0], values=np.ones((3, 2, 2)) * 1j)
    assert spectra.is_spectrum
    assert np.isnan(spectra.rate)
    for changes in (
        {"quantity": "pressure"}, {"quantity": "speed"}, {"frequencies": [1.0]},
        {"places": [[0.0, 0.0, 0.0]]}, {"values": np.zeros((50, 2))},
        {"values": np.full((1, 50, 2), np.nan)}, {"drive": np.zeros(3)},
        {"times": np.r_[np.arange(49), 60] / 1000}, {"times": np.arange(50)[::-1] / 1000},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="measure|speed"):
            waveforms(**changes)
