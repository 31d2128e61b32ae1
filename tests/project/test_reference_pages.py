"""Pages of the reference from the code."""

import importlib.util
import re
import sys
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from skinwave import models
from skinwave.bodies import BODIES, KINDS
from skinwave.commands import COMMANDS, cli
from skinwave.scene.keys import DERIVED, SECTIONS
from skinwave.verify.suite import CASES

ROOT = Path(__file__).parents[2]
EXTENSION = ROOT / "docs" / "extension"
if not EXTENSION.exists():
    pytest.skip("the sources were unpacked without their documentation", allow_module_level=True)


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, EXTENSION / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


generated = loaded("generated")


def test_every_page_asks_for_what_there_is():
    asked = {
        name
        for path in (ROOT / "docs").rglob("*.md")
        for name in generated.MARK.findall(path.read_text("utf-8"))
    }
    assert asked == generated.PAGES.keys()


def test_blocks_of_a_page_are_followed_by_what_they_print_and_draw():
    page = """```python
import matplotlib.pyplot as plt
plt.figure(figsize=(3, 2), dpi=50)
print(6 * 7)
```

<!-- output: A picture -->

```toml
# scene.toml
[body]
kind = "none"
```

```sh
skinwave plan scene.toml \\
    --tolerance 0.02
```

<!-- output -->
"""
    text = loaded("outputs").with_outputs(page)
    assert "\n42\n" in text
    assert "point-kernel" in text
    (data,) = re.findall(r"!\[A picture\]\(data:image/png;base64,(.*)\)", text)
    assert Image.open(BytesIO(b64decode(data))).size == (150, 100)
    with pytest.raises(ValueError, match="needs an alternative text"):
        loaded("outputs").with_outputs(page.replace(": A picture", ""))


def test_commands_are_listed_with_every_option():
    text = generated.commands()
    assert re.findall(r"^## skinwave (\w+)$", text, re.MULTILINE) == [*COMMANDS]
    (commands,) = (a for a in cli.parser()._actions if a.dest == "command_name" or a.choices)
    for name, parser in commands.choices.items():
        part = text.split(f"## skinwave {name}\n")[1].split("\n## ")[0]
        for action in parser._actions:
            assert action.dest == "help" or (action.option_strings or [""])[-1] in part


def test_keys_of_scenes_are_listed_with_their_meaning():
    text = generated.scene_keys()
    for section, keys in SECTIONS.items():
        part = text.split(f"## `[{section}]`")[1].split("\n## ")[0]
        rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", part, re.MULTILINE))
        assert rows.keys() == keys.keys()
        assert [key for key in rows.keys() - DERIVED if not rows[key]] == []


def test_registries_are_listed():
    for text, names in (
        (generated.models(), models.names()),
        (generated.bodies(), (*KINDS, *BODIES)),
    ):
        assert [name for name in names if f"| `{name}` |" not in text] == []


def test_materials_have_their_speed():
    row = next(r for r in generated.materials().splitlines() if "| `forearm` |" in r)
    mu = 7.86e3 + 2j * np.pi * 200 * 5.03  # Zhang et al. (2011), Voigt's law
    speed = 1 / (1 / np.sqrt(mu / 1000)).real
    assert float(row.split("|")[-2]) == pytest.approx(speed, rel=5e-3)


def test_the_page_of_the_verification_has_all_cases_and_their_sources():
    page = generated.verification()
    assert f"has {len(CASES)} cases" in page
    assert all(f"`{name}`" in page for name in CASES)
