"""Text from a user's file or name is shown by terminals and spreadsheets, and not obeyed."""

import csv
import io
import json
import os
import re
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest
from rich.console import Console

import skinwave
from skinwave.commands import common
from skinwave.commands.cli import main
from skinwave.results.claims import AssessedClaim, write_claims
from skinwave.sweeps import dataset
from skinwave.system.plain_text import cell, csv_table, printable, say

HOSTILE = "a\x1b[2Jb\x07c\x9bd\x7fe\u202ef\u2066g\x00h\ud800i"
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no such file names")


def is_plain(text):
    """Whether a terminal obeys nothing of a text but its ends of lines."""
    return all(letter.isprintable() or letter == "\n" for letter in text)


def test_control_characters_are_escapes():
    shown = "a\\u001b[2Jb\\u0007c\\u009bd\\u007fe\\u202ef\\u2066g\\u0000h\\ud800i"
    assert printable(HOSTILE) == shown
    assert printable("\U000e0041") == "\\U000e0041"
    assert printable("µm, 掌, é\n") == "µm, 掌, é\n"
    assert printable("a\nb", keep="") == "a\\u000ab"


def test_a_letter_that_the_terminal_lacks_is_an_escape():
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding="ascii", newline="\n")
    say("掌 5 µm", file)
    assert raw.getvalue() == b"\\u638c 5 \\xb5m\n"


@POSIX
@pytest.mark.parametrize("option", [[], ["--json"]])
def test_names_of_files_are_shown(tmp_path, monkeypatch, capsys, option):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b[2Jb\u202e\x9b.wav"
    (tmp_path / "s.toml").write_text("[tacton]\nam_frequency_hz = 100\nduration_s = 0.01\n")
    assert main(["convert", "s.toml", name, "--rate", "1000", *option]) == 0
    printed = capsys.readouterr()
    assert is_plain(printed.out)
    assert "a\\u001b[2Jb\\u202e\\u009b.wav" in printed.out
    if option:
        assert json.loads(printed.out)["out"] == name
    assert main(["run", name.replace("wav", "toml")]) == 2
    printed = capsys.readouterr().err
    assert is_plain(printed)
    assert "a\\u001b[2Jb\\u202e\\u009b.toml" in printed
    assert printed.count("\n") == 1


@pytest.mark.parametrize(
    "text",
    [
        '"\\u001b[31mkey" = 1',
        '[tacton]\nshape = "\\u001b]0;title\\u0007"',
        '[body]\nkind = "\\u202ebals"',
        '[body]\nkind = "mesh"\nfile = "\\u001b[2J.stl"',
    ],
)
def test_keys_and_words_of_a_scene_are_shown(tmp_path, monkeypatch, capsys, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text)
    assert main(["run", "s.toml", "--quiet"]) == 2
    printed = capsys.readouterr().err
    assert is_plain(printed)
    assert printed.count("\n") == 1


def test_arguments_are_shown(capsys):
    with pytest.raises(SystemExit):
        main(["run", "s.toml", "\x1b[2J\nmore"])
    assert is_plain(printed := capsys.readouterr().err)
    assert "\\u001b[2J\\u000amore" in printed


def test_warnings_and_steps_are_shown(capsys):
    common.warn(["\x1b[2J of a\nfile"])
    with common.progress_of(Namespace(quiet=False, json=False)) as progress:
        progress("reading \x1b[2J.stl", 0.0)
    printed = capsys.readouterr().err
    assert is_plain(printed)
    assert printed.count("\n") == 2


def test_a_bar_shows_brackets(monkeypatch):
    """Rich would make colours and links of them."""
    drawn, name = io.StringIO(), "[red]x[/red][link=file:///etc]y"

    def console(**asked):
        return Console(file=drawn, force_terminal=True, width=120)

    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setattr("rich.console.Console", console)
    with common.progress_of(Namespace(quiet=False, json=False)) as progress:
        progress(f"{name}\x1b[2J", 0.5)
    assert name in drawn.getvalue()
    assert "\\u001b[2J" in drawn.getvalue()
    assert "\x1b[2J" not in drawn.getvalue()


def test_output_that_is_no_utf_8_takes_every_name(tmp_path):
    (tmp_path / "s.toml").write_text("[tacton]\nam_frequency_hz = 100\nduration_s = 0.01\n")
    command = [sys.executable, "-m", "skinwave", "convert", "s.toml", "掌.wav", "--rate", "1000"]
    asked = os.environ | {"PYTHONIOENCODING": "ascii"}
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, env=asked)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith(b"wrote \\u638c.wav")


FORMULAE = ["=1+1", "+A1", "-A1", "@SUM(1)", "\t=1", '=HYPERLINK("x")']


def test_text_that_a_spreadsheet_would_compute_is_marked(tmp_path):
    for text in FORMULAE:
        assert cell(text) == f"'{text}"
    for value in ("-1.5", "+3e-4", "-inf", -2.0, "f_AM", "", None):
        assert cell(value) == value
    assessed = AssessedClaim(
        claim="M1", body="b", model="m", holds=True, value=-1.0, bar=0.0, sentence="=cmd"
    )
    write_claims(tmp_path / "claims.csv", [assessed])
    (row,) = csv.DictReader((tmp_path / "claims.csv").read_text().splitlines())
    assert (row["sentence"], row["value"]) == ("'=cmd", "-1")
    dataset.write_csv(tmp_path, [{"key": "@a", "error": "=b", "level": -3.0}])
    (row,) = csv.DictReader((tmp_path / "rows.csv").read_text().splitlines())
    assert list(row.values()) == ["'@a", "'=b", "-3.0"]


def test_tables_have_one_writer():
    written = csv_table(["=a", "b"], [["-x", None], [-1.0, 'two\nlines, "quoted"']], "\n")
    assert written == b'\'=a,b\n\'-x,\n-1.0,"two\nlines, ""quoted"""\n'
    assert csv_table(["a"], [[0.1]]) == b"a\r\n0.1\r\n"
    home = Path(skinwave.__file__).parent
    writers = [
        p.name for p in home.rglob("*.py") if re.search(r"csv\.(w|DictW)rite", p.read_text())
    ]
    assert writers == ["plain_text.py"]
