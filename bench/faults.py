"""Deliberate faults that tests must find: `python -m bench.faults [--only NAME] [--list]`.

`faults.txt` has one fault in three lines: its name, the file and the pytest arguments of the tests
that should find it; after "- " a text that occurs once in the file; after "+ " the wrong one. Each
fault is put into a copy of the tree, alone, and only its tests run there.
"""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import timed

ROOT = Path(__file__).parent.parent
COPIED = ("bench", "examples", "fem", "meshes", "simple_model", "skinwave", "tests")
PASSED, FAILED = 0, 1  # exit codes of pytest; others say that tests were not run


@dataclass(frozen=True)
class Fault:
    name: str
    file: str
    tests: tuple[str, ...]
    right: str
    wrong: str

    def applied(self) -> str | None:
        """The file with the fault; None if the text does not occur once."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        return text.replace(self.right, self.wrong) if text.count(self.right) == 1 else None


def faults() -> Iterator[Fault]:
    text = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    for head, right, wrong in re.findall(r"^(\S.*)\n- (.*)\n\+ (.*)$", text, re.MULTILINE):
        name, file, *tests = shlex.split(head)
        yield Fault(name, file, tuple(tests), right, wrong)


def outcome(fault: Fault, copy: Path) -> str:
    """Run the tests of a fault in a copy of the tree; the test that found it, or why none did."""
    text = fault.applied()
    if text is None:
        return "does not apply"
    (copy / fault.file).write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", *fault.tests]
    environment = os.environ | {"PYTHONPATH": str(copy), "MPLBACKEND": "Agg"}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True)
    shutil.copy2(ROOT / fault.file, copy / fault.file)
    if done.returncode == PASSED:
        return "SURVIVED"
    by = re.search(r"^(?:FAILED|ERROR) (?:\S*/)?(\S+)", done.stdout, re.MULTILINE)
    if done.returncode != FAILED or not by:
        raise RuntimeError(f"{fault.name}: pytest ended with {done.returncode}\n{done.stdout}")
    return f"found by {by[1]}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.faults", description=__doc__)
    parser.add_argument("--only", metavar="NAME", help="faults whose name or file contains NAME")
    parser.add_argument("--list", action="store_true", help="print the faults, and run no test")
    given = parser.parse_args()
    chosen = [x for x in faults() if not given.only or given.only in f"{x.name} {x.file}"]
    if given.list:
        for each in chosen:
            print(f"{each.name:<28}{each.file}{'' if each.applied() else '  does not apply'}")
        return
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED:
            shutil.copytree(ROOT / name, copy / name)
        shutil.copy2(ROOT / "pyproject.toml", copy)
        for fault in chosen:
            result, seconds = timed(outcome, fault, copy)
            print(f"{fault.name:<28}{seconds:4.0f} s  {result}", flush=True)
            counts[result.split(" by ")[0]] += 1
    print(f"{len(chosen)} faults:", ", ".join(f"{n} {kind}" for kind, n in counts.items()))


if __name__ == "__main__":
    main()
