"""Hostile files, by name a function that writes into a folder and gives arguments of a command."""

import copy
import io
import json
import os
import random
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tomli_w
from pattern_files import adaptics, keyframe
from scipy.io import wavfile

from skinwave.sweeps import dataset

SEED = 1907
Write = Callable[[Path], list[str]]
QUICK = {
    "name": "small",
    "tacton": {"am_frequency_hz": 200.0, "duration_s": 0.02, "shape": "circle", "size_mm": 10.0,
               "speed_m_per_s": 6.0},
    "focus": {"height_mm": 200.0},
    "body": {"kind": "none"},
    "probes": {"points_mm": [[0.0, 0.0], [5.0, 0.0]]},
}  # fmt: skip
DEEP: list = []
for _ in range(200):
    DEEP = [DEEP]
VALUES = (
    None, True, "", "x", "\x1b[2J", "\u202e", "../../x", [], {}, [[]], [None], {"a": {}}, -1, 0,
    1e308, -1e308, 5e-324, float("nan"), float("inf"), 10**400, 2**63, ["a"], [1e308, -1e308], DEEP,
)  # fmt: skip
PATTERN = adaptics(keyframe(0.0), keyframe(50.0, (5.0, 0.0)))
RUN = ("run", "FILE", "--model", "point-kernel", "--quiet")


def changed(table: object, rng: random.Random) -> object:
    """The table with one value anywhere in it replaced, left out, or put elsewhere."""
    table = copy.deepcopy(table)
    places = list(_places(table))
    holder, key = rng.choice(places)
    how = rng.randrange(6)
    if how == 0:
        del holder[key]
    elif how == 1 and len(places) > 1:
        other, place = rng.choice(places)
        holder[key] = copy.deepcopy(other[place])
    else:
        holder[key] = rng.choice(VALUES)
    return table


def _places(node: object):
    items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in list(items):
        yield node, key
        if isinstance(value, dict | list):
            yield from _places(value)


def file(name: str, content: bytes | str, *arguments: str) -> Write:

    def write(folder: Path) -> list[str]:
        raw = content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass")
        (folder / name).write_bytes(raw)
        return [name if word == "FILE" else word for word in arguments]

    return write


def scenes() -> dict[str, Write]:
    rng, good = random.Random(SEED), tomli_w.dumps(QUICK)
    texts = {
        "keys by the hundred thousand": "\n".join(f"k{k} = 1" for k in range(120_000)),
        "15 MB of comments": "#\n" * 7_500_000,
        "probes that fill memory": "[tacton]\nduration_s = 10\n[probes]\npoints_mm = ["
        + "[0, 0], " * 40_000 + "]\n[body]\nkind = 'none'\n",
        "name with a terminal's escape": 'name = "\\u001b]0;x\\u0007"\nx = 1',
        "surrogate": "name = '\ud800'",
        "mesh is the scene": "[body]\nkind = 'mesh'\nfile = 'scene.toml'",
        "mesh has a zero byte": '[body]\nkind = "mesh"\nfile = "a\\u0000.stl"',
        "dates": "name = 1979-05-27T07:32:00Z",
    }  # fmt: skip
    found = {f"scene, {name}": file("scene.toml", text, *RUN) for name, text in texts.items()}
    for k in range(5):
        table = QUICK
        for _ in range(rng.choice((1, 2, 3))):
            table = changed(table, rng)
        found[f"scene, changed {k}"] = file("scene.toml", _as_toml(table), *RUN)
    for k in range(2):
        spoilt = bytearray(good.encode())
        for _ in range(3):
            at = rng.randrange(len(spoilt))
            spoilt[at : at + 1] = rng.randbytes(rng.randrange(4))
        found[f"scene, spoilt {k}"] = file("scene.toml", bytes(spoilt), *RUN)
    return found


def _as_toml(table: object) -> str:
    def plain(node: object) -> object:
        if isinstance(node, dict):
            return {key: plain(value) for key, value in node.items() if value is not None}
        if isinstance(node, list):
            return [plain(value) for value in node if value is not None]
        return node

    return "x = " + "[" * 500 if table is DEEP else _dumped(plain(table))


def _dumped(table: object) -> str:
    try:
        return tomli_w.dumps(table)
    except (RecursionError, ValueError):
        return "x = " + "[" * 500 + "]" * 500


def _wav(change: Callable[[bytearray], None] = lambda raw: None) -> bytes:
    stream = io.BytesIO()
    wavfile.write(stream, 1000, np.sin(np.arange(100)).astype(np.float32))
    raw = bytearray(stream.getvalue())
    change(raw)
    return bytes(raw)


def _put(at: int, form: str, value: int) -> Callable[[bytearray], None]:
    return lambda raw: struct.pack_into(form, raw, at, value)


def patterns() -> dict[str, Write]:
    rng = random.Random(SEED)
    found = {}

    def add(name: str, suffix: str, content: bytes | str) -> None:
        more = ("--rate", "1000") if suffix == ".csv" else ()
        words = "convert", "FILE", "out.toml", "--quiet", *more
        found[f"pattern, {name}"] = file(f"in{suffix}", content, *words)

    for name in ("\x1b[2J", "../../x", None):
        text = json.dumps(PATTERN | {"name": name})
        add(f"named {str(name)[:8]!a}", ".adaptics", text)
    for k in range(5):
        add(f"changed {k}", ".adaptics", json.dumps(changed(PATTERN, rng)))
    add("JSON nested deeply", ".adaptics", '{"a":' * 100_000)
    unhashable = json.dumps(PATTERN).replace('"circle"', '["circle"]')
    add("a brush that is a list", ".adaptics", unhashable)
    lies = {
        "RIFF of 4 GB": _put(4, "<I", 2**32 - 1),
        "no channels": _put(22, "<H", 0),
        "unknown format": _put(20, "<H", 0x1234),
    }
    for name, lie in lies.items():
        add(f"WAV, {name}", ".wav", _wav(lie))
    for cut in (0, 57):
        add(f"WAV, cut at {cut}", ".wav", _wav()[:cut])
    rows = "t_s,point,x_m,y_m,z_m,intensity\n0,0,0,0,0.2,1\n0.01,0,0.001,0,0.2,1\n"
    tables = {
        "a cell of 1 MB": rows + "9" * 1_000_000,
        "point of 1e18": rows.replace("0,0,0,0,0.2", "0,1000000000000000000,0,0,0.2"),
        "UTF-16": rows.encode("utf-16"),
        "columns by the thousand": ",".join(["x_m"] * 100_000) + "\n",
    }
    for name, text in tables.items():
        add(f"CSV, {name}", ".csv", text)
    return found


def special_files() -> dict[str, Write]:
    commands = {
        "scene": ("x.toml", *RUN), "WAV": ("x.wav", "convert", "FILE", "o.toml"),
        "surface": ("x.stl", "mesh", "FILE", "--quiet"),
    }  # fmt: skip
    kinds = {"pipe": os.mkfifo, "folder": os.mkdir, "device": lambda p: os.symlink("/dev/zero", p)}
    kinds["sparse file of 100 GB"] = _sparse
    found = {}
    for of, (name, *arguments) in commands.items():
        for kind, make in kinds.items():

            def write(folder: Path, name=name, arguments=arguments, make=make) -> list[str]:
                make(folder / name)
                return [name if word == "FILE" else word for word in arguments]

            found[f"{kind} as {of}"] = write
    return found


def _sparse(path: Path) -> None:
    with open(path, "wb") as file:
        file.truncate(100 * 10**9)


def meshes() -> dict[str, Write]:
    """Meshes and surfaces that ask for more than they hold; each is read by another process."""
    texts: dict[str, bytes | str] = {
        "itself.inp": "*INCLUDE,INPUT=itself.inp\n",
        "count.msh": "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1000000000000\n",
        "faces.stl": b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 100,
        "index.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 999999999999\n",
        "points.vtu": '<VTKFile type="UnstructuredGrid" version="1.0"><UnstructuredGrid><Piece '
        'NumberOfPoints="1000000000000" NumberOfCells="1"></Piece></UnstructuredGrid></VTKFile>',
        "escape\x1b[2J.stl": "solid \x1b[2J",
        "junk.ply": random.Random(SEED).randbytes(2000),
    }
    return {f"mesh, {n!a}": file(n, text, "mesh", "FILE", "--quiet") for n, text in texts.items()}


def _answered(folder: Path) -> Path:
    scene = folder / "scene.toml"
    scene.write_text(tomli_w.dumps(QUICK))
    command = [sys.executable, "-m", "skinwave", *RUN, "--out", "result"]
    subprocess.run([w if w != "FILE" else "scene.toml" for w in command], cwd=folder, check=True)
    return folder / "result"


def results(made: Path) -> dict[str, Write]:
    """Reports of result folders in which something is damaged or foreign; `made` is a sound one."""
    rng, found = random.Random(SEED), {}
    files = {path.name: path.read_bytes() for path in made.iterdir() if path.is_file()}

    def add(name: str, damaged: str, content: bytes | Callable[[Path], object]) -> None:
        def write(folder: Path) -> list[str]:
            (folder / "a").mkdir()
            for known, sound in files.items():
                (folder / "a" / known).write_bytes(sound)
            (folder / "a" / damaged).unlink(missing_ok=True)
            if callable(content):
                content(folder / "a" / damaged)
            else:
                (folder / "a" / damaged).write_bytes(content)
            return ["report", "a", "--out", "o", "--quiet"]

        found[f"result, {name}"] = write

    arrays = dict(np.load(io.BytesIO(files["responses.npz"])))

    def stored(**fields: object) -> bytes:
        stream = io.BytesIO()
        np.savez(stream, **fields)
        return stream.getvalue()

    spoilt = bytearray(files["responses.npz"])
    for _ in range(20):
        spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
    npz: dict[str, bytes | Callable[[Path], object]] = {
        "objects": stored(**(arrays | {"t": np.array([{}], object)})),
        "nan": stored(**(arrays | {"t": arrays["t"] * np.nan})),
        "another model": stored(t=arrays["t"], probes=arrays["probes"], **{"\x1b[2J": arrays["t"]}),
        "cut": files["responses.npz"][:500], "empty": b"", "spoilt": bytes(spoilt),
        "pipe": os.mkfifo, "sparse": _sparse,
    }  # fmt: skip
    for name, content in npz.items():
        add(f"npz, {name}", "responses.npz", content)
    for name in ("effort.json", "plan.json"):
        table = json.loads(files[name]) if name in files else {"rows": [], "tolerance": 0.05}
        for k in range(2):
            add(f"{name}, changed {k}", name, json.dumps(changed(table, rng)).encode())
        add(f"{name}, deep", name, b"[" * 100_000)
    add("scene, spoilt", "scene.toml", b"[")
    return found


def tables() -> dict[str, Write]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def parquet(**columns: list) -> bytes:
        stream = io.BytesIO()
        pq.write_table(pa.table(columns), stream)
        return stream.getvalue()

    good = {"key": ["k"], "index": [0], "status": ["done"], "peak_um": [1.0]}
    contents: dict[str, bytes | Callable[[Path], object]] = {
        "foreign": parquet(a=[1, 2]),
        "key of numbers": parquet(**(good | {"key": [1]})),
        "no rows": parquet(key=pa.array([], pa.string())),
        "names that are obeyed": parquet(**(good | {"\x1b[2J.x": [1.0], "$\\frac{$": [2.0]})),
        "many rows": parquet(key=pa.array(["k"]).take(pa.array(np.zeros(3_000_000, int)))),
        "cut": parquet(**good)[:-10],
        "pipe": os.mkfifo,
    }
    found = {}
    for name, content in contents.items():
        for command in ("--plot", "sweep"):

            def write(folder: Path, content=content, command=command) -> list[str]:
                dataset.open_folder(folder / "s")
                place = folder / "s/rows/part-k.parquet"
                if callable(content):
                    content(place)
                else:
                    place.write_bytes(content)
                (folder / "scene.toml").write_text(tomli_w.dumps(QUICK))
                vary = ["--vary", "tacton.size_mm=nonsense", "--scheduler", "threads"]
                if command == "sweep":
                    return ["sweep", "scene.toml", *vary, "--out", "s", "--quiet"]
                return ["sweep", "s", "--plot", "--quiet", "--x", "peak_um"]

            found[f"table, {name}, {command}"] = write
    return found


def requests() -> dict[str, Write]:
    asked = [
        ["sweep", "FILE", "--vary", vary]
        for vary in (
            "tacton.size_mm=" + ",".join(["1"] * 200_001), "tacton.size_mm=1:2:1e18",
            "tacton.size_mm=[" * 500, "\x1b[2J=1", "body=/dev/zero", "tacton=1", "=",
        )
    ]  # fmt: skip
    asked += [["sweep", "FILE", "--vary", "tacton.size_mm=1,2", *more] for more in (
        ["--design", "\x1b[2J"], ["--samples", "-1"], ["--workers", "-5", "--scheduler", "threads"],
 ["--seed", "-1"], ["--tolerance", "nan"],
    )]  # fmt: skip
    rates = ("nan", "1e308", "0")
    asked += [["convert", "FILE", f"o{e}", "--rate", x] for e in (".wav", ".csv") for x in rates]
    asked += [["convert", "FILE", name] for name in ("\0.wav", "a/b/c.wav", ".wav", "x.\x1b[2J")]
    text = tomli_w.dumps(QUICK)
    return {
        f"request {k}, {' '.join(words)[:40]!a}": file("scene.toml", text, *words, "--quiet")
        for k, words in enumerate(asked)
    }
