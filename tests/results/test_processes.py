"""Functions in processes of their own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from threadpoolctl import ThreadpoolController, threadpool_info

from skinwave.system.effort import one_thread
from skinwave.system.processes import environment, pool

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals differ")


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
