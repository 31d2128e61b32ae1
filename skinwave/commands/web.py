"""The live page in a browser, served from this machine, so that its bodies can be changed."""

import argparse
import os
import sys
import tempfile
from pathlib import Path

from skinwave.commands.common import progress_of
from skinwave.system.plain_text import say

QUICK = ("skin-slab", "paper-sheet")  # bodies whose packs take seconds


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scenes", nargs="*", type=Path, metavar="SCENE",
        help="scene files (TOML) whose bodies and Tactons the page has; without any, the bodies "
        f"{' and '.join(QUICK)}",
    )  # fmt: skip
    parser.add_argument("--port", type=int, default=8080, help="0 is any (default: 8080)")
    parser.add_argument(
        "--base-url", default="/", metavar="PATH",
        help="path under which a proxy shows the page, such as /user/name/proxy/8080/",
    )  # fmt: skip
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    parser.add_argument("--debug", action="store_true", help="traceback of an error")


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    if not 0 <= options.port <= 65535:
        raise ValueError(f"port = {options.port} is outside 0..65535; leave it out for 8080")
    from skinwave.live.data import data_of, read_scene
    from skinwave.live.serve import Server

    options.json = False
    base = f"/{options.base_url.strip('/')}/" if options.base_url.strip("/") else "/"
    scenes = [read_scene(path) for path in options.scenes]
    with progress_of(options) as progress:
        data = data_of(scenes, progress, bodies=QUICK, test=False)
    with Server(data, options.port, base) as server, tempfile.TemporaryDirectory() as private:
        say(f"skinwave: {server.address} (Ctrl-C ends it)", sys.stderr)
        if base != "/":
            say(f"skinwave: behind the proxy, open {base}?token={server.token}", sys.stderr)
        elif not options.no_browser and has_display():
            open_unseen(server.address, Path(private))
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            return 0
    return 0


def has_display() -> bool:
    """Whether a browser with windows can be opened here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_unseen(address: str, folder: Path) -> None:
    """Open an address by a file in a private folder that leads there.

    Other users of the machine may read a browser's command line, which would have the token.
    """
    import webbrowser

    leading = folder / "open.html"
    leading.write_text(f'<meta http-equiv="refresh" content="0; url={address}">')
    webbrowser.open(leading.as_uri())
