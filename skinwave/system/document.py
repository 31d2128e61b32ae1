"""Pages: a `Report` is a title, a verdict and parts, written as one HTML file.

Parts are text (a paragraph each), `Table`, `Picture`, `Section`, `Details`, `Choice` or `Markup`.
The templates escape all text except `Markup`, which is made only from templates and literals.
"""

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

from markupsafe import Markup

from simple_model import Effort
from skinwave.system.failures import failure_text
from skinwave.system.scripts import digest
from skinwave.system.table import Table
from skinwave.system.templates import part, render, typeset


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


@dataclass(frozen=True)
class Section:
    """A part with a heading; level 3 is for a section inside another."""

    heading: str
    parts: "Sequence[Part]"
    level: int = 2


@dataclass(frozen=True)
class Details:
    """Parts that a reader can unfold."""

    heading: str
    parts: "Sequence[Part]"


@dataclass(frozen=True)
class Choice:
    """Parts by name. A page shows one of them at a time, and a button for each."""

    name: str
    options: "Mapping[str, Part]"


Part = str | Table | Picture | Section | Details | Choice


@dataclass(frozen=True)
class Report:
    """A page: title, paragraphs of the verdict, and parts.

    The first sentence names the `failures`. Warnings of `efforts`, which have names, follow.
    Pictures are written to the folder `pictures`.
    """

    title: str
    verdict: Sequence[str] = ()
    parts: Sequence[Part] = ()
    efforts: Sequence[tuple[str, Effort]] = ()
    pictures: str = ""
    failures: Mapping[str, str] = field(default_factory=dict)

    def html(self) -> str:
        """Return the page, with a policy that lets only inner pages run scripts."""
        failed, *verdict = (
            Markup('<p class="verdict">{}</p>').format(typeset(said)) if said else Markup()
            for said in (failure_text(self.failures), *self.verdict)
        )
        parts = (failed, warnings_banner(self.efforts), *verdict, *self.parts)
        body = Markup("\n").join(map(html_of, parts))
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
        if isinstance(each, Section | Details):
            yield from _flat(each.parts)
        elif isinstance(each, Choice):
            yield from _flat(each.options.values())


def html_of(one: Part) -> Markup:
    """Return a part for a page."""
    match one:
        case Markup():
            return one
        case str():
            return Markup("<p>{}</p>").format(typeset(one))
        case Table():
            return one.html()
        case Picture():
            data = b64encode(one.image).decode()
            return part("picture", data, one.caption, one.name, one.kind)
        case Choice():
            shown = [(name, html_of(each)) for name, each in one.options.items()]
            return part("choice", one.name, shown) if len(shown) > 1 else shown[0][1]
        case Section():
            parts = list(map(html_of, one.parts))
            return part("section", one.heading, one.level, parts, _anchor(one.heading))
        case Details():
            return part("details", one.heading, list(map(html_of, one.parts)), _anchor(one.heading))


def contents(parts: Iterable[Part]) -> Markup:
    """Return links to the sections and folded parts of a page."""
    headings = (each.heading for each in parts if isinstance(each, Section | Details))
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
    """Return the warnings of named responses for a page, empty if there are none."""
    return part("warnings", worst_warnings(efforts))


def inner_page(page: str, caption: str) -> Markup:
    """Return a page inside the page, for screens only; its scripts are isolated."""
    return part("inner_page", str(page), caption)


def worst_warnings(efforts: Iterable[tuple[str, Effort]]) -> list[str]:
    """Return the warnings of some responses, with their names unless all have the same warnings.

    Of warnings that differ only in numbers, return the one with the largest number, and count the
    others.
    """
    efforts, number = list(efforts), re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
    differ = len({tuple(effort.warnings) for _, effort in efforts}) > 1
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, effort in efforts:
        for sentence in effort.warnings:
            alike.setdefault(number.sub("#", sentence), []).append((name, sentence))
    found = []
    for group in alike.values():
        name, sentence = max(group, key=lambda one: [float(x) for x in number.findall(one[1])])
        of = f"{name}, and {len(group) - 1} more" if len(group) > 1 else name
        found.append(f"{sentence} ({of})" if name and differ else sentence)
    return found


def _policy(body: Markup) -> str:
    """Return the policy of a page.

    It may load its own pictures and styles, but nothing from a network, no forms, and no scripts
    except those of an inner page, by their digests.
    """
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; "
        "form-action 'none'"
    )
    # Escaped text has no quotes, so that each match is an inner page.
    inner = re.findall(r'<iframe [^>"]*"allow-scripts"[^>]* srcdoc="([^"]*)"', body)
    script = re.compile(r"<script\b[^>]*>(.*?)</script\s*>", re.DOTALL | re.IGNORECASE)
    scripts = (each for page in inner for each in script.findall(unescape(page)))
    allowed = " ".join(map(digest, scripts))
    return f"{policy}; script-src {allowed}" if allowed else policy
