"""The process behind one page: says its port and password, waits for what is asked, and serves it.

python -m skinwave.web.serve      # started by `front`, not by hand
"""

import asyncio
import json
import logging
import os
import secrets
import sys
import threading
import traceback
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from skinwave.processes import environment

STATIC_ROUTE = {"__skinwave": str(Path(__file__).with_name("static"))}


def session_of(
    server: Any, scene: str = "", query: dict[str, str] | None = None, samples: int = 0
) -> Any:
    """A session with its page; the address's values, if it has any, before the scene's. What of
    either is out of range falls back to a control's start, and is said. Bands have so many samples.
    """
    from skinwave.scene_file import loads
    from skinwave.web import controls, scenes
    from skinwave.web.layout import lay_out
    from skinwave.web.moves import connect
    from skinwave.web.session import Session

    start, own, spreads = None, None, scenes.NO_SPREADS
    refused: tuple[str, ...] = ()
    if scene:
        read = loads(scene)
        start, refused = controls.in_range(scenes.values_of(read))
        own = read.body if start["body"] == controls.OWN_BODY else None
        spreads = scenes.spreads_in(read, start)
    given = {key: value for key, value in (query or {}).items() if key in controls.KEYS}
    if given:
        start, refused = controls.from_query(urlencode(given), own is not None)
    session = Session(server, start, own, spreads, samples)
    connect(session)
    lay_out(session)
    if refused:
        session.state.problem = "; ".join(refused)
    return session


def _on_one_thread() -> None:
    """Have numpy compute on one thread here: what a move takes is too small to share out, and
    threads that wait for each other delay it. The process that computes a body's response has more.
    """
    from skinwave.web.worker import limits

    with environment(limits(1)):
        import numpy as np

        np.ones((2, 2)) @ np.ones((2, 2))


def _quiet() -> None:
    """Log unreadable messages, as other libraries report them, in one line each."""
    from skinwave.web.access import in_lines

    logging.getLogger("wslink").setLevel(logging.CRITICAL + 1)  # `guard` says what is a fault here
    in_lines("a message to the process of a page is left out")


def main() -> None:
    """Serve one page until it is closed."""
    password = secrets.token_hex(32)  # so that nobody but the page talks to this port
    sys.argv = [sys.argv[0], "--authKey", password]  # trame reads it
    _on_one_thread()
    from trame.app import get_server
    from trame_server.protocol import CoreServer

    import skinwave.web.layout  # noqa: F401, what takes its time, before a page asks
    from skinwave.web.access import local_only, one_line
    from skinwave.web.asked import guard

    guard(CoreServer)
    _quiet()
    server = get_server("page", client_type="vue3")
    server.controller.on_error = lambda said: print(
        f"skinwave: a script of the page has failed: {one_line(said)}", file=sys.stderr
    )
    server.controller.on_server_bind.add(lambda bound: bound.app.middlewares.append(local_only))
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)

    def begin(**_: Any) -> None:
        try:
            print(server.port, password, flush=True)
        except OSError:
            os._exit(0)  # who started this has ended
        threading.Thread(target=listen, daemon=True).start()

    def listen() -> None:
        line = sys.stdin.readline()
        if line:
            loop.call_soon_threadsafe(assign, json.loads(line))
            sys.stdin.read()  # until the other end is closed
        os._exit(0)

    def assign(asked: dict[str, Any]) -> None:
        try:
            session = session_of(server, asked["scene"], asked["query"], asked["samples"])
            session.attach(loop)
            with session.state:
                pass
            print("ready", flush=True)
        except BaseException:
            traceback.print_exc()
            os._exit(1)

    server.controller.on_server_ready.add(begin)
    loop.run_until_complete(
        server.start(
            host="127.0.0.1", port=0, exec_mode="coroutine", open_browser=False,
            show_connection_info=False, disable_logging=True, timeout=0,
        )
    )  # fmt: skip


if __name__ == "__main__":
    main()
