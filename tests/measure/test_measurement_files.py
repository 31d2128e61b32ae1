"""Measurements in files that other libraries wrote, and in our own: the same numbers, exactly."""

import measurement_files as files
import numpy as np
import pytest
from measurement_files import DRIVE, MM_S, PLACES_MM, RATE, UM, F, T
from scipy.io import savemat

from simple_model import Response
from skinwave.measure import Measurement
from skinwave.measure.reading import places_of, read
from skinwave.measure.units import per_unit, plain, quantity_of
from skinwave.measure.writing import write
from skinwave.results.exports import write_probes


def assert_same_motion(found, values, places=PLACES_MM):
    assert found.quantity == "velocity"
    assert np.array_equal(found.values, values / 1e3)
    assert np.array_equal(found.places, places / 1e3)
    assert found.times == pytest.approx(T, abs=1e-15)


@pytest.mark.parametrize("name", ["wide_csv", "long_tsv", "numpy_npz", "matlab_5", "matlab_73"])
def test_both_repetitions_of_a_recording_are_read_exactly(tmp_path, name):
    path = tmp_path / ("file." + {"5": "mat", "73": "mat"}.get(name[7:], name[-3:]))
    getattr(files, name)(path)
    found = read(path)
    assert_same_motion(found, MM_S)
    if name in ("wide_csv", "numpy_npz"):
        assert np.array_equal(found.drive, DRIVE)


def test_semicolons_and_decimal_commas(tmp_path):
    files.german_csv(tmp_path / "a.csv")
    assert_same_motion(read(tmp_path / "a.csv"), MM_S[:1])


def test_columns_without_a_header_and_white_space(tmp_path):
    np.savetxt(tmp_path / "a.txt", MM_S[0], fmt="%.17g")
    found = read(tmp_path / "a.txt", rate=RATE, unit="mm/s", places=PLACES_MM / 1e3)
    assert_same_motion(found, MM_S[:1])


TWO = [[[0.0015, 0.002], [0.003, 0.004]]]  # m/s


@pytest.mark.parametrize(
    "text",
    [
        "t [s] v(0,0) [mm/s] v(5,0) [mm/s]\n0 1.5 2\n0.5 3 4\n",
        "Time (s);Left (mm/s);Right (mm/s)\n0,0;1,5;2\n0,5;3;4\n",
        "time,left,right\nms,mm/s,mm/s\n0,1.5,2\n500,3,4\n",
        "Source File:\ta.pvd\nSignal:\tVelocity\n\nTime\tA\tB\n[ s ]\t[ mm/s ]\t[ mm/s ]\n"
        "0\t1.5\t2\n0.5\t3\t4\n",
        '# note\n"t [s]","v(0,0) [m/s]","v(5,0) [m/s]"\n"0","0.0015","0.002"\n0.5,0.003,"0.004"\n',
        "t_ms,velocity_mm_s,velocity_mm_s\n0,1.5,2\n500,3,4\n",
        "t [s],x [mm],y [mm],v [mm/s]\n0,0,0,1.5\n0.5,0,0,3\n0.5,5,0,4\n0,5,0,2\n",
    ],
)
def test_headers_of_many_programs(tmp_path, text):
    (tmp_path / "a.txt").write_text(text)
    found = read(tmp_path / "a.txt")
    assert found.quantity == "velocity"
    assert found.values.tolist() == TWO
    assert found.times.tolist() == [0, 0.5]


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_file_of_waveforms(tmp_path, binary):
    path = tmp_path / "a.uff"
    files.universal(path, binary=binary)
    found = read(path)
    # Along +z is out of the body. In text pyuff writes twelve digits.
    same = np.array_equal if binary else (lambda a, b: np.allclose(a, b, rtol=1e-11, atol=0))
    assert same(found.values, -MM_S / 1e3)
    assert np.array_equal(found.places, PLACES_MM / 1e3)
    assert found.times == pytest.approx(T, abs=1e-12)
    assert np.array_equal(read(path, sign=1).values, -found.values)
    files.universal(path, binary=binary, rsp_dir=-3)
    assert same(read(path).values, MM_S / 1e3)


def test_universal_file_of_spectra(tmp_path):
    files.universal(tmp_path / "a.unv", complex_=True)
    found = read(tmp_path / "a.unv")
    assert found.quantity == "displacement"
    assert np.allclose(found.values, -UM / 1e6, rtol=1e-11, atol=0)
    assert found.frequencies == pytest.approx(F)
    assert "per unit of the reference" in found.remarks[0]


def test_universal_file_without_a_unit_is_in_its_unit_of_length(tmp_path):
    files.universal(tmp_path / "a.uff", binary=1, ordinate_axis_units_lab="NONE")
    found = read(tmp_path / "a.uff")
    assert found.values == pytest.approx(-MM_S / 1e3, rel=1e-14)
    assert any("0.001 m/s is assumed" in said for said in found.remarks)


def test_universal_file_with_a_reference_function(tmp_path):
    path = tmp_path / "a.uff"
    files.universal(path)
    more = tmp_path / "b.uff"
    files.universal(more, ordinate_spec_data_type=13, ordinate_axis_units_lab="N")
    blocks = more.read_text().split("    -1\n    -1\n")
    path.write_text(path.read_text() + "    -1\n" + blocks[2] + "    -1\n")
    assert np.allclose(read(path).drive, MM_S[0, :, 0], rtol=1e-11)


def test_spectra_in_columns(tmp_path):
    files.spectrum_csv(tmp_path / "a.csv")
    found = read(tmp_path / "a.csv")
    assert found.quantity == "displacement"
    assert np.array_equal(found.values, UM / 1e6)
    assert np.array_equal(found.frequencies, F)
    rows = ["f [kHz], abs v(0,0) [mm/s], phase v(0,0) [deg]", "0.1, 2, 90", "0.2, 4, -180"]
    (tmp_path / "b.csv").write_text("\n".join(rows))
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


def test_wav_of_24_bits(tmp_path):
    levels = np.array([0, 1, -1, 2**23 - 1, -(2**23)])
    raw = b"".join(int(x).to_bytes(3, "little", signed=True) for x in levels)
    head = b"fmt " + (16).to_bytes(4, "little") + (1).to_bytes(2, "little")
    head += (1).to_bytes(2, "little") + (1000).to_bytes(4, "little")
    head += (3000).to_bytes(4, "little") + (3).to_bytes(2, "little") + (24).to_bytes(2, "little")
    body = b"WAVE" + head + b"data" + len(raw).to_bytes(4, "little") + raw + b"\0"
    (tmp_path / "a.wav").write_bytes(b"RIFF" + len(body).to_bytes(4, "little") + body)
    assert read(tmp_path / "a.wav", unit="m/s").values.ravel() == pytest.approx(levels / 2**23)


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


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("kind", [0, 1])
def test_what_is_written_is_read_to_the_last_bit(tmp_path, suffix, kind):
    measured = list(both_kinds())[kind]
    path = tmp_path / f"a{suffix}"
    write(measured, path)
    found = read(path)
    for name in ("values", "places", "times", "frequencies", "drive"):
        assert np.array_equal(getattr(found, name), getattr(measured, name), equal_nan=True), name
    assert (found.quantity, found.name) == (measured.quantity, measured.name)
    assert found.remarks[:2] == measured.remarks
    write(found, path, overwrite=True)
    assert read(path).remarks == found.remarks
    with pytest.raises(ValueError, match="exists and is kept"):
        write(measured, path)


def test_own_csv_is_a_table_for_other_readers(tmp_path):
    measured = next(both_kinds())
    write(measured, tmp_path / "a.csv")
    found = np.genfromtxt(tmp_path / "a.csv", delimiter=",", skip_header=5, comments=None)
    assert np.array_equal(found[:, 1:4], measured.values[0])


def test_a_published_impulse_response(tmp_path):
    path = tmp_path / "model-2-location-07.f32"
    values = files.skinsource(path)
    found = read(path)
    assert np.array_equal(found.values[0], values[:, :, 2].astype(float))
    assert found.rate == pytest.approx(1300)
    assert found.drive[0] == 1
    assert not found.drive[1:].any()


def test_a_published_scan_is_aligned_by_its_reference(tmp_path):
    begun, lag = files.zigzag(tmp_path / "v7_distal.mat")
    found = read(tmp_path / "v7_distal.mat")
    left = 400 - np.ptp(lag)
    assert found.values.shape == (2, left, 4)
    for n, k in np.ndindex(4, 2):  # all begin where the place that began last does
        assert np.array_equal(found.values[k, :, n], begun[n, lag.max() : lag.max() + left, k])
    assert found.places[:, 0] == pytest.approx(np.arange(4) * 1e-2)
    assert found.rate == pytest.approx(5000)
    assert any("taken as normal" in said for said in found.remarks)


@pytest.mark.parametrize("given", [None, PLACES_MM / 1e3])
def test_places_of_a_scan_are_those_by_name_or_given(tmp_path, given):
    """Not the triangles between them, which come first and are whole numbers."""
    arrays = {"y": np.ones((3, 50, 2)), "r": np.arange(50.0), "fs": 5000.0}
    arrays |= {"tri": np.ones((3, 3), int), "normals": np.ones((3, 3)), "xyz": np.eye(3) / 100}
    savemat(tmp_path / "v7.mat", arrays)
    expected = np.eye(3)[:, :2] / 100 if given is None else given
    assert read(tmp_path / "v7.mat", places=given).places == pytest.approx(expected)


def test_places_that_are_given_replace_those_of_the_file(tmp_path):
    savemat(tmp_path / "a.mat", {"t": T, "v": MM_S[0], "Points": PLACES_MM + 50})
    with pytest.raises(ValueError, match="or give --places"):
        read(tmp_path / "a.mat", unit="mm/s")
    found = read(tmp_path / "a.mat", unit="mm/s", places=PLACES_MM / 1e3)
    assert_same_motion(found, MM_S[:1])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_columns_are_read_in_the_encodings_that_programs_export(tmp_path, encoding):
    text = "t [s], v(0,0) [µm/s]\n0, 1\n0.001, 2\n"
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    found = read(tmp_path / "a.csv")
    assert found.values.ravel() == pytest.approx([1e-6, 2e-6])


def test_units_of_motion():
    for unit, kind, per in (
        ("µm", "displacement", 1e6), ("μm", "displacement", 1e6), ("nm", "displacement", 1e9),
        ("mm/s", "velocity", 1e3), ("mm s^-1", "velocity", 1e3), ("m·s⁻¹", "velocity", 1.0),
        ("m/s²", "acceleration", 1.0), ("m/s^2", "acceleration", 1.0),
        ("m/s/s", "acceleration", 1.0), ("g", "acceleration", 1 / 9.80665),
        ("20 mm/s", "velocity", 50.0), ("1e-3 m/s", "velocity", 1e3),
    ):  # fmt: skip
        assert quantity_of(unit) == kind, unit
        assert per_unit(unit, kind) == pytest.approx(per, rel=1e-15), unit
    assert plain(" [mm/s] ") == "mm/s"
    for unit, said in (("dB", "a level"), ("dB re 1 m/s", "a level"), ("V", "no unit of velocity"),
                       ("um", "one of displacement")):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            per_unit(unit, "velocity")


def test_places_are_pairs_in_millimetre(tmp_path):
    for text in (
        "x [mm],y [mm]\n0,0\n5,-2.5\n",
        "0 0\n5 -2.5\n",
        "x_m,y_m,z_m\n0,0,1\n0.005,-0.0025,1",
    ):
        (tmp_path / "a.csv").write_text(text)
        assert np.array_equal(places_of(str(tmp_path / "a.csv")), [[0, 0], [0.005, -0.0025]])
    (tmp_path / "a.csv").write_text("x [mm],z [mm]\n0,0\n")
    with pytest.raises(ValueError, match="needs the columns x \\[mm\\], y \\[mm\\]"):
        places_of(str(tmp_path / "a.csv"))
    assert np.array_equal(places_of("0,0 (5,-2.5)"), [[0, 0], [0.005, -0.0025]])
    for wrong in ("", "5", "a,b", "1,2,3", "nan,0"):
        with pytest.raises(ValueError, match="mm"):
            places_of(wrong)


@pytest.mark.parametrize("quantity", ["displacement", "velocity"])
def test_exported_responses_are_read_as_they_were(tmp_path, quantity):
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


def test_a_kernels_pressure_is_no_motion(tmp_path):
    arrays = {"t": np.arange(4) / 1e3, "probes": np.zeros((1, 2)), "displacement": np.ones((4, 1))}
    np.savez(tmp_path / "responses.npz", **arrays, **{"point-kernel": np.ones((4, 1))})
    with pytest.raises(ValueError, match="no motion"):
        read(tmp_path / "responses.npz")
