"""Pages: a `Report` is a title, a verdict and parts, written as one HTML file.

Parts are text (a paragraph each), `Table`, `Picture`, `Section`, `Details`, `Choice` or `Markup`.
The templates escape all text except `Markup`, which is made only from templates and literals.
"""

import hashlib
import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

from markupsafe import Markup

from simple_model import Effort
from skinwave.system.failures import failure_text
from skinwave.system.table import Table
from skinwave.system.templates import part, render, typeset

# A page may load its own pictures and styles; no network, forms or scripts, except the scripts of
# an inner page, by their digests.
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
_INNER = re.compile(r'<iframe [^>"]*"allow-scripts"[^>]* srcdoc="([^"]*)"')
_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script\s*>", re.DOTALL | re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True)
class Picture:
    """An image of a `kind`, with a caption. With a `name`, `files` by suffix, by default the image,
    are written next to the page.
    """

    image: bytes
    caption: str
    name: str = ""
    kind: str = "png"
    files: Mapping[str, bytes] = field(default_factory=dict)

    def html(self) -> Markup:
        """Return the image for a page."""
        return part("picture", b64encode(self.image).decode(), self.caption, self.name, self.kind)


@dataclass(frozen=True)
class Section:
    """A part with a heading; level 3 is for a section inside another."""

    heading: str
    parts: "Sequence[Part]"
    level: int = 2

    def html(self) -> Markup:
        """Return heading and parts for a page."""
        parts = list(map(_html, self.parts))
        return part("section", self.heading, self.level, parts, _anchor(self.heading))


@dataclass(frozen=True)
class Details:
    """Parts that a reader can unfold."""

    summary: str
    parts: "Sequence[Part]"

    def html(self) -> Markup:
        """Return summary and parts for a page."""
        return part("details", self.summary, list(map(_html, self.parts)), _anchor(self.summary))


@dataclass(frozen=True)
class Choice:
    """Parts by name, of which a page shows one at a time; `name` is the name of the choice."""

    name: str
    options: "Mapping[str, Part]"

    @property
    def parts(self) -> "Sequence[Part]":
        """All parts."""
        return list(self.options.values())

    def html(self) -> Markup:
        """Return a button for each part, and the chosen part."""
        shown = [(name, _html(each)) for name, each in self.options.items()]
        return part("choice", self.name, shown) if len(shown) > 1 else shown[0][1]


Part = str | Table | Picture | Section | Details | Choice


@dataclass(frozen=True)
class Report:
    """A page: title, paragraphs of the verdict, and parts.

    The first sentence names `failures`; warnings of `efforts`, given by name, follow. Pictures are
    written to the folder `pictures`.
    """

    title: str
    verdict: Sequence[str] = ()
    parts: Sequence[Part] = ()
    efforts: Sequence[tuple[str, Effort]] = ()
    pictures: str = ""
    failures: Mapping[str, str] = field(default_factory=dict)

    def html(self) -> str:
        """Return the page with its policy."""
        failed, *verdict = (
            Markup('<p class="verdict">{}</p>').format(typeset(said)) if said else Markup()
            for said in (failure_text(self.failures), *self.verdict)
        )
        parts = (failed, warnings_banner(self.efforts), *verdict, *self.parts)
        body = Markup("\n").join(map(_html, parts))
        return render("page.html", title=self.title, body=body, policy=_policy(body))

    def write(self, folder: Path) -> None:
        """Write index.html, and files of all named pictures and tables, into a folder."""
        beside = folder / self.pictures
        beside.mkdir(exist_ok=True)
        for one in _flat(self.parts):
            if isinstance(one, Picture) and one.name:
                for ending, content in (one.files or {one.kind: one.image}).items():
                    (beside / f"{one.name}.{ending}").write_bytes(content)
            elif isinstance(one, Table) and one.name:
                (folder / f"{one.name}.csv").write_bytes(one.to_csv())
        (folder / "index.html").write_text(self.html(), encoding="utf-8")


def _flat(parts: Iterable[Part]) -> Iterator[Part]:
    for each in parts:
        yield each
        if isinstance(each, Section | Details | Choice):
            yield from _flat(each.parts)


def _html(one: Part) -> Markup:
    if isinstance(one, Markup):
        return one
    return Markup("<p>{}</p>").format(typeset(one)) if isinstance(one, str) else one.html()


def contents(parts: Iterable[Part]) -> Markup:
    """Return links to the sections and folded parts of a page."""
    headings = [
        each.heading if isinstance(each, Section) else each.summary
        for each in parts
        if isinstance(each, Section | Details)
    ]
    return part("contents", [(_anchor(heading), heading) for heading in headings])


def _anchor(heading: str) -> str:
    """Return the name of a heading in links."""
    return re.sub(r"\W+", "-", heading.lower()).strip("-")


def live_link(file: str) -> Markup:
    """Return a paragraph with a link to a live page."""
    return Markup(
        '<p><a href="{}">Change the Tacton and see the waves move</a>: a page that computes in the '
        "browser.</p>"
    ).format(file)


def preformat(text: str) -> Markup:
    """Return text with its own lines and spaces."""
    return Markup("<pre>{}</pre>").format(text)


def warnings_banner(efforts: Iterable[tuple[str, Effort]]) -> Markup:
    """Return all warnings of named responses for a page; empty without warnings."""
    return part("warnings", worst_warnings(efforts))


def inner_page(page: str, caption: str) -> Markup:
    """Return a page inside the page, for screens only; its scripts are isolated."""
    return part("inner_page", str(page), caption)


def worst_warnings(efforts: Iterable[tuple[str, Effort]]) -> list[str]:
    """Return the warnings of some responses, with their names unless all have the same warnings.

    If warnings differ only in numbers, the one with the largest is returned with the number of
    others.
    """
    efforts = list(efforts)
    differ = len({tuple(effort.warnings) for _, effort in efforts}) > 1
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, effort in efforts:
        for sentence in effort.warnings:
            alike.setdefault(_NUMBER.sub("#", sentence), []).append((name, sentence))
    found = []
    for group in alike.values():
        name, sentence = max(group, key=lambda one: [float(x) for x in _NUMBER.findall(one[1])])
        of = f"{name}, and {len(group) - 1} more" if len(group) > 1 else name
        found.append(f"{sentence} ({of})" if name and differ else sentence)
    return found


def _policy(body: Markup) -> str:
    """Return the policy of a page."""
    # Escaped text has no quotes, so that each match is an inner page.
    inner = (unescape(found) for found in _INNER.findall(body))
    scripts = [script for page in inner for script in _SCRIPT.findall(page)]
    if not scripts:
        return POLICY
    digests = (b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    return f"{POLICY}; script-src " + " ".join(f"'sha256-{digest}'" for digest in digests)
