"""`python -m bench [TABLE ...]`: our growth, our models in turn, then all codes in turn."""

import argparse
import os
import platform

from bench.beside import assembly, waves
from bench.own import growth, models

# The order matters: the peak memory of a process never falls, so that growth comes first.
TABLES = ("growth", "models", "assembly", "waves")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--across", type=int, default=40, help="cells across, of assembly")
    parser.add_argument(
        "--h", type=float, default=4.7, help="mm, elements of waves: 4.7 is 30 k dofs, 2.9 89 k"
    )
    asked = parser.parse_args()
    if unknown := set(asked.tables) - set(TABLES):
        parser.error(f"no table {', '.join(unknown)}; there are {', '.join(TABLES)}")
    os.environ["SKINWAVE_CACHE"] = ""  # every first response is a cold one
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    run = {
        "growth": growth,
        "models": models,
        "assembly": lambda: assembly(asked.across),
        "waves": lambda: waves(asked.h / 1e3),
    }
    for table in TABLES:
        if table in (asked.tables or TABLES):
            run[table]()


if __name__ == "__main__":
    main()
