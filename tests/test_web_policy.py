"""Pages that wait or are refused, as a browser shows them, and no text becomes a script."""

import re
import stat
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from in_browser import ended, served
from test_web_page import (
    PATIENCE,
    READY,
    opened,
    pytestmark,  # noqa: F401
    query_has,
    state,
)

from skinwave.web.controls import KEYS

SCRIPTS = (
    "<img src=x onerror='window.ran=1'>",
    "<script>window.ran=1</script>",
    "{{ constructor.constructor('window.ran=1')() }}",
    "'\"><svg onload=window.ran=1>",
)
FEW = """
from skinwave.web import turns
turns.MOST, turns.AT_ONCE = 2, 1
from skinwave.cli import main
main(["web", "--port", "0", "--samples", "0"])
"""
WAITING = "() => document.querySelector('#sw-waiting')?.innerText.includes('as many as')"
RAN = "() => [window.ran, document.querySelectorAll('[onerror], [onload], img[src=x]').length]"


@pytest.fixture(scope="module")
def page(browser, address):
    return opened(browser, address, "?body=none&foci=2&pulses=10/20")[0]


def never_ran(page):
    page.wait_for_timeout(300)
    assert page.evaluate(RAN) == [None, 0]


def next_open(pages):
    """The page that opens first and the other; one that is kept from asking loses its turn."""
    for _ in range(PATIENCE // 200):
        for page, other in (pages, pages[::-1]):
            if page.evaluate(READY):
                return page, other
        pages[0].wait_for_timeout(200)
    raise AssertionError("no page opens when another is closed")


def test_pages_open_one_after_the_other_and_beyond_the_most_when_another_is_closed(
    browser,
):
    process = subprocess.Popen([sys.executable, "-c", FEW], stderr=subprocess.PIPE, text=True)
    address = re.search(r"http://\S+", process.stderr.readline())[0]
    context = browser.new_context()
    pages = [context.new_page() for _ in range(4)]
    for two, awaited in ((pages[:2], READY), (pages[2:], WAITING)):
        for page in two:
            page.set_default_timeout(2 * PATIENCE)
            page.goto(address + "&body=none", wait_until="commit")
        for page in two:
            page.wait_for_function(awaited)
    assert pages[2].locator("#sw-waiting").is_visible()
    pages[0].close()
    opened_by_itself, waits = next_open(pages[2:])
    assert opened_by_itself.locator("#sw-waiting").count() == 0
    assert "as many as" in waits.locator("#sw-waiting").inner_text()
    context.close()
    ended(process)


def test_a_page_without_its_token_says_what_to_open(browser, address):
    page = browser.new_page()
    assert page.goto(address.partition("?")[0]).status == 403
    assert "open the address that `skinwave web` has printed" in page.inner_text("body")
    page.close()


def test_the_token_leaves_the_address_and_reloads_and_links_go_on(browser, address):
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(address + "&body=none&am=71")
    page.wait_for_function(READY)
    assert "token" not in page.url
    page.locator("#am-field").fill("72")
    query_has(page, "am=72")
    page.reload()
    page.wait_for_function(READY)
    assert state(page, "am") == 72
    page.goto(address.partition("?")[0] + "?body=none&am=73")
    page.wait_for_function(READY)
    assert (state(page, "am"), state(page, "body")) == (73, "none")
    assert page.evaluate("document.cookie") == "", "no script reads it"
    context.close()


def test_the_policy_is_there_and_keeps_scripts_from_running(page):
    policy = page.request.get(page.url).headers["content-security-policy"]
    assert "script-src 'self' 'unsafe-eval';" in policy
    assert "frame-ancestors 'none'" in policy
    for tried in (
        "document.body.insertAdjacentHTML('beforeend', `<img src=x onerror='window.ran=1'>`)",
        "(() => { const s = document.createElement('script'); s.textContent = 'window.ran=1';"
        " document.body.append(s); s.remove(); })()",
        "(() => { const s = document.createElement('script'); s.src = 'data:,window.ran=1';"
        " document.body.append(s); s.remove(); })()",
        "document.body.setAttribute('onclick', 'window.ran=1'); document.body.click()",
    ):
        page.evaluate(tried)
    page.wait_for_timeout(300)
    assert page.evaluate("() => window.ran") is None
    page.evaluate("() => document.querySelectorAll('img[src=x]').forEach(e => e.remove())")
    assert page.evaluate(
        "fetch('http://127.0.0.1:9/').catch(() => 0).then(() => new Promise(done => {"
        " document.addEventListener('securitypolicyviolation', e => done(e.violatedDirective));"
        " new WebSocket('ws://127.0.0.1:9/') }))"
    ) == "connect-src"  # fmt: skip


@pytest.mark.parametrize("text", SCRIPTS)
def test_a_script_in_a_field_never_runs(page, text):
    page.evaluate("() => window.trame.trigger('restart', ['body=none&foci=2&pulses=10/20'])")
    query_has(page, "pulses=10/20")
    fields = page.locator("#controls input[type=text]:not([readonly]), #controls input:not([type])")
    assert fields.count() >= 10
    for k in range(fields.count()):
        if fields.nth(k).is_visible():
            fields.nth(k).fill(text)
    page.locator(".sw-error").first.wait_for()
    assert any(text[:12] in said for said in page.locator(".sw-error").all_inner_texts())
    never_ran(page)
    page.evaluate("q => window.trame.trigger('restart', [q])",
                  "body=none&foci=2&paths=circle/9/0/0,line/9/0/0")  # fmt: skip
    cell = page.locator("#own-1-0")
    cell.fill(text)
    cell.press("Tab")
    page.locator("#paths-error").wait_for()
    never_ran(page)


@pytest.mark.parametrize("text", SCRIPTS)
def test_a_script_in_a_scene_or_its_name_never_runs(page, tmp_path, text):
    quoted = '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
    for k, scene in enumerate((
        f"name = {quoted}\n[body]\nkind = 'none'\n",
        f"[tacton]\nshape = {quoted}\n",
        f"[tacton]\n{quoted} = 1\n",
        f"{text}\n",
        f'[body]\nkind = "mesh"\nfile = {quoted}\nunit = "mm"\n',
    )):  # fmt: skip
        path = tmp_path / f"{'<img src=x onerror=window.ran=1>' if k else 'a'}{k}.toml"
        path.write_text(scene)
        page.locator("#open").set_input_files(path)
        if k:
            page.locator("#problem").wait_for()
        never_ran(page)
        page.evaluate("() => window.trame.trigger('restart', ['body=none&am=99'])")
        page.locator("#problem").wait_for(state="detached")


def test_a_script_in_an_address_never_runs(browser, address):
    context = browser.new_context()
    context.request.get(address)  # the cookie
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    asked = []
    page.on("websocket", lambda socket: asked.append(socket.url))
    own = address.partition("?")[0]
    other = "sessionURL=ws://127.0.0.1:9/&sessionManagerURL=http://127.0.0.1:9/&ui=x&reconnect=1"
    for text in SCRIPTS:
        # One of them for a body, too: what is refused there is the one that takes time to compute.
        given = dict.fromkeys(KEYS, text) | ({"body": "none"} if text != SCRIPTS[0] else {})
        query = "".join(f"&{key}={value}" for key, value in given.items())
        page.goto(f"{own}?{other}{query}&secret={text}&application={text}#{text}")
        page.wait_for_function(READY)
        assert "left out of the address" in page.locator("#problem").inner_text()
        never_ran(page)
    assert len(asked) >= len(SCRIPTS)
    assert all(url.startswith(own.replace("http", "ws")) for url in asked), asked
    context.close()


def test_the_token_is_not_on_the_command_line_of_the_browser(browser, tmp_path, monkeypatch):
    told = tmp_path / "told"
    opener = tmp_path / "opener"
    opener.write_text(f'#!/bin/sh\necho "$@" > {told}.new\nmv {told}.new {told}\n')
    opener.chmod(0o700)
    monkeypatch.setenv("BROWSER", str(opener))
    scene = tmp_path / "none.toml"
    scene.write_text("[body]\nkind = 'none'\n")
    process, address = served("--port", "0", "--samples", "0", "--open", str(scene))
    for _ in range(PATIENCE // 100):
        if told.exists():
            break
        time.sleep(0.1)
    given = told.read_text().strip()
    assert parse_qs(urlsplit(address).query)["token"][0] not in given
    assert stat.S_IMODE(Path(urlsplit(given).path).parent.stat().st_mode) == 0o700
    page = browser.new_context().new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(given)
    page.wait_for_function(READY)
    page.context.close()
    ended(process)
    assert not Path(urlsplit(given).path).parent.exists()
