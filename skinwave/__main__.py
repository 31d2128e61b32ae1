"""`python -m skinwave`: the command line."""

import os
import sys

# Python looks for modules in the working folder first, which may have a `json.py` of its own.
home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if not sys.flags.safe_path and sys.path[0] in ("", os.getcwd()) and sys.path[0] != home:
    del sys.path[0]

from skinwave.cli import main  # noqa: E402

sys.exit(main())
