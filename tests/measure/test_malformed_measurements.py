"""Malformed files of measurements: one sentence each, code 2, and nothing is written."""

import io
import zipfile

import measurement_files as files
import numpy as np
import pytest
from corpus import contents
from scipy.io import savemat, wavfile

from skinwave.commands.cli import main

HEAD = "t [s], v(0,0) [mm/s], v(5,0) [mm/s]\n"
ROWS = "0, 1, 2\n0.001, 3, 4\n0.002, 5, 6\n"
# Name of the file, its text, and what is said of it.
TEXTS = {
    "empty": ("", "has no table; give a header such as t [s]"),
    "comments alone": ("# name: x\n\n", "has no table"),
    "header alone": (HEAD, "a header and no numbers"),
    "no header": (ROWS, "write a header such as t [s], v(0,0) [mm/s], v(5,0) [mm/s], or"),
    "a word": (HEAD + ROWS + "0.003, x, 8\n", "line 5 has 'x', which is no number"),
    "thousands": ("t [s]; v(0,0) [nm/s]\n0,001; 594\n0,002; 1.357\n", "'1.357', which has a dot"),
    "a short row": (HEAD + ROWS + "0.003, 7\n", "line 5 has 2 cells and the rows above 3"),
    "not a number": (HEAD + ROWS + "0.003, nan, 1\n", "of 4 samples only 3 lie between"),
    "uneven times": (HEAD + ROWS + "0.007, 1, 1\n", "equal steps"),
    "falling times": (HEAD + "0, 1, 2\n-0.001, 3, 4\n", "must rise"),
    "time without unit": (HEAD.replace(" [s]", "") + ROWS, "'t' has no unit; write 't [s]'"),
    "time in weeks": (HEAD.replace("[s]", "[weeks]") + ROWS, "'weeks' is no unit of time; use one"),
    "decibel": (HEAD.replace("mm/s", "dB") + ROWS, "'dB' is a level, not a unit; export linear"),
    "unit of another quantity": (HEAD.replace("mm/s", "um") + ROWS, "one of displacement, not of"),
    "two units": (HEAD.replace("[mm/s]", "[m/s]", 1) + ROWS, "columns differ in unit: m/s, mm/s"),
    "no unit": (HEAD.replace(" [mm/s]", "") + ROWS, "the unit is not in the file; give --unit"),
    "no quantity": ("t [s], left, right\n" + ROWS, "give --quantity velocity --unit mm/s"),
    "no time": ("v(0,0) [mm/s], v(5,0) [mm/s]\n1, 2\n3, 4\n", "or give --rate"),
    "time alone": ("t [s]\n0\n1\n", "no column is of motion"),
    "two times": ("t [s], t [s], v [m/s]\n0, 1, 1\n1, 2, 1\n", "2 columns are of time"),
    "place in three": ("t [s], v(0,0,0) [mm/s]\n0, 1\n1, 2\n", "is no pair x,y; write (5,0)"),
    "repetitions": ("t [s], v(0,0) [m/s], v(1,0)#2 [m/s]\n0, 1, 1\n", "not the same places"),
    "half a spectrum": ("f [Hz], v(0,0) [m/s]\n1, 1\n", "two columns a place: 're v(0,0)', 'im"),
    "two real parts": ("f [Hz], re v [m/s], re v [m/s]\n1, 1, 1\n", "no complex amplitude; name"),
    "phase in turns": ("f [Hz], abs v [m/s], phase v [turn]\n1, 1, 1\n", "give [deg] or [rad]"),
    "part in time": ("t [s], re v [m/s], im v [m/s]\n0, 1, 1\n1, 1, 1\n", "is of a spectrum; give"),
    "a place lacks a time": (
        "t [s], x [mm], y [mm], v [mm/s]\n0,0,0,1\n1,0,0,1\n0,5,0,1\n", "3 rows are not"
    ),
    "a place twice": (
        "t [s], x [mm], y [mm], v [mm/s]\n0,0,0,1\n0,0,0,2\n1,0,0,1\n1,5,0,1\n", "another row has"
    ),
    "a place without y": ("t [s], x [mm], v [mm/s]\n0,0,1\n1,0,1\n", "needs the columns t [s], x"),
}  # fmt: skip


def binary_npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def truncated(write, tmp_path, suffix, share=0.6):
    write(tmp_path / f"whole{suffix}")
    content = (tmp_path / f"whole{suffix}").read_bytes()
    (tmp_path / f"whole{suffix}").unlink()
    return content[: int(share * len(content))]


def wav(array, tmp_path):
    wavfile.write(tmp_path / "whole.wav", 1000, array)
    content = (tmp_path / "whole.wav").read_bytes()
    (tmp_path / "whole.wav").unlink()
    return content


def mat(tmp_path, **arrays):
    savemat(tmp_path / "whole.mat", arrays)
    content = (tmp_path / "whole.mat").read_bytes()
    (tmp_path / "whole.mat").unlink()
    return content


def universal(tmp_path, **changes):
    files.universal(tmp_path / "whole.uff", **changes)
    content = (tmp_path / "whole.uff").read_bytes()
    (tmp_path / "whole.uff").unlink()
    return content


def pickled():
    file = io.BytesIO()
    np.savez(file, t=np.array([{}], dtype=object))
    return file.getvalue()


def no_arrays():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.txt", "text")
    return file.getvalue()


V = np.zeros((10, 2))
A_MAP = np.arange(18.0).reshape(9, 2) / 100
OWN = {"format": "skinwave measurement 1", "quantity": "velocity", "unit": "m/s"}
# Name of the file, its content of a folder to write in, options, and what is said of it.
BINARIES = {
    "not utf-8": ("a.csv", lambda d: b"\xff\x00t", [], "no text"),
    "half of utf-16": ("a.csv", lambda d: b"\xff\xfe\x00", [], "no text"),
    "no zip": ("a.npz", lambda d: b"text", [], "cannot be read"),
    "half a zip": ("a.npz", lambda d: truncated(files.numpy_npz, d, ".npz"), [], "cannot be read"),
    "no arrays": ("a.npz", lambda d: no_arrays(), [], "cannot be read"),
    "objects": ("a.npz", lambda d: pickled(), [], "cannot be read"),
    "no motion": ("a.npz", lambda d: binary_npz(t=np.arange(9.0)), [], "no array is of motion"),
    "several": ("a.npz", lambda d: binary_npz(left=V, right=V), [], "--variable as left, right"),
    "no such": ("a.npz", lambda d: binary_npz(v=V), ["--variable", "w"], "give --variable as v"),
    "no rate": ("a.npz", lambda d: binary_npz(v=V), ["--unit", "mm/s"], "give --rate in Hz"),
    "another length": (
        "a.npz", lambda d: binary_npz(t=np.arange(7.0), v=V), ["--unit", "mm/s"], "are 7 times"
    ),
    "complex in time": (
        "a.npz", lambda d: binary_npz(t=np.arange(10.0), v=V * 1j), [], "add an array 'frequencies'"
    ),
    "far places": (
        "a.npz", lambda d: binary_npz(v=V, places=V[:2] + 100), [], "millimetre 'places_mm'"
    ),
    "own without places": (
        "a.npz", lambda d: binary_npz(**OWN, values=V, times=V, frequencies=V), [], "'places'"
    ),
    "own of wrong shape": (
        "a.npz", lambda d: binary_npz(**OWN, values=V, times=V, frequencies=V, places=V), [],
        "values have the shape (10, 2)"
    ),
    "no wav": ("a.wav", lambda d: b"RIFFtext", ["--unit", "m/s"], "not a WAV file"),
    "wav without unit": (
        "a.wav", lambda d: wav(np.zeros(9, np.int16), d), [], "give --quantity velocity --unit mm/s"
    ),
    "wav of nan": (
        "a.wav", lambda d: wav(np.full(9, np.nan, np.float32), d), ["--unit", "m/s"],
        "no place has a value"
    ),
    "wav of one sample": (
        "a.wav", lambda d: wav(np.zeros(1, np.int16), d), ["--unit", "m/s"], "has 1 samples"
    ),
    "empty mat": ("a.mat", lambda d: b"", [], "the file is empty"),
    "no mat": ("a.mat", lambda d: b"text " * 99, [], "the file is damaged or no MATLAB file"),
    "half an hdf5": (
        "a.mat", lambda d: truncated(files.matlab_73, d, ".mat"), [], "the file is damaged"
    ),
    "mat of text": ("a.mat", lambda d: mat(d, note="text"), [], "no array is of motion"),
    "no sets": ("a.uff", lambda d: b"text", [], "no set 58 of functions; export"),
    "half a set": (
        "a.uff", lambda d: universal(d).replace(b"         4        48", b"         4        99"),
        [], "and its header tells of 99" ,
    ),
    "no end": ("a.uff", lambda d: universal(d)[:-300], [], "ends within a set"),
    "two maps": (
        "a.mat", lambda d: mat(d, y=np.ones((9, 50, 2)), r=np.ones(50), fs=1e3, one=A_MAP,
                               two=A_MAP + 1), [], "the places may be one or two; give --places"
    ),
    "no phase": ("a.uff", lambda d: universal(d, func_type=9), [], "type 9, which has no phase"),
    "along x": (
        "a.uff", lambda d: universal(d, rsp_dir=1), [], "their directions are x; give --direction"
    ),
    "wrong name": ("model-5-location-01.f32", lambda d: b"", [], "not that of a SkinSource file"),
    "wrong size": ("model-1-location-01.f32", lambda d: b"x" * 9, [], "has 9 bytes where"),
    "unknown kind": ("a.docx", lambda d: b"", [], "'.docx' is no known kind of file"),
}  # fmt: skip
OPTIONS = {
    "one place": (["--places", "0,0"], "--places has 1 places, and the file has 2"),
    "three numbers": (["--places", "0,0,0 1,1,1"], "has '0,0,0', no x,y in mm"),
    "quantity": (["--quantity", "pressure"], "quantity 'pressure' is unknown"),
    "nearest quantity": (["--quantity", "velocty"], "did you mean 'velocity'?"),
    "unit": (["--unit", "furlong"], "'furlong' is no unit of velocity; give --unit as one of m/s"),
    "rate": (["--rate", "0"], "must be above 0 and finite"),
    "alarm": (["--false-alarm", "2"], "must be between 0 and 1"),
}


def refused(folder, capsys, arguments):
    before = contents(folder)
    assert main(["fit", "--inspect", *arguments, "--out", str(folder / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("skinwave: ")
    assert printed.err.count("\n") == 1
    assert contents(folder) == before
    return printed.err


@pytest.mark.parametrize("name", TEXTS)
def test_malformed_text(tmp_path, capsys, name):
    text, said = TEXTS[name]
    (tmp_path / "a.csv").write_text(text)
    assert said in refused(tmp_path, capsys, [str(tmp_path / "a.csv")])


@pytest.mark.parametrize("name", BINARIES)
def test_malformed_binary(tmp_path, capsys, name):
    file, make, options, said = BINARIES[name]
    content = make(tmp_path)
    (tmp_path / file).write_bytes(content)
    assert said in refused(tmp_path, capsys, [str(tmp_path / file), *options])


@pytest.mark.parametrize("name", OPTIONS)
def test_wrong_options(tmp_path, capsys, name):
    options, said = OPTIONS[name]
    (tmp_path / "a.csv").write_text(HEAD + ROWS)
    assert said in refused(tmp_path, capsys, [str(tmp_path / "a.csv"), *options])


def test_what_is_no_file(tmp_path, capsys):
    assert "cannot be read" in refused(tmp_path, capsys, [str(tmp_path / "none.csv")])
    (tmp_path / "folder.csv").mkdir()
    assert "no regular file" in refused(tmp_path, capsys, [str(tmp_path / "folder.csv")])
