"""Processes of pages: started, told what to show, and ended with all that they have left."""

import asyncio
import contextlib
import json
import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from typing import Any

from skinwave.processes import SAFE_PATH, end_group
from skinwave.web.access import one_line
from skinwave.web.memory import KEEPING

PATIENCE = 60.0  # s that a session may take to start
COMMAND = (sys.executable, "-m", "skinwave.web.serve")
FAILURES = (OSError, TimeoutError, ValueError)  # of a process that does not start


@dataclass(frozen=True, kw_only=True, eq=False)
class PageProcess:
    """A process, the port that it serves its page at, the page's password for it, and the folder
    of its temporary files.
    """

    process: Any
    port: int
    password: str
    folder: str
    relay: asyncio.Task[None] | None = None


async def started(folder: str) -> PageProcess:
    """A process that waits for a page, its temporary files in a new folder within `folder`.

    Raises
    ------
    OSError, TimeoutError, ValueError
        If it does not start, or says something else than its port and password.
    """
    own = tempfile.mkdtemp(dir=folder)
    # In a session of its own: Ctrl-C in a terminal is for the server alone, which ends it. In a
    # task of its own: asyncio leaves the pipes of a process open that it was cancelled in starting.
    starting = asyncio.create_task(
        asyncio.create_subprocess_exec(
            *COMMAND, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE, start_new_session=True,
            env={**KEEPING, **os.environ, **SAFE_PATH, "WSLINK_READY_MSG": "",
                 **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), own)},
        )
    )  # fmt: skip
    relay = None
    try:
        process = await asyncio.shield(starting)
        assert process.stdout is not None
        relay = asyncio.create_task(_relayed(process))
        line = await asyncio.wait_for(process.stdout.readline(), PATIENCE)
        port, password = line.decode().split()
        return PageProcess(
            process=process, port=int(port), password=password, folder=own, relay=relay
        )
    except BaseException:
        with contextlib.suppress(OSError):
            kill(process := await starting)
            await _ended(process)
        if relay is not None:
            relay.cancel()
        shutil.rmtree(own, ignore_errors=True)
        raise


async def begun(page: PageProcess, asked: dict[str, Any]) -> PageProcess:
    """The process once it shows what is asked: the text of a "scene", the "query" of an address,
    how many "samples" bands have.

    Raises
    ------
    OSError, TimeoutError
        If it does not; it has ended then.
    """
    try:
        page.process.stdin.write((json.dumps(asked) + "\n").encode())
        await page.process.stdin.drain()
        if await asyncio.wait_for(page.process.stdout.readline(), PATIENCE) != b"ready\n":
            raise OSError("the process of a page has ended")
    except BaseException:
        kill(page.process)
        await gone(page)
        raise
    return page


def kill(process: Any) -> None:
    """End a process at once, with what it is about to start; what it has started ends as soon as
    it does.
    """
    with contextlib.suppress(RuntimeError, OSError):
        process.stdin.close()
        if process.returncode is None:
            end_group(process.pid)  # not `process.kill`, which takes the exit code from asyncio


async def gone(page: PageProcess) -> None:
    """Wait for the end of a process, and remove its temporary files."""
    await _ended(page.process)
    if page.relay is not None:
        page.relay.cancel()
    shutil.rmtree(page.folder, ignore_errors=True)


async def _ended(process: Any) -> None:
    """Wait for the end of a process, and close its pipes: asyncio would do so when it deletes
    them, which may be after the loop has closed, and fail. Who is cancelled here once more, as at
    the end of the server, ends the process and still waits.
    """
    while process.returncode is None:
        try:
            await process.wait()
        except asyncio.CancelledError:
            kill(process)
    process._transport.close()


async def _relayed(process: Any) -> None:
    """Say what a process says of errors, as long as it is there: what it has started may say that
    it was ended in the middle.
    """
    while True:
        try:
            line = await process.stderr.readline()
        except ValueError:  # longer than any of ours
            continue
        if not line:
            return
        if process.returncode is None:
            print(one_line(line.decode("utf-8", "replace")), file=sys.stderr, flush=True)
