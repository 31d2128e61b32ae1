"""The text of the page: trame's own, but for what a content security policy forbids."""

import re
from pathlib import Path

from skinwave.web.controls import KEYS

WAITING = (
    "position: absolute; z-index: 1001; left: 10%; right: 10%; top: 12%; text-align: center; "
    "font: 1.1rem sans-serif"
)
VIEWPORT = re.compile(r'width=device-width,[^"]*')  # with what keeps a reader from zooming in
SCRIPT = re.compile(r"<script(?P<said>[^>]*)>.*?</script>\s*", re.DOTALL)
SOURCE = re.compile(r'src="([^"]*)"')


def page_text(folder: str) -> str:
    """The page of trame's `folder`, without a script in its text, begun by `static/opening.js`.

    Raises
    ------
    ValueError
        If it is not begun by one script.
    """
    text = Path(folder, "index.html").read_text(encoding="utf-8")
    text = text.replace("<title>trame is built by Kitware</title>", "<title>skinwave</title>")
    text = VIEWPORT.sub("width=device-width, initial-scale=1", text)
    scripts = [(found["said"], SOURCE.search(found["said"])) for found in SCRIPT.finditer(text)]
    mains = [source[1] for said, source in scripts if source and 'type="module"' in said]
    if len(mains) != 1:
        raise ValueError(
            f"the page of this trame-client is begun by {len(mains)} scripts instead of 1; "
            "install another version of it"
        )
    first = "".join(
        f'<script src="{source[1]}"></script>'
        for said, source in scripts
        if source and 'type="module"' not in said
    )
    begun = (
        f'<script src="__skinwave/opening.js" data-main="{mains[0]}" data-keys="{" ".join(KEYS)}">'
        "</script>"
    )
    text = SCRIPT.sub("", text).replace("</head>", f"{first}</head>", 1)
    loading = Path(folder, "loading.tpl").read_text(encoding="utf-8")
    shown = f'<div id="app"><p id="sw-waiting" role="status" style="{WAITING}"></p>{loading}</div>'
    return text.replace('<div id="app"></div>', shown, 1).replace("</body>", f"{begun}</body>", 1)
