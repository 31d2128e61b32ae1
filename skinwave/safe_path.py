"""`python -m skinwave` without the working folder, where Python looks for modules first and where a
`json.py` would be taken for the standard library's.

Imported first of all; what it imports itself, Python has loaded before it finds this package.
"""

import os
import sys


def leave_out_working_folder() -> None:
    """Drop it from where modules are looked for if Python put it there to run this package, and the
    package itself is not in it. `python -m other` that imports this package keeps it.
    """
    run_as_module = sys.argv[:1] == ["-m"] and not sys.flags.safe_path
    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if run_as_module and _asked().endswith("skinwave") and sys.path[0] != home:
        del sys.path[0]


def _asked() -> str:
    """The package of the module that Python was told to run."""
    return sys.orig_argv[len(sys.orig_argv) - len(sys.argv)].split(".")[0]
