"""Small scenes; malformed scenes, meshes and command lines, from one seed: always the same ones.

`python tests/corpus.py FOLDER` writes the scenes out, to look at or to try elsewhere.
"""

import random
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import fem
import meshes
from meshes import TetMesh

SEED = 1404
GOOD = """
name = "small"
[tacton]
am_frequency_hz = 200
duration_s = 0.02
[body]
size_x_mm = 30
size_y_mm = 30
thickness_mm = 6
sides = "clamped"
[probes]
points_mm = [[0, 0], [5, 0]]
"""
SILENT_GROUND = GOOD.replace("[body]", "[body]\nkind = 'none'")  # planned without computing
# A scene that takes a second to compute.
SMALL = """
name = "short"
[tacton]
am_frequency_hz = 200
duration_s = 0.05
shape = "circle"
size_mm = 10
speed_m_per_s = 6
[body]
size_x_mm = 60
size_y_mm = 60
[probes]
points_mm = [[0, 0], [10, 0]]
"""

NUMBERS = {
    "tacton": ("amplitude_percent", "am_frequency_hz", "second_am_frequency_hz",
               "envelope_frequency_hz", "duration_s", "size_mm", "speed_m_per_s"),
    "focus": ("height_mm", "depth_of_modulation", "peak_pressure_pa"),
    "body": ("size_x_mm", "size_y_mm", "thickness_mm"),
    "body.material": ("density_kg_m3", "shear_modulus_pa", "poisson", "viscosity_pa_s",
                      "loss_factor"),
    "[body.material.prony]": ("modulus_pa", "time_s"),
}  # fmt: skip
NO_NUMBERS = (
    "'7'",
    "true",
    "[]",
    "[1.0]",
    "{}",
    "2024-05-11",
    "nan",
    "-inf",
    "-1",
    "1" + "0" * 400,
)
WORDS = {
    "tacton": ("shape", "sweep"),
    "focus": ("drive", "profile"),
    "body": ("kind", "material", "base", "sides"),
}
NO_WORDS = ("3", "nan", "false", "[]", "['circle']", "''", "'nonsense'", "'Circle '", "07:32:00")
PAIRS = (
    "1",
    "[]",
    "[1]",
    "[1, 0, 0]",
    "['a', 'b']",
    "[nan, 1]",
    "[2, -1]",
    "[0.5, 0.6]",
    "[[1], 0]",
)
POINTS = (
    "1", "[]", "[1, 2]", "[[1]]", "[[1, 2, 3]]", "[['a', 0]]", "[[nan, 0]]", "[[0, inf]]",
    "[[1e9, 0]]", "[[0, 0], [16, 0]]", "[[0, 0], [true, 0]]", "{}", "'0, 0'", "[[1e308, 1e308]]",
)  # fmt: skip
MATERIAL = "density_kg_m3 = 1000\nshear_modulus_pa = 1e4\npoisson = 0.45\n"
WHOLE_FILES = {
    "empty table header": "[]",
    "table left open": "[tacton",
    "value left out": "[tacton]\nsize_mm =",
    "key twice": "name = 'a'\nname = 'b'",
    "table twice": "[tacton]\n[tacton]",
    "text left open": "name = 'small",
    "no TOML": "Dear Sir or Madam,",
    "JSON": '{"tacton": {"size_mm": 20}}',
    "HTML": "<!doctype html><title>404</title>",
    "table is a number": "tacton = 3",
    "table is a list": "body = [1, 2]",
    "list of tables": "[[probes]]\npoints_mm = [[0, 0]]",
    "name is a number": "name = 3",
    "name is a table": "[name]",
    "brackets without end": "x = " + "[" * 50_000,
    "brackets that end": "x = " + "[" * 5_000 + "]" * 5_000,
    "tables without end": "x = " + "{a = " * 5_000,
    "digits without end": "[tacton]\nsize_mm = " + "9" * 10_000,
    "hexadecimal digits without end": "[tacton]\nsize_mm = 0x" + "f" * 10_000,
    "a key without end": "k" * 100_000 + " = 1",
    "material lacks poisson": "[body.material]\ndensity_kg_m3 = 1000\nshear_modulus_pa = 1e4",
    "material is empty": "[body.material]",
    "material has a key of its own": "[body.material]\nyoung_pa = 1e4\n" + MATERIAL,
    "incompressible": "[body.material]\n" + MATERIAL.replace("0.45", "0.5"),
    "beyond Poisson": "[body.material]\n" + MATERIAL.replace("0.45", "-1.0"),
    "unconstrained": "[body]\nbase = 'free'\nsides = 'free'",
    "infinite sheet": "[body]\nkind = 'sheet'\nthickness_mm = inf",
    "path off the body": "[tacton]\nshape = 'square'\nsize_mm = 60\n[body]\nsize_x_mm = 59",
    "drawn too fast": "[tacton]\nshape = 'circle'\nsize_mm = 1e-300\nspeed_m_per_s = 1e300",
    "polyline without points": "[tacton]\nshape = 'polyline'",
    "points of a circle": "[tacton]\nshape = 'circle'\npoints_mm = [[0, 0], [1, 1]]",
    "points in words": "[tacton]\nshape = 'polyline'\npoints_mm = [['a', 'b'], [0, 1]]",
    "points of three": "[tacton]\nshape = 'polyline'\npoints_mm = [[0, 0, 0], [0, 1, 0]]",
    "recorded without times": "[tacton]\nshape = 'recorded'\npoints_mm = [[0, 0], [1, 1]]",
    "times that fall": "[tacton]\nshape = 'recorded'\npoints_mm = [[0, 0], [1, 1]]\n"
    "times_s = [0, -1]",
    "levels of four": "[tacton]\nshape = 'recorded'\npoints_mm = [[0, 0], [1, 1]]\n"
    "times_s = [0, 1]\nlevels = [1, 4]",
    "hold is a word": "[tacton]\nhold = 'yes'",
    "centre is a number": "[tacton]\ncentre_mm = 5",
    "centre of three": "[tacton]\ncentre_mm = [0, 0, 200]",
    "no foci": "[tacton]\nfoci = []",
    "foci are a number": "[tacton]\nfoci = 3",
    "nine foci": "[tacton]\nfoci = [0, 0, 0, 0, 0, 0, 0, 0, 0]",
    "a focus at infinity": "[tacton]\nfoci = [inf]",
    "sharing unfairly": "[tacton]\nsharing = 'unfair'",
    "rhythm is a number": "[tacton]\nrhythm = 3",
    "rhythm is empty": "[tacton.rhythm]",
    "rhythm without pulses": "[tacton.rhythm]\npulses_ms = []",
    "pulse without gap": "[tacton.rhythm]\npulses_ms = [[10]]",
    "pulse of no length": "[tacton.rhythm]\npulses_ms = [[0, 10]]",
    "ramp beyond its pulse": "[tacton.rhythm]\npulses_ms = [[10, 10]]\nramp_ms = 6",
    "rhythm in seconds": "[tacton.rhythm]\npulses_s = [[0.1, 0.1]]",
    "signal without samples": "[tacton.signal]\nrate_hz = 100",
    "signal of no rate": "[tacton.signal]\nrate_hz = 0\nsamples = [0, 1]",
    "signal too loud": "[tacton.signal]\nrate_hz = 100\nsamples = [0, 2]",
    "signal in words": "[tacton.signal]\nrate_hz = 100\nsamples = ['a', 'b']",
    "signal of no role": "[tacton.signal]\nrate_hz = 100\nsamples = [0, 1]\nrole = 'lead'",
    "carrier as modulation": "[tacton]\nam_frequency_hz = 40000",
    "above the array": "[focus]\nheight_mm = 601",
}
ABSURD = {
    "elements of a hundredth of a millimetre": ("", "size_x_mm = 1000", "--h", "0.01"),
    "elements of an atom": ("", "thickness_mm = 6", "--h", "1e-7"),
    "a strip of two metres": (
        "kind = 'sheet'\n", "size_x_mm = 2e3\nsize_y_mm = 10.1", "--h", "0.1",
    ),
    "a floating strip of two metres": ("base = 'free'\n", "size_x_mm = 2e3", "--h", "0.2"),
}  # fmt: skip


def scenes() -> dict[str, bytes]:
    """Files that are no scenes, by what is wrong with them."""
    found = {name: text.encode() for name, text in WHOLE_FILES.items()}
    for table, keys in NUMBERS.items():
        rest = MATERIAL if table == "body.material" else ""
        for key in keys:
            others = "".join(line + "\n" for line in rest.splitlines() if key not in line)
            for value in NO_NUMBERS:
                found[f"{key} = {value[:12]}"] = f"[{table}]\n{others}{key} = {value}".encode()
    for table, keys in WORDS.items():
        for key in keys:
            for value in NO_WORDS:
                found[f"{key} = {value}"] = f"[{table}]\n{key} = {value}".encode()
    found |= {f"superposition = {v}": f"[tacton]\nsuperposition = {v}".encode() for v in PAIRS}
    small = GOOD.split("[probes]")[0]
    found |= {f"points = {v}": f"{small}[probes]\npoints_mm = {v}".encode() for v in POINTS}
    return found | _misspelt() | _junk()


def _misspelt() -> dict[str, bytes]:
    """A good scene with one letter of one key changed."""
    rng, found = random.Random(SEED), {}
    lines = GOOD.strip().splitlines()
    while len(found) < 40:
        k = rng.randrange(len(lines))
        key = lines[k].split(" =")[0].strip("[]")
        at = rng.randrange(len(key))
        wrong = key[:at] + rng.choice("QXZ7") + key[at + 1 :]
        changed = [*lines[:k], lines[k].replace(key, wrong, 1), *lines[k + 1 :]]
        found[f"misspelt {wrong}"] = "\n".join(changed).encode()
    return found


def _junk() -> dict[str, bytes]:
    rng = random.Random(SEED)
    found = {f"junk {n} {k}": rng.randbytes(n) for n in (8, 100, 5000) for k in range(5)}
    for code in ("utf-16", "utf-32", "utf-16-be"):
        found[code] = GOOD.encode(code)
    found["latin-1"] = GOOD.replace("small", "schön").encode("latin-1")
    found["a zero byte"] = GOOD.encode().replace(b"small", b"sm\0all")
    found["carriage returns only"] = GOOD.encode().replace(b"\n", b"\r")
    found["a PNG"] = b"\x89PNG\r\n\x1a\n" + rng.randbytes(50)
    found["larger than any scene"] = b"# " + b"x" * 32_000_000
    return found


def damaged_scenes() -> list[bytes]:
    """A good scene cut off, or with bytes changed; some are still scenes."""
    rng, good = random.Random(SEED), SILENT_GROUND.encode()
    found = [good[: rng.randrange(len(good))] for _ in range(30)]
    for _ in range(60):
        changed = bytearray(good)
        for _ in range(rng.choice((1, 1, 2, 5))):
            at = rng.randrange(len(changed))
            changed[at : at + rng.randrange(2)] = bytes([rng.choice((rng.randrange(256), 48, 45))])
        found.append(bytes(changed))
    return found


def command_lines() -> list[list[str]]:
    """Arguments that are refused in one sentence, beside good.toml, none.toml and kept/note."""
    run, compare, plan = ["run", "good.toml"], ["compare", "good.toml"], ["plan", "good.toml"]
    trade, fem_run = ["verify", "--tradeoff", "good.toml"], [*run, "--model", "fem"]
    found = [
        [*command, "--h", h]
        for command in (run, fem_run, compare, plan)
        for h in ("nan", "inf", "-1", "0", "-0.0", "1e-9", "1e300", "1e400", "31")
    ]
    found += [
        [*command, "--tolerance", t]
        for command in (run, fem_run, plan)
        for t in ("0", "1", "-1", "nan", "inf", "1e400", "5")
    ]
    found += [
        [*command, "--model", "fem-transient", "--h", "5", "--dt", dt]
        for command in (run, plan)
        for dt in ("0", "-1", "nan", "inf", "1e300", "1e-12", "1")
    ]
    found += [
        [*command, "--solver", s]
        for command in (run, fem_run, compare)
        for s in ("nonsense", "", "AUTO", "pardiso ", "splu")
    ]
    outs = ("kept", "kept/note", "kept/note/below", "good.toml", ".", "", "/", "..",
            "x\0y", "n" * 300, "new/" + "n" * 300, "loop", "/proc/nowhere/out",
            "/dev/null/out")  # fmt: skip
    for command in (run, compare, trade, ["verify", "--quick"]):
        found += [[*command, "--out", out] for out in outs]
        over = ("kept/note", ".", "", "/", "..", "loop")
        found += [[*command, "--overwrite", "--out", out] for out in over]
    files = ("missing.toml", "kept", "", "kept/note", "x\0y", "n" * 300, "good.toml/x")
    files += ("/dev/zero",)
    found += [[c, f] for c in ("run", "compare", "plan") for f in files]
    found += [["verify", "--tradeoff", "none.toml"], [*run, "--model", "flat-body", "--h", "nan"]]
    found += [["run", "none.toml", "--model", m] for m in ("fem", "fem-transient", "flat-body")]
    return found


def wrong_usage() -> list[list[str]]:
    """Arguments that no command takes."""
    run = ["run", "good.toml"]
    found: list[list[str]] = [[], ["fly"], ["run"], ["plan"], ["run", "a", "b"]]
    found += [["verify", "--tradeoff"]]
    found += [["--version-of-what"], ["run", "--quick", "good.toml"], ["verify", "good.toml"]]
    found += [[*run, "--model", m] for m in ("magic", "", "FEM", "fem-static")]
    found += [[*run, "--h", h] for h in ("", "abc", "1,5", "1 mm", "0x10", "--quiet")]
    found += [[*run, "--dt", "soon"], [*run, "--tolerance", "5 %"], [*run, "--out"]]
    found += [["plan", "good.toml", *o] for o in (["--out", "x"], ["--solver"], ["--h"])]
    found += [["convert"], ["convert", "good.toml"], ["convert", "a", "b", "--rate", "fast"]]
    found += [["compare", "a", "b"], ["compare", "--tolerance", "0.1"], ["compare", "--dt", "1"]]
    return found


CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]


def broken_meshes() -> dict[str, Callable[[], object]]:
    """Calls that result in no mesh, operator or response."""

    def tet(**fields: object) -> Callable[[], object]:
        return lambda: TetMesh(**({"points": CORNERS, "tets": [[0, 1, 2, 3]]} | fields))  # type: ignore[arg-type]

    def points(at: int, value: object) -> Callable[[], object]:
        return tet(points=[value if k == at else corner for k, corner in enumerate(CORNERS)])

    inf, nan, grading = np.inf, np.nan, meshes.Grading
    found = {
        f"points {k}": tet(points=p)
        for k, p in enumerate(
            (None, "xyz", 3.0, [], [[]], CORNERS[0], [[0, 0]] * 4, CORNERS[:3],
             [["a", "b", "c"]] * 4, [[0, 0, 0], [1, 0]], {"x": 1}, np.zeros((4, 3, 1)),
             np.array(CORNERS, object) * 1j,
             [[None] * 3] * 4, np.zeros((4, 3)), np.array(CORNERS) * 1e-200, CORNERS * 2)
        )
    }  # fmt: skip
    del found["points 16"]  # spare points are no error
    found |= {
        f"tets {k}": tet(tets=t)
        for k, t in enumerate(
            (None, "0123", 0, [], [[]], [0, 1, 2, 3], [[0, 1, 2]], [[0, 1, 2, 4]], [[-1, 1, 2, 3]],
             [[0, 1, 2, 2]], [[0, 0, 0, 0]], [[0.5, 1, 2, 3]], [[nan, 1, 2, 3]], [[0, 1, 2, 2**40]],
             [[0, 1, 2, 3], [0, 1, 2]], [["0", "1", "2", "x"]], [list(range(10))],
             np.zeros((1, 4, 1), int), [[0, 1, 2, 2**70]], [[0, 1, 2, None]])
        )
    }  # fmt: skip
    found |= {
        f"region {k}": tet(region=r)
        for k, r in enumerate(([0, 1], [-1], [0.5], [nan], ["skin"], [[0]], [None]))
    }
    found |= {
        f"facets {k}": tet(facets={"top": f})
        for k, f in enumerate(
            ([[0, 1, 9]], [[-1, 0, 1]], [[0, 1]], [[0, 1, 2, 3]], [0, 1, 2], [[0.5, 1, 2]],
             [[nan, 1, 2]], "top", [[0, 1, 2], [0, 1]], None, [[None, 1, 2]])
        )
    }  # fmt: skip
    found |= {
        f"corner {v}": points(3, v)
        for v in ([0, 0, nan], [0, 0, inf], [0, -inf, 0], [1, 1, 0.0], [0, 0, 1e300], [0, 0, 1e-12])
    }
    found |= {
        f"block of {a}": lambda a=a: meshes.block(*a)
        for a in (
            ((0, 1, 1), 0.5), ((-1, 1, 1), 0.5), ((nan, 1, 1), 0.5), ((inf, 1, 1), 0.5),
            ((1, 1, 1), 0), ((1, 1, 1), -1), ((1, 1, 1), nan), ((1, 1, 1), 1e-5),
            ((1, 1, 1), 1e-300), ((1e300, 1, 1), 1), ((1, 1), 0.5),
        )
    }  # fmt: skip
    found |= {
        f"graded block of {a}": lambda a=a: meshes.block(*a, grading=grading(radius=0.1))
        for a in (((1, 1, 1), 0), ((1, 1, nan), 0.1), ((1, 1, 1), inf), ((1, 1, 1), 1e-12))
    }
    found |= {
        f"grading {g}": lambda g=g: grading(**g)
        for g in (
            {"radius": -1}, {"radius": nan}, {"radius": 0, "growth": 0.5},
            {"radius": 0, "growth": nan}, {"radius": 0, "coarsest": 0},
            {"radius": 0, "coarsest": nan},
        )
    }  # fmt: skip
    slow = {"radius": 0.0, "growth": 1 + 1e-12}
    found["grading that hardly grows"] = lambda: meshes.graded_axis(1, 1e-9, grading(**slow))
    found |= {
        f"sheet {a}": lambda a=a: meshes.sheet(*a[:4], **a[4])
        for a in (
            (1, 1, 0, 0.5, {}), (1, 1, -1, 0.5, {}), (1, 1, nan, 0.5, {}), (1, 0, 1, 0.5, {}),
            (1, 1, 1, 0.5, {"layers": 0}), (1, 1, 1, 0.5, {"order": 3}), (1, 1, 1, 1e-4, {}),
        )
    }  # fmt: skip
    found |= {
        f"grid {k}": lambda line=line: meshes.extrude(line, [0, 1], [0, 1])
        for k, line in enumerate(([0], [], [1, 0], [0, 0], [0, nan], [[0, 1]], [0, 1e300]))
    }
    cube = meshes.block((1, 1, 1), 0.5)
    skin, top = fem.PRESETS["palm"], cube.facets["top"]
    found |= {f"half along {a}": lambda a=a: meshes.half(cube, a) for a in ("w", "", "xy", "z")}
    found["half that is cut"] = lambda: meshes.half(meshes.block((1, 1, 1), 1), "z")
    found |= {
        f"load on {k}": lambda f=f: fem.load_operator(cube, f)
        for k, f in enumerate(("lid", "", top[:, :3], top + 10**6, top - 10**6, top * 0.5, top[0]))
    }
    found |= {
        f"probe {k}": lambda p=p: fem.probe_operator(cube, p)
        for k, p in enumerate(
            ([[2, 0]], [[nan, 0]], [[inf, 0]], [[0]], [0, 0, 0, 0], [[[0, 0]]], [])
        )
    }
    found["probe on no facets"] = lambda: fem.probe_operator(cube, [[0, 0]], top[:0])
    everything = np.ones(cube.points.shape, bool)
    found |= {
        f"assemble with {k}": lambda a=a: fem.assemble(cube, **({"material": skin} | a))
        for k, a in enumerate(
            ({"material": "palm"}, {"material": {}}, {"material": {1: skin}}, {"material": None},
             {"fixed": "lid"}, {"fixed": {"top": "w"}}, {"fixed": {"top": ""}},
             {"fixed": everything}, {"fixed": everything[:5]}, {"fixed": None},
             {"absorbing": "lid"},
             {"absorbing": top[:, :3]}, {"absorbing": top + 10**6}, {"absorbing": top * 0},
             {"absorbing": top * 0.5})
        )
    }  # fmt: skip
    bowed = cube.points.copy()
    bowed[cube.tets[0, 4]] += 5.0
    found["assemble what is inside out"] = lambda: fem.assemble(
        TetMesh(points=bowed, tets=cube.tets, facets=cube.facets), skin
    )
    return found


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Every file below a folder, with what is in it; folders with None."""
    return {p: p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True)
    for k, content in enumerate([*scenes().values(), *damaged_scenes()]):
        (folder / f"{k:03}.toml").write_bytes(content)
