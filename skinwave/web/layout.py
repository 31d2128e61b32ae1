"""The page: control panel on the left, visualization panel beside it (trame, Vuetify).

Its text is the template `interactive.html`.
"""

from pathlib import Path
from typing import Any

import jinja2
from trame_vuetify.module import v3

from simple_model.drive import DRIVES
from simple_model.quantities import QUANTITIES
from skinwave.web import controls, drawings
from skinwave.web.examples import EXAMPLES
from skinwave.web.help import BAR, HELP
from skinwave.web.plots import SPANS
from skinwave.web.session import Session
from skinwave.web.shown import HIGHEST, THIRD

STATIC = Path(__file__).with_name("static")
MODULE = {
    "serve": {"__skinwave": str(STATIC)},
    "scripts": [f"__skinwave/{name}.js" for name in ("plots", "body", "rhythm", "skinwave")],
    "styles": ["__skinwave/skinwave.css"],
}
LOST = """
<div id="sw-lost" role="alert" style="font: 1rem sans-serif; padding: 3rem; text-align: center">
  <p>The connection to skinwave is lost. This page reloads by itself, with the parameters in its
  address, as soon as the program is running again.</p><p id="sw-lost-why"></p>
  <p><a href="">Try now</a></p>
</div>
"""
ITEMS: dict[str, list[Any]] = {  # of dropdowns
    "spans": list(SPANS),
    "highests": list(HIGHEST),
    "thirds": list(THIRD),
    "ratio_items": list(controls.RATIOS),
    "drive_items": [
        {"title": f"{name.replace('_', ' ')}: {law.words}", "value": name}
        for name, law in DRIVES.items()
    ],
    "profile_items": [
        {"title": "Gaussian, of the half width and force of the array's", "value": "gaussian"},
        {"title": "main lobe (sinc²), as published", "value": "main_lobe"},
    ],
    "quantity_items": [
        {"title": f"{QUANTITIES[name].words}, {QUANTITIES[name].shown}", "value": name}
        for name in controls.CHOICES["quantity"]
    ],
    "sharing_items": [
        {"title": "all at once, at 1/n of the pressure each", "value": "simultaneous"},
        {"title": "in turn, each for 1/n of the time", "value": "time_multiplexed"},
    ],
}
# Braces are Vue's, which computes them in the browser.
PAGE = jinja2.Environment(
    loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True, lstrip_blocks=True,
    undefined=jinja2.StrictUndefined, block_start_string="<%", block_end_string="%>",
    variable_start_string="<%=", variable_end_string="%>", comment_start_string="<%#",
    comment_end_string="#%>",
).get_template("interactive.html")  # fmt: skip


def rendered() -> str:
    """Text of the page, a template of Vue."""
    return PAGE.render(
        numbers=controls.NUMBERS, presets=controls.presets(),
        sequential=drawings.SEQUENTIAL, signed=drawings.SIGNED, diverging=drawings.DIVERGING,
        helps=HELP, bar=BAR, examples=EXAMPLES,
    )  # fmt: skip


def lay_out(session: Session) -> None:
    """Make the page of a session."""
    for module in (MODULE, v3):
        session.server.enable_module(module)
    session.state.update({
        **ITEMS, "trame__title": "skinwave", "trame__template_error": LOST,
        "trame__template_main": rendered(),
    })  # fmt: skip
