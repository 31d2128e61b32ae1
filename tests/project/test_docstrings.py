"""Docstrings of what the packages export, and one meaning for each index letter."""

import inspect
import re
from pathlib import Path

import fem
import meshes
import simple_model
import skinwave

ROOT = Path(__file__).parents[2]
PACKAGES = (simple_model, meshes, fem, skinwave)
NAMES = {package.__name__ for package in PACKAGES}
LONGEST, EACH = 300, 33  # characters of a signature, or of each argument where there are ten
FEWEST = 3  # arguments from which a docstring has sections


def exported():
    """What the packages export, by name, and the methods of its classes."""
    for package in PACKAGES:
        for name in package.__all__:
            found = getattr(package, name)
            if callable(found):
                yield f"{package.__name__}.{name}", found
            for method, own in inspect.getmembers(found) if inspect.isclass(found) else ():
                if not method.startswith("_") and callable(own):
                    yield f"{name}.{method}", own


def section(text, name):
    """Lines of a numpydoc section, unindented; none without it."""
    found = re.search(rf"^{name}\n-{{{len(name)}}}\n(.*?)(?=^\w+\n---|\Z)", text, re.M | re.S)
    return found.group(1).splitlines() if found else []


def lacks(function):
    """What the docstring of a function lacks."""
    text, signature = inspect.getdoc(function) or "", inspect.signature(function)
    named = {
        name.strip("* ")
        for line in section(text, "Parameters")
        if line[:1].strip() and " : " in line
        for name in line.split(" : ")[0].split(",")
    }
    others = {n for n, each in signature.parameters.items() if each.kind is each.VAR_KEYWORD}
    if missing := (set(signature.parameters) ^ named) - others:
        yield f"parameters {missing}"
    if str(signature.return_annotation) != "None" and not (
        section(text, "Returns") or section(text, "Yields")
    ):
        yield "returns"
    if re.search(r"^    raise ", inspect.getsource(function), re.M) and not section(text, "Raises"):
        yield "raises"
    if re.match(r"(What|Which|Of|The|A|An|This|It)\b", text):
        yield "a verb or noun first"


def test_exported_functions_of_three_arguments_have_numpydoc_sections():
    found = {
        name: [*lacks(each)]
        for name, each in exported()
        if inspect.isfunction(each)
        and name.split(".")[0] in NAMES
        and len(inspect.signature(each).parameters) >= FEWEST
    }
    assert len(found) > 40
    assert not {name: said for name, said in found.items() if said}


def test_index_letters_of_every_einsum_in_fem_are_listed_once():
    listed = re.findall(r"^    ([a-z](?: [a-z])*)  ", (ROOT / "fem/__init__.py").read_text(), re.M)
    letters = [letter for row in listed for letter in row.split()]
    assert len(letters) == len(set(letters)) > 10
    used = set()
    for path in (ROOT / "fem").glob("*.py"):
        for subscripts in re.findall(r'einsum\(\s*"([^"]+)"', path.read_text(encoding="utf-8")):
            used |= set(re.findall(r"[a-z]", subscripts))
    assert used <= set(letters)


def test_signatures_are_short_and_name_types_as_the_source_does():
    for name, each in exported():
        try:
            signature = inspect.signature(each)
        except ValueError:  # of a class in C
            continue
        assert "typing." not in str(signature), name
        if not inspect.isclass(each):  # a record has as many fields as it has
            assert len(str(signature)) < max(LONGEST, EACH * len(signature.parameters)), name
