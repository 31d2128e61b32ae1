"""Error messages of scene files name a key or a change that the file then accepts."""

from pathlib import Path

import pytest

from skinwave import loads
from skinwave.commands.cli import main

TACTON = "[tacton]\nduration_s = 0.05\n"
KEYS = {
    "size = 10": ("size_mm", "size_mm = 10"),
    "[tacton.rhythm]\npulses = [[1, 2]]": ("pulses_ms", "[tacton.rhythm]\npulses_ms = [[1, 2]]"),
    "[body]\n[body.material]\nyoung = 3": ("young_modulus_pa", ""),
    "[body]\nsize_mm = 10": ("[tacton]", "size_mm = 10"),
    "[body]\nkind = slab": ("", '[body]\nkind = "slab"'),
    '[body]\nkind = "sheet"\nair = True': ("", '[body]\nkind = "sheet"\nair = true'),
    "size_mm = 0,5": ("", "size_mm = 0.5"),
}


@pytest.mark.parametrize("wrong", KEYS)
def test_the_key_that_a_message_names_is_accepted(wrong):
    name, right = KEYS[wrong]
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        loads(TACTON + wrong)
    assert name in str(refusal.value)
    loads(TACTON + right)


@pytest.mark.parametrize(
    "path", [r'"C:\Users\me\hand.stl"', r"C:\temp\thumb.stl", r'"meshes\new.stl"']
)
def test_a_windows_path_needs_single_quotes_or_slashes(path):
    scene = '[body]\nkind = "mesh"\nmaterial = "palm"\nfile = '
    with pytest.raises(ValueError, match="'.*/"):
        loads(scene + path)
    plain = path.strip('"')
    assert loads(f"{scene}'{plain}'").body.file == plain
    slashes = plain.replace("\\", "/")
    assert loads(f'{scene}"{slashes}"').body.file == slashes


TEXTS = {
    "latin.toml": 'name = "Größe"'.encode("latin-1"),
    "utf16.toml": TACTON.encode("utf-16"),
    "picture.toml": b"\x89PNG\r\n\x1a\n" + bytes(20),
}


@pytest.mark.parametrize("name", TEXTS)
def test_other_encodings_than_utf_8_are_refused(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(TEXTS[name])
    assert main(["plan", name]) == 2
    assert "UTF-8" in capsys.readouterr().err
