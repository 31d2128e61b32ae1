"""Docstrings, comments, messages and pages use the field's terms, as docs/glossary.md has them."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# Within a text: what it computes, names, and a documented parameter with its class.
CODE = re.compile(r"\{[^{}]*\}|`[^`]*`|^ +\w+(, \w+)* :( [A-Z]\w+)?")
PACKAGES = ("fem", "meshes", "simple_model", "skinwave", "bench")
REFUSED = {
    r"\bendless": "infinite, laterally infinite layer, half-space",
    r"\bexact waves?\b": "wavenumber integral, Green's function, analytic solution",
    r"\b(sends?|sent|sending|comes?|came|coming) back\b": "reflection, reflected waves",
    r"\bnothing holds|\bwhat holds\b|\bunheld\b": "unconstrained body",
    r"\bflies away|\bever further\b": "rigid-body drift",
    r"\btakes? waves away|\blets? (no )?waves? (out|return)": "absorbing layer",
    r"\bacts directly\b|\bthe remedy\b": "mixed u-p split, volumetric locking",
    r"\bclusters? of elements\b": "macroelements",
    r"\ba small model\b|\bthe large one\b|\bthe large model\b": "reduced-order model",
    r"\bjudge[ds]?\b|\bjudging\b": "assessed",
    r"\bverdicts?\b|\bstatements?\b": "claim",
    r"\btold apart\b|\buntold\b|\btell apart\b": "resolved, unresolved",
    r"\bknobs?\b": "discretisation parameters, solver options",
    r"\brungs?\b|\bladders?\b|\bclimbs?\b": "model hierarchy, step",
    r"\bkept on disk\b|\bthe next answer\b": "cached",
    r"\bwrong by\b|\bhow wrong\b|\bright to\b|\bgood enough\b": "relative error of, accurate to",
    r"\bleaves? ringing\b": "transient, free vibration",
    r"\bgives? way\b": "compliance, deflects",
    r"\bfelt\b": "above threshold, sensation level",
    r"\bunknowns\b": "degrees of freedom (dofs)",
    # After a dot it is a name, as skinwave.prepare.
    r"(?<!\.)\bprepare[ds]?\b|\bpreparing\b": "reduced body, offline stage",
    r"(?<!\.)\banswer(s|ed|ing)?\b": "response",
    r"upon every other\b": "dense added-mass operator",
}
FIRST = re.compile(r"(What|Which|Of)\b")


def texts(path):
    """Number and text of lines that a reader or user sees; of Python, strings and comments."""
    if path.suffix != ".py":
        yield from enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        return
    source = path.read_text(encoding="utf-8")
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        is_text = token.type == tokenize.STRING and (" " in token.string)
        if token.type == tokenize.COMMENT or is_text:
            for k, line in enumerate(token.string.splitlines()):
                yield token.start[0] + k, CODE.sub("", line)


def files():
    found = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
    found += [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found += [*sorted((ROOT / "examples").glob("*.toml")), *sorted((ROOT / "bench").glob("*.md"))]
    return (
        found
        + sorted((ROOT / "skinwave").rglob("*.js"))
        + sorted((ROOT / "skinwave").rglob("*.html"))
    )


def refused(path):
    name = str(path.relative_to(ROOT))
    for line, text in texts(path):
        for pattern, instead in REFUSED.items():
            for hit in re.finditer(pattern, text, re.IGNORECASE):
                yield f"{name}:{line}: '{hit.group()}', say {instead}: {text.strip()}"


def first_lines(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            said = ast.get_docstring(node) or ""
            if FIRST.match(said):
                yield f"{path.relative_to(ROOT)}: {said.splitlines()[0]}"


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_words_are_those_of_the_field(path):
    assert list(refused(path)) == []
    if path.suffix == ".py":
        assert list(first_lines(path)) == []
