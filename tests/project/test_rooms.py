"""Who may import whom, what importing costs, what the project ships, and deliberate faults."""

import ast
import re
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from importlib.metadata import version
from pathlib import Path

import pytest

import skinwave
from bench.faults import faults
from skinwave.commands.cli import main

ROOT = Path(__file__).parents[2]
ROOMS = {
    "simple_model": set(),
    "meshes": set(),
    "fem": {"simple_model", "meshes"},
    "skinwave": {"simple_model", "meshes", "fem"},
}

# Rooms within skinwave, in order: each imports those before it only.
INNER = (
    "system", "bodies", "scene", "models", "planning", "results", "report", "patterns", "measure",
    "sweeps", "live", "verify", "studies", "commands",
)  # fmt: skip
MESHES = ("surface", "shapes", "volume", "files")  # within meshes, likewise
WITHIN = {"meshes": MESHES, "skinwave": INNER}


def imports_of(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports are not read here"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.fixture(scope="module")
def graph() -> dict[str, set[str]]:
    files = {}
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found = {}
    for module, path in files.items():
        names = imports_of(path)
        used = {name if name in files else name.rpartition(".")[0] for name in names}
        found[module] = used & files.keys() - {module}
    return found


def test_no_modules_import_each_other_in_a_circle(graph):
    assert len(graph) > 200
    assert {"meshes", "fem.assembly"} <= graph["fem"] | graph["fem.geometry"]
    assert "meshes.files.mesh_files" in graph["skinwave.commands.mesh"]  # within a function
    list(TopologicalSorter(graph).static_order())  # whose CycleError names the circle


def rooms_of(package: str, modules: set[str]) -> set[str]:
    """The rooms within a package that modules are in."""
    parts = [module.split(".") for module in modules]
    return {own[1] for own in parts if own[0] == package and own[1:2] and own[1] in WITHIN[package]}


def test_rooms_import_only_rooms_below_them(graph):
    for module, used in graph.items():
        package = module.split(".")[0]
        assert {name.split(".")[0] for name in used} <= ROOMS[package] | {package}, module
    for package, order in WITHIN.items():
        for module, used in graph.items():
            for own in rooms_of(package, {module}):
                assert rooms_of(package, used) <= {*order[: order.index(own) + 1]}, module


def test_modules_of_skinwave_are_in_rooms():
    loose = {path.name for path in (ROOT / "skinwave").glob("*.py")}
    assert loose == {"__init__.py", "__main__.py", "typing.py"}
    folders = {path.parent.name for path in (ROOT / "skinwave").glob("*/__init__.py")}
    assert folders == set(INNER)


def test_two_modules_start_processes():
    starts = r"subprocess\.(run|Popen|check_)|create_subprocess|get_context|os\.(fork|exec|sys)"
    places = (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    found = {str(path.relative_to(ROOT)) for path in places if re.search(starts, path.read_text())}
    assert found == {"meshes/subprocess_call.py", "skinwave/system/processes.py"}


def loaded_by(code: str) -> set[str]:
    code += "\nimport sys; print('loaded:', *sys.modules)"
    said = subprocess.check_output([sys.executable, "-c", code], text=True)
    return set(said.rpartition("loaded:")[2].split())


def test_packages_and_commands_load_only_what_they_need():
    heavy = {"matplotlib", "pyvista", "vtkmodules", "meshio", "pytetwild", "rich", "pymetis",
             "pyarrow", "platformdirs", "jinja2"}  # fmt: skip
    found = loaded_by("import fem, simple_model, meshes")
    few = {"scipy.signal", "scipy.stats", "scipy.interpolate", "scipy.optimize"}
    assert "numpy" in found
    assert not found & (heavy | few)
    help_of = "import skinwave.commands.cli as c\ntry: c.main(['--help'])\nexcept SystemExit: pass"
    assert not loaded_by(help_of) & (heavy | {"numpy", "scipy", "markupsafe"})
    commands = "import skinwave.planning.simulate, skinwave.sweeps.sweep, skinwave.live.serve"
    assert not loaded_by(commands) & (few - {"scipy.signal", "scipy.stats"} | {"matplotlib.figure"})
    assert not loaded_by("import skinwave.studies.study") & (few - {"scipy.signal"})


def test_public_names_are_importable_after_their_modules():
    code = (
        "import skinwave\n"
        "assert {*skinwave.__all__, '__version__'} <= {*dir(skinwave)}\n"
        "import skinwave.planning.simulate, skinwave.planning.plan, skinwave.results.comparison\n"
        "assert callable(skinwave.simulate) and callable(skinwave.compare)\n"
        "assert callable(skinwave.plan) and 'scene' in skinwave.plan.__annotations__\n"
        "assert all(hasattr(skinwave, name) for name in skinwave.__all__)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_version_is_what_is_installed_if_it_is(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"skinwave {version('skinwave')}\n"
    assert skinwave.__version__ == version("skinwave")
    code = (
        "import importlib.metadata as m\n"
        "def none(name): raise m.PackageNotFoundError(name)\n"
        "m.version = none\n"
        "import skinwave\n"
        "assert skinwave.__version__ == 'unknown'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_dependencies_have_lower_bounds_only():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [d for group in project["optional-dependencies"].values() for d in group]
    for dependency in project["dependencies"] + extras:
        requirement = dependency.split(";")[0]
        assert ">=" in requirement
        assert not set("<,~") & set(requirement), dependency
        assert "==" not in requirement


def test_the_packages_are_named_and_typed():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    packages = build["targets"]["wheel"]["packages"]
    assert packages == sorted(ROOMS)
    assert all((ROOT / package / "py.typed").exists() for package in packages)


def test_deliberate_faults_apply_and_name_tests():
    listed = list(faults())
    lines = (ROOT / "bench/faults.txt").read_text("utf-8").splitlines()
    # A fault that is not in three lines would be skipped.
    assert len(listed) == sum(line.startswith("- ") for line in lines) > 100
    assert [fault.name for fault in listed if not fault.applied()] == []
    files = {name for fault in listed for name in fault.tests if name.endswith(".py")}
    assert [name for name in sorted(files) if not (ROOT / name).exists()] == []
