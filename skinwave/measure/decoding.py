"""Text of files as programs export it, whatever its encoding."""

import codecs
from pathlib import Path

from meshes import reading

LARGEST = 256_000_000  # bytes


def decoded(path: Path) -> str:
    """Text of a file in UTF-8, UTF-16, or else Windows' Latin-1, whose letters matter little here.

    Raises
    ------
    ValueError
        If it is no text.
    """
    content = reading.content(path, LARGEST)
    encoding = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif b"\0" in content[:2000] and not len(content) % 2:
        encoding = "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
    for name in (encoding, *["cp1252", "latin-1"] * (encoding == "utf-8-sig")):
        try:
            text = content.decode(name)
        except UnicodeDecodeError:
            continue
        if not reading.CONTROL.search(text.encode()):
            return text
        break
    raise ValueError("the file is no text; export it as text in UTF-8, or name it by its format")
