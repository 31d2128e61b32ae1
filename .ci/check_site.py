"""Check built pages: every link and anchor within the site, no file from a network, axe-core.

    python .ci/check_site.py FOLDER

Pages are opened from the file system by chromium without a network. Where playwright, chromium or
axe-playwright-python are missing, it says so and checks links alone.
"""

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

CHROMIUM = Path("/usr/bin/chromium")
# Attributes by which a browser fetches a file, or goes to one.
FETCHED = {
    ("img", "src"),
    ("script", "src"),
    ("iframe", "src"),
    ("link", "href"),
    ("source", "src"),
}
OPENED = ("index", "waves", "tutorial/1-first-scene", "tutorial/2-kernel-and-waves", "how-to",
          "explanation/load", "reference/commands", "reference/scene-keys",
          "reference/api-skinwave", "reference/verification", "gallery/index",
          "gallery/11_fingertip_with_bone")  # fmt: skip
WIDE_CODE = "[...document.querySelectorAll('pre')].some((x) => x.scrollWidth > x.clientWidth)"
SERIOUS = ("serious", "critical")


class Page(HTMLParser):
    """Anchors of a page, and its links: tag, attribute and address."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[tuple[str, str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Keep what a tag names and where it points."""
        for name, value in attributes:
            if name in ("id", "name") and value:
                self.anchors.add(value)
            if name in ("href", "src") and value:
                self.links.append((tag, name, value))


def broken(folder: Path) -> Iterator[str]:
    """Sentences on links that lead nowhere, and files that a network would have to bring."""
    pages = {path: Page(path.read_text("utf-8")) for path in sorted(folder.rglob("*.html"))}

    def anchors(target: Path) -> set[str]:
        return pages[target].anchors if target in pages else set()

    for path, page in pages.items():
        name = path.relative_to(folder)
        for tag, attribute, address in page.links:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                inline = parts.scheme == "data"
                if (tag, attribute) in FETCHED and not inline:
                    yield f"{name}: fetches {address}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield f"{name}: no {address}"
            elif parts.fragment and unquote(parts.fragment) not in anchors(target):
                yield f"{name}: no anchor {address}"


def inaccessible(folder: Path) -> Iterator[str]:
    """Serious and critical violations that axe-core finds, and messages of the browser."""
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=str(CHROMIUM), args=["--headless", "--no-sandbox", "--disable-gpu"]
        )
        context = browser.new_context(offline=True, reduced_motion="reduce")
        for name in OPENED:
            page, said = context.new_page(), []
            page.on("pageerror", lambda error, said=said: said.append(str(error)))
            page.on("requestfailed", lambda request, said=said: said.append(request.url))
            page.goto((folder / f"{name}.html").as_uri())
            for width in (1280, 400):
                page.set_viewport_size({"width": width, "height": 900})
                if page.evaluate("document.documentElement.scrollWidth") > width:
                    yield f"{name}: is wider than {width} pixels"
                if width == 1280 and page.evaluate(WIDE_CODE):
                    yield f"{name}: a line of code is wider than its column"
            yield from (f"{name}: {text}" for text in said)
            # Without `preload`, which asks for style sheets that pages from files do not hand out.
            options = {"resultTypes": ["violations"], "preload": False}
            found = Axe().run(page, options=options).response
            for each in found["violations"]:
                if each["impact"] in SERIOUS:
                    where = each["nodes"][0]["target"]
                    yield f"{name}: {each['id']} at {where}, {len(each['nodes'])} in all"
            page.close()
        yield from unmoved(context.new_page(), folder)
        browser.close()


def unmoved(page: Any, folder: Path) -> Iterator[str]:
    """Sentences on what does not follow a control of the live page, or differs from Python."""
    address = (folder / "waves.html").as_uri()
    page.goto(f"{address}#selftest")
    said = page.locator("#selftest-title", has_text="largest error")
    said.wait_for(timeout=120_000)
    if said.get_attribute("data-failed") != "0":  # tests whose error exceeds the one stated
        yield f"waves: {said.inner_text()}"
    page.goto(f"{address}#x=10")
    page.reload()
    page.locator(".tile").first.wait_for()
    before = page.inner_text("#tiles")
    page.get_by_role("slider", name="Drawing speed").first.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(1000)
    if page.inner_text("#tiles") == before:
        yield "waves: the speed of the focus has no effect"


def main() -> int:
    """Check a folder; 1 if anything is wrong."""
    folder = Path(sys.argv[1]).resolve()
    found = [*broken(folder)]
    try:
        found += inaccessible(folder) if CHROMIUM.exists() else []
    except ImportError as error:
        print(f"{error.name} is missing: pages are not opened in a browser")
    print(
        "\n".join(found)
        or f"{len([*folder.rglob('*.html')])} pages: links and anchors lead somewhere"
    )
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
