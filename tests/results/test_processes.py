"""Functions in processes of their own; text that terminals and spreadsheets show, not obey."""

import io
import os
import re
import signal
import subprocess
import sys
import threading
from argparse import Namespace
from contextlib import ExitStack
from pathlib import Path

import pytest
from rich.console import Console
from threadpoolctl import ThreadpoolController, threadpool_info

from skinwave.commands import common
from skinwave.commands.cli import main
from skinwave.system.effort import one_thread, usable_cores
from skinwave.system.plain_text import cell, csv_table, printable, say
from skinwave.system.processes import beside, environment, pool
from skinwave.system.progress_bar import expecting

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
HOSTILE = "a\x1b[2Jb\x07c\x9bd\x7fe\u202ef\u2066g\x00h\ud800i"


def begins():
    with beside() as begin:
        return begin is not None and begin(os.getpid).result() == os.getpid()


@pytest.mark.skipif(usable_cores() < 2, reason="one core")
def test_calls_begin_beside_others_unless_processes_have_all_cores():
    assert begins()
    with pool(usable_cores() - 1) as workers:
        assert not begins()
        assert not workers.submit(begins).result()
    assert begins()


def test_modules_of_the_working_folder_are_not_imported(tmp_path):
    for name in ("random", "numpy", "multiprocessing", "signal", "skinwave"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported')")
    (tmp_path / "elsewhere").mkdir()
    script = tmp_path / "elsewhere/script.py"
    script.write_text(
        "import os\nfrom skinwave.system.processes import pool\n"
        "if __name__ == '__main__':\n    with pool(1) as other:\n"
        "        print(other.submit(os.getppid).result() == os.getpid())\n"
    )
    said = subprocess.check_output([sys.executable, str(script)], cwd=tmp_path, text=True)
    assert said.strip() == "True"


@posix
def test_processes_end_with_the_one_that_started_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import os, signal\nfrom skinwave.system.processes import pool\n"
        "if __name__ == '__main__':\n    with pool(1) as other:\n"
        "        print(other.submit(os.getpid).result(), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    ended = subprocess.run([sys.executable, str(script)], stdout=subprocess.PIPE, check=False)
    assert ended.returncode == -signal.SIGKILL
    # Its standard output was the child's, too, and is closed: the child is gone or ends.
    child = Path(f"/proc/{int(ended.stdout)}/stat")
    assert not child.exists() or child.read_text().split()[2] in "ZX"


def test_each_call_of_a_renewed_pool_has_a_process_of_its_own():
    with pool(1, renewed=True) as other:
        calls = [other.submit(os.getpid) for _ in range(3)]
        assert len({call.result() for call in calls} | {os.getpid()}) == 4


def test_no_thread_of_a_pool_outlives_it():
    before = set(threading.enumerate())
    with pool(1, renewed=True) as other:
        assert other.submit(abs, -1).result() == 1
    # It would start a process for the next call, and print a traceback.
    assert set(threading.enumerate()) <= before


def test_a_pool_cancels_unfinished_calls_and_restores_the_environment(monkeypatch):
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with pool(1) as other:
        unfinished = other.submit(signal.pause if hasattr(signal, "pause") else input)
        waiting = other.submit(os.getpid)
    assert waiting.cancelled() or waiting.exception()
    assert unfinished.cancelled() or unfinished.exception()
    assert "PYTHONSAFEPATH" not in os.environ
    monkeypatch.setenv("SOME_NAME", "before")
    with environment({"SOME_NAME": "here"}):
        assert os.environ["SOME_NAME"] == "here"
    assert os.environ["SOME_NAME"] == "before"


def test_threads_that_limit_linear_algebra_restore_the_limit():

    def threads():
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    with ThreadpoolController().limit(limits=2, user_api="blas"):
        before = threads()
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert set(threads()) == {1}
        second.__exit__(None, None, None)
        assert threads() == before


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


@pytest.mark.parametrize("fraction", [0.0, 0.5])
def test_the_bar_counts_down_from_the_predicted_seconds_until_it_knows_better(
    fraction, monkeypatch
):
    console = Console(file=(drawn := io.StringIO()), force_terminal=True, width=120)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setattr("rich.console.Console", lambda **asked: console)
    with ExitStack() as phases, common.progress_of(Namespace(quiet=False, json=False)) as progress:
        phases.enter_context(expecting(progress, 36_000))
        progress("lines", fraction)
    last = drawn.getvalue().rpartition("lines")[2]
    assert bool(re.search(r"9:59:5\d|10:00:00", last)) == (fraction == 0.0)


def test_text_that_a_spreadsheet_would_compute_is_marked():
    for text in ("=1+1", "+A1", "-A1", "@SUM(1)", "\t=1", '=HYPERLINK("x")'):
        assert cell(text) == f"'{text}"
    for value in ("-1.5", "+3e-4", "-inf", -2.0, "f_AM", "", None):
        assert cell(value) == value
    written = csv_table(["=a", "b"], [["-x", None], [-1.0, 'two\nlines, "quoted"']], "\n")
    assert written == b'\'=a,b\n\'-x,\n-1.0,"two\nlines, ""quoted"""\n'
