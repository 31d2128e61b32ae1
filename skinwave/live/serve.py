"""Server of the live page on this machine. It computes bodies that the page requests.

Only this machine can reach the server, and only requests with the token get an answer. The address
of the page contains the token, and the page sends it in `X-Token`, which other sites cannot. The
server keeps no state of a page.
"""

import json
import re
import secrets
import sys
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from threading import Lock
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from skinwave.live.answers import body_answer, dispersion_answer, measurement_answer, scene_answer
from skinwave.live.html_file import page
from skinwave.system.effort import Progress
from skinwave.system.plain_text import printable, say

LARGEST_REQUEST = {  # bytes
    "body": 2**20, "dispersion": 2**20, "scene": 2**22, "measurement": 20_000_000,
}  # fmt: skip
FAULT = "The server failed. Its terminal shows the error."
HEADERS = {
    "Cache-Control": "no-store", "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
}  # fmt: skip


class Superseded(Exception):
    """A newer request has replaced this one."""


class Server(ThreadingHTTPServer):
    """Server of a page, which `show` sets, on a port, 0 for any free one.

    `base` is the path under which a proxy shows the page. It begins and ends with "/". Raises
    ValueError if the path or the port cannot be used.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self, port: int = 0, base: str = "/") -> None:
        if not re.fullmatch(r"/([\w.~%@:+-]+/)*", base):
            raise ValueError(
                f"base-url = {base} is not a path. Give a path such as /user/name/proxy/8123/."
            )
        self.base, self.token = base, secrets.token_urlsafe(24)
        try:
            super().__init__(("127.0.0.1", port), _Handler)
        except (OSError, OverflowError) as error:
            raise ValueError(
                f"Port {port} cannot be used: {getattr(error, 'strerror', None) or error}. Give "
                "another with --port, or 0 for any free one."
            ) from None
        self.page = b""
        self._newest, self._numbers, self._computing = 0, count(1), Lock()

    def show(self, data: Mapping[str, Any]) -> None:
        """Set the page from data of `data_of`."""
        api = {"base": self.base, "token": self.token}
        self.page = page({**data, "api": api}).encode()

    @property
    def address(self) -> str:
        """Address that opens the page on this machine."""
        return f"http://127.0.0.1:{self.server_port}{self.base}?token={self.token}"

    def compute(self, work: Callable[[Progress], Any]) -> Any:
        """Return the result of `work(progress)`. The callback raises `Superseded` when newer work
        arrives. Only one call runs at a time.
        """
        own = self._newest = next(self._numbers)

        def check(phase: str = "", fraction: float = 0.0) -> None:
            if own != self._newest:
                raise Superseded

        with self._computing:
            check()
            return work(check)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print an error in one line, unless the connection was closed."""
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            _print_fault(error)


class _Handler(BaseHTTPRequestHandler):
    server: Server
    server_version, sys_version = "skinwave", ""
    timeout = 60.0  # s without data, after which a connection is closed

    def log_message(self, *_: Any) -> None:
        """Print nothing for a request."""

    def do_GET(self) -> None:
        """Send the page."""
        split = urlsplit(self.path)
        token = parse_qs(split.query).get("token", [""])[0]
        if refused := self._refusal(token, known=self._route(split.path) == ""):
            return self._refuse(*refused)
        return self._send(HTTPStatus.OK, self.server.page, "text/html")

    def do_POST(self) -> None:
        """Answer a request of the page."""
        name = self._route(urlsplit(self.path).path)
        kind = name.removeprefix("api/")
        known = kind != name and kind in LARGEST_REQUEST
        if refused := self._refusal(self.headers.get("X-Token", ""), known=known):
            return self._refuse(*refused)
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch(r"\d{1,12}", length) or "Transfer-Encoding" in self.headers:
            return self._refuse(HTTPStatus.LENGTH_REQUIRED, "Send a Content-Length.")
        if int(length) > LARGEST_REQUEST[kind]:
            return self._refuse(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                f"The request has {int(length) / 1e6:.3g} MB; the limit is "
                f"{LARGEST_REQUEST[kind] / 1e6:.3g} MB. Use the command line.",
            )
        return self._answer(kind, self.rfile.read(int(length)))

    def _refusal(self, token: str, *, known: bool) -> tuple[HTTPStatus, str] | None:
        """Status and reason of a refusal, or None. `known` says whether the address exists."""
        if not self._is_local():
            return HTTPStatus.FORBIDDEN, (
                "Open this page as http://127.0.0.1 or http://localhost, or start it with "
                "--base-url."
            )
        if not secrets.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode()):
            return HTTPStatus.FORBIDDEN, (
                "The token is missing or belongs to another run. Open the address that skinwave "
                "web printed, with its ?token=..., in this browser."
            )
        return None if known else (HTTPStatus.NOT_FOUND, "There is nothing at this address.")

    def _answer(self, kind: str, content: bytes) -> None:
        name, compute = unquote(self.headers.get("X-Name", "")), self.server.compute
        works: dict[str, Callable[[], Any]] = {
            "body": lambda: compute(partial(body_answer, content)),
            "scene": lambda: compute(partial(scene_answer, name, content)),
            "dispersion": lambda: dispersion_answer(content),
            "measurement": lambda: measurement_answer(name, content),
        }
        try:
            text = json.dumps(works[kind](), allow_nan=False, separators=(",", ":"))
            return self._send(HTTPStatus.OK, text.encode(), "application/json")
        except ConnectionError:
            raise
        except Exception as error:
            return self._refuse(*_error_answer(error))

    def _route(self, path: str) -> str:
        """Path below the base, which a proxy may have removed already."""
        base = self.server.base
        if path in (base, base.rstrip("/"), "/", ""):
            return ""
        return path[len(base) :] if path.startswith(base) else path.removeprefix("/")

    def _is_local(self) -> bool:
        """Whether the request names this machine. Behind a proxy, any name is valid."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin", "")
        if self.server.base != "/":
            return True
        same = not origin or origin.partition("://")[2] == host
        return same and bool(re.fullmatch(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", host))

    def _refuse(self, status: HTTPStatus, sentence: str) -> None:
        self._send(status, sentence.encode(), "text/plain")

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        self.send_response(status)
        own = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(content))}
        for name, value in {**own, **HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)


def _print_fault(error: BaseException | None) -> None:
    """Print a fault of the server in one line, of at most 300 characters, on its terminal."""
    text = printable(f"{type(error).__name__}: {error}"[:300], keep="")
    say(f"skinwave: a request failed: {text}", sys.stderr)


def _error_answer(error: Exception) -> tuple[HTTPStatus, str]:
    """Status and sentence for an error. Faults of the server are printed on its terminal."""
    if isinstance(error, Superseded):
        return HTTPStatus.CONFLICT, "A newer request has replaced this one."
    if isinstance(error, ValueError | ArithmeticError | MemoryError | RecursionError):
        words = " ".join(str(error).split())
        return HTTPStatus.BAD_REQUEST, words or "There is not enough memory. Use larger elements."
    _print_fault(error)
    return HTTPStatus.INTERNAL_SERVER_ERROR, FAULT
