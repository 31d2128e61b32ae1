"""Hostile working folders have no effect on commands; functions in processes of their own."""

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import corpus
import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_info

import meshes
import skinwave
from meshes import subprocess_call
from meshes.shapes import palm
from skinwave.sweeps import engine
from skinwave.system.effort import one_thread
from skinwave.system.processes import ended_by_signals, environment, side_by_side

ROOT = Path(skinwave.__file__).parents[1]
THIRD = ("numpy", "scipy", "matplotlib", "pyvista", "vtk", "vtkmodules", "rich", "PIL", "dask",
         "pyarrow", "threadpoolctl", "tomli_w", "meshio", "pytetwild", "pymetis", "mkl", "imageio",
         "packaging", "pooch", "tornado")  # fmt: skip
OURS = ("fem", "meshes", "simple_model")
MARK = "with open({0!r}, 'a') as file:\n    file.write(__name__ + chr(10))\n"
# An extension: the program itself, as it was started, does these commands before its own. Those
# that take minutes are interrupted once a process that they start has loaded its libraries.
IN_TURN = """
import os
import sys
from contextlib import contextmanager
from skinwave.system import processes
from skinwave.commands.cli import main
from skinwave.sweeps import engine
del os.environ["SKINWAVE_EXTENSIONS"]
whole = processes.pool

@contextmanager
def interrupted(*given):
    with whole(*given) as executor:
        executor.submit(exec, "import skinwave.planning.simulate").result()
        raise KeyboardInterrupt

for words, code in {0!r}:
    processes.pool = engine.pool = interrupted if code == 1 else whole
    assert main(words) == code, words
    assert os.getcwd() not in map(os.path.abspath, sys.path), words
"""
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals differ")


def loaded_before_us():
    """Modules that `python -m` itself looks for before any of this program is run."""
    code = "import runpy, sys; print(*{name.split('.')[0] for name in sys.modules})"
    return set(subprocess.check_output([sys.executable, "-P", "-c", code], text=True).split())


def as_module():
    return [sys.executable, "-m", "skinwave"], loaded_before_us() | {"skinwave"}


def as_program():
    program = shutil.which("skinwave", path=sysconfig.get_path("scripts"))
    if program is None:
        pytest.skip("the program is not installed here")
    return [program], set()


@pytest.fixture
def hostile(request, tmp_path):
    """A folder with modules named as ours, others' and the standard library's; the command."""
    command, left_out = request.param()
    place, ran = tmp_path / "here", tmp_path / "ran"
    place.mkdir()
    for name in {*sys.stdlib_module_names, *OURS, *THIRD, "skinwave"} - left_out:
        (place / f"{name}.py").write_text(MARK.format(str(ran)))
    (place / "small.toml").write_text(corpus.GOOD)
    return command, place, ran


def run_there(hostile, *arguments, threads="1"):
    """Output of a command there."""
    command, place, ran = hostile
    env = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), threads)
    env |= {"TMPDIR": str(place.parent)}
    ended = subprocess.run(
        [*command, *arguments], cwd=place, env=env, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    assert not ran.exists(), ran.read_text()
    assert "no_such_key" not in ended.stderr
    return ended.stderr


def settle(hostile):
    """Settings by which matplotlib would have `latex` typeset its text, and warn of a key."""
    (hostile[1] / "matplotlibrc").write_text("text.usetex: True\nno_such_key: 1\n")


@pytest.mark.parametrize("hostile", [as_program], indirect=True)
def test_nothing_of_a_hostile_folder_is_imported_or_set(hostile):
    settle(hostile)
    run_there(hostile, "--version")
    run_there(hostile, "run", "small.toml", "--h", "10", "--out", "out", "--quiet")


def hand(path):
    """Write the surface of a palm, m."""
    import pyvista

    found = palm.surface(meshes.Palm(), 6e-3)
    corners = np.insert(found.triangles, 0, 3, axis=1)
    pyvista.PolyData(found.points, corners.ravel()).save(path)


@pytest.mark.slow
@pytest.mark.parametrize("hostile", [as_module], indirect=True)
def test_nothing_of_a_hostile_folder_is_imported_by_any_command(hostile, tmp_path, monkeypatch):
    """All in one process, but for those that they start. `validate` and `verify` start none, and
    take minutes.
    """
    from skinwave.commands.cli import COMMANDS

    settle(hostile)
    (beside := tmp_path / "beside").mkdir()
    small = ["small.toml", "--h", "10", "--quiet"]
    hand(hostile[1] / "body.stl")
    (hostile[1] / "flat.toml").write_text('[body]\npreset = "skin-slab"\n')
    (hostile[1] / "wave.csv").write_text("t [s], v(0,0) [m/s]\n0, 1\n1, 2\n")
    asked = {
        "run": [*small, "--out", "out"],
        "plan": ["small.toml"],
        "same": ["out", "out"],
        "compare": [*small, "--out", "both"],
        "sweep": [*small, "--vary", "tacton.am_frequency_hz=100,150", "--model", "fem", "--out",
                  "swept", "--workers", "1"],
        "plot": ["swept"],
        "convert": ["small.toml", "out.csv"],
        "mesh": ["body.stl", "--h", "20", "--out", "body.vtu"],
        "doctor": [],
        "measured": ["wave.csv", "--out", "measured"],
        "fit": ["small.toml", "--measured", "wave.csv", "--vary", "gain=0.1:10"],
        "cache": [],
        "report": ["out", "--quiet"],
        "film": ["out", "--out", "film.gif"],
        "relax": small,
        "dispersion": ["small.toml", "--quiet"],
        "map": ["small.toml", "--step", "10", "--quiet"],
        "tradeoff": ["small.toml", "--quiet"],
        "live": ["flat.toml", "--quiet"],
    }  # fmt: skip
    assert set(COMMANDS) == {*asked, "rerun", "validate", "verify", "web"}
    codes = dict.fromkeys(("compare", "relax", "tradeoff"), 1)
    codes |= {"film": 2, "fit": 2}  # no report is there, and no motion measured
    in_turn = [([name, *words], codes.get(name, 0)) for name, words in asked.items()]
    in_turn.append((["run", "nothing.toml"], 2))
    (beside / "in_turn.py").write_text(IN_TURN.format(in_turn))
    with monkeypatch.context() as patch:
        patch.setenv("SKINWAVE_EXTENSIONS", "in_turn")
        patch.setenv("PYTHONPATH", str(beside), prepend=os.pathsep)
        run_there(hostile, "doctor")
    # With as many threads as its record does not have, in a process of its own.
    run_there(hostile, "rerun", "out", "--quiet", threads="2")


def test_a_script_elsewhere_starts_processes_without_the_working_folder(tmp_path):
    """A user's own script, whose folder is searched, but not that in which it is run."""
    hostile, script, ran = tmp_path / "here", tmp_path / "there/script.py", tmp_path / "ran"
    hostile.mkdir()
    script.parent.mkdir()
    for name in {*sys.stdlib_module_names, *OURS, *THIRD} - {"__main__"}:
        (hostile / f"{name}.py").write_text(MARK.format(str(ran)))
    (script.parent / "beside.py").write_text("def two():\n    return 2\n")
    script.write_text(
        "from skinwave.system.processes import apart, helper\nimport beside\n"
        "if __name__ == '__main__':\n"
        "    with helper() as aside:\n"
        "        print(apart(beside.two) + aside.submit(beside.two).result())"
    )
    said = subprocess.check_output([sys.executable, str(script)], cwd=hostile, text=True)
    assert said.strip() == "4"
    assert not ran.exists(), ran.read_text()


def test_another_programs_working_folder_stays(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/__init__.py").write_text("import skinwave")
    (tmp_path / "mine/__main__.py").write_text("import beside")
    (tmp_path / "beside.py").write_text("print('found')")
    words = [sys.executable, "-m", "mine"]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    assert subprocess.check_output(words, cwd=tmp_path, env=env, text=True) == "found\n"


def test_a_program_finds_these_packages_and_says_what_it_printed(tmp_path):
    (tmp_path / "meshes.py").write_text("raise SystemExit(1)")
    (tmp_path / "script.py").write_text(
        "import meshes, os; print(meshes.__file__, os.environ['A'])"
    )
    said = subprocess_call.run(
        tmp_path / "script.py", folder=tmp_path, timeout=600,
        environment={"PYTHONPATH": "", "A": "one"},
    )  # fmt: skip
    assert said == f"{subprocess_call.__file__.replace('subprocess_call', '__init__')} one\n"


def test_calls_side_by_side_are_apart_and_wait_for_what_they_must():
    calls = [partial(divmod, 1, 0), os.getpid, os.getpid, partial(os._exit, 1), os.getpid]
    events: list[str] = []
    for k, future in side_by_side(
        calls, lambda k, running: k != 1 or 0 not in running, lambda k: events.append(f"begins {k}")
    ):
        events.append(f"ends {k}")
        if k == 0:
            with pytest.raises(ZeroDivisionError):
                future.result()
        elif k == 3:
            with pytest.raises(BrokenProcessPool):
                future.result()
        else:
            assert future.result() != os.getpid()
    # Two at once, but the second not beside the first.
    assert events[:2] == ["begins 0", "begins 2"]
    assert events.index("ends 0") < events.index("begins 1")
    assert sorted(events) == [f"{what} {k}" for what in ("begins", "ends") for k in range(5)]
    assert "PYTHONSAFEPATH" not in os.environ


def test_the_environment_is_as_before(monkeypatch):
    for before in (None, "", "1"):
        monkeypatch.delenv("SOME_NAME", raising=False)
        if before is not None:
            monkeypatch.setenv("SOME_NAME", before)
        with environment({"SOME_NAME": "here"}):
            assert os.environ["SOME_NAME"] == "here"
        assert os.environ.get("SOME_NAME") == before


def ended(work):
    """The code of the exit by which some work ends that gets a signal."""
    with pytest.raises(SystemExit) as stopped, ended_by_signals():
        work()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0
    return stopped.value.code


def taken_for(raised):
    try:
        signal.raise_signal(signal.SIGTERM)
    except SystemExit:
        if raised is not None:
            raise raised from None


@POSIX
@pytest.mark.parametrize("raised", [SystemExit(5), None, ImportError("numpy"), ValueError("bad")])
def test_a_signal_ends_all_whatever_it_is_taken_for(raised):
    """An ImportError by numpy, while it is imported."""
    assert ended(lambda: taken_for(raised)) == 143


@POSIX
def test_an_ignored_signal_stays_ignored():
    """As under nohup."""
    handled = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, handled)


def test_threads_that_limit_linear_algebra_leave_it_as_it_was():
    """Two limits that overlap, the first of which ends first."""

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


def test_workers_share_the_cores(monkeypatch):
    made = []

    @contextmanager
    def recorded(count, begin):
        made.append((count, begin.args))
        yield ThreadPoolExecutor(count)

    monkeypatch.setattr(engine, "pool", recorded)
    monkeypatch.setattr(engine, "usable_cores", lambda: 8)
    for count in (2, 3, 16):
        engine.run_all(str, [1, 2], "processes", count, lambda k, result: None)
    assert made == [(2, (4,)), (3, (2,)), (16, (1,))]
