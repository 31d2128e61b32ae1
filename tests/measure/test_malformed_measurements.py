"""Malformed files of measurements: one sentence each, code 2, and nothing is written."""

import io

import measurement_files as files
import numpy as np
import pytest
from scipy.io import savemat, wavfile

HEAD = "t [s], v(0,0) [mm/s], v(5,0) [mm/s]\n"
ROWS = "0, 1, 2\n0.001, 3, 4\n0.002, 5, 6\n"
# Texts of tables, and what their refusal names.
TEXTS = {
    "": "no table",
    HEAD: "no numbers",
    ROWS: "--rate",
    HEAD + ROWS + "0.003, x, 8\n": "line 5 has 'x'",
    "t [s]; v(0,0) [nm/s]\n0,001; 594\n0,002; 1.357\n": "1.357",
    HEAD + ROWS + "0.003, 7\n": "line 5",
    HEAD + ROWS + "0.003, 7+1i, 8\n": "complex numbers",
    HEAD + ROWS + "0.007, 1, 1\n": "rows are missing",
    HEAD + "0, 1, 2\n-0.001, 3, 4\n": "must rise",
    HEAD.replace("mm/s", "dB") + ROWS: "'dB' is a level",
    HEAD.replace("mm/s", "um") + ROWS: "displacement",
    HEAD.replace("[mm/s]", "[m/s]", 1) + ROWS: "m/s, mm/s",
    HEAD.replace(" [mm/s]", "") + ROWS: "--unit",
    "t [s], left, right\n" + ROWS: "--quantity velocity --unit mm/s",
    "v(0,0) [mm/s], v(5,0) [mm/s]\n1, 2\n3, 4\n": "--rate",
    "t [s]\n0\n1\n": "motion",
    "t [s], v(0,0,0) [mm/s]\n0, 1\n1, 2\n": "pair x,y",
    "t [s], v(0,0) [m/s], v(1,0)#2 [m/s]\n0, 1, 1\n": "places",
    "f [Hz], v(0,0) [m/s]\n1, 1\n": "two columns",
    "f [Hz], re v [m/s], re v [m/s]\n1, 1, 1\n": "complex amplitude",
    "t [s], re v [m/s], im v [m/s]\n0, 1, 1\n1, 1, 1\n": "of a spectrum",
    "t [s], x [mm], y [mm], v [mm/s]\n0,0,0,1\n1,0,0,1\n0,5,0,1\n": "4 rows",
    "t [s], x [mm], y [mm], v [mm/s]\n0,0,0,1\n0,0,0,2\n1,0,0,1\n1,5,0,1\n": "row",
}
V = np.zeros((10, 2))
OWN = {"format": "skinwave measurement 1", "quantity": "velocity", "unit": "m/s"}
MM_S = ["--unit", "mm/s"]
OPTIONS = [
    (["--places", "0,0"], "1 place"),
    (["--quantity", "velocty"], "did you mean 'velocity'?"),
    (["--unit", "furlong"], "'furlong'"),
    (["--rate", "0"], "above 0"),
    (["--false-alarm", "2"], "between 0 and 1"),
]


def bytes_of(write, *arguments, **options):

    def content(folder, name):
        write(folder / name, *arguments, **options)
        return (folder / name).read_bytes()

    return content


def half(write):
    return lambda *where: write(*where)[: len(write(*where)) * 6 // 10]


def npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **arrays)
    return lambda *_: file.getvalue()


def mat(**arrays):
    return bytes_of(savemat, arrays)


def wav(array):
    return bytes_of(wavfile.write, 1000, array)


# Name of the file, its content, options, and what is named.
BINARIES = [
    ("a.csv", lambda *_: b"\xff\x00t", [], "not text"),
    ("a.npz", lambda *_: b"text", [], "cannot be read"),
    ("a.npz", half(bytes_of(files.numpy_npz)), [], "cannot be read"),
    ("a.npz", npz(t=np.array([{}], dtype=object)), [], "cannot be read"),
    ("a.npz", npz(t=np.arange(9.0)), [], "motion"),
    ("a.npz", npz(left=V, right=V), [], "--variable as left, right"),
    ("a.npz", npz(v=V), ["--variable", "w"], "--variable as v"),
    ("a.npz", npz(v=V), MM_S, "--rate"),
    ("a.npz", npz(t=np.arange(7.0), v=V), MM_S, "7 times"),
    ("a.npz", npz(t=np.arange(10.0), v=V * 1j), [], "'frequencies'"),
    ("a.npz", npz(v=V, places=V[:2] + 100), [], "'places_mm'"),
    ("a.npz", npz(**OWN, values=V, times=V, frequencies=V), [], "'places'"),
    ("a.wav", lambda *_: b"RIFFtext", MM_S, "WAV"),
    ("a.wav", wav(np.zeros(9, np.int16)), [], "--unit mm/s"),
    ("a.wav", wav(np.full(9, np.nan, np.float32)), MM_S, "no place has a value"),
    ("a.mat", lambda *_: b"", [], "empty"),
    ("a.mat", half(bytes_of(files.matlab_73)), [], "damaged"),
    ("a.mat", mat(note="text"), [], "motion"),
    ("a.uff", lambda *_: b"text", [], "no set 58"),
    ("a.uff", lambda *where: bytes_of(files.universal)(*where)[:-300], [], "within a set"),
    ("a.uff", bytes_of(files.universal, func_type=9), [], "type 9"),
    ("a.uff", bytes_of(files.universal, rsp_dir=1), [], "--direction"),
    ("model-5-location-01.f32", lambda *_: b"", [], "SkinSource"),
    ("model-1-location-01.f32", lambda *_: b"x" * 9, [], "9 bytes"),
    ("a.docx", lambda *_: b"", [], "'.docx'"),
]  # fmt: skip


@pytest.fixture
def inspected(tmp_path, monkeypatch, refused):
    """The sentence by which a measurement is refused."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: refused("fit", "--inspect", *arguments, "--out", "out")


def test_malformed_text(tmp_path, inspected):
    for text, named in TEXTS.items():
        (tmp_path / "a.csv").write_text(text)
        assert named in inspected("a.csv")


def test_malformed_binary(tmp_path, inspected):
    for name, make, options, named in BINARIES:
        content = make(tmp_path, name)
        (tmp_path / name).write_bytes(content)
        assert named in inspected(name, *options)


def test_wrong_options_and_no_file(tmp_path, inspected):
    inspected("none.csv")
    (tmp_path / "a.csv").write_text(HEAD + ROWS)
    for options, named in OPTIONS:
        assert named in inspected("a.csv", *options)


def test_no_words_of_a_library_are_in_a_refusal(tmp_path, inspected):
    for suffix in ("lvm", "tdms", "uff", "mat", "npz", "wav", "csv"):
        for content in (b"\x00\x01\x02" * 99, b"LabVIEW Measurement\t\n"):
            (tmp_path / f"a.{suffix}").write_bytes(content)
            said = inspected(f"a.{suffix}", *MM_S, "--rate", "9")
            for word in ("codec", "unpack", "zero-size", "buffer", "expected"):
                assert word not in said
