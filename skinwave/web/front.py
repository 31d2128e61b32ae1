"""The server: hands out the page, and gives each page that opens a process of its own.

State is per process, so that two browsers, or two tabs, do not disturb each other. One process
waits ready for the next page. A page waits for its turn, asks for its session, and then talks to it
through here.
"""

import asyncio
import contextlib
import json
import secrets
import shutil
import signal
import tempfile
import uuid
from collections.abc import Callable
from html import escape
from typing import Any

import aiohttp
from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from skinwave.web.access import TOKEN, in_lines, local_only, secured, unencoded, with_token
from skinwave.web.controls import KEYS
from skinwave.web.page import page_text
from skinwave.web.processes import FAILURES, PATIENCE, PageProcess, begun, gone, kill, started
from skinwave.web.turns import MOST, Turns

LATER = 5.0  # s after which the next process is made ready: the page that opens comes first
LARGEST = 2**26  # bytes of a message
LARGEST_REQUEST = 2**16  # bytes of what a page asks for as it opens
LAST = 0.3  # s that requests and pages have when the server ends
MALFORMED = (HttpProcessingError, web.RequestPayloadError)  # requests that are no HTTP
UNREAD = (
    "What the page asks for cannot be read: it must be a JSON object of at most "
    f"{LARGEST_REQUEST} bytes that gives numbers or texts; reload the page without its ?..."
)
UNSTARTED = "The process of this page did not start; reload the page."


class Front:
    """Pages and the processes behind them; `samples` are those of their bands, `scene` is the text
    of a scene that all begin with.
    """

    def __init__(self, samples: int = 0, scene: str = "", token: str = "") -> None:
        self.samples = samples
        self.scene = scene
        self.token = token or secrets.token_urlsafe(24)
        self.turns = Turns()
        self._folder = ""  # of temporary files
        self._spare: asyncio.Task[PageProcess] | None = None
        self._opening: set[asyncio.Task[PageProcess]] = set()
        self._unclaimed: dict[str, PageProcess] = {}
        self._there: dict[PageProcess, asyncio.Task[None]] = {}  # until each has ended
        self._ending = False

    def app(self, static: dict[str, str], page: str) -> web.Application:
        """The application; `static` folders by route, `page` the folder of the page itself."""
        app = web.Application(
            middlewares=[unencoded, local_only, with_token(self.token)],
            client_max_size=LARGEST_REQUEST,
        )
        app.router.add_get("/turn", self.turn)
        app.router.add_post("/paraview/", self.open)
        app.router.add_get("/session/{name}", self.talk)
        app.router.add_get("/alive", _alive)
        app.router.add_get("/", _page(page))
        for route, folder in static.items():
            app.router.add_static(f"/{route}", folder)
        app.router.add_static("/", page)
        app.on_response_prepare.append(secured)
        app.on_startup.append(self._prepare)
        app.on_shutdown.append(self._end)
        return app

    async def turn(self, request: web.Request) -> web.Response:
        """Why a page has to wait, if it has."""
        return web.json_response({"wait": self.turns.wait(_name(request))})

    async def open(self, request: web.Request) -> web.Response:
        """A session for a page: where it is to talk to."""
        try:
            query = asked(await request.text())
        except (ValueError, RecursionError, LookupError, web.HTTPRequestEntityTooLarge):
            return _refused(UNREAD, 400)
        if said := UNSTARTED if self._ending else self.turns.wait(name := _name(request)):
            return _refused(said, 503)
        self.turns.begin(name)
        page = None
        wanted = {"scene": self.scene, "query": query, "samples": self.samples}
        opening = asyncio.create_task(self._opened(wanted))
        self._opening.add(opening)
        try:
            page = await opening
        except FAILURES:
            return _refused(UNSTARTED, 503)
        finally:
            self._opening.discard(opening)
            self.turns.opening -= 1
            if page is None:
                self.turns.there -= 1
        self._unclaimed[session := uuid.uuid4().hex] = page
        asyncio.get_running_loop().call_later(PATIENCE, self._forget, session)
        return web.json_response(
            {"sessionURL": f"ws://USE_HOST/session/{session}", "secret": page.password}
        )

    async def talk(self, request: web.Request) -> web.WebSocketResponse:
        """Between a page and its session, for as long as the page is open."""
        behind = self._unclaimed.pop(request.match_info["name"], None)
        if behind is None:
            raise web.HTTPNotFound
        page = web.WebSocketResponse(
            max_msg_size=LARGEST, compress=False, heartbeat=30, timeout=LAST
        )
        try:
            await page.prepare(request)
            async with (
                aiohttp.ClientSession() as client,
                client.ws_connect(f"ws://127.0.0.1:{behind.port}/ws", max_msg_size=LARGEST,
                                  compress=0) as session,
            ):  # fmt: skip
                await _both_ways(page, session)
        except (OSError, aiohttp.ClientError):
            pass  # its process has ended: the page is closed, and says so
        finally:
            kill(behind.process)
            if page.prepared:
                await page.close()
        return page

    async def _opened(self, asked: dict[str, Any]) -> PageProcess:
        """A process that shows what is asked, and is waited for from now on."""
        page = await self._begun(asked)
        self._there[page] = asyncio.create_task(self._until_gone(page))
        return page

    async def _begun(self, asked: dict[str, Any]) -> PageProcess:
        """A process that shows what is asked: the one that waits, unless it has ended, or a new
        one.
        """
        spare, self._spare = self._spare, None
        asyncio.get_running_loop().call_later(LATER, self._make_ready)
        if spare is not None:
            with contextlib.suppress(*FAILURES):
                return await begun(await spare, asked)
        return await begun(await started(self._folder), asked)

    async def _until_gone(self, page: PageProcess) -> None:
        await gone(page)
        self.turns.there -= 1
        del self._there[page]

    def _forget(self, name: str) -> None:
        """End a session that no page has come to talk to."""
        if (unclaimed := self._unclaimed.pop(name, None)) is not None:
            kill(unclaimed.process)

    async def _prepare(self, _: web.Application) -> None:
        self._folder = tempfile.mkdtemp(prefix="skinwave-web-")
        self._make_ready()

    def _make_ready(self) -> None:
        if self._spare is None and not self._ending and self.turns.there < MOST:
            self._spare = asyncio.create_task(started(self._folder))

    async def _end(self, _: web.Application) -> None:
        """End all processes; pages that talk to them are closed with that."""
        self._ending = True
        for opening in self._opening:
            opening.cancel()
        await asyncio.gather(*self._opening, return_exceptions=True)
        ends = list(self._there.values())
        for page in self._there:
            kill(page.process)
        if self._spare is not None:
            self._spare.cancel()
            with contextlib.suppress(asyncio.CancelledError, *FAILURES):
                kill((spare := await self._spare).process)
                ends.append(asyncio.create_task(gone(spare)))
        await asyncio.gather(*ends)
        shutil.rmtree(self._folder, ignore_errors=True)


def asked(text: str) -> dict[str, str]:
    """Values of the controls that a page asks for as it opens.

    Raises
    ------
    ValueError, RecursionError
        If it is not JSON, or no object of numbers and texts.
    """
    given = json.loads(text)
    if not isinstance(given, dict):
        raise ValueError("no object")
    found = {key: given[key] for key in KEYS if key in given}
    if any(not isinstance(value, str | int | float) for value in found.values()):
        raise ValueError("neither a number nor a text")
    said = {key: str(value) for key, value in found.items()}
    "".join(said.values()).encode()  # what is no text in Unicode is refused, too
    return said


def _name(request: web.Request) -> str:
    """Name that a page gives itself while it waits."""
    return request.query.get("page", "")[:64] or uuid.uuid4().hex


def _refused(said: str, status: int) -> web.Response:
    """A sentence that the page shows, of our own words alone: it is taken for HTML."""
    return web.json_response({"error": escape(said)}, status=status)


async def _both_ways(page: Any, session: Any) -> None:
    ways = [asyncio.create_task(_carry(page, session)), asyncio.create_task(_carry(session, page))]
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)


async def _carry(source: Any, sink: Any) -> None:
    async for message in source:
        if message.type is aiohttp.WSMsgType.BINARY:
            await sink.send_bytes(message.data)
        elif message.type is aiohttp.WSMsgType.TEXT:
            await sink.send_str(message.data)


async def _alive(_: web.Request) -> web.Response:
    return web.Response(text="yes")


def _page(folder: str) -> Any:
    text = page_text(folder)

    async def page(_: web.Request) -> web.Response:
        return web.Response(text=text, content_type="text/html")

    return page


def served() -> tuple[dict[str, str], str]:
    """Folders of what a page is made of, by route, and the folder of the page itself."""
    import trame_client.module.vue3 as client
    import trame_vuetify.module.v3 as vuetify

    from skinwave.web.serve import STATIC_ROUTE

    return {**vuetify.serve, **STATIC_ROUTE}, str(client.www)


def run(port: int, samples: int, scene: str = "", ready: Callable[[str], None] = print) -> None:
    """Serve pages at 127.0.0.1 until interrupted.

    Parameters
    ----------
    port : 0 is any
    samples : of each page's bands; 0 is none
    scene : text of a scene that all pages begin with
    ready : is told the address

    Raises
    ------
    OSError
        If the port is taken.
    """

    async def forever() -> None:
        front, ended = Front(samples, scene), asyncio.Event()
        runner = web.AppRunner(
            front.app(*served()), shutdown_timeout=LAST, handler_cancellation=True,
            auto_decompress=False,
        )  # fmt: skip
        in_lines("a request is left out", MALFORMED)
        _on_signals(ended.set)
        await runner.setup()
        try:
            site = web.TCPSite(runner, "127.0.0.1", port)
            await site.start()
            ready(f"http://127.0.0.1:{runner.addresses[0][1]}/?{TOKEN}={front.token}")
            await ended.wait()
        finally:
            await runner.cleanup()

    asyncio.run(forever())


def _on_signals(end: Callable[[], None]) -> None:
    """Ctrl-C and SIGTERM end the server in order, however often they come."""
    for each in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):  # Windows
            asyncio.get_running_loop().add_signal_handler(each, end)
