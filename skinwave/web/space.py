"""Where the foci go: one path for all with phases along it, or a path of its own for each."""

from functools import partial

from trame.widgets import html
from trame.widgets import vuetify3 as v3
from trame_client.widgets.core import HtmlElement

from skinwave.web.fields import choice, error, number, text
from skinwave.web.moves import follow
from skinwave.web.session import Session

SHAPES = {
    "point": "M12 12h.01",
    "line": "M3 12h18",
    "circle": "M12 4a8 8 0 1 0 .01 0z",
    "triangle": "M12 4L3 20H21z",
    "square": "M4 4h16v16H4z",
}
ROWS = "(typed.paths ?? paths).split(',').map(p => p.trim().split('/'))"
COLUMNS = {"Size": """:disabled="row[0] === 'point'" """, "x": "", "y": ""}
SHARED = (
    "As this model knows no device, the load is the same whether they are made at once or in turn."
)


def in_space(session: Session) -> None:
    """Paths, foci, and how they are shared out."""
    number(session, "foci")
    with v3.VBtnToggle(
        model_value=("paths ? 'own' : 'one'",), mandatory=True, density="compact", divided=True,
        update_modelValue=(partial(follow, session), "[$event]"), variant="outlined",
        id="follow", classes="sw-follow", raw_attrs=['aria-label="What the foci follow"'],
    ):  # fmt: skip
        v3.VBtn("one path", value="one", id="follow-one", size="small",
                raw_attrs=[':aria-pressed="String(!paths)"'])  # fmt: skip
        v3.VBtn("paths of their own", value="own", id="follow-own", size="small",
                raw_attrs=[':aria-pressed="String(!!paths)"'])  # fmt: skip
    with html.Div(v_if="!paths"):
        _one_path(session)
    with html.Div(v_if="paths"):
        _own_paths(session)
    choice("sharing", "Several foci are made", [
        {"title": "all at once, at 1/n of the pressure each", "value": "simultaneous"},
        {"title": "in turn, each for 1/n of the time", "value": "time_multiplexed"},
    ])  # fmt: skip
    html.Div("{{ foci }} foci. " + SHARED, v_if="foci > 1", classes="sw-note")


def _one_path(session: Session) -> None:
    _shapes()
    for key in ("size", "speed"):
        number(session, key)
    html.Div("drawing frequency: <b id='drawing'>{{ drawing_frequency.toFixed(2) }} Hz</b>",
             classes="sw-note")  # fmt: skip
    v3.VCheckbox(v_model=("hold", False), density="compact", hide_details=True, id="hold",
                 label="constant drawing frequency")  # fmt: skip
    error("hold")
    with html.Div(v_if="foci > 1"):
        text(session, "phases", "Phases in % of the path, such as 0, 25, 60; empty is even")


def _own_paths(session: Session) -> None:
    number(session, "drawn")
    options = "".join(f'<option value="{name}">{name}</option>' for name in SHAPES)
    cells = "".join(
        # What is being typed stays when the update after the field before arrives.
        f'<td><input inputmode="decimal" :id="`own-{part}-${{k}}`" '
        f':value="draft[`{part}-${{k}}`] ?? row[{part}]" '
        f'@input="draft = {{ [`{part}-${{k}}`]: $event.target.value }}" '
        f'@change="{_set(part)}; draft = {{}}" '
        f':aria-label="`{name} of path ${{k + 1}}, mm`" {more}/></td>'
        for part, (name, more) in enumerate(COLUMNS.items(), 1)
    )
    HtmlElement("table", classes="sw-own", id="own", children=[
        '<tr><th scope="col"></th><th scope="col">path</th><th scope="col">size, mm</th>'
        '<th scope="col">x, mm</th><th scope="col">y, mm</th></tr>'
        f'<tr v-for="(row, k) in {ROWS}" :key="k"><th scope="row">{{{{ k + 1 }}}}</th>'
        f'<td><select :id="`own-0-${{k}}`" :value="row[0]" @change="{_set(0)}" '
        f':aria-label="`Shape of path ${{k + 1}}`">{options}</select></td>{cells}</tr>'
    ])  # fmt: skip
    error("paths")
    html.Div(
        "All are drawn <b>{{ drawing_frequency.toFixed(2) }} times a second</b>, each at its own "
        "speed: {{ own_speeds }}.", classes="sw-note", id="own-speeds",
    )  # fmt: skip


def _set(part: int) -> str:
    return f"trigger('own_path', [k, {part}, $event.target.value])"


def _shapes() -> None:
    with v3.VBtnToggle(v_model=("shape",), mandatory=True, density="compact", classes="sw-shapes",
                       raw_attrs=['aria-label="Shape of the path"'], divided=True,
                       variant="outlined", id="shape"):  # fmt: skip
        for name, path in SHAPES.items():
            v3.VBtn(
                f'<svg viewBox="0 0 24 24" aria-hidden="true"><path d="{path}" '
                'stroke-linecap="round"/></svg>',
                value=name, title=name, id=f"shape-{name}",
                raw_attrs=[f'aria-label="{name}"',
                           f""":aria-pressed="String(shape === '{name}')" """],
            )  # fmt: skip
