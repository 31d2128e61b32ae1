"""One self-contained HTML file: template, styles, ES modules and data, without a request."""

import hashlib
from base64 import b64encode
from collections.abc import Mapping
from importlib import resources
from typing import Any

from skinwave.system.scripts import bundle, encoded
from skinwave.system.templates import render

ENTRY = "page.js"
TITLE = "skinwave: waves in skin and paper under mid-air ultrasound haptics"


def page(data: Mapping[str, Any], title: str = TITLE) -> str:
    """Return the live page as HTML, of the data that `skinwave.live.data` makes."""
    static = resources.files("skinwave") / "static"
    script = "\n" + bundle(static, ENTRY)
    return render(
        "live.html", title=title, script=script,
        css=(static / "page.css").read_text(encoding="utf-8"),
        data=encoded(data), policy=policy(script, served=bool(data.get("api"))),
    )  # fmt: skip


def policy(script: str, *, served: bool = False) -> str:
    """Return the content security policy: one script, no request except to a page's own server."""
    digest = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    own = "'self'" if served else "'none'"
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src data: blob:; worker-src blob:; "
        f"connect-src {own}; base-uri 'none'; form-action 'none'"
    )
