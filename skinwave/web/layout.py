"""The page: control panel on the left, visualization panel beside it (trame, Vuetify)."""

from functools import partial
from pathlib import Path
from typing import Any

from trame.ui.vuetify3 import VAppLayout
from trame.widgets import client, html
from trame.widgets import vuetify3 as v3

from skinwave.web import controls, drawings, moves, panels
from skinwave.web.plots import SPANS
from skinwave.web.session import Session
from skinwave.web.shown import HIGHEST

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
PLOTS = {
    "commanded_plot": "The commanded signal over time",
    "waveform_plot": "Waveform at the selected point",
    "spectrum_plot": "Spectrum at the selected point, with its lines and the detection threshold",
}
SAVED = {  # name of the file, what makes it, its kind, what it is called
    "scene.toml": ("scene_toml", "", "application/toml", "Scene (TOML)"),
    "waveform.csv": ("waveform_csv", "", "text/csv", "Waveform (CSV)"),
    "waveform.wav": ("waveform_wav", "", "audio/wav", "Waveform (WAV)"),
    "figure.svg": ("figure", ", ['svg']", "image/svg+xml", "Figure (SVG)"),
    "figure.png": ("figure", ", ['png']", "image/png", "Figure (PNG)"),
    "report.html": ("report", "", "text/html", "Report (HTML)"),
}


def lay_out(session: Session) -> None:
    """Make the page of a session."""
    server = session.server
    server.enable_module(MODULE)
    session.state.trame__title = "skinwave"
    session.state.trame__template_error = LOST
    with VAppLayout(server, theme=("dark ? 'dark' : 'light'",)):
        client.ClientTriggers(
            mounted="dark = utils.skinwave.prefersDark();"
            f"utils.skinwave.begin(trame.state, {list(PLOTS)})"
        )
        _bar(session)
        with v3.VNavigationDrawer(
            v_model=("drawer", None), width=320, mobile_breakpoint=960,
            raw_attrs=['aria-label="Control panel"'],
        ):  # fmt: skip
            panels.control_panel(session)
        panels.about()
        with v3.VMain(), html.Div(classes="sw-page", id="ready"):
            with html.Div(classes="sw-above"):
                panels.summary()
                panels.warnings()
                panels.differences()
            _maps(session)
            _plots()


def _bar(session: Session) -> None:
    with v3.VAppBar(density="compact", flat=True, border=True, height=48):
        _button("mdi-menu", "Control panel", "drawer = !drawer", 'aria-expanded="String(!!drawer)"')
        with v3.VAppBarTitle(style="flex: 0 0 auto; min-width: 90px"):
            html.H1("skinwave", classes="sw-title")
        with v3.VMenu():
            with v3.Template(v_slot_activator="{ props }"):
                v3.VBtn("Presets", v_bind="props", append_icon="mdi-menu-down", id="presets")
            with v3.VList(density="compact", max_height=420):
                for name in controls.presets():
                    v3.VListItem(title=name, id=f"preset-{name}",
                                 click=(partial(moves.preset, session), f"['{name}']"))  # fmt: skip
        v3.VSpacer()
        _looks()
        _button(
            "mdi-undo", "Undo", partial(moves.undo, session), id="undo", disabled=("!undoable",)
        )
        _button(
            "mdi-redo", "Redo", partial(moves.redo, session), id="redo", disabled=("!redoable",)
        )
        v3.VBtn("Pin", prepend_icon="mdi-pin",
                click=partial(moves.pin, session),
                id="pin", raw_attrs=[':aria-pressed="String(pinned)"'],
                title="Keep what is shown as A, to compare with B, what is shown then")  # fmt: skip
        v3.VBtn("A/B", click=partial(moves.exchange, session), disabled=("!pinned",), id="swap",
                title="Exchange A, which is pinned, and B, which is shown")  # fmt: skip
        _save_menu()
        _button("mdi-theme-light-dark", "Dark", "dark = !dark", 'aria-pressed="String(dark)"',
                id="theme")  # fmt: skip
        _button("mdi-information-outline", "About this model", "about = !about",
                'aria-expanded="String(about)"', id="about")  # fmt: skip


def _save_menu() -> None:
    with v3.VMenu():
        with v3.Template(v_slot_activator="{ props }"):
            v3.VBtn("Save", v_bind="props", append_icon="mdi-menu-down", id="save")
        with v3.VList(density="compact"):
            for file, (made_by, given, kind, said) in SAVED.items():
                v3.VListItem(
                    title=said, id=f"save-{file.replace('.', '-')}",
                    click=f"utils.download('{file}', trigger('{made_by}'{given}), '{kind}')",
                )  # fmt: skip


def _button(icon: str, said: str, click: Any, state: str = "", **more: Any) -> None:
    """A button with an icon; `state` is the attribute that says whether it is pressed, if it is
    one that stays so.
    """
    told = [f":{state}"] if state else []
    v3.VBtn(icon=icon, click=click, title=said, density="comfortable",
            raw_attrs=[f'aria-label="{said}"', *told], **more)  # fmt: skip


def _maps(session: Session) -> None:
    with html.Div(classes="sw-maps"):
        with html.Div():
            html.Div("<b>Kernel, same load</b>: RMS pressure, Pa", classes="sw-caption")
            panels.area("kernel_map", "kernel-map", "kernel, same load")
            panels.colour_bar("kernel_map.ends", drawings.SEQUENTIAL)
        with html.Div(v_if="body != 'none'", classes=("{ 'sw-stale': waves_stale }",)):
            with html.Div(classes="sw-caption sw-which"):
                html.Span(
                    "<b>Waves</b>: {{ waves_stale ? 'being computed' : solid ? "
                    "'displacement, µm' : 'RMS displacement, µm' }}"
                )
                html.Button(
                    "3-D", click="solid = !solid", id="solid",
                    title="The body in three dimensions, moving, instead of its map",
                    raw_attrs=[':aria-pressed="String(solid)"'],
                )  # fmt: skip
            panels.area("wave_map", "wave-map", "waves in the body", "!solid")
            with html.Div(classes="sw-over", raw_attrs=['role="status"', 'aria-live="polite"']):
                panels.computing(session)
            with html.Div(v_if="!solid"):
                panels.colour_bar("wave_map.ends", drawings.SEQUENTIAL)
            panels.body()
        with html.Div(style="grid-column: 1 / -1"):
            html.Div(
                "<span><b aria-hidden='true' style='color:#56B4E9'>━</b> path, foci</span> "
                "<span><b aria-hidden='true'>┄</b> border of the influence</span> "
                "<span><b aria-hidden='true' style='color:#CC4FA0'>━</b> detection threshold"
                "</span> "
                "<span><b aria-hidden='true' style='color:#D55E00'>✕</b> selected</span>",
                classes="sw-caption sw-legend",
            )
            v3.VSlider(
                v_model=("phase", 0), min=0, max=99, step=1, hide_details=True, density="compact",
                raw_attrs=['aria-label="Where the foci are in a drawing period, per cent"'],
                label="foci at", id="phase",
            )  # fmt: skip
            panels.line_table()


def _plots() -> None:
    with html.Div(classes=("['sw-plots', `sw-of-${body}`]",)):
        for name, said in PLOTS.items():
            with html.Div():
                html.Canvas(id=name, raw_attrs=[
                    'tabindex="0"', 'role="img"',
                    f'aria-label="{said}; plus and minus zoom, arrow keys move, Home shows all"',
                ])  # fmt: skip
        with html.Div(style="position: fixed; right: 10px; top: 54px; width: 340px; z-index: 5",
                      raw_attrs=['role="status"', 'aria-live="polite"']):  # fmt: skip
            panels.notices()


def _looks() -> None:
    """Selectors of the part of the response that is shown."""
    v3.VSelect(v_model=("span",), items=("spans", list(SPANS)), density="compact", id="span",
               hide_details=True, variant="plain", style="flex: 0 0 120px",
               raw_attrs=['aria-label="Part of the Tacton that is shown"'])  # fmt: skip
    v3.VSelect(v_model=("highest",), items=("highests", list(HIGHEST)), density="compact",
               hide_details=True, variant="plain", style="flex: 0 0 96px", suffix="Hz",
               raw_attrs=['aria-label="Highest frequency shown"'], id="highest")  # fmt: skip
