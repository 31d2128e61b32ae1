"""Text from a user's file or name is shown by terminals and spreadsheets, and not obeyed."""

import io
import sys
from argparse import Namespace

import pytest
from rich.console import Console

from skinwave.commands import common
from skinwave.commands.cli import main
from skinwave.system.plain_text import cell, csv_table, printable, say

HOSTILE = "a\x1b[2Jb\x07c\x9bd\x7fe\u202ef\u2066g\x00h\ud800i"


def is_plain(text):
    return all(letter.isprintable() or letter == "\n" for letter in text)


def test_control_characters_are_escapes():
    shown = "a\\u001b[2Jb\\u0007c\\u009bd\\u007fe\\u202ef\\u2066g\\u0000h\\ud800i"
    assert printable(HOSTILE) == shown
    assert printable("µm, 掌, é\n") == "µm, 掌, é\n"
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding="ascii", newline="\n")
    say("掌 5 µm", file)
    assert raw.getvalue() == b"\\u638c 5 \\xb5m\n"


@pytest.mark.skipif(sys.platform == "win32", reason="no such file names")
def test_printed_text_has_no_control_characters(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b[2Jb\u202e\x9b.csv"
    (tmp_path / "s.toml").write_text("[tacton]\nam_frequency_hz = 100\nduration_s = 0.01\n")
    (tmp_path / "bad.toml").write_text('[tacton]\nshape = "\\u001b]0;title\\u0007"')
    assert main(["convert", "s.toml", name, "--rate", "1000"]) == 0
    assert main(["run", name.replace("csv", "toml")]) == 2
    assert main(["run", "bad.toml"]) == 2
    with pytest.raises(SystemExit):
        main(["run", "s.toml", "\x1b[2J\nmore"])
    common.warn(["\x1b[2J of a\nfile"])
    with common.progress_of(Namespace(quiet=False, json=False)) as progress:
        progress("reading \x1b[2J.stl", 0.0)
    printed = capsys.readouterr()
    assert is_plain(printed.out + printed.err)
    assert "a\\u001b[2Jb\\u202e\\u009b.csv" in printed.out
    assert printed.err.count("\n") == 5


def test_the_progress_bar_escapes_markup(monkeypatch):
    drawn, name = io.StringIO(), "[red]x[/red][link=file:///etc]y"
    console = Console(file=drawn, force_terminal=True, width=120)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setattr("rich.console.Console", lambda **asked: console)
    with common.progress_of(Namespace(quiet=False, json=False)) as progress:
        progress(f"{name}\x1b[2J", 0.5)
    assert name in drawn.getvalue()
    assert "\x1b[2J" not in drawn.getvalue()


def test_text_that_a_spreadsheet_would_compute_is_marked():
    for text in ("=1+1", "+A1", "-A1", "@SUM(1)", "\t=1", '=HYPERLINK("x")'):
        assert cell(text) == f"'{text}"
    for value in ("-1.5", "+3e-4", "-inf", -2.0, "f_AM", "", None):
        assert cell(value) == value
    written = csv_table(["=a", "b"], [["-x", None], [-1.0, 'two\nlines, "quoted"']], "\n")
    assert written == b'\'=a,b\n\'-x,\n-1.0,"two\nlines, ""quoted"""\n'
