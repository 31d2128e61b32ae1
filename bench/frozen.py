"""Regression check of all numbers: `python -m bench.frozen write DIR` before a change of the code,
`python -m bench.frozen compare DIR` after it.

`compare` repeats the commands on the scenes in DIR. Texts and times may differ; different texts are
counted. Numbers must agree to 1e-9 of the largest in their column. Each check of a verification
must agree with one of the old checks, to 1e-9 of its reference or its tolerance.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
AGREE = 1e-9
NOT_COMPARED = ("seconds", "memory", "versions", "peak", "typed", "arguments")
SCENES, PLANNED = ("skin-slab", "paper-sheet"), 20
CHECK = "check of a verification"


def parts() -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the command and the compared files of each part, for the scenes in `scenes`."""
    table = {"paper-15": (("compare",), ("lines.csv", "claims.csv", "responses.npz"))}
    for name in sorted(p.stem for p in (ROOT / "examples").glob("*.toml")):
        table[f"run {name}"] = (("run", f"scenes/{name}.toml"), ("lines.csv", "responses.npz"))
    for name in SCENES:
        table[f"relax {name}"] = (("relax", f"scenes/{name}.toml"), ("relax.csv", "responses.npz"))
    for k in range(PLANNED):
        table[f"plan {k:02}"] = (("plan", f"scenes/planned-{k:02}.toml", "--json"), ("said.json",))
    return table | {"verify": (("verify",), ("verify.json",))}


def write_scenes(folder: Path) -> None:
    """Write the examples, and random slabs and sheets."""
    from bench.plans import random_layer
    from skinwave.scene.file import dumps

    folder.mkdir(parents=True)
    texts = {path.stem: path.read_text("utf-8") for path in (ROOT / "examples").glob("*.toml")}
    texts |= {f"planned-{k:02}": dumps(random_layer(k)[0]) for k in range(PLANNED)}
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")


def run(name: str, command: tuple[str, ...], scenes: Path, folder: Path, cache: str) -> Path:
    """Run the command of a part beside its scenes, and return the folder with its files."""
    out = folder / name.replace(" ", "-")
    words = command if command[0] == "plan" else (*command, "--out", str(out), "--quiet")
    env = os.environ | {"SKINWAVE_CACHE": cache, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
                        "PYTHONPATH": str(ROOT)}  # fmt: skip
    done = subprocess.run([sys.executable, "-m", "skinwave", *words], capture_output=True,
                          text=True, cwd=scenes.parent, env=env, check=False)  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{name}: exit code {done.returncode}: {done.stderr.strip()}")
    out.mkdir(exist_ok=True)
    if command[0] == "plan":
        (out / "said.json").write_text(done.stdout, encoding="utf-8")
    return out


def numbers(path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the numbers of a file by column, and its texts, in order."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: arrays[name] for name in arrays.files}, []
    with path.open(encoding="utf-8", newline="") as file:
        values = [*(_cells(file) if path.suffix == ".csv" else _leaves(json.load(file), ""))]
    columns: dict[str, list[float]] = {}
    texts = []
    for name, value in values:
        if any(word in name for word in NOT_COMPARED):
            continue
        if isinstance(value, float):
            columns.setdefault(name, []).append(value)
        else:
            texts.append(str(value))
    return {name: np.array(column) for name, column in columns.items()}, texts


def _cells(file: Iterator[str]) -> Iterator[tuple[str, object]]:
    for row in csv.DictReader(file):
        palm = "palm " if any("palm" in str(cell) for cell in row.values()) else ""
        for column, cell in row.items():
            try:
                yield palm + column, float(cell)
            except ValueError:
                yield column, cell


def _leaves(value: object, name: str) -> Iterator[tuple[str, object]]:
    """Yield all values in JSON; checks of a verification are divided by their tolerance."""
    if isinstance(value, dict) and "bar" in value:
        unit = max(abs(value["reference"] or 0.0), 1e6 * value["bar"])
        yield CHECK, float(value["value"] or 0.0) / (unit or 1.0)
    elif isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(inner, f"{name} {key}".strip())
    else:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        yield name, float(value) if is_number else value  # type: ignore[arg-type]


def differences(before: Path, after: Path) -> Iterator[str]:
    """Yield differences between two files; names may have changed, but not the order."""
    (old, old_text), (new, new_text) = numbers(before), numbers(after)
    changed = sum(a != b for a, b in zip(old_text, new_text, strict=False))
    if changed or len(old_text) != len(new_text):
        print(f"  {after.name}: {changed} of {len(old_text)} texts differ, now {len(new_text)}")
    if CHECK in old:
        old, new = {CHECK: old[CHECK]}, {CHECK: new[CHECK]}
    if len(old) != len(new):
        yield f"{len(old)} columns, now {len(new)}"
        return
    for (name, a), (_, b) in zip(old.items(), new.items(), strict=True):
        if name == CHECK:  # which may be in another order
            print(f"  {len(a)} checks, now {len(b)}")
            apart = np.abs(b[:, None] - a).min(axis=1)
            for k in np.flatnonzero(apart > AGREE):
                yield f"check {k}: by {apart[k]:.2g} from the nearest"
        elif a.shape != b.shape:
            yield f"{name}: {a.shape}, now {b.shape}"
        elif a.dtype.kind in "fc":
            size = float(np.abs(a[np.isfinite(a)]).max(initial=1e-300))
            if not np.allclose(a, b, rtol=0, atol=AGREE * size, equal_nan=True):
                worst = np.nanmax(np.abs(a - b)) / size
                yield f"{name}: differs by {worst:.2g} of its largest (may by {AGREE:g})"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.frozen", description=__doc__)
    parser.add_argument("what", choices=("write", "compare"))
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--only", default="", metavar="TEXT", help="only parts that start with it")
    given = parser.parse_args()
    folder = given.folder.resolve()
    scenes = folder / "scenes"
    writes, failed = given.what == "write", 0
    if writes and not scenes.exists():
        write_scenes(scenes)
    with tempfile.TemporaryDirectory() as place:
        for name, (command, files) in parts().items():
            if not name.startswith(given.only):
                continue
            print(name, flush=True)
            out = run(name, command, scenes, folder if writes else Path(place), f"{place}/cache")
            for file in () if writes else files:
                for difference in differences(folder / out.name / file, out / file):
                    failed += 1
                    print(f"  {file}: {difference}", flush=True)
    if not writes:
        print(f"{failed} differences" if failed else "all numbers agree")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
