"""Shared, small: a cache of their own, and a body that no element fits well."""

import os
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

if "PYTEST_XDIST_WORKER" in os.environ:  # before anything that reads it: a core each
    os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest
from corpus import SMALL, contents
from hypothesis import HealthCheck, settings
from in_browser import chromium
from shares import dealt

import meshes
from meshes import subprocess_call
from skinwave.commands import kept
from skinwave.commands.cli import main
from skinwave.verify import elements

# The same examples every time, whatever the speed of the machine.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, max_examples=25,
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
settings.load_profile("repeatable")


@pytest.hookimpl(trylast=True)  # when `-m` has left tests out
def pytest_collection_modifyitems(config, items):
    """Slow modules first in the share that each worker begins with, so that none ends with one."""
    workers = getattr(config, "workerinput", {}).get("workercount", 1)
    if workers > 1:
        items[:] = dealt(items, workers)


@pytest.fixture(scope="session", autouse=True)
def fresh_cache(tmp_path_factory):
    """Cold cache of the tests, whatever this machine has cached before; workers share it. Commands
    compute, also if an earlier test had the same result.
    """
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    os.environ["SKINWAVE_CACHE"] = str(base / "cache")
    kept.COMMANDS = ()


@pytest.fixture(scope="session")
def distorted_cube() -> meshes.TetMesh:
    """A unit cube of ten-node tetrahedra whose inner corners are shaken."""
    return elements.distorted_cube()


@pytest.fixture
def read_here(monkeypatch):
    """Read mesh files in this process, which has imported the readers already."""
    monkeypatch.setattr(subprocess_call, "call_reader", lambda read, path: read(path))


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """The path of a small scene in an empty working directory."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "short.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture
def refused(capsys):
    """The one line by which a command is refused; all in the working directory stays the same."""

    def call(*arguments):
        before = contents(Path.cwd())
        assert main([*map(str, arguments)]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.startswith("skinwave: ")
        assert printed.err.count("\n") == 1
        assert contents(Path.cwd()) == before
        return printed.err

    return call


class Here:
    """An executor that calls at once, in this process."""

    map = staticmethod(map)

    def shutdown(self, **options):
        """Nothing is left to do."""

    def submit(self, function, *given, **options):
        done = Future()
        try:
            done.set_result(function(*given, **options))
        except (ValueError, ArithmeticError) as error:
            done.set_exception(error)
        return done


@pytest.fixture
def in_one_process(monkeypatch):
    """Studies without processes beside this one, where these are not what is tested."""

    @contextmanager
    def here(count, **options):
        yield Here()

    monkeypatch.setenv("SKINWAVE_CACHE", os.environ["SKINWAVE_CACHE"])  # which a study may change
    for study in ("study", "relax", "tradeoff"):
        monkeypatch.setattr(f"skinwave.studies.{study}.pool", here)


@pytest.fixture(scope="session")
def browser():
    """A browser, as Playwright has it."""
    with chromium() as found:
        yield found
