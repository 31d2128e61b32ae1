"""Who may import whom, what importing costs, and what the project ships."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = {
    "simple_model": set(),
    "meshes": set(),
    "fem": {"simple_model", "meshes"},
    "skinwave": {"simple_model", "meshes", "fem"},
}

# Rooms within skinwave, and what each may import beside the modules at the top of it.
INNER = {
    "models": set(),
    "planning": {"models"},
    "patterns": set(),
    "pictures": {"models", "planning"},
    "verify": {"models", "planning", "pictures"},
    "studies": {"models", "planning", "pictures"},
    "reports": {"models", "planning", "pictures", "studies", "verify"},
    "sweeps": {"models", "planning", "pictures"},
    "web": {"models", "planning", "pictures", "reports", "studies"},
}


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_what_they_may(room):
    for path in (ROOT / room).rglob("*.py"):
        others = imported(path) & set(ROOMS) - {room}
        assert others <= ROOMS[room], path


@pytest.mark.parametrize("room", INNER)
def test_inner_rooms_import_only_what_they_may(room):
    for path in (ROOT / "skinwave" / room).rglob("*.py"):
        used = re.findall(r"from skinwave\.(\w+)[. ]", path.read_text())
        assert set(used) & {*INNER, "commands"} <= INNER[room] | {room}, path


@pytest.mark.parametrize("package", ["fem", "simple_model", "meshes"])
def test_the_numeric_packages_load_numpy_and_scipy_only(package):
    code = f"import sys, {package}; print(*{{name.split('.')[0] for name in sys.modules}})"
    loaded = set(subprocess.check_output([sys.executable, "-c", code], text=True).split())
    heavy = {
        "matplotlib",
        "pyvista",
        "vtkmodules",
        "meshio",
        "pytetwild",
        "trame",
        "rich",
        "pymetis",
        "dask",
        "pyarrow",
        "platformdirs",
        "jinja2",
    }
    assert not loaded & heavy
    assert {"numpy"} <= loaded


def test_help_loads_nothing_heavy():
    code = "import sys, skinwave.cli as c\ntry: c.main(['--help'])\nexcept SystemExit: pass\n"
    code += "assert not {'numpy', 'scipy', 'matplotlib', 'rich', 'dask'} & set(sys.modules)\n"
    code += "assert not {'jinja2', 'markupsafe', 'platformdirs'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_functions_are_looked_up_even_after_their_modules():
    code = (
        "import skinwave.simulation, skinwave.comparison, skinwave\n"
        "assert callable(skinwave.simulate) and callable(skinwave.compare)\n"
        "assert all(hasattr(skinwave, name) for name in skinwave.__all__)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_public_names_are_listed_and_found():
    code = (
        "import skinwave\n"
        "names = dir(skinwave)\n"
        "assert {*skinwave.__all__, '__version__'} <= set(names)\n"
        "import skinwave.planning.plan\n"
        "assert callable(skinwave.plan) and 'plan' in names\n"
        "assert 'scene' in skinwave.plan.__annotations__"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_version_is_what_is_installed(capsys):
    from importlib.metadata import version

    import skinwave
    from skinwave.cli import main

    assert skinwave.__version__ == version("skinwave")
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"skinwave {version('skinwave')}\n"


def test_sources_that_are_not_installed_have_a_version_too():
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
