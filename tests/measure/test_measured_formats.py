"""Binary and structured files of instruments: frequency, amplitude and phase come back."""

import warnings

import h5py
import lvm_read
import measurement_files as files
import numpy as np
import pytest
import pyuff
from scipy.io import savemat
from test_measured_tables import COUNT, MM_S, OTHER, RATE, TONE, T, amplitude, assert_tone, rows

from skinwave.measure.reading import read

X = np.arange(4) * 5e-3  # m
XYZ = np.column_stack([X, 0 * X, 0 * X])
PHASE = -80.0 * X  # rad, of a wave of 80 rad/m
WAVE = 2.0 * np.cos(2 * np.pi * 140 * T[:, None] + PHASE)  # mm/s


def assert_wave(found, tolerance=1e-3):
    """Amplitudes at each place relative to the first."""
    each = np.array([amplitude(found, p) for p in range(len(X))])
    assert np.abs(each) == pytest.approx(2.0, abs=tolerance)
    assert each / each[0] == pytest.approx(np.exp(1j * PHASE), abs=tolerance)
    assert found.places == pytest.approx(XYZ[:, :2])


def uff(path, sets):
    """A file of nodes along x and of sets, whose defaults are those of a time response along z."""
    path.unlink(missing_ok=True)
    node = np.arange(1, len(X) + 1)
    head = pyuff.prepare_2411(node_nums=node, def_cs=0 * node, disp_cs=0 * node, color=0 * node,
                              x=X, y=0 * X, z=0 * X)  # fmt: skip
    kept = {
        "binary": 0, "func_type": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "x": T - T[0],
        "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 11, "orddenom_spec_data_type": 0,
        "ordinate_axis_units_lab": "mm/s", "id1": "Response Time Trace",
    }  # fmt: skip
    every = [pyuff.prepare_58(**kept | one) for one in sets]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff does not close binary files
        pyuff.UFF(str(path)).write_sets([head, *every], "add")
    return path


FORCE = {"ordinate_spec_data_type": 13, "ordinate_axis_units_lab": "N", "id1": "Reference Time"}


@pytest.mark.parametrize("whole", [True, False])
def test_places_measured_one_after_the_other_are_aligned_by_their_references(tmp_path, whole):
    starts = np.array([0, 137, 61, 330]) / RATE + (0 if whole else np.array([0, 3, -2, 1]) * 1e-5)
    burst = np.exp(-((T[:, None] + 0.02 + starts - 0.06) ** 2) / 2e-4)
    shown = T[:, None] + starts
    drive = np.sin(2 * np.pi * 140 * shown) * burst
    wave = 2.0 * np.cos(2 * np.pi * 140 * shown + PHASE)
    sets = [s for p in range(4) for s in (
        {"rsp_node": p + 1, "data": wave[:, p]},
        {"rsp_node": p + 1, "data": drive[:, p], **FORCE})]  # fmt: skip
    found = read(uff(tmp_path / "a.uff", sets), sign=1)
    assert_wave(found, 2e-3)
    assert len(found.drive) == len(found.times)
    assert any("aligned in time by their references" in said for said in found.remarks)


def test_places_without_references_are_said_not_to_be_simultaneous(tmp_path):
    sets = [{"rsp_node": p + 1, "data": WAVE[:, p]} for p in range(4)]
    found = read(uff(tmp_path / "a.uff", sets), sign=1)
    assert_wave(found)
    assert any("no reference was recorded with each place" in said for said in found.remarks)
    noise = np.random.default_rng(0).normal(size=(COUNT, 4))
    sets += [{"rsp_node": p + 1, "data": noise[:, p], **FORCE} for p in range(4)]
    found = read(uff(tmp_path / "b.uff", sets), sign=1)
    assert any("are not aligned in time" in said for said in found.remarks)


def test_spectra_are_turned_by_the_phases_of_their_references(tmp_path):
    f, turn = np.arange(100.0, 200.0, 10), np.exp(1j * np.array([0.0, 1, 2, 3]))
    shown = {"func_type": 4, "x": f, "abscissa_spec_data_type": 18}
    sets = [s for p in range(4) for s in (
        {"rsp_node": p + 1, "data": np.full(10, 2 * np.exp(1j * PHASE[p]) * turn[p]), **shown},
        {"rsp_node": p + 1, "data": np.full(10, turn[p]), **FORCE, **shown})]  # fmt: skip
    path = uff(tmp_path / "a.uff", sets)
    path.write_text(path.read_text().replace("    4         0    0", "   12         0    0"))
    found = read(path, sign=1)
    assert 1e3 * found.values[0, 4] == pytest.approx(2 * np.exp(1j * PHASE), abs=1e-9)
    real = [{"rsp_node": 1, "data": np.ones(10), **shown}]
    with pytest.raises(ValueError, match="no phase"):
        read(uff(tmp_path / "b.uff", real))


UNKNOWN = {"ordinate_spec_data_type": 0, "ordinate_axis_units_lab": "NONE", "id1": "time"}


@pytest.mark.parametrize("kind", [UNKNOWN, UNKNOWN | {"ordinate_axis_units_lab": "V"}])
def test_functions_of_an_unknown_type_have_the_unit_that_is_given(tmp_path, kind):
    sets = [{"rsp_node": p + 1, "data": WAVE[:, p]} | kind for p in range(4)]
    path = uff(tmp_path / "a.uff", sets)
    with pytest.raises(ValueError, match="give --unit"):
        read(path)
    assert_wave(read(path, unit="mm/s"))


@pytest.mark.parametrize("binary", [0, 1])
def test_quantity_and_direction_are_chosen_in_a_file_of_several(tmp_path, binary):
    more = {"ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "g", "binary": binary}
    sets = [s for p in range(4) for s in (
        {"rsp_node": p + 1, "data": WAVE[:, p], "rsp_dir": 1, "binary": binary},
        {"rsp_node": p + 1, "data": 5 + WAVE[:, p], "rsp_dir": 1, **more})]  # fmt: skip
    path = uff(tmp_path / "a.uff", sets)
    with pytest.raises(ValueError, match="directions are x; give --direction"):
        read(path)
    with pytest.raises(ValueError, match="--quantity"):
        read(path, direction="x")
    assert_wave(read(path, direction="x", quantity="velocity"))


def test_channels_of_no_node_are_places_and_sets_of_one_node_repetitions(tmp_path):
    sets = [{"rsp_node": 0, "data": WAVE[:, p], "id1": f"channel {p}"} for p in range(4)]
    found = read(uff(tmp_path / "a.uff", sets))
    assert found.values.shape == (1, COUNT, 4)
    found = read(uff(tmp_path / "b.uff", [one | {"rsp_node": 7} for one in sets]))
    assert found.values.shape == (4, COUNT, 1)
    assert any("taken as repetitions" in said for said in found.remarks)


def matlab_5(path, scan, **more):
    fields = [(name, object) for name in scan[0]]
    array = np.zeros((1, len(scan)), fields)
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


MATLAB = {"5": matlab_5, "7.3": matlab_73}


@pytest.mark.parametrize("version", MATLAB)
def test_structures_of_places(tmp_path, version):
    scan = [{"v": WAVE[:, [p]], "xyz": XYZ[[p]], "t": T[:, None]} for p in range(4)]
    MATLAB[version](tmp_path / "a.mat", scan)
    for variable in ("", "scan.v"):
        found = read(tmp_path / "a.mat", unit="mm/s", variable=variable)
        assert_wave(found)
        assert found.times == pytest.approx(T)
    MATLAB[version](
        tmp_path / "b.mat", [{"v": one["v"], "xyz": one["xyz"]} for one in scan], fs=RATE
    )
    assert_wave(read(tmp_path / "b.mat", unit="mm/s"))


@pytest.mark.parametrize("version", MATLAB)
def test_structures_of_other_times_are_refused_or_aligned(tmp_path, version):
    begin = np.array([0, 20, 50, 10])
    scan = [{"v": WAVE[k : 1000 + k, [p]], "t": T[k : 1000 + k, None]}
            for p, k in enumerate(begin)]  # fmt: skip
    MATLAB[version](tmp_path / "a.mat", scan, places_mm=1e3 * XYZ)
    with pytest.raises(ValueError, match="differ from place to place"):
        read(tmp_path / "a.mat", unit="mm/s")
    drive = np.random.default_rng(0).normal(size=COUNT)
    for one, k in zip(scan, begin, strict=True):
        del one["t"]
        one["ref"] = drive[k : 1000 + k, None]
    MATLAB[version](tmp_path / "b.mat", scan, places_mm=1e3 * XYZ, fs=RATE)
    assert_wave(read(tmp_path / "b.mat", unit="mm/s"))


def test_cells_of_places(tmp_path):
    cell = np.empty((1, 4), object)
    for p in range(4):
        cell[0, p] = WAVE[:, p]
    savemat(tmp_path / "a.mat", {"velocity": cell, "t": T, "places": XYZ})
    assert_wave(read(tmp_path / "a.mat", unit="mm/s"))


@pytest.mark.parametrize("suffix", ["mat", "npz"])
def test_times_within_a_matrix_and_beside_it(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"

    def save(**arrays):
        savemat(path, arrays) if suffix == "mat" else np.savez(path, **arrays)

    save(data=np.column_stack([T, TONE]))
    with pytest.raises(ValueError, match="column 1 of 'data' rises evenly as times do"):
        read(path, unit="mm/s")
    assert_tone(read(path, unit="mm/s", rate=RATE))
    save(t_ms=1e3 * T, v=TONE)
    assert_tone(read(path, unit="mm/s"))
    save(fs=RATE, t0=T[0], v=TONE)
    assert_tone(read(path, unit="mm/s"))


def test_more_places_than_samples(tmp_path):
    places = np.random.default_rng(0).uniform(-0.1, 0.1, (300, 2))
    motion = np.sin(2 * np.pi * 140 * np.arange(200) / RATE)[:, None] * np.ones(300)
    savemat(tmp_path / "a.mat", {"v": motion, "places": places, "fs": RATE})
    assert np.array_equal(read(tmp_path / "a.mat", unit="m/s").values[0], motion)


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t{sign}
Multi_Headings\tNo
X_Columns\t{columns}
Time_Pref\tRelative
***End_of_Header***\t
\t
Channels\t{count}\t\t
Samples\t1200\t1200\t
Y_Unit_Label\t{unit}
X_Dimension\tTime\tTime\t
X0\t-2.0E-2\t-2.0E-2\t
Delta_X\t1.0E-4\t1.0E-4\t
***End_of_Header***\t\t\t
"""


@pytest.mark.parametrize("suffix", ["lvm", "txt"])
@pytest.mark.parametrize("columns", ["One", "Multi", "No"])
def test_labview_measurement(tmp_path, columns, suffix):
    sign = "," if columns == "No" else "."
    many = columns == "Multi"
    text = LVM.format(sign=sign, columns=columns, count=2,
                      unit="mm/s\t\tmm/s\t" if many else "mm/s\tmm/s\t")  # fmt: skip
    text += ("X_Value\tleft\tX_Value\tright\tComment\n" if many
             else "X_Value\tleft\tright\tComment\n")  # fmt: skip
    shown = {"One": (T, TONE, OTHER), "Multi": (T, TONE, T, OTHER), "No": (TONE, OTHER)}[columns]
    body = rows(*shown, sep="\t", comma=columns == "No")
    text += body if columns != "No" else "".join(f"\t{line}\n" for line in body.splitlines())
    text = text.replace("E-2", "E-2").replace(".0E", f"{sign}0E")
    (tmp_path / f"a.{suffix}").write_text(text)
    assert lvm_read.read_str(text)["Segments"] == 1
    assert_tone(read(tmp_path / f"a.{suffix}"), 2)


@pytest.mark.parametrize("offset", [0.0, 0.01])
def test_tdms_of_waveforms(tmp_path, offset):
    nptdms = pytest.importorskip("nptdms")
    shown = {"wf_increment": 1 / RATE, "wf_start_offset": START_OFFSET, "unit_string": "mm/s"}
    channels = [
        nptdms.ChannelObject("scan", "left", TONE, properties=shown),
        nptdms.ChannelObject("scan", "right", OTHER,
                             properties=shown | {"wf_start_offset": START_OFFSET + offset}),
    ]  # fmt: skip
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(channels)
    if offset:
        with pytest.raises(ValueError, match="not simultaneous"):
            read(tmp_path / "a.tdms")
    else:
        assert_tone(read(tmp_path / "a.tdms"), 2)


START_OFFSET = float(T[0])


def test_channels_of_a_wav_are_chosen(tmp_path):
    files.wav_float(tmp_path / "a.wav")
    found = read(tmp_path / "a.wav", columns=["3", "channel 1"], **MM_S)
    assert found.values.shape[2] == 2


@pytest.mark.parametrize("suffix", ["lvm", "tdms", "uff", "mat", "npz", "wav", "csv"])
@pytest.mark.parametrize(
    "content",
    [b"", b"\x00\x01\x02" * 99, b"LabVIEW Measurement\t\n", "µ".encode("cp932", "replace")],
)
def test_no_words_of_a_library_are_in_a_refusal(tmp_path, suffix, content):
    (tmp_path / f"a.{suffix}").write_bytes(content)
    with pytest.raises(
        ValueError, match=f"a.{suffix}: .*; (export|save|give|mend|download|name)"
    ) as error:
        read(tmp_path / f"a.{suffix}", unit="mm/s", rate=1e3)
    for word in ("codec", "unpack", "zero-size", "buffer", "expected", "byte"):
        assert word not in str(error.value)


def test_frequency_responses_of_several_references_are_refused(tmp_path):
    f = np.arange(5.0, 1000, 5)
    sets = [
        {"func_type": 4, "rsp_node": node, "ref_node": shaker, "ref_dir": 3, "x": f,
         "data": np.ones(len(f)) * (1 + 1j), "abscissa_spec_data_type": 18}
        for node in (1, 2) for shaker in (101, 102)
    ]  # fmt: skip
    with pytest.raises(ValueError, match="2 references, the nodes 101, 102; export those of one"):
        read(uff(tmp_path / "a.uff", sets))
    found = read(uff(tmp_path / "a.uff", sets[::2]))
    assert found.values.shape == (1, len(f), 2)


def test_functions_of_other_directions_are_named(tmp_path):
    sets = [{"rsp_node": node, "rsp_dir": way, "data": WAVE[:, node - 1]}
            for node in (1, 2, 3, 4) for way in (1, 3)]  # fmt: skip
    found = read(uff(tmp_path / "a.uff", sets))
    assert_wave(found)
    assert any("4 functions of other directions are left out" in said for said in found.remarks)


def test_objects_of_matlab_are_refused_by_name(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["scan"] = np.array([[3707764736, 2, 1, 1, 1, 1]], np.uint32)
        file["scan"].attrs["MATLAB_class"] = np.bytes_("table")
        file["scan"].attrs["MATLAB_object_decode"] = np.int32(3)
        file["fs"] = [[RATE]]
    with pytest.raises(ValueError, match="'scan' is a table of MATLAB"):
        read(tmp_path / "a.mat", **MM_S)


def test_a_rate_that_holds_no_vibration_and_a_place_without_a_signal_are_said(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],v(0,0) [mm/s],v(5,0) [mm/s]\n" + rows(T, TONE, 0 * T + 0.003))
    assert any("place 2 has the same value throughout" in said for said in read(path).remarks)
    path.write_text("t [s],v(0,0) [mm/s]\n" + rows(T * RATE, TONE))
    assert any("samples at 1 Hz show no vibration" in said for said in read(path).remarks)
