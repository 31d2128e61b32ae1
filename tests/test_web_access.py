"""Who may open a page, what a page may send, and how the server ends."""
# ruff: noqa: E402, what follows needs the libraries that are looked for first

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path
from unittest.mock import Mock

import pytest

aiohttp = pytest.importorskip("aiohttp")
for name in ("msgpack", "trame", "trame_vuetify"):
    pytest.importorskip(name)
from aiohttp.test_utils import TestClient, TestServer
from page_client import Refused, browser, opened

from skinwave.web import access, asked, controls, downloads, front, moves, processes, turns
from skinwave.web.access import is_local, policy
from skinwave.web.controls import STARTS
from skinwave.web.page import page_text

HOSTILE = ("fem", "meshes", "simple_model", "skinwave", "json", "random", "numpy", "trame",
           "multiprocessing", "socket", "matplotlib", "aiohttp")  # fmt: skip
PATHS = ("/", "/alive", "/turn?page=a", "/__skinwave/opening.js", "/index.html", "/session/x")


@asynccontextmanager
async def fronted(monkeypatch, token="right"):
    """A server, of which no process starts, and a browser's client of it."""

    async def never(_):
        await asyncio.sleep(600)

    monkeypatch.setattr(front, "started", never)
    one = front.Front(token=token)
    async with (
        TestServer(one.app(*front.served())) as server,
        TestClient(server, cookie_jar=aiohttp.CookieJar(unsafe=True)) as client,
    ):
        yield one, client


def served(folder=None, *, words=("-P", "-m", "skinwave", "web", "--port", "0", "--samples", "2")):
    """A server in a process of its own, by itself with few samples, and its address."""
    process = subprocess.Popen(
        [sys.executable, *words],
        stderr=subprocess.PIPE, text=True, cwd=folder,
    )  # fmt: skip
    return process, re.search(r"http://\S+", process.stderr.readline())[0]


def family(pid):
    """A process and all that it has started."""
    children = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = path.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if state not in "ZX":
            children.setdefault(int(parent), []).append(int(path.parent.name))
    found = [pid]
    for each in found:
        found += children.get(each, [])
    return found


def there(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


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


# --- whose turn it is --------------------------------------------------------------------------


def test_pages_open_a_few_at_a_time_in_the_order_in_which_they_came():
    line = turns.Turns()
    said = {page: line.wait(page) for page in "abcd"}
    assert [not each for each in said.values()] == [True, True, False, False]
    assert said["c"] == f"{turns.BUSY} (2 before it)."
    line.begin("a")
    assert line.wait("c"), "two are before it still: one that is opened, one that may"
    line.opening -= 1  # the first is open
    assert [not line.wait(page) for page in "dcb"] == [False, True, True]


def test_no_more_pages_open_than_there_is_place_for(monkeypatch):
    now = 0.0
    monkeypatch.setattr(turns.time, "monotonic", lambda: now)
    line = turns.Turns()
    for k in range(turns.MOST):
        assert not line.wait(f"{k}")
        line.begin(f"{k}")
        line.opening -= 1
    assert line.wait("late") == f"{turns.FULL}."
    assert line.wait("later") == f"{turns.FULL} (1 before it)."
    line.there -= 1  # one is closed
    assert line.wait("later").startswith(turns.BUSY), "the one before it may open first"
    assert not line.wait("late")
    now = turns.FORGOTTEN + 1
    assert not line.wait("later"), "the one before it has been closed while it waited"


def test_the_line_itself_is_limited():
    line = turns.Turns()
    line.opening = turns.AT_ONCE
    for k in range(turns.LONGEST_LINE + 100):
        assert line.wait(f"{k}")
    assert len(line._line) == turns.LONGEST_LINE


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


def test_nothing_is_handed_out_without_the_token(monkeypatch):
    async def asked_for():
        async with fronted(monkeypatch) as (_, client):
            for path in PATHS:
                for more in ("", "token=", "token=wrong", "token=righ", "token=r%C3%AFght"):
                    address = f"{path}{'&' if '?' in path else '?'}{more}"
                    answer = await client.get(address)
                    assert answer.status == 403, address
                    assert "open the address that `skinwave web` has printed" in await answer.text()
            assert (await client.post("/paraview/?token=right", data=b"{}")).status == 403
            assert not list(client.session.cookie_jar)

    asyncio.run(asked_for())


def test_an_address_with_the_token_brings_a_cookie_that_replaces_it(monkeypatch):
    async def asked_for():
        async with fronted(monkeypatch) as (_, client):
            first = await client.get("/?am=77&token=right")
            said = first.headers["Set-Cookie"]
            assert first.status == 200
            assert all(each in said for each in ("HttpOnly", "SameSite=Strict", "Path=/"))
            assert f"skinwave-{client.port}=" in said, "cookies of all ports are one browser's"
            statuses = [(await client.get(path)).status for path in PATHS]
            assert statuses == [200, 200, 200, 200, 200, 404]
            assert (await client.get("/?am=78")).status == 200
            wrong = {"Origin": "http://127.0.0.1:1"}
            assert (await client.get("/alive", headers=wrong)).status == 403

    asyncio.run(asked_for())


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


# --- the whole of it, in processes of their own -------------------------------------------------

FEW = 3  # places for pages
OF_FEW_PAGES = f"""
from skinwave.web import turns
turns.MOST = {FEW}
from skinwave.cli import main
raise SystemExit(main(["web", "--port", "0", "--samples", "0"]))
"""
slow = pytest.mark.slow
on_linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no list of processes")


@pytest.fixture(scope="module")
def server():
    process, address = served(words=("-P", "-c", OF_FEW_PAGES))
    yield process, address
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=20)[1]
    assert "Traceback" not in said, said
    assert process.returncode == 0


@slow
def test_what_is_hostile_on_a_connection_leaves_the_page_as_it_is(server):
    wrong = [float("nan"), 1e308, -(2**63), "x" * 100_000, [[[]]], {"a": {}}, None, b"\xff", True]

    async def hostile():
        async with browser() as session, opened(session, server[1], body="none", am=90) as page:
            first = await page.state()
            for value in wrong:
                for key in ("am", "paths", "span", "phase", "opened", "errors", "typed", "hold",
                            "pinned_query", "trame__template_main", "none such"):  # fmt: skip
                    assert "result" in await page.set(**{key: value}), (key, value)
                for name in ("select", "zoom", "restart", "own_path", "figure", "../../x"):
                    await page.trigger(name, value, value)
                    await page.trigger(name, value)
            assert "error" in await page.trigger("figure", "pgf")
            for method in ("trame.force.push", "trame.lifecycle.update", "trame.error.client",
                           "trame.trigger", "trame.state.update", "none.such"):  # fmt: skip
                for value in (*wrong, "server_ready", "\x1b]0;a\x07"):
                    await page.call(method, value)
            await page.trigger("restart", "body=none&am=90")
            last = await page.state()
            await page.set(am=91)
            after = await page.state()
            await page.socket.send_bytes(b"")  # no message at all
            with pytest.raises(ConnectionError):
                await _until_lost(page)
            return first, last, after

    first, last, after = asyncio.run(hostile())
    assert [first[key] for key in controls.KEYS] == [last[key] for key in controls.KEYS]
    assert after["am"] == 91
    assert last["trame__template_main"] == first["trame__template_main"]
    assert not any(each in json.dumps(after["errors"]) for each in ("nan", "xxx"))


@slow
@pytest.mark.parametrize("encoding", ["gzip", "br", "deflate", "none-such"])
def test_a_malformed_body_is_refused_and_logged_without_a_traceback(server, encoding):
    """The log is read when the server has ended."""

    async def posted(path):
        async with browser() as session:
            await session.get(server[1])
            sent = {"data": b"not packed", "headers": {"Content-Encoding": encoding}}
            async with session.post(server[1].partition("?")[0] + path, **sent) as answer:
                return answer.status

    assert [asyncio.run(posted(path)) for path in ("paraview/", "none-such")] == [400, 400]


@slow
def test_a_page_process_answers_to_no_other_site(tmp_path):
    elsewhere = {"Host": "elsewhere.example"}, {"Origin": "http://elsewhere.example"}
    wrong = [*elsewhere, {"Origin": "null"}]

    async def asked_for():
        page = await processes.started(str(tmp_path))
        try:
            async with browser() as session:
                own = f"http://127.0.0.1:{page.port}"
                statuses = {}
                for headers in wrong:
                    for path in ("/ws", "/index.html", "/"):
                        async with session.get(own + path, headers=headers) as answer:
                            statuses[path, str(headers)] = answer.status
                async with session.ws_connect(f"{own}/ws"):
                    return statuses
        finally:
            processes.kill(page.process)
            await processes.gone(page)

    statuses = asyncio.run(asked_for())
    assert len(statuses) == 9
    assert set(statuses.values()) == {403}, statuses


@slow
@on_linux
@pytest.mark.parametrize(
    ("doing", "end"),
    [("nothing", signal.SIGTERM), ("computing", signal.SIGINT), ("opening", signal.SIGTERM)],
)
def test_the_server_ends_at_once_with_pages_open(tmp_path, monkeypatch, end, doing):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    process, address = served()

    async def use():
        body = "none" if doing == "nothing" else "skin-slab"
        async with browser() as session, opened(session, address, body=body) as page:
            if doing == "computing":
                await page.set(body="palm")
                while not (await page.state())["busy"]:
                    await asyncio.sleep(0.05)
            if doing == "opening":
                late = asyncio.create_task(opened(session, address, "late").__aenter__())
                await asyncio.sleep(0.5)
            processes = family(process.pid)
            assert len(processes) > 1
            start = time.monotonic()
            process.send_signal(end)
            process.send_signal(end)  # impatiently
            said = await asyncio.to_thread(process.communicate, None, 30)
            lasted = time.monotonic() - start
            while any(map(there, processes)) and time.monotonic() - start < 30:
                await asyncio.sleep(0.02)
            gone = time.monotonic() - start
            if doing == "opening":
                late.cancel()
                await asyncio.gather(late, return_exceptions=True)
            return said[1], lasted, gone

    try:
        said, lasted, gone = asyncio.run(use())
    finally:
        process.kill()
        process.wait()
    print(f"ended {lasted:.2f} s, all gone {gone:.2f} s after {end.name}")
    assert said == ""
    assert process.returncode == 0
    assert gone <= 10, "3 s, when the machine does nothing else"
    assert list(tmp_path.iterdir()) == []


@slow
@on_linux
def test_a_page_whose_process_is_killed_is_closed_and_its_place_is_free(server):
    refusals = set()

    async def killed():
        async with browser() as session:
            for _ in range(FEW + 2):  # more than there are places for
                while True:
                    try:
                        async with opened(session, server[1], "one", body="none") as page:
                            await page.state()
                            mine = [p for p in family(server[0].pid)[1:] if _is_page(p)]
                            for each in mine:  # the spare one, too
                                os.kill(each, signal.SIGKILL)
                            with pytest.raises(ConnectionError):
                                await _until_lost(page)
                            break
                    except Refused as said:
                        refusals.add(str(said))

    asyncio.run(killed())
    assert all("reload" in said or turns.BUSY in said for said in refusals), refusals


async def _until_lost(page):
    for _ in range(100):
        await page.state()


def _is_page(pid):
    return b"skinwave.web.serve" in Path(f"/proc/{pid}/cmdline").read_bytes()


@slow
def test_a_page_imports_nothing_of_the_folder_that_it_is_started_in(tmp_path):
    for name in HOSTILE:
        told = f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r} + '\\n')\nraise SystemExit"
        (tmp_path / f"{name}.py").write_text(told)
    process, address = served(tmp_path)

    async def use():
        async with (
            browser() as session,
            opened(session, address, body="skin-slab", duration=0.1) as page,
        ):
            while (await page.state())["waves_stale"]:  # of a process that this one starts
                await asyncio.sleep(0.1)
            for name, *given in (("figure", "svg"), ("waveform_wav",)):
                assert (await page.trigger(name, *given)).get("result"), name
            await page.trigger("restart", "body=none&duration=0.1")  # fewer pictures
            assert (await page.trigger("report")).get("result")
            return await page.state()

    try:
        found = asyncio.run(use())
    finally:
        process.terminate()
        said = process.communicate(timeout=20)[1]
    assert not (tmp_path / "ran").exists(), (tmp_path / "ran").read_text()
    assert found["problem"] == ""
    assert "Traceback" not in said


@slow
@on_linux
def test_pages_at_random_and_processes_that_are_killed():
    """The five-minute one is `python -m bench.web_stress`; other work may share this machine."""
    found = subprocess.run(
        [sys.executable, "-m", "bench.web_stress", "6", "7", "2", "10"],
        cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    print(found.stdout, found.stderr)
    assert found.returncode == 0, found.stdout + found.stderr
    for what in ("answered", "killed"):
        assert re.search(rf"[1-9]\d* {what}", found.stdout), what
