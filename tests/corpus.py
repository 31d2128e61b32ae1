"""Small scenes; malformed scenes, meshes and command lines, from one seed."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import fem
import meshes
from meshes import TetMesh
from simple_model import Material, MovingPressure, Tacton
from skinwave.scene.scene import Body, Scene

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

SHORT = """
name = "short"
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[body]
size_x_mm = 60
size_y_mm = 60
[probes]
points_mm = [[0, 0], [5, 0]]
"""
SOFT = Material(density=1000, shear_modulus=30100, poisson=0.4999, viscosity=4.3)
FREE = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=226, duration=0.09)),
    body=Body(width=0.0293, height=0.02, depth=0.0099, base="free", sides="clamped", material=SOFT),
    probes=((-5.3e-3, 8.7e-3), (-0.5e-3, -1.1e-3), (-7.7e-3, -1.3e-3)),
)

NUMBERS = {
    "tacton": ("amplitude_percent", "am_frequency_hz", "second_am_frequency_hz",
               "envelope_frequency_hz", "duration_s", "size_mm", "speed_m_per_s"),
    "focus": ("height_mm", "depth_of_modulation", "peak_pressure_pa"),
    "body": ("size_x_mm", "size_y_mm", "thickness_mm"),
    "body.material": ("density_kg_m3", "shear_modulus_pa", "poisson", "viscosity_pa_s"),
}  # fmt: skip
NO_NUMBERS = ("'7'", "true", "-inf", "1" + "0" * 400)
WORDS = {
    "tacton": ("shape", "sweep"),
    "focus": ("drive", "profile"),
    "body": ("kind", "material", "base", "sides"),
}
NO_WORDS = ("3", "['circle']", "'nonsense'")
PAIRS = ("1", "[1]", "['a', 'b']", "[nan, 1]", "[0.5, 0.6]")
POINTS = ("1", "[]", "[[1, 2, 3]]", "[['a', 0]]", "[[0, inf]]", "[[0, 0], [16, 0]]", "{}")
MATERIAL = "density_kg_m3 = 1000\nshear_modulus_pa = 1e4\npoisson = 0.45\n"
WHOLE_FILES = {
    "empty table header": "[]",
    "table left open": "[tacton",
    "key twice": "name = 'a'\nname = 'b'",
    "no TOML": "Dear Sir or Madam,",
    "table is a number": "tacton = 3",
    "brackets without end": "x = " + "[" * 50_000,
    "a key of 3,000 parts": ".".join(["a"] * 3000) + " = 1",
    "a header of 100,000 parts": f"[{'.'.join('a' * 100_000)}]",
    "digits without end": "[tacton]\nsize_mm = " + "9" * 10_000,
    "material lacks poisson": "[body.material]\ndensity_kg_m3 = 1000\nshear_modulus_pa = 1e4",
    "material has a key of its own": "[body.material]\nyoung_pa = 1e4\n" + MATERIAL,
    "incompressible": "[body.material]\n" + MATERIAL.replace("0.45", "0.5"),
    "unconstrained": "[body]\nbase = 'free'\nsides = 'free'",
    "infinite sheet": "[body]\nkind = 'sheet'\nthickness_mm = inf",
    "path off the body": "[tacton]\nshape = 'square'\nsize_mm = 60\n[body]\nsize_x_mm = 59",
    "polyline without points": "[tacton]\nshape = 'polyline'",
    "times that fall": "[tacton]\nshape = 'recorded'\npoints_mm = [[0, 0], [1, 1]]\n"
    "times_s = [0, -1]",
    "levels of four": "[tacton]\nshape = 'recorded'\npoints_mm = [[0, 0], [1, 1]]\n"
    "times_s = [0, 1]\nlevels = [1, 4]",
    "nine foci": "[tacton]\nfoci = [0, 0, 0, 0, 0, 0, 0, 0, 0]",
    "sharing unfairly": "[tacton]\nsharing = 'unfair'",
    "pulse without gap": "[tacton.rhythm]\npulses_ms = [[10]]",
    "ramp beyond its pulse": "[tacton.rhythm]\npulses_ms = [[10, 10]]\nramp_ms = 6",
    "signal too loud": "[tacton.signal]\nrate_hz = 100\nsamples = [0, 2]",
    "carrier as modulation": "[tacton]\nam_frequency_hz = 40000",
    "above the array": "[focus]\nheight_mm = 601",
}
ABSURD = {
    "elements of an atom": ("", "thickness_mm = 6", "--element-size", "1e-7"),
    "a strip of two metres": (
        "kind = 'sheet'\n", "size_x_mm = 2e3\nsize_y_mm = 10.1", "--element-size", "0.1",
    ),
}  # fmt: skip
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]


def scenes() -> dict[str, dict[str, bytes]]:
    """Files that are no scenes, by kind and by what is wrong with them."""
    rng = random.Random(SEED)
    numbers, words, misspelt = {}, {}, {}
    for table, keys in NUMBERS.items():
        lines = MATERIAL.splitlines() if table == "body.material" else []
        for k, key in enumerate(keys):
            others = "".join(f"{line}\n" for line in lines if key not in line)
            for value in ("nan", NO_NUMBERS[k % len(NO_NUMBERS)]):
                numbers[f"{key} = {value[:12]}"] = f"[{table}]\n{others}{key} = {value}"
    for table, keys in WORDS.items():
        words |= {f"{k} = {v}": f"[{table}]\n{k} = {v}" for k in keys for v in NO_WORDS}
    words |= {f"superposition = {v}": f"[tacton]\nsuperposition = {v}" for v in PAIRS}
    small = GOOD.split("[probes]")[0]
    words |= {f"points = {v}": f"{small}[probes]\npoints_mm = {v}" for v in POINTS}
    lines = GOOD.strip().splitlines()
    for k, line in enumerate(lines):  # one letter of its key changed
        key = line.split(" =")[0].strip("[]")
        at = rng.randrange(len(key))
        wrong = key[:at] + rng.choice("QXZ7") + key[at + 1 :]
        changed = [*lines[:k], line.replace(key, wrong, 1), *lines[k + 1 :]]
        misspelt[f"misspelt {wrong}"] = "\n".join(changed)
    texts = {"whole files": WHOLE_FILES, "numbers": numbers, "words": words, "misspelt": misspelt}
    found = {kind: {n: text.encode() for n, text in of.items()} for kind, of in texts.items()}
    junk = {f"junk {n}": rng.randbytes(n) for n in (8, 100, 5000)}
    junk |= {code: GOOD.encode(code) for code in ("utf-16", "utf-16-be")}
    junk["latin-1"] = GOOD.replace("small", "schön").encode("latin-1")
    junk["a picture"] = b"\x89PNG\r\n\x1a\n" + bytes(20)
    junk["a zero byte"] = GOOD.encode().replace(b"small", b"sm\0all")
    junk["larger than any scene"] = b"# " + b"x" * 32_000_000
    return found | {"junk": junk}


def damaged_scenes() -> list[bytes]:
    """A good scene cut off, or with bytes changed; some are still scenes."""
    rng, good = random.Random(SEED), SILENT_GROUND.encode()
    found = [good[: rng.randrange(len(good))] for _ in range(10)]
    for _ in range(20):
        changed = bytearray(good)
        for _ in range(rng.choice((1, 2, 5))):
            at = rng.randrange(len(changed))
            changed[at : at + rng.randrange(2)] = bytes([rng.choice((rng.randrange(256), 48, 45))])
        found.append(bytes(changed))
    return found


def command_lines() -> list[list[str]]:
    """Arguments that are refused in one sentence, beside good.toml, none.toml and kept/note."""
    run, compare, plan = ["run", "good.toml"], ["compare", "good.toml"], ["plan", "good.toml"]
    fem_run = [*run, "--model", "fem"]
    sizes = ("nan", "0", "1e-9", "31", "-1")
    found = [[*c, "--element-size", h] for c in (run, compare, plan) for h in sizes]
    found += [[*c, "--tolerance", t] for c in (fem_run, plan) for t in ("0", "1", "nan", "1e400")]
    found += [
        [*c, "--model", "fem-transient", "--element-size", "5", "--dt", dt]
        for c in (run, plan)
        for dt in ("0", "nan", "1e300", "1e-12", "-1")
    ]
    found += [[*c, "--solver", "nonsense"] for c in (run, compare)]
    outs = ("kept", "kept/note/below", "good.toml", ".", "", "x\0y", "loop")
    found += [[*run, "--out", out] for out in outs] + [[*compare, "--out", "kept"]]
    found += [[*run, "--overwrite", "--out", out] for out in ("kept/note", ".", "", "/", "loop")]
    files = ("missing.toml", "kept", "", "x\0y", "n" * 300, "good.toml/x", "/dev/zero")
    found += [["plan", f] for f in files]
    return found + [["run", "none.toml", "--model", m] for m in ("fem", "flat-body")]


def wrong_usage() -> list[list[str]]:
    """Arguments that no command takes."""
    run = ["run", "good.toml"]
    found: list[list[str]] = [[], ["fly"], ["run"], ["run", "a", "b"], ["--version-of-what"]]
    found += [[*run, "--model", m] for m in ("magic", "")]
    found += [[*run, "--element-size", h] for h in ("abc", "1,5", "--quiet")]
    return [*found, [*run, "--out"], ["plan", "good.toml", "--out", "x"], ["convert", "good.toml"]]


def broken_meshes() -> dict[str, Callable[[], object]]:
    """Calls that result in no mesh, operator or response."""
    nan, grading = np.nan, meshes.Grading

    def tet(**fields: object) -> Callable[[], object]:
        return lambda: TetMesh(**({"points": CORNERS, "tets": [[0, 1, 2, 3]]} | fields))  # type: ignore[arg-type]

    fields: dict[str, tuple[object, ...]] = {
        "points": (None, [], CORNERS[0], CORNERS[:3], np.zeros((4, 3)), [*CORNERS[:3], [0, 0, nan]],
                   [*CORNERS[:3], [1, 1, 0.0]], [*CORNERS[:3], [0, 0, 1e300]]),
        "tets": (None, [], [[0, 1, 2]], [[0, 1, 2, 4]], [[-1, 1, 2, 3]], [[0, 1, 2, 2]],
                 [[0.5, 1, 2, 3]], [list(range(10))]),
        "region": ([0, 1], [-1], [0.5]),
        "facets": tuple({"top": f} for f in ([[0, 1, 9]], [[0, 1]], [[0.5, 1, 2]])),
    }  # fmt: skip
    found = {f"{n} {k}": tet(**{n: v}) for n, of in fields.items() for k, v in enumerate(of)}
    cube = meshes.block((1, 1, 1), 0.5)
    skin, top = fem.PRESETS["palm"], cube.facets["top"]
    everything = np.ones(cube.points.shape, bool)
    calls: dict[str, tuple[Callable[..., object], tuple[object, ...]]] = {
        "block": (lambda a: meshes.block(*a), (((nan, 1, 1), 0.5), ((1, 1, 1), 1e-300))),
        "grading": (lambda g: grading(**g), ({"radius": nan}, {"radius": 0, "growth": 0.5})),
        "grid": (lambda x: meshes.extrude(x, [0, 1], [0, 1]), ([1, 0], [0, nan])),
        "half": (lambda axis: meshes.half(cube, axis), ("w", "z")),
        "load": (lambda f: fem.pressure_operator(cube, f), ("lid", top + 10**6)),
        "probe": (lambda p: fem.probe_operator(cube, p), ([[2, 0]], [[nan, 0]], [[0]])),
        "assembly": (lambda a: fem.assemble(cube, **({"material": skin} | a)), (
            {"material": "palm"}, {"fixed": {"top": "w"}}, {"fixed": everything})),
    }  # fmt: skip
    for name, (call, of) in calls.items():
        found |= {f"{name} {k}": lambda call=call, v=v: call(v) for k, v in enumerate(of)}
    slow = grading(radius=0.0, growth=1 + 1e-12)
    found["grading that hardly grows"] = lambda: meshes.graded_axis(1, 1e-9, slow)
    bowed = cube.points.copy()
    bowed[cube.tets[0, 4]] += 5.0
    bent = TetMesh(points=bowed, tets=cube.tets, facets=cube.facets)
    found["assemble what is inside out"] = lambda: fem.assemble(bent, skin)
    return found


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Every file below a folder, with what is in it; folders with None."""
    return {p: p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


def write_block(path: Path, *, regions: bool = True) -> None:
    """Write a block of 24 x 24 x 8 mm; with regions, its lower half is the region `deep`."""
    mesh = meshes.block((0.024, 0.024, 0.008), 0.004)
    deep = mesh.points[mesh.tets[:, :4], 2].mean(axis=1) < mesh.points[:, 2].max() - 4e-3
    named = {"region": deep.astype(int), "region_names": {0: "skin", 1: "deep"}} if regions else {}
    meshes.write(path, replace(mesh, facets={}, **named))
