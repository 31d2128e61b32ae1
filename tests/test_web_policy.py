"""No text becomes a script, in a browser."""

import pytest
from in_browser import settled
from test_web_page import (
    PATIENCE,
    READY,
    opened,
    pytestmark,  # noqa: F401
    query_has,
)

from skinwave.web.controls import KEYS

SCRIPTS = (
    "<img src=x onerror='window.ran=1'>",
    "<script>window.ran=1</script>",
    "{{ constructor.constructor('window.ran=1')() }}",
    "'\"><svg onload=window.ran=1>",
)
RAN = "() => [window.ran, document.querySelectorAll('[onerror], [onload], img[src=x]').length]"


@pytest.fixture(scope="module")
def page(browser, address):
    return opened(browser, address, "?body=none&foci=2&pulses=10/20")[0]


def never_ran(page):
    settled(page)
    assert page.evaluate(RAN) == [None, 0]


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
    settled(page)
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
