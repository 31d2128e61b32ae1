"""A page without a browser: what its script says to the server, spoken directly."""

import contextlib
import re
import uuid
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import msgpack
from wslink.chunking import UnChunker, generate_chunks

LARGEST = 2**26
ANSWERED = 60.0  # s


class Refused(Exception):
    """Reason of the server for not opening a page."""


@dataclass(kw_only=True)
class Client:
    """A page that is open: its connection and its calls, numbered."""

    socket: Any
    numbers: Any = field(default_factory=count)
    parts: UnChunker = field(default_factory=UnChunker)

    async def call(self, method: str, *given: Any) -> dict[str, Any]:
        """Reply of the page's process: a "result" or an "error".

        Raises
        ------
        ConnectionError
            If the connection ends first.
        """
        name = f"{'system' if method == 'wslink.hello' else 'rpc'}:c0:{next(self.numbers)}"
        said = {"wslink": "1.0", "id": name, "method": method, "args": list(given), "kwargs": {}}
        for chunk in generate_chunks(msgpack.packb(said), 2**20):
            await self.socket.send_bytes(chunk)
        while True:
            message = await self.socket.receive(timeout=ANSWERED)
            if message.type is not aiohttp.WSMsgType.BINARY:
                raise ConnectionError("the connection has ended")
            answer = self.parts.process_chunk(message.data)
            if answer and answer.get("id") == name:
                return dict(answer)

    async def set(self, **values: Any) -> dict[str, Any]:
        """Set variables of the state."""
        changes = [{"key": key, "value": value} for key, value in values.items()]
        return await self.call("trame.state.update", changes)

    async def trigger(self, name: str, *given: Any) -> dict[str, Any]:
        """Call a trigger."""
        return await self.call("trame.trigger", name, list(given), {})

    async def state(self) -> dict[str, Any]:
        """All variables of the state."""
        return dict((await self.call("trame.state.get"))["result"]["state"])


def browser() -> aiohttp.ClientSession:
    """Client session that keeps cookies, of addresses by number, too."""
    return aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True))


@contextlib.asynccontextmanager
async def opened(
    session: aiohttp.ClientSession, address: str, name: str = "", **query: Any
) -> AsyncIterator[Client]:
    """A page at an address with its token; `name` is what it calls itself while it waits.

    Raises
    ------
    Refused
        With the sentence that the server says, if it does not open.
    """
    async with session.get(address) as page:
        page.raise_for_status()
    own, name = re.sub(r"\?.*", "", address), name or uuid.uuid4().hex
    async with session.get(f"{own}turn?page={name}") as turn:
        if said := (await turn.json())["wait"]:
            raise Refused(said)
    async with session.post(f"{own}paraview/?page={name}", json=query) as answer:
        found = await answer.json()
        if "error" in found:
            raise Refused(found["error"])
    url = found["sessionURL"].replace("USE_HOST", urlsplit(own).netloc)
    async with session.ws_connect(url, max_msg_size=LARGEST) as socket:
        client = Client(socket=socket)
        client.parts.set_max_message_size(LARGEST)
        hello = await client.call("wslink.hello", {"secret": found["secret"]})
        if "error" in hello:
            raise Refused(str(hello["error"]))
        yield client
