"""Pages of the reference from the code: `<!-- generated: name -->` in a page becomes its Markdown.

What is listed is what the program itself reads: parsers, keys, registries and docstrings.
"""

import argparse
import inspect
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
MARK = re.compile(r"<!-- generated: ([\w-]+) -->")
RELATIVE = re.compile(r"\]\(([^)\s]+)")
HERTZ = 200.0  # at which a table of materials states losses and speeds
PARAMETER = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n    .*)*)", re.MULTILINE)


def table(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A Markdown table."""
    head = list(head)
    lines = [head, ["---"] * len(head), *([_cell(each) for each in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _cell(value: Any) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")


def described(record: type) -> dict[str, str]:
    """What the docstring of a record says of each of its fields."""
    found = {}
    said = {f"`{name}`": _listed(values) for name, values in _choices().items()}
    for names, text in PARAMETER.findall(inspect.getdoc(record) or ""):
        for name in names.split(", "):
            found[name] = " ".join(text.split())
            for constant, values in said.items():
                found[name] = found[name].replace(constant, values)
    return found


def _choices() -> dict[str, Iterable[str]]:
    """Constants that docstrings name, whose values a reader of the page wants."""
    from simple_model import SHAPES
    from simple_model.load.trajectory import BY_POINTS
    from skinwave.scene.load import LOADS

    return {"SHAPES": SHAPES, "BY_POINTS": BY_POINTS, "LOADS": LOADS}


def _listed(values: Iterable[str]) -> str:
    return ", ".join(f"`{value}`" for value in values)


# The command line


def commands() -> str:
    """Every command with its options, as its parser has them."""
    from skinwave.commands import cli

    actions = cli.parser()._actions
    (commands,) = (each for each in actions if isinstance(each, argparse._SubParsersAction))
    helps = {each.dest: each.help or "" for each in commands._choices_actions}
    overview = table(
        ["command", ""], [[f"[`{n}`](#skinwave-{n})", helps[n]] for n in commands.choices]
    )
    parts = [_command(name, helps[name], parser) for name, parser in commands.choices.items()]
    return "\n".join([overview, *parts])


def _command(name: str, said: str, parser: argparse.ArgumentParser) -> str:
    usage = parser.format_usage().removeprefix("usage: ").strip()
    rows = [_option(parser, each) for each in parser._actions if each.dest != "help"]
    options = table(["", "", "if not given"], rows) if rows else ""
    return (
        f"(skinwave-{name})=\n\n## skinwave {name}\n\n{said}.\n\n```text\n{usage}\n```\n\n{options}"
    )


def _option(parser: argparse.ArgumentParser, action: argparse.Action) -> list[str]:
    formatter = parser._get_formatter()
    shown = formatter._format_action_invocation(action)
    said = formatter._expand_help(action) if action.help else ""
    default = action.default
    plain = default is None or default is False or default is argparse.SUPPRESS or default == []
    return [f"`{shown}`", said, "" if plain else f"`{default}`"]


# Scene files


def scene_keys() -> str:
    """Every key of a scene file with its meaning and the value that it takes if not given."""
    from simple_model import Material, MovingPressure, PronyTerm, Rhythm, Signal, Tacton, Trajectory
    from skinwave import Body, Load, Scene
    from skinwave.bodies import Layer, Mounting, Phalanx, Placement, Relief
    from skinwave.scene import keys as scene_keys
    from skinwave.scene.support_motion import SupportMotion

    sections = scene_keys.SECTIONS
    records: dict[str, list[type]] = {
        "tacton": [Tacton, Trajectory], "focus": [MovingPressure], "body": [Body], "load": [Load],
        "placement": [Placement], "probes": [Scene],
    }  # fmt: skip
    inner = {
        "tacton.rhythm": (scene_keys.PULSES, Rhythm),
        "tacton.signal": (scene_keys.SIGNAL, Signal),
        "body.material": (scene_keys.MATERIAL, Material),
        "body.material.prony": (scene_keys.PRONY, PronyTerm),
        "body.layers": (scene_keys.LAYER, Layer),
        "body.relief": (scene_keys.RELIEF, Relief),
        "body.bone": (scene_keys.BONE, Phalanx),
        "body.mounting": (scene_keys.MOUNTING, Mounting),
        "load.support_motion": (scene_keys.SUPPORT_MOTION, SupportMotion),
    }
    parts = [_section(name, sections[name], classes) for name, classes in records.items()]
    parts += [_section(name, keys, [record]) for name, (keys, record) in inner.items()]
    if missing := sections.keys() - records.keys():
        raise ValueError(f"no record describes the section {', '.join(missing)}; name it here")
    return "\n".join(parts)


def _section(name: str, keys: Mapping[str, Any], records: list[type]) -> str:
    said: dict[str, str] = {}
    for record in records:
        said |= described(record)
    rows = [[f"`{k}`", said.get(key.name, ""), _default(key, records)] for k, key in keys.items()]
    lists = name in ("body.layers", "body.material.prony")
    heading = f"[[{name}]]" if lists else f"[{name}]"
    return f"## `{heading}`\n\n{table(['key', '', 'if not given'], rows)}"


def _default(key: Any, records: list[type]) -> str:
    """A default as a scene file has it; nothing where there is none."""
    from dataclasses import MISSING, fields

    for field in (each for record in records for each in fields(record)):
        if field.name != key.name or field.default in (MISSING, None):
            continue
        try:
            return f"`{json.dumps(key.write(field.default))}`"
        except (TypeError, ValueError, AttributeError):  # a record of its own, see its section
            return ""
    return ""


def shipped() -> str:
    """Scene files of examples/, whole."""
    files = sorted((ROOT / "examples").glob("*.toml"))
    return "\n".join(f"## {f.name}\n\n```toml\n{f.read_text('utf-8')}```\n" for f in files)


# Registries


def models() -> str:
    """Registered models: what each computes and leaves out, and for which bodies."""
    from skinwave import models
    from skinwave.bodies import BODIES

    bodies = {name: BODIES[name] for name in ("skin-slab", "palm-layers", "palm", "paper-sheet")}
    rows = []
    for model in map(models.named, models.names()):
        marks = [_takes(model, body) for body in bodies.values()]
        rows.append([f"`{model.name}`", model.words, *marks])
    said = [
        f"**{model.name}** rests on: {'; '.join(model.sources)}.\n"
        for model in map(models.named, models.names())
        if model.sources
    ]
    return table(["model", "computes", *bodies], rows) + "\n" + "\n".join(said)


def _takes(model: Any, body: Any) -> str:
    from simple_model import MovingPressure, Tacton
    from skinwave.models.limits import takes
    from skinwave.scene.scene import Scene

    scene = Scene(pressure=MovingPressure(tacton=Tacton()), body=body, probes=((0.0, 0.0),))
    return "yes" if takes(model, scene) else ""


def bodies() -> str:
    """Kinds of body with the keys that only they take, and bodies by name."""
    from skinwave.bodies import BODIES, KINDS

    kinds = [
        [
            f"`{kind.name}`",
            "yes" if kind.may_be_layered and kind.discretise else "",
            "yes" if kind.compliance else "",
            "yes" if kind.dispersion else "",
            ", ".join(f"`{key}`" for key in kind.keys),
        ]
        for kind in KINDS.values()
    ]
    named = [[f"`{name}`", body.of_kind.words(body), _of(body)] for name, body in BODIES.items()]
    head = ["kind", "layers", "wavenumber integral", "dispersion", "keys of its own"]
    return f"{table(head, kinds)}\n## By name\n\n{table(['name', 'is', 'material'], named)}"


def _of(body: Any) -> str:
    name = body.material if isinstance(body.material, str) else "a table"
    layers = [layer.material for layer in body.layers if isinstance(layer.material, str)]
    return ", ".join([*layers, name])


def materials() -> str:
    """Material presets: moduli at rest, loss and wave speed at `HERTZ`."""
    import numpy as np

    from simple_model.layers.material import PRESETS

    w, rows = 2 * np.pi * HERTZ, []
    for name, solid in PRESETS.items():
        modulus = complex(solid.complex_modulus(w))
        speed = 1 / (1 / np.sqrt(modulus / solid.density)).real
        rows.append(
            [
                f"`{name}`", f"{solid.density:g}", _shown(solid.shear_modulus / 1e3),
                f"{solid.poisson:.4g}", _shown(modulus.real / 1e3),
                f"{modulus.imag / modulus.real:.2g}", _shown(speed),
            ]
        )  # fmt: skip
    at = f"at {HERTZ:g} Hz"
    head = ["name", "density, kg/m³", "shear modulus at rest, kPa", "Poisson's ratio"]
    return table(
        [*head, f"storage modulus {at}, kPa", f"loss factor {at}", f"shear speed {at}, m/s"], rows
    )


def _shown(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def quantities() -> str:
    """Quantities that probes may read."""
    from simple_model.quantities import QUANTITIES

    rows = [[f"`{q.name}`", q.words, q.unit, q.shown] for q in QUANTITIES.values() if q.of_body]
    return table(["quantity", "", "SI unit", "on axes"], rows)


def drives() -> str:
    """Drive laws, with the sentence that pages have of each."""
    from simple_model import DRIVES

    rows = [[f"`{law.name}`", law.words, law.note] for law in DRIVES.values()]
    return table(["drive law", "", "lines of AM"], rows)


# Verification


def verification() -> str:
    """Cases of the verification suite: what each compares with, its bars and its errors.

    Errors are those that `skinwave verify` wrote into the folder that the environment variable
    SKINWAVE_VERIFIED names; cases that it lacks are listed without.
    """
    from skinwave.verify.suite import CASES, TOPICS

    done: dict[str, Any] = {}
    parts = [f"`skinwave verify` has {len(CASES)} cases."]
    if folder := os.environ.get("SKINWAVE_VERIFIED"):
        record = json.loads(Path(folder, "verify.json").read_text("utf-8"))
        done = {case["name"]: case for case in record["cases"]}
        parts[0] += (
            f" The errors below are of {len(done)} of them, run by {_versions(record)}: "
            f"{record['passed']} passed, {record['failed']} failed.\n"
        )
    for topic, cases in TOPICS.items():
        rows = [row for each in cases for row in _case(each.name, done.get(each.name))]
        head = ["case", "compared", "error", "at most", "with"]
        parts.append(f"## {topic}\n\n{table(head, rows)}")
    return "\n".join(parts)


def _versions(record: dict[str, Any]) -> str:
    return ", ".join(
        f"{k} {v}" for k, v in record["versions"].items() if k in ("skinwave", "numpy", "scipy")
    )


def _case(name: str, case: dict[str, Any] | None) -> list[list[str]]:
    if case is None:
        return [[f"`{name}`", "", "", "", "`skinwave verify` runs it"]]
    nearest = sorted(case["checks"], key=lambda c: -(c["error"] or 0) / (c["bar"] or 1))[:3]
    first = [f"`{name}`", "", "", "", case["source"]]
    rows = [["", _plain(c["what"]), _number(c["error"]), _number(c["bar"]), ""] for c in nearest]
    return [[*first[:1], *rows[0][1:4], first[4]], *rows[1:]] if rows else [first]


def _plain(text: str) -> str:
    return text.replace("*", "\\*").replace("_", "\\_").replace("<", "&lt;").replace("|", "\\|")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2g}".replace("-", "\N{NON-BREAKING HYPHEN}")


# Pages that stand beside docs/


def _page(name: str, folder: str) -> str:
    """A Markdown page of the repository without its title, with links as from a folder."""
    path = ROOT / name

    def turned(match: re.Match[str]) -> str:
        target = match.group(1)
        if "://" in target or target.startswith("#"):
            return match.group()
        return f"]({os.path.relpath(path.parent / target, ROOT / folder)}"

    return RELATIVE.sub(turned, path.read_text("utf-8").split("\n", 1)[1])


PAGES: Mapping[str, Callable[[], str]] = {
    "commands": commands,
    "scene-keys": scene_keys,
    "scenes-shipped": shipped,
    "models": models,
    "bodies": bodies,
    "materials": materials,
    "quantities": quantities,
    "drives": drives,
    "verification": verification,
    "changelog": lambda: _page("CHANGELOG.md", "docs"),
    "contributing": lambda: _page("CONTRIBUTING.md", "docs"),
    "benchmarks": lambda: _page("bench/README.md", "docs/reference"),
}


def read(app: "Sphinx", page: str, source: list[str]) -> None:
    """Put what is generated into the source of a page when Sphinx has read it."""
    source[0] = MARK.sub(lambda match: PAGES[match.group(1)](), source[0])


def outdated(app: "Sphinx", env: Any, *changes: set[str]) -> list[str]:
    """Pages that are read anew in every build, since the code may have changed."""
    pages = [page for page in env.found_docs if env.doc2path(page).suffix == ".md"]
    return [page for page in pages if MARK.search(env.doc2path(page).read_text("utf-8"))]


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the reader."""
    app.connect("source-read", read)
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True}
