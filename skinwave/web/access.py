"""Who may open a page: browsers on this machine that have the token, and nothing of another site.

A name that another site has pointed at this machine (DNS rebinding) is recognised by its `Host`,
a request that another site makes by its `Origin`, another user of the machine by the token, which
the address has and a cookie keeps. What a page may load and run is in its content security policy.
"""

import logging
import re
import secrets
from typing import Any

from aiohttp import web

from skinwave.plain_text import printable

OWN = re.compile(r"(127\.0\.0\.1|localhost)(:\d{1,5})?")  # what Host may be
TOKEN = "token"  # in an address
LONGEST_LINE = 300  # characters of what is printed of what a page sends
ENCODED = "send the body of this request without a Content-Encoding"
REFUSED = "open this page at its own address, http://127.0.0.1"
NO_TOKEN = (
    "The token of this page is missing or of another run: open the address that `skinwave web` "
    "has printed, http://127.0.0.1:PORT/?token=..., in this browser."
)


def is_local(host: str, origin: str) -> bool:
    """Whether a request of this `Host` and `Origin` comes from a page of this machine's own."""
    return OWN.fullmatch(host) is not None and (not origin or origin.partition("://")[2] == host)


@web.middleware
async def local_only(request: web.Request, handler: Any) -> Any:
    """Refuse what other web sites ask a browser to send here."""
    if not is_local(request.headers.get("Host", ""), request.headers.get("Origin", "")):
        raise web.HTTPForbidden(text=REFUSED)
    return await handler(request)


@web.middleware
async def unencoded(request: web.Request, handler: Any) -> Any:
    """Refuse bodies that would have to be unpacked: no page sends any."""
    if "Content-Encoding" in request.headers:
        raise web.HTTPBadRequest(text=ENCODED)
    return await handler(request)


def with_token(token: str) -> Any:
    """A middleware that refuses requests without the token; an address that has it brings the
    cookie which keeps it.
    """

    @web.middleware
    async def checked(request: web.Request, handler: Any) -> Any:
        name = _cookie(request)
        if _same(request.cookies.get(name, ""), token):
            return await handler(request)
        if request.path != "/" or not _same(request.query.get(TOKEN, ""), token):
            raise web.HTTPForbidden(text=NO_TOKEN)
        response = await handler(request)
        response.set_cookie(name, token, httponly=True, samesite="Strict", path="/")
        return response

    return checked


async def secured(request: web.Request, response: web.StreamResponse) -> None:
    """Headers of every HTTP response (a signal of aiohttp, before it is sent)."""
    response.headers["Content-Security-Policy"] = policy(request.headers.get("Host", ""))
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"


def policy(host: str) -> str:
    """The content security policy of a page at this host: nothing but its own files, no script
    within its text. Vue compiles templates, for which it needs 'unsafe-eval', and Vuetify writes
    its theme as a style.
    """
    socket = f" ws://{host}" if OWN.fullmatch(host) else ""  # 'self' of older browsers has no ws
    return "; ".join((
        "default-src 'none'", "script-src 'self' 'unsafe-eval'",
        "style-src 'self' 'unsafe-inline'", "img-src 'self' data: blob:", "font-src 'self' data:",
        f"connect-src 'self'{socket}", "base-uri 'self'", "form-action 'none'",
        "frame-ancestors 'none'",
    ))  # fmt: skip


def one_line(said: Any) -> str:
    """Text from outside the program as one line of a terminal."""
    return printable(str(said)[:LONGEST_LINE].rstrip(), keep="")[:LONGEST_LINE]


def in_lines(what: str, kinds: tuple[type[BaseException], ...] = (BaseException,)) -> None:
    """Have aiohttp log what goes wrong with messages as one line of each, that begins with `what`,
    for errors of these kinds and for what has none.
    """

    def in_a_line(record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        if error is None or isinstance(error, kinds):
            record.msg = f"skinwave: {what}: %s"
            record.args = (one_line(error or record.getMessage()),)
            record.exc_info = None
        return True

    logging.getLogger("aiohttp.server").addFilter(in_a_line)


def _cookie(request: web.Request) -> str:
    """The name of the cookie: browsers send those of one port to all others."""
    return f"skinwave-{request.headers.get('Host', '').rpartition(':')[2]}"


def _same(given: str, token: str) -> bool:
    """Compared in a time that says nothing of where they differ."""
    return secrets.compare_digest(given.encode("utf-8", "replace"), token.encode())
