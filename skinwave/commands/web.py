"""Interactive tool in a browser: a Tacton's parameters, its waves and its sensation level."""

import argparse
import sys
import tempfile
from pathlib import Path

SAMPLES, MOST = 64, 1000  # of bands


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scene", nargs="?", type=Path, metavar="SCENE", help="scene file (TOML) to begin with"
    )
    parser.add_argument("--port", type=int, default=8080, help="0 is any (default: 8080)")
    parser.add_argument(
        "--samples", type=int, default=SAMPLES, metavar="N",
        help="samples of the scene's uncertain numbers, for bands; 0 is no bands "
        f"(default: {SAMPLES})",
    )  # fmt: skip
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument("--debug", action="store_true", help="traceback of an error")


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.web import check_extra

    if not 0 <= options.port <= 65535:
        raise ValueError(f"port = {options.port} is outside 0..65535; leave it out for 8080")
    if options.samples and not 2 <= options.samples <= MOST:
        raise ValueError(
            f"--samples = {options.samples} is outside 2..{MOST}; give 0 for a page without bands"
        )
    check_extra()
    from skinwave.scene_file import dumps, read
    from skinwave.web import front, scenes

    scene = read(options.scene) if options.scene else None
    if scene is not None:
        scenes.values_of(scene)  # refuses what no control says

    with tempfile.TemporaryDirectory(prefix="skinwave-") as private:

        def ready(address: str) -> None:
            print(f"skinwave: {address} (Ctrl-C ends it)", file=sys.stderr, flush=True)
            if options.open:
                open_unseen(address, Path(private))

        try:
            text = dumps(scene) if scene is not None else ""
            front.run(options.port, options.samples, text, ready)
        except KeyboardInterrupt:
            return 0
        except OSError as error:
            raise ValueError(
                f"port {options.port} cannot be used ({error.strerror}); name another with --port"
            ) from None
    return 0


def open_unseen(address: str, folder: Path) -> None:
    """Open an address by a file in a private folder that leads there.

    Other users of the machine may read a browser's command line, which would have the token.
    """
    import webbrowser

    leading = folder / "open.html"
    leading.write_text(f'<meta http-equiv="refresh" content="0; url={address}">')
    webbrowser.open(leading.as_uri())
