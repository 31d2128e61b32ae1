"""`python -m skinwave` without the working folder, where Python looks for modules first and where a
`json.py` would be taken for the standard library's.

Imported first of all, but after what Python itself imports to find a module to run, such as
`importlib.util` and `contextlib`; only `python -P` leaves that out of the working folder, too.
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
    if sys.flags.safe_path:  # as in the processes that this program starts
        leave_out_working_settings()


def leave_out_working_settings() -> None:
    """Load matplotlib where no `matplotlibrc` is, if the working folder has one: it is read before
    any other, and can have programs run that typeset text.
    """
    if not os.path.lexists("matplotlibrc") or "matplotlib" in sys.modules:
        return
    before = os.getcwd()
    os.chdir(os.path.dirname(os.path.abspath(__file__)))
    try:
        import matplotlib  # noqa: F401, which reads its settings once
    finally:
        os.chdir(before)


def _asked() -> str:
    """The package of the module that Python was told to run."""
    return sys.orig_argv[len(sys.orig_argv) - len(sys.argv)].split(".")[0]
