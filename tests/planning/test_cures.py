"""What messages advise works: the input as they say is accepted."""

from pathlib import Path

import pytest

from skinwave import loads
from skinwave.commands.cli import main

TACTON = "[tacton]\nduration_s = 0.05\n"
KEYS = [
    ("size = 10", "size_mm = 10"),
    ("[tacton.rhythm]\npulses = [[1, 2]]", "[tacton.rhythm]\npulses_ms = [[1, 2]]"),
    ("[body]\n[body.material]\nyoung = 3", "young_modulus_pa"),
    ("[body]\nsize_mm = 10", "it belongs to [tacton]"),
    ("[body]\nkind = slab", '[body]\nkind = "slab"'),
    ('[body]\nkind = "sheet"\nair = True', '[body]\nkind = "sheet"\nair = true'),
    ("size_mm = 0,5", "size_mm = 0.5"),
]


@pytest.mark.parametrize(("wrong", "right"), KEYS, ids=[wrong for wrong, _ in KEYS])
def test_the_right_key_is_named_with_its_unit(wrong, right):
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        loads(TACTON + wrong)
    said = str(refusal.value)
    named = right.split("\n")[-1].split(" = ")[0]
    assert named in said or "; write key = value" in said or "close the quotes" in said
    if " = " in right:
        loads(TACTON + right)


PATHS = [
    r'"C:\Users\me\hand.stl"',
    r"C:\temp\thumb.stl",
    r'"meshes\new.stl"',
]


@pytest.mark.parametrize("path", PATHS)
def test_a_windows_path_is_written_in_single_quotes_or_with_slashes(path):
    scene = '[body]\nkind = "mesh"\nmaterial = "palm"\nfile = '
    with pytest.raises(ValueError, match="in single quotes, .* or with /"):
        loads(scene + path)
    plain = path.strip('"')
    for cured, name in (
        (f"'{plain}'", plain),
        (f"'''{plain}'''", plain),
        (f'"{plain}"'.replace("\\", "/"), plain.replace("\\", "/")),
    ):
        assert loads(scene + cured).body.file == name
    table = '[body.material]\nlaw = "table"\ntable = "C:\\temp.csv"'
    with pytest.raises(ValueError, match="in single quotes"):
        loads(table)


TEXTS = {
    "latin.toml": 'name = "Größe"'.encode("latin-1"),
    "utf16.toml": TACTON.encode("utf-16"),
    "picture.toml": b"\x89PNG\r\n\x1a\n" + bytes(20),
}


@pytest.mark.parametrize("name", TEXTS)
def test_other_encodings_are_to_be_saved_as_utf_8(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(TEXTS[name])
    assert main(["plan", name]) == 2
    assert capsys.readouterr().err.endswith("save it as UTF-8\n")
