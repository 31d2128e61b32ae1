"""Who may open a page, and what a page may send."""
# ruff: noqa: E402, what follows needs the libraries that are looked for first

import asyncio
import json
import os
import re
from contextlib import asynccontextmanager
from unittest.mock import Mock

import pytest

aiohttp = pytest.importorskip("aiohttp")
for name in ("msgpack", "trame", "trame_vuetify"):
    pytest.importorskip(name)
from aiohttp.test_utils import TestClient, TestServer

from skinwave.web import access, asked, downloads, front, moves
from skinwave.web.access import is_local, policy
from skinwave.web.controls import STARTS
from skinwave.web.page import page_text

PATHS = ("/", "/alive", "/turn?page=a", "/__skinwave/opening.js", "/index.html", "/session/x")


@asynccontextmanager
async def fronted(monkeypatch, token="right"):
    """A server, of which no process starts, and a browser's client of it."""

    async def never(_):
        await asyncio.Event().wait()

    monkeypatch.setattr(front, "started", never)
    one = front.Front(token=token)
    async with (
        TestServer(one.app(*front.served())) as server,
        TestClient(server, cookie_jar=aiohttp.CookieJar(unsafe=True)) as client,
    ):
        yield one, client


# --- what a page asks for as it opens ---------------------------------------------------------


@pytest.mark.parametrize(
    "sent",
    [
        b"", b"null", b"[]", b'"text"', b"7", b"{", b"\xff\xfe", b"[" * 30_000, b"x" * 200_000,
        b'{"am": null}', b'{"am": {"a": 1}}', b'{"am": [1]}', b'{"paths": "\\ud800"}',
        b'{"am": ' + b"9" * 5000 + b"}",
    ],
    ids=lambda sent: repr(sent[:24]),
)  # fmt: skip
def test_a_request_that_is_malformed_takes_no_process(monkeypatch, sent):
    async def posted():
        async with fronted(monkeypatch) as (one, client):
            await client.get("/?token=right")
            prepared = one._spare
            answer = await client.post("/paraview/", data=sent)
            said = (await answer.json())["error"]
            assert one._spare is prepared
            assert not prepared.done()
            assert (one.turns.there, one.turns.opening) == (0, 0)
            return answer.status, said

    assert asyncio.run(posted()) == (400, front.UNREAD.replace("'", "&#x27;"))


def test_a_charset_that_nobody_knows_is_malformed(monkeypatch):
    async def posted():
        async with fronted(monkeypatch) as (_, client):
            await client.get("/?token=right")
            headers = {"Content-Type": "application/json; charset=none-such"}
            return (await client.post("/paraview/", data=b"{}", headers=headers)).status

    assert asyncio.run(posted()) == 400


def test_a_body_that_would_have_to_be_unpacked_is_refused(monkeypatch):
    async def posted():
        async with fronted(monkeypatch) as (_, client):
            await client.get("/?token=right")
            sent = {"data": b"not packed", "headers": {"Content-Encoding": "gzip"}}
            answer = await client.post("/paraview/", **sent)
            return answer.status, await answer.text()

    assert asyncio.run(posted()) == (400, access.ENCODED)


def test_of_a_request_values_of_controls_are_kept():
    given = {"am": 77, "paths": "circle/20/0/0", "sessionURL": "ws://elsewhere", "application": {}}
    assert front.asked(json.dumps(given)) == {"am": "77", "paths": "circle/20/0/0"}


# --- who asks ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "origin", "local"),
    [
        ("127.0.0.1:8080", "", True),
        ("localhost:8080", "http://localhost:8080", True),
        ("127.0.0.1", "", True),
        ("127.0.0.1:8080", "http://elsewhere.example", False),
        ("127.0.0.1:8080", "http://127.0.0.1:8081", False),
        ("127.0.0.1:8080", "null", False),
        ("elsewhere.example:8080", "", False),
        ("elsewhere.example:8080", "http://elsewhere.example:8080", False),
        ("127.0.0.1.elsewhere.example", "", False),
        ("127.0.0.1:80;script-src *", "", False),
        ("", "", False),
    ],
)
def test_only_this_machine_itself_is_local(host, origin, local):
    assert is_local(host, origin) is local


def test_every_answer_has_a_policy(monkeypatch):
    async def asked_for():
        async with fronted(monkeypatch) as (_, client):
            refused = await client.get("/")
            await client.get("/?token=right")
            answers = [refused, *[await client.get(path) for path in PATHS]]
            page = await (await client.get("/")).text()
            return [dict(answer.headers) for answer in answers], page, client.port

    found, page, port = asyncio.run(asked_for())
    for headers in found:
        assert headers["Content-Security-Policy"] == policy(f"127.0.0.1:{port}")
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
    assert re.findall(r"<script[^>]*>\s*[^<\s]", page) == [], "no script in the text of the page"
    assert "unsafe-inline" not in re.search("script-src[^;]*", policy("localhost:1"))[0]
    assert "elsewhere" not in policy("elsewhere.example")


@pytest.mark.parametrize("scripts", ["", 2 * '<script type="module" src="a.js"></script>'])
def test_a_page_of_trame_that_begins_otherwise_is_refused(tmp_path, scripts):
    (tmp_path / "index.html").write_text(f"<html><head>{scripts}</head></html>")
    with pytest.raises(ValueError, match="install another version"):
        page_text(str(tmp_path))


# --- what a page sends -------------------------------------------------------------------------


class Server:
    """Parts of trame's server that a session uses."""

    def __init__(self):
        from trame.app import get_server

        self.real = get_server("asked", client_type="vue3")


@pytest.fixture(scope="module")
def session():
    from skinwave.web.session import Session

    one = Session(Server().real, STARTS | {"body": "none"})
    moves.connect(one)
    return one


@pytest.mark.parametrize(
    ("key", "value", "taken"),
    [
        ("am", 77, True), ("am", "7", True), ("body", "none", True), ("opened", None, True),
        ("phase", 50, False), ("span", "whole Tacton", False), ("drawer", None, True),
        ("layers_open", True, True),
        ("opened", [{"content": b"name = 'a'", "name": "a"}], True),
        ("opened", {"content": [b"a", b"b"]}, True), ("opened", {"content": "a"}, False),
        ("opened", "a", False), ("opened", [1], False), ("opened", [{}, {}], False),
        ("am", float("nan"), False), ("am", float("inf"), False), ("am", 1e300, False),
        ("am", 10**400, False), ("am", [1], False), ("am", {"a": 1}, False), ("am", None, False),
        ("paths", "x" * 20_000, False), ("span", [], False), ("highest", 1e9, False),
        ("phase", 1e9, False), ("hold", "yes", False), ("solid", 1, False),
        ("errors", "x", False), ("typed", 7, False), ("pinned_query", ["a"], False),
        ("held_frequency", "x", False), ("problem", "<img>", False), ("rows", [{}], False),
        ("trame__template_main", "<b/>", False), ("trame__scripts", ["http://a"], False),
        (["am"], 7, False), (None, 7, False),
    ],
)  # fmt: skip
def test_of_what_a_page_sets_only_what_its_script_would_is_taken(key, value, taken):
    assert bool(asked.kept([{"key": key, "value": value}])) is taken


@pytest.mark.parametrize("sent", [None, 7, "x", {"key": "am"}, [None, 7, [], {}]])
def test_changes_that_are_none_are_left_out(sent):
    assert asked.kept(sent) == []


def test_what_can_be_chosen_on_the_page_is_taken():
    from skinwave.web.plots import SPANS
    from skinwave.web.shown import HIGHEST

    chosen = [{"key": "span", "value": span} for span in SPANS]
    chosen += [{"key": "highest", "value": highest} for highest in HIGHEST]
    assert asked.kept(chosen) == chosen


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("none-such", []), ("select", [1]), ("select", [1, 2, 3, 4]), ("select", "ab"),
        ("select", ["a", "b"]), ("select", [float("nan"), 0]), ("select", [True, None]),
        ("zoom", ["a", "b"]), ("zoom", [1e300, 0]), ("zoom", [[1], 2]), ("own_path", ["a", 1, 2]),
        ("entered", ["am"]), ("entered", ["none-such", 1]), ("entered", [None, 1]),
        ("preset", ["none-such"]), ("cancel", [1]), ("undo", [0]), ("restart", [{"am": 1}]),
        ("figure", ["pgf"]), ("figure", ["ps"]), ("figure", [7]),
        ("figure", ["svg/../../x"]), ("figure", []),
        ("figure", ["svg", 99]), ("figure", ["svg", "wide"]), ("figure", ["svg", 7, "body:1"]),
        ("figure", ["svg", 7, "spectrum_plot:a:b"]), ("report", ["/etc/passwd"]),
        ("scene_toml", ["/etc/passwd"]), ("waveform_csv", [0, 0]),
    ],
)  # fmt: skip
def test_a_trigger_with_values_that_it_does_not_take_says_so(session, name, given, monkeypatch):
    monkeypatch.setattr(downloads, "elsewhere", Mock(side_effect=AssertionError("is computed")))
    values, made = session.values, session.server.controller.trigger_fn(name)

    async def called():
        result = made(*asked.checked_call(made, given, {}))
        return await result if asyncio.iscoroutine(result) else result

    with pytest.raises(ValueError, match=r"\w+ \w+"):
        asyncio.run(called())
    assert session.values == values


@pytest.mark.parametrize("which", [-1, 0.5, 9, 1e9])
@pytest.mark.parametrize("part", [-1, 4, 1e9])
def test_a_path_that_is_not_there_stays_as_it_is(session, which, part):
    with session.state:
        moves.turn(session, {"paths": "circle/10/0/0, line/10/0/0"})
    before = session.values
    with session.state:
        moves.own_path(session, which, part, "30")
    assert session.values == before


def test_a_preset_that_is_unknown_is_refused(session):
    with pytest.raises(ValueError, match="preset 'none-such' is unknown"):
        moves.preset(session, "none-such")


def test_a_figure_is_svg_png_or_pdf():
    assert downloads.FORMATS == ("svg", "png", "pdf")


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_scene_that_a_page_opens_reads_no_file(session, tmp_path, unit):
    """A pipe that nobody writes to would be waited for, if it were opened."""
    os.mkfifo(tmp_path / "pipe.stl")
    text = f'[body]\nkind = "mesh"\nfile = "{tmp_path}/pipe.stl"\nunit = "{unit}"\n'
    before, own = session.values, session.own
    with session.state:
        moves.open_scene(session, text)
    assert "a body from a file cannot be opened in a page" in session.state.problem
    assert (session.values, session.own) == (before, own)
    with session.state:
        moves.restart(session, f"body={tmp_path}/pipe.stl")
    assert "is unknown" in session.state.problem


def test_a_line_of_the_terminal_has_no_control_characters():
    from skinwave.web.access import one_line

    said = one_line("a\x1b]0;title\x07\r\nb\u202e" + "c" * 1000)
    assert said.isprintable()
    assert len(said) <= 300
