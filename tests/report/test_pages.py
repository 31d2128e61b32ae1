"""Pages show what a user or a file has written, and run none of it."""

import json
import re
from contextlib import contextmanager
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from in_browser import needs_browser, settled

import skinwave
from simple_model import Effort, Response
from skinwave.commands.cli import main
from skinwave.scene.file import loads
from skinwave.studies import relax, tradeoff
from skinwave.studies.assumptions import ASSUMPTIONS
from skinwave.studies.relax import Hierarchy, HierarchyStep
from skinwave.studies.tradeoff import Candidate, Tradeoff
from skinwave.studies.tradeoff import Result as TradeoffResult
from skinwave.system import document
from skinwave.system.document import Details, Markup, Picture, Report, Section, html_of
from skinwave.system.table import Table
from skinwave.verify import suite
from skinwave.verify.case import Case, Check, Result

FIRST_ASSUMPTION = next(iter(ASSUMPTIONS))
# Begins as HTML of a cell did, and leaves an attribute, a title, an element of text and a frame.
HOSTILE = (
    "<b>'\"></title></pre></script></iframe><script>top.ran=1</script>"
    "<img src=x onerror=top.ran=1><svg onload=top.ran=1>$title{}"
)
RAN = "() => window.ran || document.querySelectorAll('body script, [onerror], [onload]').length"


def table(**sections):
    """A scene of a tenth of a second of work, its name hostile."""
    point = {"am_frequency_hz": 140, "duration_s": 0.05} | sections.pop("tacton", {})
    rest = {"probes": {"points_mm": [[0, 0], [5, 0]]}} | sections
    return tomli_w.dumps({"name": HOSTILE, "tacton": point} | rest)


def response(model="point-kernel", **fields):
    times = np.arange(500) / 1e4
    motion = np.sin(2 * np.pi * 140 * times)[:, None] * (
        [1.0, 0.5] if model == "point-kernel" else [0.5, 1.0]
    )
    probes = np.array([[0, 0], [5e-3, 0]])
    return Response(model=model, times=times, probes=probes, values=motion, **fields)


def relaxed(folder):
    steps = [HierarchyStep(name="a", dropped=(), model=HOSTILE, response=response())]
    steps += [
        HierarchyStep(
            name=FIRST_ASSUMPTION,
            dropped=(FIRST_ASSUMPTION,),
            model="m",
            response=response("other"),
        )
    ]
    failed = HierarchyStep(name="f", dropped=(), model="m", error=HOSTILE)
    scene = loads(table())
    found = Hierarchy(scene=scene, steps=(*steps, failed), side_steps=(), leave_one_out=())
    relax.write(folder, found)


def traded(folder):
    result = TradeoffResult(
        candidate=Candidate(model=HOSTILE), error=0.1, cold=1.0, warm=0.1, memory=1, dofs=1,
    )  # fmt: skip
    known = replace(result, candidate=Candidate(model="fem"))
    found = Tradeoff(
        results=(result, known), reference=Candidate(model="fem"), self_convergence=0.001
    )
    tradeoff.write(folder, loads(table()), found)


def verified(folder):
    check = Check(what=HOSTILE, value=1.0, reference=1.0, error=0.0, bar=0.1, unit=HOSTILE)
    found = Case(name=HOSTILE, title=HOSTILE, source=HOSTILE, mesh=HOSTILE, note=HOSTILE,
                 slow=False, checks=lambda: [check])  # fmt: skip
    result = Result(case=found, checks=(check,), seconds=1.0, error=HOSTILE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite, "TOPICS", {HOSTILE: (found,)})
        suite.page([result], 1).write(folder)


def ran(folder):
    (folder / "scene.toml").write_text(table(body={"kind": "none"}), encoding="utf-8")
    out = ["--out", str(folder / "out"), "--quiet"]
    assert main(["run", str(folder / "scene.toml"), *out]) == 0


def reported(folder):
    ran(folder)
    result = folder / "out"
    row = {"what": HOSTILE, "value": HOSTILE, "reason": HOSTILE}
    plan = {"rows": [row], "tolerance": 0.05, "warnings": [HOSTILE], "model": HOSTILE}
    plan["misfit"] = 0.1
    effort = json.loads((result / "effort.json").read_text())
    effort |= {"warnings": [HOSTILE], "solver": HOSTILE, "versions": {HOSTILE: HOSTILE}}
    for name, content in (("plan", plan), ("effort", effort)):
        (result / f"{name}.json").write_text(json.dumps(content))
    out = ["--out", str(folder / "report"), "--quiet"]
    assert main(["report", str(result), *out]) == 0


def compared(folder):
    body = {"size_x_mm": 30, "size_y_mm": 30, "thickness_mm": 6, "sides": "clamped"}
    (folder / "scene.toml").write_text(table(body=body), encoding="utf-8")
    out = ["--out", str(folder / "out"), "--quiet"]
    assert main(["compare", str(folder / "scene.toml"), "--element-size", "6", *out]) == 0


@contextmanager
def opened(browser, path, obeyed=False):
    """A page and what its console said, closed in the end; without its policy if `obeyed`."""
    context = browser.new_context(bypass_csp=obeyed)
    tab, said = context.new_page(), []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.set_default_timeout(120_000)
    tab.goto(f"file://{path}")
    settled(tab)
    yield tab, said
    context.close()


class Tags(HTMLParser):
    def __init__(self, page):
        super().__init__()
        self.found, self.text = set(), ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found |= {tag, *(name for name, _ in attrs if name.startswith("on"))}

    def handle_data(self, data):
        self.text += data


def test_pages_escape_markup_in_text(tmp_path):
    for write in (relaxed, traded, verified, reported, compared):
        folder = tmp_path / write.__name__
        folder.mkdir()
        write(folder)
        for path in folder.rglob("index.html"):
            text = path.read_text(encoding="utf-8")
            page = Tags(text)
            assert text.index("Content-Security-Policy") < text.index("<title>")
            assert "default-src 'none'" in unescape(text)
            assert not page.found & {"b", "script", "svg", "onerror", "onload"}
            assert HOSTILE in page.text


@pytest.mark.slow
@needs_browser
def test_the_policy_lets_a_page_within_a_page_run_its_own_scripts_only(browser, tmp_path):
    page = Report("t", parts=[Markup(f"<p>{HOSTILE}</p>")]).html()
    (tmp_path / "hostile.html").write_text(page, encoding="utf-8")
    for obeyed in (False, True):  # it would run without the policy
        with opened(browser, tmp_path / "hostile.html", obeyed) as (tab, _):
            assert bool(tab.evaluate("window.ran")) == obeyed
    inner = (
        "<body><script>document.body.append('drawn');\nlet a = '<é>';</script><script>"
        "try { top.ran = 1 } catch { document.body.append(' alone') }</script>"
    )
    page = Report("t", parts=[document.inner_page(inner, HOSTILE), HOSTILE]).html()
    (tmp_path / "index.html").write_text(page, encoding="utf-8")
    with opened(browser, tmp_path / "index.html") as (tab, said):
        assert said == []
        assert tab.frames[1].inner_text("body") == "drawn alone"
        assert tab.evaluate(RAN) == 0
    changed = page.replace("drawn", "changed")
    (tmp_path / "changed.html").write_text(changed, encoding="utf-8")
    with opened(browser, tmp_path / "changed.html") as (tab, said):
        assert tab.frames[1].inner_text("body").strip() == "alone"
        assert len(said) == 1


def test_only_markup_of_templates_is_not_escaped():
    cells = ["<b>1</b>", Markup("<b>2</b>"), Markup("<i>{}</i>").format("<b>"), "-1e+3"]
    made = Table(["a", "b", "c", "d"], [cells]).html()
    assert "<td>&lt;b&gt;1&lt;/b&gt;</td><td><b>2</b></td><td><i>&lt;b&gt;</i></td>" in made
    assert '<td class="number">\u22121\u00a0\u00d7\u00a010<sup>3</sup></td>' in made
    for made in (
        Report("<t>", ["<p>"]).html(), html_of(Section("<t>", ["<p>"])),
        html_of(Details("<t>", ["<p>"])), Table(["<t>"], [["<p>"]]).html(),
        html_of(Picture(b"", "<p>\"'", '<t>"')), document.inner_page("<p>", "<t>"),
        document.preformat("<p><t>"),
        document.warnings_banner([("<t>", Effort(warnings=("<p>",))), ("", Effort())]),
    ):  # fmt: skip
        assert not re.search(r"<[pt]>[^<]*(?!</p>)<[pt]>|<t>|<p>\"", made)
        assert "&lt;p&gt;" in made
        assert "&lt;t&gt;" in made


def test_pages_come_from_templates_alone():
    for path in Path(skinwave.__file__).parent.rglob("*.py"):
        assert "<!doctype" not in path.read_text(encoding="utf-8").lower(), path
