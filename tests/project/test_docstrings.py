"""Docstrings of public functions: numpydoc sections, one meaning for each index letter."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import fem
import meshes
import simple_model
import skinwave

ROOT = Path(__file__).parents[2]
PACKAGES = ("fem", "simple_model", "meshes")
ROOMS = ("bodies", "models", "planning")  # of skinwave, whose functions others call
LONGEST, EACH = 300, 33  # characters of a signature, or of each argument where there are ten
FEWEST = 3  # arguments from which a docstring has sections


def sources():
    """Source files of the packages below skinwave, and of skinwave what is called from outside."""
    exported = {home.replace(".", "/") for home in skinwave._HOMES.values()}
    for part in (*PACKAGES, *(f"skinwave/{room}" for room in ROOMS)):
        yield from (ROOT / part).rglob("*.py")
    for name in exported:
        yield ROOT / f"skinwave/{name}.py"


def functions(path):
    """Public functions of a file with `FEWEST` arguments or more, by module and name."""
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            given = node.args
            arguments = given.posonlyargs + given.args + given.kwonlyargs
            arguments += [given.vararg] if given.vararg else []
            if len(arguments) >= FEWEST:
                yield pytest.param(node, arguments, id=f"{module}.{node.name}")


def section(text, name):
    """Lines of a numpydoc section, unindented; none without it."""
    found = re.search(rf"^{name}\n-{{{len(name)}}}\n(.*?)(?=^\w+\n---|\Z)", text, re.M | re.S)
    return found.group(1).splitlines() if found else []


ALL = [entry for path in sorted(set(sources())) for entry in functions(path)]


@pytest.mark.parametrize(("node", "arguments"), ALL)
def test_public_functions_of_three_arguments_have_numpydoc_sections(node, arguments):
    text = ast.get_docstring(node) or ""
    named = {
        name.strip("* ")
        for line in section(text, "Parameters")
        if line[:1].strip() and " : " in line
        for name in line.split(" : ")[0].split(",")
    }
    assert {a.arg for a in arguments} == named, "each parameter and no other"
    if ast.unparse(node.returns) != "None":
        assert section(text, "Returns") or section(text, "Yields")
    if any(isinstance(part, ast.Raise) for part in ast.walk(node)):
        assert section(text, "Raises")
    assert not re.match(r"(What|Which|Of|Whether|The|A|An|This|It)\b", text), "a noun phrase first"


def test_index_letters_of_every_einsum_in_fem_are_listed_once():
    listed = re.findall(r"^    ([a-z](?: [a-z])*)  ", (ROOT / "fem/__init__.py").read_text(), re.M)
    letters = [letter for row in listed for letter in row.split()]
    assert len(letters) == len(set(letters)) > 10
    used = set()
    for path in (ROOT / "fem").glob("*.py"):
        for subscripts in re.findall(r'einsum\(\s*"([^"]+)"', path.read_text(encoding="utf-8")):
            used |= set(re.findall(r"[a-z]", subscripts))
    assert used <= set(letters)


def public():
    """What the packages export, by name, and the methods of its classes."""
    for package in (simple_model, meshes, fem, skinwave):
        for name in getattr(package, "__all__", dir(package)):
            found = getattr(package, name, None)
            if name.startswith("_") or not callable(found):
                continue
            yield pytest.param(found, id=f"{package.__name__}.{name}")
            for method, _ in inspect.getmembers(found) if inspect.isclass(found) else ():
                if not method.startswith("_") and callable(getattr(found, method)):
                    yield pytest.param(getattr(found, method), id=f"{name}.{method}")


@pytest.mark.parametrize("found", public())
def test_signatures_are_short_and_name_types_as_the_source_does(found):
    try:
        signature = inspect.signature(found)
    except ValueError:  # of a class in C
        return
    assert "typing." not in str(signature)
    if not inspect.isclass(found):  # a record has as many fields as it has
        assert len(str(signature)) < max(LONGEST, EACH * len(signature.parameters))
