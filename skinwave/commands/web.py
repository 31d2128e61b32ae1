"""Open the live page in a browser, served from this machine, with bodies that can be edited."""

import argparse
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from skinwave.commands.common import add_options, add_scenes, progress_of, warn, with_failures
from skinwave.system.plain_text import say

QUICK = ("skin-slab", "paper-sheet")  # bodies that are ready in seconds


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add_scenes(parser, " and ".join(QUICK))
    add("--port", type=int, default=8080, help="port (default: 8080; 0 for any free port)")
    add(
        "--base-url", default="/", metavar="PATH",
        help="path of the page behind a proxy, such as /user/name/proxy/8080/",
    )  # fmt: skip
    add("--no-browser", action="store_true", help="only print the address")
    add_options(parser, "--quiet", "--json", "--debug")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    if not 0 <= options.port <= 65535:
        raise ValueError(f"--port is {options.port}; give a number from 0 to 65535")
    from skinwave.live.html_file import data_of, read_scene
    from skinwave.live.serve import Server

    base = f"/{options.base_url.strip('/')}/" if options.base_url.strip("/") else "/"
    scenes = [read_scene(path) for path in options.scenes]
    with Server(options.port, base) as server, tempfile.TemporaryDirectory() as private:
        with progress_of(options) as progress:
            data = data_of(scenes, progress, bodies=QUICK, tests=0)
        warn(with_failures(data["failures"], []))
        server.show(data)
        say(f"skinwave: {server.address} (press Ctrl-C to stop)", sys.stderr)
        displays = map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))
        has_display = sys.platform in ("win32", "darwin") or any(displays)
        if base != "/":
            say(f"skinwave: behind the proxy, open {base}?token={server.token}", sys.stderr)
        elif has_display and not options.no_browser:
            open_privately(server.address, Path(private))
        with suppress(KeyboardInterrupt):
            server.serve_forever()
    return 0


def open_privately(address: str, folder: Path) -> None:
    """Open an address in the browser through a file in a private folder that redirects to it.

    Other users can read a browser's command line, which must not contain the token.
    """
    import webbrowser

    redirect = folder / "open.html"
    redirect.write_text(f'<meta http-equiv="refresh" content="0; url={address}">')
    webbrowser.open(redirect.as_uri())
