"""Hostile working folders have no effect on commands; and processes end with those they serve."""

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import corpus
import pytest
from test_ended_anywhere import hand
from threadpoolctl import ThreadpoolController, threadpool_info

import skinwave
from meshes import subprocess_call
from skinwave.effort import one_thread
from skinwave.processes import as_part, ended_by_signals, environment, pool, side_by_side
from skinwave.sweeps import engine

ROOT = Path(skinwave.__file__).parents[1]
THIRD = ("numpy", "scipy", "matplotlib", "pyvista", "vtk", "vtkmodules", "rich", "PIL", "dask",
         "pyarrow", "threadpoolctl", "tomli_w", "meshio", "pytetwild", "pymetis", "mkl", "imageio",
         "trame", "trame_pyvista", "packaging", "pooch", "tornado", "aiohttp")  # fmt: skip
OURS = ("fem", "meshes", "simple_model")
MARK = "with open({0!r}, 'a') as file:\n    file.write(__name__ + chr(10))\n"
# An extension: the program itself, as it was started, does these commands before its own.
IN_TURN = """
import os
import sys
from skinwave.cli import main
del os.environ["SKINWAVE_EXTENSIONS"]
for words, code in {0!r}:
    assert main(words) == code, words
    assert os.getcwd() not in map(os.path.abspath, sys.path), words
"""
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
LOOKED_UP = pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="looks processes up")


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


def run_there(hostile, *arguments, code=0, threads="1", until=None):
    """Output of a command there; it may be told to end when one of these processes works."""
    command, place, ran = hostile
    env = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), threads)
    env |= {"TMPDIR": str(place.parent)}
    process = subprocess.Popen(
        [*command, *arguments], cwd=place, env=env, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    if until is not None and works(process, until):
        process.terminate()
        code = 143
    said = process.communicate()[1]
    assert process.returncode == code, said
    assert not ran.exists(), ran.read_text()
    return said


def itself(number):
    return [number]


def works(process, which):
    """Wait until one of a command's processes has loaded its libraries; False if it has ended."""
    while process.poll() is None:
        for number in which(process.pid):
            with suppress(OSError):
                if "_sparsetools" in Path(f"/proc/{number}/maps").read_text():  # of scipy
                    time.sleep(1)
                    return True
        time.sleep(0.05)
    return False


def settle(hostile):
    """Settings by which matplotlib would have `latex` typeset its text, and warn of a key."""
    (hostile[1] / "matplotlibrc").write_text("text.usetex: True\nno_such_key: 1\n")


@pytest.mark.parametrize("hostile", [as_program], indirect=True)
def test_nothing_of_a_hostile_folder_is_imported_or_set(hostile):
    settle(hostile)
    run_there(hostile, "--version")
    said = run_there(hostile, "compare", "small.toml", "--h", "10", "--out", "both", "--quiet")
    assert "no_such_key" not in said


@pytest.mark.slow
@pytest.mark.parametrize("hostile", [as_module], indirect=True)
def test_nothing_of_a_hostile_folder_is_imported_by_any_command(hostile, tmp_path, monkeypatch):
    """Those that take minutes, or are run to their end by another test, are told to end when a
    process of their own works; those that start none are in one process.
    """
    from skinwave.cli import COMMANDS

    settle(hostile)
    run_there(hostile, "--version")
    (beside := tmp_path / "beside").mkdir()
    small = ["small.toml", "--h", "10", "--quiet"]
    hand(hostile[1] / "body.stl", 6e-3)
    (hostile[1] / "wave.csv").write_text("t [s], v(0,0) [m/s]\n0, 1\n1, 2\n")
    asked = {
        "run": [*small, "--out", "out"],
        "plan": ["small.toml"],
        "same": ["out", "out"],
        "rerun": ["out", "--quiet"],
        "compare": [*small, "--out", "both"],
        "sweep": [*small, "--vary", "tacton.am_frequency_hz=100,150", "--model", "fem", "--out",
                  "swept", "--workers", "1"],
        "plot": ["swept"],
        "convert": ["small.toml", "out.csv"],
        "mesh": ["body.stl", "--h", "20", "--out", "body.vtu"],
        "doctor": [],
        "measured": ["wave.csv", "--out", "measured"],
        "fit": ["small.toml", "--measured", "wave.csv", "--vary", "gain=0.1:10"],
        "infer": ["--samples", "2", "--workers", "1", "--quiet"],
        "cache": [],
        "report": ["out", "--quiet"],
        "film": ["out", "--out", "film.gif"],
        "relax": small,
        "dispersion": ["small.toml", "--quiet"],
        "map": ["small.toml", "--step", "10", "--quiet"],
        "tradeoff": ["small.toml", "--quiet"],
        "verify": ["--quick", "--quiet"],
        "validate": ["--quiet"],
    }  # fmt: skip
    assert set(COMMANDS) == {*asked, "web"}  # which has a test of its own
    until = {
        "compare": below, "rerun": below, "infer": itself, "relax": below, "tradeoff": below,
        "validate": itself, "verify": itself,
    }  # fmt: skip
    refused = ("film", "fit")  # no report is there, and no motion measured
    in_turn = [([name, *asked[name]], 2 if name in refused else 0)
               for name in asked if name not in until]  # fmt: skip
    in_turn.append((["run", "nothing.toml"], 2))
    monkeypatch.setenv("SKINWAVE_EXTENSIONS", "in_turn")
    monkeypatch.setenv("PYTHONPATH", str(beside), prepend=os.pathsep)
    (beside / "in_turn.py").write_text(IN_TURN.format(in_turn))
    said = run_there(hostile, "doctor")
    monkeypatch.undo()
    assert "no_such_key" not in said
    for name, end in until.items():
        threads = "2" if name == "rerun" else "1"  # which then needs a process of its own
        said = run_there(hostile, name, *asked[name], threads=threads, until=end)
        assert "no_such_key" not in said, name


def test_a_script_elsewhere_starts_processes_without_the_working_folder(tmp_path):
    """A user's own script, whose folder is searched, but not that in which it is run."""
    hostile, script, ran = tmp_path / "here", tmp_path / "there/script.py", tmp_path / "ran"
    hostile.mkdir()
    script.parent.mkdir()
    for name in {*sys.stdlib_module_names, *OURS, *THIRD} - {"__main__"}:
        (hostile / f"{name}.py").write_text(MARK.format(str(ran)))
    (script.parent / "beside.py").write_text("def two():\n    return 2\n")
    script.write_text(
        "from skinwave.processes import apart, helper\nimport beside\n"
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
        tmp_path / "script.py", folder=tmp_path, timeout=60,
        environment={"PYTHONPATH": "", "A": "one"},
    )  # fmt: skip
    assert said == f"{subprocess_call.__file__.replace('subprocess_call', '__init__')} one\n"


def test_a_pool_ends_its_own_processes_only():
    """A page computes a response while it has a report drawn."""
    with pool(1, as_part) as other:
        number = other.submit(os.getpid).result()
        beside = get_context("spawn").Process(target=time.sleep, args=(60,), daemon=True)
        beside.start()
    try:
        assert beside.is_alive()
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)
    finally:
        beside.kill()
        beside.join()


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
def test_a_signal_that_is_lost_comes_again(monkeypatch):
    monkeypatch.setattr("skinwave.processes.AGAIN", 0.05)
    went_on = []

    def work():
        taken_for(None)
        time.sleep(10)
        went_on.append(True)

    assert ended(work) == 143
    assert not went_on


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


def below(process):
    """Numbers of the processes that a process has started, and of those that they have."""
    try:
        folders = Path(f"/proc/{process}/task").iterdir()
        found = [int(n) for folder in folders for n in (folder / "children").read_text().split()]
    except OSError:
        return []
    return found + [n for child in found for n in below(child)]


def alive(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def gone(numbers, patience=10.0):
    """Wait for the end of these processes; those that are left after a while."""
    last = time.monotonic() + patience
    while (left := [n for n in numbers if alive(n)]) and time.monotonic() < last:
        time.sleep(0.05)
    return left


def works_at(process, what):
    """Wait until a script with this name runs below a process; all that run there."""
    last = time.monotonic() + 90
    while time.monotonic() < last and process.poll() is None:
        numbers = below(process.pid)
        for number in numbers:
            try:
                if what in Path(f"/proc/{number}/cmdline").read_text():
                    return numbers
            except OSError:
                pass
        time.sleep(0.05)
    raise AssertionError(f"{what} never ran; {process.poll()}")


MESHING = "import meshes; meshes.palm_mesh(meshes.Palm(), 3e-3)"
ASIDE = (
    "from skinwave.processes import {0}, ended_by_signals\n"
    "import meshes\nif __name__ == '__main__':\n    with ended_by_signals():\n        {1}"
)
CALLS = {
    "here": ASIDE.format("apart", "meshes.palm_mesh(meshes.Palm(), 3e-3)"),
    "apart": ASIDE.format("apart", "apart(meshes.palm_mesh, meshes.Palm(), 3e-3)"),
    "helper": ASIDE.format("helper", "with helper() as aside:\n            "
                           "aside.submit(meshes.palm_mesh, meshes.Palm(), 3e-3).result()"),
    "side_by_side": ASIDE.format(
        "side_by_side",
        "call = functools.partial(meshes.palm_mesh, meshes.Palm(), 3e-3)\n        "
        "list(side_by_side([call], bool, bool))",
    ).replace("import meshes", "import functools, meshes"),
}  # fmt: skip
# Processes of `apart` and of `helper` begin and end alike, by `as_part`.
ENDS = [
    ("here", signal.SIGTERM),
    ("here", signal.SIGINT),
    ("here", signal.SIGKILL),
    ("apart", signal.SIGINT),
    ("helper", signal.SIGTERM),
    ("side_by_side", signal.SIGINT),
    ("helper", signal.SIGKILL),
]


@pytest.fixture
def interruptible():
    """Interrupts are not ignored, as they are in a background job and what it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@LOOKED_UP
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(("call", "number"), ENDS)
def test_a_mesher_ends_with_what_asked_for_it(tmp_path, call, number):
    places = [tmp_path / name for name in ("work", "temporary")]
    for place in places:
        place.mkdir()
    (tmp_path / "script.py").write_text(CALLS[call])
    env = os.environ | {"SKINWAVE_CACHE": "", "TMPDIR": str(places[1])}
    words = [sys.executable, str(tmp_path / "script.py")]
    with subprocess.Popen(words, cwd=places[0], env=env, **QUIET) as parent:
        numbers = works_at(parent, "tetwild_child.py")
        time.sleep(1)
        parent.send_signal(number)
        code = parent.wait(30)
    assert not gone(numbers)
    assert code == {signal.SIGTERM: 143, signal.SIGINT: -2, signal.SIGKILL: -9}[number]
    if number != signal.SIGKILL:
        assert not list(places[1].iterdir())


@pytest.mark.slow
@LOOKED_UP
@pytest.mark.usefixtures("interruptible")
def test_a_rerun_hands_on_what_ends_it(tmp_path):
    """In a process with as many threads as the record has."""
    (tmp_path / "good.toml").write_text(corpus.GOOD)
    words = [sys.executable, "-m", "skinwave"]
    run = ["run", "good.toml", "--h", "3", "--model", "fem-transient", "--quiet", "--no-cache"]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    asked = os.environ | threads | {"TMPDIR": str(tmp_path / "temporary")}
    (tmp_path / "temporary").mkdir()
    subprocess.run([*words, *run, "--out", "out"], cwd=tmp_path, env=asked, check=True, **QUIET)
    asked |= dict.fromkeys(threads, "2")
    before = sorted(tmp_path.rglob("*"))
    for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 1)):
        with subprocess.Popen([*words, "rerun", "out"], cwd=tmp_path, env=asked, **QUIET) as again:
            numbers = works_at(again, "rerun")
            time.sleep(1.5)
            again.send_signal(number)
            assert again.wait(30) == code
        assert not gone(numbers)
        assert sorted(tmp_path.rglob("*")) == before


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
