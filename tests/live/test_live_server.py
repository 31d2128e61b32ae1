"""The server of the live page: access, answers, and a page that uses it."""

import json
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPConnection
from urllib.parse import urlsplit

import pytest
from in_browser import end_server, needs_browser, start_server

from skinwave.commands.cli import main
from skinwave.live import serve
from skinwave.live.records import body_of, toml_of
from skinwave.scene.scene import BODIES

SLAB = BODIES["skin-slab"]
DATA = {"bodies": [], "start": {}, "presets": [], "selftest": []}
SCENE = b'name = "s"\n[tacton]\nam_frequency_hz = 90\n[body]\npreset = "skin-slab"\n'


class Client:
    def __init__(self, base="/"):
        self.server = serve.Server(base=base)
        self.server.token = "right"
        self.server.show(DATA)
        self.thread = threading.Thread(target=self.server.serve_forever, daemon=True)
        self.thread.start()

    def request(self, method, path, body=None, **headers):
        connection = HTTPConnection("127.0.0.1", self.server.server_port, timeout=60)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer, content

    def post(self, name, body, **headers):
        answer, content = self.request("POST", name, body, X_Token="right", **headers)
        return answer.status, json.loads(content) if answer.status == 200 else content.decode()

    def change(self, body=SLAB, **changes):
        content = {"toml": toml_of(body), "name": "own", "title": "Own", "changes": changes}
        return self.post("/api/body", json.dumps(content).encode())

    def close(self):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


@pytest.fixture(scope="module")
def client():
    found = Client()
    yield found
    found.close()


def test_the_page_needs_the_token(client):
    assert client.server.server_address[0] == "127.0.0.1"
    for path, status in (("/", 403), ("/?token=wrong", 403), ("/other?token=right", 404)):
        assert client.request("GET", path)[0].status == status
    answer, content = client.request("GET", "/?token=right")
    assert answer.status == 200
    assert b'"token":"right"' in content
    assert answer.headers["Referrer-Policy"] == "no-referrer"


def test_other_sites_and_other_tokens_are_refused(client):
    for headers in ({"Host": "evil.example"}, {"Host": "127.0.0.1.evil.example"},
                    {"Origin": "http://evil.example"}):  # fmt: skip
        assert client.request("GET", "/?token=right", **headers)[0].status == 403
        assert client.post("/api/body", b"{}", **headers)[0] == 403
    for headers in ({}, {"X_Token": "wrong"}, {"X_Token": "\u00fc"}, {"Cookie": "skinwave=right"}):
        assert client.request("POST", "/api/body", b"{}", **headers)[0].status == 403


def test_a_proxy_with_a_prefix():
    base = "/user/me/proxy/8123/"
    client = Client(base)
    try:
        for path in (base, "/", base[:-1]):
            answer, _ = client.request("GET", f"{path}?token=right", Host="hub.example")
            assert answer.status == 200
        for wrong in ("//evil.example/", "/a b/", "/a", '/"/', "/a\r\nX: b/"):
            with pytest.raises(ValueError, match="path"):
                serve.Server(base=wrong)
        for path in (f"{base}api/scene", "/api/scene"):
            status, found = client.post(path, SCENE, Host="hub.example")
            assert (status, found["values"]["am"]) == (200, 90)
    finally:
        client.close()


def test_a_body_is_changed(client):
    status, found = client.change(modulus=40.0)
    record = found["body"]
    assert (status, record["name"], record["title"]) == (200, "own", "Own, changed")
    assert record["dispersion"] is None
    assert next(key["value"] for key in record["keys"] if key["key"] == "modulus") == 40
    assert body_of(record["toml"]).solid.shear_modulus == pytest.approx(40e3)
    assert record["pack"]["kind"] == "radial"
    status, found = client.post("/api/dispersion", record["toml"])
    assert status == 200
    assert found["dispersion"]["branches"]


def test_errors_are_sentences(client):
    assert client.change(base="glued")[0] == 400
    sent = [("body", each) for each in (b"", b"[]", b"\xff", b'{"toml": 3}', b"[" * 9999)]
    sent += [("scene", b"\xff"), ("scene", b"a ="), ("measurement", b"t,u\n")]
    for name, content in sent:
        status, found = client.post(f"/api/{name}", content, X_Name="a.csv")
        assert status == 400
        assert found
        assert "\n" not in found


def test_large_and_unknown_requests_are_refused(client):
    assert client.post("/api/other", b"")[0] == 404
    connection = HTTPConnection("127.0.0.1", client.server.server_port, timeout=60)
    for length, status in (("99999999", 413), ("-1", 411), ("many", 411)):
        connection.putrequest("POST", "/api/body")
        connection.putheader("X-Token", "right")
        connection.putheader("Content-Length", length)
        connection.endheaders()
        assert connection.getresponse().status == status
        connection.close()


def test_a_scene_and_a_measurement_are_read(client):
    status, found = client.post("/api/scene", SCENE, X_Name="s.toml")
    assert status == 200
    assert (found["values"]["am"], found["values"]["body"]) == (90, found["body"]["name"])
    sent = b"time_s,displacement_um\n0.1,0\n0.101,1\n0.102,0.5\n"
    status, found = client.post("/api/measurement", sent, X_Name="m%C3%A4.csv")
    assert (status, found["name"], found["quantity"]) == (200, "m\u00e4.csv", "displacement")
    assert found["values"] == [pytest.approx([0, 1e-6, 5e-7])]
    assert found["times"] == pytest.approx([0, 1e-3, 2e-3])
    assert found["places"] == [None]


def test_newer_work_ends_older_work(client):
    began = threading.Event()

    def older(progress):
        began.set()
        for _ in range(10_000_000):  # until the newer one is there
            progress("solve", 0.5)

    with ThreadPoolExecutor() as pool:
        first = pool.submit(client.server.compute, older)
        assert began.wait(60)
        second = pool.submit(client.server.compute, lambda progress: "newer")
        with pytest.raises(serve.Superseded):
            first.result(60)
        assert second.result(60) == "newer"


def test_internal_errors_appear_in_the_terminal_only(client, monkeypatch, capsys):
    def fails(name, content, progress):
        raise KeyError("private")

    monkeypatch.setattr(serve, "scene_answer", fails)
    status, found = client.post("/api/scene", b"")
    assert (status, found) == (500, serve.FAULT)
    assert capsys.readouterr().err == "skinwave: a request failed: KeyError: 'private'\n"


def test_invalid_options_are_refused(client, capsys, tmp_path):
    for given in (["--port", "70000"], ["--port", str(client.server.server_port)],
                  ["--base-url", "a b"], [str(tmp_path / "none.toml")]):  # fmt: skip
        (tmp_path / "s.toml").write_bytes(SCENE)
        scene = [] if given[0].endswith("none.toml") else [str(tmp_path / "s.toml")]
        assert main(["web", *scene, "--no-browser", "--quiet", *given]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.fixture
def address(tmp_path):
    (tmp_path / "s.toml").write_bytes(SCENE)
    process, found = start_server("--port", "0", "--quiet", str(tmp_path / "s.toml"))
    yield found
    end_server(process)


@needs_browser
def test_a_page_changes_its_body(browser, address):
    tab, messages = browser.new_page(reduced_motion="reduce"), []
    tab.on("request", lambda request: request.url.startswith("blob:")
           or messages.append(request.url))  # fmt: skip
    tab.on("pageerror", lambda error: messages.append(str(error)))
    tab.goto(address)
    tab.locator(".tile").first.wait_for()
    before = tab.inner_text("#tiles")
    tab.locator("summary", has_text="Layers").click()
    field = tab.get_by_role("slider", name=re.compile("Shear modulus")).first
    field.focus()
    with tab.expect_response(re.compile("api/body")):
        field.press("PageUp")
    changed = "before => document.querySelector('#tiles').innerText !== before"
    tab.wait_for_function(changed, arg=before)
    host = urlsplit(address).netloc
    assert {urlsplit(each).netloc for each in messages} == {host}
    tab.close()
