"""Reference pages from the code: generated Markdown replaces `<!-- generated: name -->` in a page.

It lists options of parsers, keys, registries and docstrings of the program.
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
HERTZ = 200.0  # of losses and speeds in the table of materials
PARAMETER = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n    .*)*)", re.MULTILINE)


def table(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a Markdown table."""
    head = list(head)
    lines = [head, ["---"] * len(head), *([_cell(each) for each in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _cell(value: Any) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")


def descriptions_of(record: type) -> dict[str, str]:
    """Return the description of each field in the docstring of a record, with the values of the
    constants that it names.
    """
    from simple_model import SHAPES
    from simple_model.load.trajectory import BY_POINTS
    from skinwave.scene.load import LOADS

    descriptions = {}
    constants = {"SHAPES": SHAPES, "BY_POINTS": BY_POINTS, "LOADS": LOADS}
    for names, text in PARAMETER.findall(inspect.getdoc(record) or ""):
        description = " ".join(text.split())
        for name, values in constants.items():
            description = description.replace(f"`{name}`", _code_list(values))
        descriptions |= dict.fromkeys(names.split(", "), description)
    return descriptions


def _code_list(values: Iterable[str]) -> str:
    return ", ".join(f"`{value}`" for value in values)


# The command line


def commands() -> str:
    """Return all commands with their options, from their parsers."""
    from skinwave.commands import cli

    actions = cli.parser()._actions
    (commands,) = (each for each in actions if isinstance(each, argparse._SubParsersAction))
    helps = {each.dest: each.help or "" for each in commands._choices_actions}
    overview = table(
        ["command", ""], [[f"[`{n}`](#skinwave-{n})", helps[n]] for n in commands.choices]
    )
    parts = [_command(name, helps[name], parser) for name, parser in commands.choices.items()]
    return "\n".join([overview, *parts])


def _command(name: str, text: str, parser: argparse.ArgumentParser) -> str:
    usage = parser.format_usage().removeprefix("usage: ").strip()
    rows = [_option(parser, each) for each in parser._actions if each.dest != "help"]
    options = table(["", "", "default"], rows) if rows else ""
    return (
        f"(skinwave-{name})=\n\n## skinwave {name}\n\n{text}.\n\n```text\n{usage}\n```\n\n{options}"
    )


def _option(parser: argparse.ArgumentParser, action: argparse.Action) -> list[str]:
    formatter = parser._get_formatter()
    invocation = formatter._format_action_invocation(action)
    text = formatter._expand_help(action) if action.help else ""
    default = action.default
    is_obvious = default in (None, False, argparse.SUPPRESS) or default == []
    return [f"`{invocation}`", text, "" if is_obvious else f"`{default}`"]


# Scene files


def scene_keys() -> str:
    """Return all keys of scene files with their meanings and defaults."""
    from simple_model import Material, MovingPressure, PronyTerm, Rhythm, Signal, Tacton, Trajectory
    from simple_model.load.spot_map import SpotMap
    from skinwave import Body, Load, Scene
    from skinwave.bodies import Layer, Mounting, Phalanx, Placement, Relief
    from skinwave.scene import keys as scene_keys
    from skinwave.scene.load import SupportMotion

    sections = scene_keys.SECTIONS
    records: dict[str, list[type]] = {
        "tacton": [Tacton, Trajectory], "focus": [MovingPressure, SpotMap], "body": [Body],
        "load": [Load], "placement": [Placement], "probes": [Scene],
    }  # fmt: skip
    inner = {
        "tacton.rhythm": Rhythm, "tacton.signal": Signal, "body.material": Material,
        "body.material.prony": PronyTerm, "body.layers": Layer, "body.relief": Relief,
        "body.bone": Phalanx, "body.mounting": Mounting, "load.support_motion": SupportMotion,
    }  # fmt: skip
    parts = [_section(name, sections[name], classes) for name, classes in records.items()]
    parts += [_section(name, scene_keys.TABLES[name], [own]) for name, own in inner.items()]
    if missing := sections.keys() - records.keys():
        raise ValueError(f"The section {', '.join(missing)} has no record. Add it to `records`.")
    return "\n".join(parts)


def _section(name: str, keys: Mapping[str, Any], records: list[type]) -> str:
    texts: dict[str, str] = {}
    for record in records:
        texts |= descriptions_of(record)
    rows = [[f"`{k}`", texts.get(key.name, ""), _default(key, records)] for k, key in keys.items()]
    lists = name in ("body.layers", "body.material.prony")
    heading = f"[[{name}]]" if lists else f"[{name}]"
    return f"## `{heading}`\n\n{table(['key', '', 'default'], rows)}"


def _default(key: Any, records: list[type]) -> str:
    """Return the default of a key as in a scene file, "" if it has none."""
    from dataclasses import MISSING, fields

    for field in (each for record in records for each in fields(record)):
        if field.name != key.name or field.default in (MISSING, None):
            continue
        try:
            return f"`{json.dumps(key.write(field.default))}`"
        except (TypeError, ValueError, AttributeError):  # a record with its own section
            return ""
    return ""


def shipped_scenes() -> str:
    """Return the scene files of examples/."""
    files = sorted((ROOT / "examples").glob("*.toml"))
    return "\n".join(f"## {f.name}\n\n```toml\n{f.read_text('utf-8')}```\n" for f in files)


# Registries


def models() -> str:
    """Return the registered models, what each computes, and for which bodies."""
    from skinwave import models
    from skinwave.bodies import BODIES

    bodies = {name: BODIES[name] for name in ("skin-slab", "palm-layers", "palm", "paper-sheet")}
    rows = []
    for model in map(models.named, models.names()):
        marks = [_takes(model, body) for body in bodies.values()]
        rows.append([f"`{model.name}`", model.words, *marks])
    sources = [
        f"**{model.name}** uses: {'; '.join(model.sources)}.\n"
        for model in map(models.named, models.names())
        if model.sources
    ]
    return table(["model", "computes", *bodies], rows) + "\n" + "\n".join(sources)


def _takes(model: Any, body: Any) -> str:
    from skinwave.live.packs import resting_scene
    from skinwave.models.limits import takes

    return "yes" if takes(model, resting_scene(body)) else ""


def bodies() -> str:
    """Return the kinds of body with their own keys, and the bodies by name."""
    from skinwave.bodies import BODIES, KINDS

    kinds = [
        [
            f"`{kind.name}`",
            "yes" if kind.may_be_layered and kind.discretise else "",
            "yes" if kind.compliance else "",
            "yes" if kind.dispersion else "",
            _code_list(kind.keys),
        ]
        for kind in KINDS.values()
    ]
    named = [
        [f"`{name}`", body.of_kind.words(body), _materials_of(body)]
        for name, body in BODIES.items()
    ]
    head = ["kind", "layers", "wavenumber integral", "dispersion", "own keys"]
    return f"{table(head, kinds)}\n## By name\n\n{table(['name', 'is', 'material'], named)}"


def _materials_of(body: Any) -> str:
    name = body.material if isinstance(body.material, str) else "a table"
    layers = [layer.material for layer in body.layers if isinstance(layer.material, str)]
    return ", ".join([*layers, name])


def materials() -> str:
    """Return the material presets: moduli at rest, loss and wave speed at `HERTZ`."""
    import numpy as np

    from simple_model.layers.material import PRESETS

    w, rows = 2 * np.pi * HERTZ, []
    for name, solid in PRESETS.items():
        modulus = complex(solid.complex_modulus(w))
        speed = 1 / (1 / np.sqrt(modulus / solid.density)).real
        rows.append(
            [
                f"`{name}`", f"{solid.density:g}", _number(solid.shear_modulus / 1e3),
                f"{solid.poisson:.4g}", _number(modulus.real / 1e3),
                f"{modulus.imag / modulus.real:.2g}", _number(speed),
            ]
        )  # fmt: skip
    at = f"at {HERTZ:g} Hz"
    head = ["name", "density, kg/m³", "shear modulus at rest, kPa", "Poisson's ratio"]
    return table(
        [*head, f"storage modulus {at}, kPa", f"loss factor {at}", f"shear speed {at}, m/s"], rows
    )


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def quantities() -> str:
    """Return the quantities of probes."""
    from simple_model.quantities import QUANTITIES

    rows = [[f"`{q.name}`", q.words, q.unit, q.shown] for q in QUANTITIES.values() if q.of_body]
    return table(["quantity", "", "SI unit", "on axes"], rows)


def drives() -> str:
    """Return the drive laws with their notes."""
    from simple_model import DRIVES

    rows = [[f"`{law.name}`", law.words, law.note] for law in DRIVES.values()]
    return table(["drive law", "", "lines of AM"], rows)


def claims() -> str:
    """Return the claims of the paper about spectral lines."""
    from skinwave.results.claims import CLAIMS

    return table(["claim", ""], ((claim.name, claim.text) for claim in CLAIMS.values()))


# Verification


def verification() -> str:
    """Return the cases of the verification suite with their references and meshes."""
    from skinwave.verify.suite import CASES, TOPICS

    parts = [f"`skinwave verify` has {len(CASES)} cases."]
    for topic, cases in TOPICS.items():
        rows = [[f"`{c.name}`", _plain(c.title), _plain(c.source), _plain(c.mesh)] for c in cases]
        parts.append(f"## {topic}\n\n{table(['case', '', 'reference', 'mesh'], rows)}")
    return "\n".join(parts)


def _plain(text: str) -> str:
    return re.sub(r"([*_<^])", r"\\\1", text)


# Pages from outside docs/


SITE = {  # path in the repository -> page of the site
    "bench": "reference/benchmarks",
    "bench/README.md": "reference/benchmarks",
    "examples": "reference/scenes-shipped",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "README.md": "index",
    "examples/gallery": "gallery/index",
}
GALLERY = Path("examples/gallery")  # whose scripts are pages
LINK = re.compile(r"\[([^\]\[]*)\]\(([^)#\s]+)((?:#[^)]*)?)\)")


def with_site_links(text: str, source: Path, page: Path) -> str:
    """Return a text of the folder `source` for a page of the folder `page`, with links to pages."""

    def one(match: re.Match[str]) -> str:
        """Return a link to a page of the site, or its text if the target is a folder."""
        label, target, anchor = match.groups()
        place = (source / target).resolve()
        if "://" in target or not place.is_relative_to(ROOT):
            return match.group()
        own = place.relative_to(ROOT)
        name = SITE.get(str(own), f"gallery/{own.stem}" if own.parent == GALLERY else "")
        if not name and place.is_dir():
            return label
        to = ROOT / "docs" / name if name else place
        return f"[{label}]({os.path.relpath(to, page)}{anchor})"

    return LINK.sub(one, text)


def _page(name: str, folder: str) -> str:
    """Return a Markdown page of the repository without its title, with links from a folder."""
    path = ROOT / name
    return with_site_links(path.read_text("utf-8").split("\n", 1)[1], path.parent, ROOT / folder)


PAGES: Mapping[str, Callable[[], str]] = {
    "commands": commands,
    "scene-keys": scene_keys,
    "scenes-shipped": shipped_scenes,
    "models": models,
    "bodies": bodies,
    "materials": materials,
    "quantities": quantities,
    "drives": drives,
    "claims": claims,
    "verification": verification,
    "changelog": lambda: _page("CHANGELOG.md", "docs"),
    "contributing": lambda: _page("CONTRIBUTING.md", "docs"),
    "benchmarks": lambda: _page("bench/README.md", "docs/reference"),
}


def read(app: "Sphinx", page: str, source: list[str]) -> None:
    """Insert generated text into the source of a page, and correct links of Markdown pages."""
    source[0] = MARK.sub(lambda match: PAGES[match.group(1)](), source[0])
    if app.env.doc2path(page).suffix == ".md":
        folder = (ROOT / "docs" / page).parent
        source[0] = with_site_links(source[0], folder, folder)


def pages_to_read(app: "Sphinx", env: Any, *changes: set[str]) -> list[str]:
    """Return the pages with generated text, which every build reads again."""
    pages = [page for page in env.found_docs if env.doc2path(page).suffix == ".md"]
    return [page for page in pages if MARK.search(env.doc2path(page).read_text("utf-8"))]


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the reader."""
    app.connect("source-read", read)
    app.connect("env-get-outdated", pages_to_read)
    return {"parallel_read_safe": True}
