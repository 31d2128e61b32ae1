"""The server: hands out the page, and gives each page that opens a process of its own.

State is per process, so that two browsers, or two tabs, do not disturb each other. One process
waits ready for the next page. A page asks for its session, and then talks to it through here.
"""

import asyncio
import contextlib
import json
import os
import re
import sys
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp
from aiohttp import web

HOSTS = ("127.0.0.1", "localhost", "[::1]")
PATIENCE = 60.0  # s that a session may take to start
LATER = 5.0  # s after which the next process is made ready: the page that opens comes first
LARGEST = 2**26  # bytes of a message
# For glibc: arrays above 2 MiB go back to the system when they are freed. By itself it raises that
# limit to what was freed once, and a process that answers for hours fills with gaps.
RETURNED = {"MALLOC_MMAP_THRESHOLD_": str(2**21)}
VIEWPORT = re.compile(r'width=device-width,[^"]*')  # with what keeps a reader from zooming in


class Front:
    """Pages and the processes behind them; `scene` is the text of a scene that all begin with."""

    def __init__(self, scene: str = "") -> None:
        self.scene = scene
        self._spare: asyncio.Task[Any] | None = None
        self._sessions: dict[str, Any] = {}
        self._ending = False

    def app(self, static: dict[str, str], page: str) -> web.Application:
        """The application; `static` folders by route, `page` the folder of the page itself."""
        app = web.Application(middlewares=[_local_only], client_max_size=2**20)
        app.router.add_post("/paraview/", self.open)
        app.router.add_get("/session/{name}", self.talk)
        app.router.add_get("/alive", _alive)
        app.router.add_get("/", _page(page))
        for route, folder in static.items():
            app.router.add_static(f"/{route}", folder)
        app.router.add_static("/", page)
        app.on_startup.append(self._prepare)
        app.on_shutdown.append(self._end)
        return app

    async def open(self, request: web.Request) -> web.Response:
        """A session for a page: where it is to talk to."""
        asked = await request.json()
        spare, self._spare = self._spare, None
        asyncio.get_running_loop().call_later(LATER, self._make_ready)
        process, port, password = await (spare or _started())
        try:
            given = {str(key): str(value) for key, value in asked.items()}
            line = json.dumps({"scene": self.scene, "query": given}) + "\n"
            process.stdin.write(line.encode())
            await process.stdin.drain()
            if await asyncio.wait_for(process.stdout.readline(), PATIENCE) != b"ready\n":
                raise OSError
        except (OSError, TimeoutError):
            _kill(process)
            return web.json_response({"error": "the session did not start"}, status=500)
        except BaseException:
            _kill(process)
            raise
        name = uuid.uuid4().hex
        self._sessions[name] = (process, port)
        asyncio.get_running_loop().call_later(PATIENCE, self._forget, name)
        return web.json_response(
            {"sessionURL": f"ws://USE_HOST/session/{name}", "secret": password}
        )

    async def talk(self, request: web.Request) -> web.WebSocketResponse:
        """Between a page and its session, for as long as the page is open."""
        process, port = self._sessions.pop(request.match_info["name"], (None, 0))
        if process is None:
            raise web.HTTPNotFound
        page = web.WebSocketResponse(max_msg_size=LARGEST, compress=False, heartbeat=30)
        await page.prepare(request)
        try:
            async with (
                aiohttp.ClientSession() as client,
                client.ws_connect(f"ws://127.0.0.1:{port}/ws", max_msg_size=LARGEST,
                                  compress=0) as behind,
            ):  # fmt: skip
                ways = [asyncio.create_task(_carry(page, behind)),
                        asyncio.create_task(_carry(behind, page))]  # fmt: skip
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in ways:
                    way.cancel()
        finally:
            _kill(process)
            await page.close()
        return page

    def _forget(self, name: str) -> None:
        """End a session that no page has come to talk to."""
        if (unclaimed := self._sessions.pop(name, None)) is not None:
            _kill(unclaimed[0])

    async def _prepare(self, _: web.Application) -> None:
        self._make_ready()

    def _make_ready(self) -> None:
        if self._spare is None and not self._ending:
            self._spare = asyncio.create_task(_started())

    async def _end(self, _: web.Application) -> None:
        self._ending = True
        for process, _port in self._sessions.values():
            _kill(process)
        if self._spare is not None:
            self._spare.cancel()
            with contextlib.suppress(asyncio.CancelledError, OSError, TimeoutError):
                _kill((await self._spare)[0])


async def _started() -> tuple[Any, int, str]:
    """A process that waits for a page, its port and what it takes as a password."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "skinwave.web.serve", stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env={**RETURNED, **os.environ, "WSLINK_READY_MSG": ""},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        line = await asyncio.wait_for(process.stdout.readline(), PATIENCE)
        port, password = line.decode().split()
        return process, int(port), password
    except BaseException:
        _kill(process)
        raise


def _kill(process: Any) -> None:
    """End a session; closing its input is what it takes as its end, a signal hurries it."""
    with contextlib.suppress(ProcessLookupError, RuntimeError, OSError):
        process.stdin.close()
        process.terminate()


async def _carry(source: Any, sink: Any) -> None:
    async for message in source:
        if message.type is aiohttp.WSMsgType.BINARY:
            await sink.send_bytes(message.data)
        elif message.type is aiohttp.WSMsgType.TEXT:
            await sink.send_str(message.data)


@web.middleware
async def _local_only(request: web.Request, handler: Any) -> Any:
    """Refuse what other web sites ask a browser to send here."""
    origin = request.headers.get("Origin", "")
    host = request.headers.get("Host", "")
    name = host.rpartition(":")[0] if ":" in host else host
    if name not in HOSTS or (origin and origin.partition("://")[2] != host):
        raise web.HTTPForbidden(text="open this page at its own address, http://127.0.0.1")
    return await handler(request)


async def _alive(_: web.Request) -> web.Response:
    return web.Response(text="yes")


def _page(folder: str) -> Any:
    text = Path(folder, "index.html").read_text(encoding="utf-8")
    text = text.replace("<title>trame is built by Kitware</title>", "<title>skinwave</title>")
    text = VIEWPORT.sub("width=device-width, initial-scale=1", text)

    async def page(_: web.Request) -> web.Response:
        return web.Response(text=text, content_type="text/html")

    return page


def served() -> tuple[dict[str, str], str]:
    """Folders of what a page is made of, by route, and the folder of the page itself."""
    import trame_client.module.vue3 as client
    import trame_vuetify.module.v3 as vuetify

    from skinwave.web.serve import STATIC_ROUTE

    return {**vuetify.serve, **STATIC_ROUTE}, str(client.www)


def run(port: int, scene: str = "", ready: Callable[[str], None] = print) -> None:
    """Serve pages at 127.0.0.1 until interrupted; `ready` is told the address.

    Raises
    ------
    OSError
        If the port is taken.
    """

    async def forever() -> None:
        runner = web.AppRunner(Front(scene).app(*served()))
        await runner.setup()
        try:
            site = web.TCPSite(runner, "127.0.0.1", port)
            await site.start()
            ready(f"http://127.0.0.1:{runner.addresses[0][1]}/")
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()

    asyncio.run(forever())
