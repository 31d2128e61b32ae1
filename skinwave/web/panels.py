"""Parts of the page: controls, an area with its map, notices, what the model leaves out."""

from collections.abc import Sequence
from typing import Any

from trame.widgets import html
from trame.widgets import vuetify3 as v3
from trame_client.widgets.core import HtmlElement

from skinwave.web.controls import CHOICES, NUMBERS
from skinwave.web.session import Session, setter

SHAPES = {
    "point": "M12 12h.01",
    "line": "M3 12h18",
    "circle": "M12 4a8 8 0 1 0 .01 0z",
    "triangle": "M12 4L3 20H21z",
    "square": "M4 4h16v16H4z",
}
DRIVES = {
    "linear": "linear: the signal itself, as published",
    "pressure_squared": "pressure squared: usual AM",
    "force_corrected": "force corrected: square root first",
}
LEFT_OUT = (
    "<b>Point kernel</b> (Lim, Seifi, Park, CHI EA '24): a skin point feels the pressure of the "
    "focus where it is, weighted by distance. Nothing propagates, no body gives way.",
    "<b>Skin slab</b>: exact waves of an endless flat layer of soft tissue of 15 mm on bone; no "
    "sides. <b>Paper sheet, palm</b>: finite elements, coarser than those of <i>skinwave "
    "compare</i>: some per cent of the motion. Another shape, size or height of the focus reduces "
    "the body anew, which takes some seconds; other controls do not.",
    "<b>3-D</b>: the steady state about its mean, exaggerated as is said below it. A slab is shown "
    "as far as the area goes; its sides are drawn straight down to the bone.",
    "Motion is linear and begins from rest; a real sheet of paper stiffens as it sags. The "
    "pressure, 50 Pa at full drive, is uncertain by a factor of 2. Air is left out.",
    "With a body the focus is a Gaussian of the same width as the main lobe that the point kernel "
    "alone has. Side lobes, and what several simultaneous foci do to each other, are left out: "
    "simultaneous and time-multiplexed foci push alike here, devices differ.",
    "Thresholds of what is felt differ by 5 dB between people. Waves: the strongest line, in dB "
    "above the threshold for a focal spot; point kernel: 4.4 Pa, just felt with AM at 200 Hz. "
    "Maps of a rhythm are those of its pulses while they are on.",
    "Weights of the superposition multiply the two "
    "AM sinusoids; a frequency of 0 is a factor of 1.",
)


def control_panel(session: Session) -> None:
    """All that can be turned."""
    with html.Div(classes="sw-controls", id="controls"):
        _heading("In time")
        for key in ("amplitude", "am"):
            number(session, key)
        choice("ratio", "Superposition ratio, first to second AM")
        for key in ("am2", "envelope", "duration"):
            number(session, key)
        _rhythm(session)
        _heading("In space")
        _shapes()
        for key in ("size", "speed"):
            number(session, key)
        html.Div("drawing frequency: <b id='drawing'>{{ drawing_frequency.toFixed(2) }} Hz</b>",
                 classes="sw-note")  # fmt: skip
        v3.VCheckbox(v_model=("hold", False), density="compact", hide_details=True, id="hold",
                     label="hold it while size or speed moves")  # fmt: skip
        _error("hold")
        number(session, "foci")
        choice("sharing", "Several foci are made", [
            {"title": "all at once, at 1/n of the pressure each", "value": "simultaneous"},
            {"title": "in turn, each for 1/n of the time", "value": "time_multiplexed"},
        ])  # fmt: skip
        with html.Div(v_if="foci > 1"):
            text(session, "phases", "Phases in % of the path, such as 0, 25, 60; empty is even")
            html.Div(
                "All {{ foci }} foci follow one path. As this model knows no device, the load is "
                "the same whether they are made at once or in turn.", classes="sw-note",
            )  # fmt: skip
        _heading("On the skin")
        number(session, "height")
        choice("drive", "Drive law", [{"title": DRIVES[d], "value": d} for d in CHOICES["drive"]])
        v3.VSelect(v_model=("body",), items=("bodies",), label="Body", density="compact",
                   hide_details=True, id="body", style="margin-top: 8px")  # fmt: skip
        for key in ("x", "y"):
            number(session, key)
        _heading("Scene file")
        v3.VFileInput(v_model=("opened", None), label="Open a scene (TOML)", accept=".toml",
                      density="compact", hide_details=True, id="open")  # fmt: skip


def number(session: Session, key: str) -> None:
    """A slider and a field for a number."""
    given = NUMBERS[key]
    said = f"{given.label}, {given.unit}" if given.unit else given.label
    # Of a move only its own row is made anew: all of them take longer than the plots.
    with html.Div(classes="sw-row", raw_attrs=[f'v-memo="[{key}, errors.{key}, typed.{key}]"']):
        html.Label(said, raw_attrs=[f'for="{key}-field"'])
        v3.VSlider(
            v_model_number=(key,), min=given.low, max=given.high, step=given.step, id=f"{key}",
            hide_details=True, density="compact", thumb_size=16,
            raw_attrs=[f'aria-label="{said}"'],
        )  # fmt: skip
        v3.VTextField(
            model_value=(f"typed.{key} ?? {key}",),
            update_modelValue=(setter(session, key), "[$event]"),
            error=(f"!!errors.{key}",), density="compact", hide_details=True, id=f"{key}-field",
            variant="outlined",
            raw_attrs=[f':aria-invalid="!!errors.{key}"', f'aria-describedby="{key}-error"'],
        )  # fmt: skip
        _error(key)


def text(session: Session, key: str, said: str) -> None:
    """A field for several numbers."""
    with html.Div(classes="sw-row", raw_attrs=[f'v-memo="[{key}, errors.{key}, typed.{key}]"']):
        html.Label(said, raw_attrs=[f'for="{key}-field"'])
        v3.VTextField(
            model_value=(f"typed.{key} ?? {key}",),
            update_modelValue=(setter(session, key), "[$event]"),
            error=(f"!!errors.{key}",), density="compact", hide_details=True, variant="outlined",
            id=f"{key}-field", style="grid-column: 1 / 3",
            raw_attrs=[f':aria-invalid="!!errors.{key}"', f'aria-describedby="{key}-error"'],
        )  # fmt: skip
        _error(key)


def choice(key: str, said: str, items: Sequence[Any] = ()) -> None:
    """A dropdown."""
    v3.VSelect(
        v_model=(key,), items=(f"{key}_items", list(items or CHOICES[key])), label=said,
        density="compact", hide_details=True, id=key, style="margin-top: 8px",
        raw_attrs=[f'v-memo="[{key}]"'],
    )  # fmt: skip


def area(name: str, marked: str, said: str, shown: str = "true") -> None:
    """A map of the area with path, foci, borderlines and the selected point, which it selects."""
    steps = {"left": "x - 1, y", "right": "x + 1, y", "up": "x, y + 1", "down": "x, y - 1"}
    keys = [f"@keydown.{key}.prevent=\"trigger('select', [{at}])\"" for key, at in steps.items()]
    drag = "trigger('select', utils.skinwave.place($event))"
    HtmlElement(
        "svg", v_if=shown, classes="sw-map", id=marked, children=[
            f'<image v-if="{name}.picture" :href="{name}.picture" x="-51.25" y="-51.25" '
            'width="102.5" height="102.5" preserveAspectRatio="none"/>'
            '<path :d="influenced" fill="none" stroke="black" stroke-width="1.1"/>'
            '<path :d="influenced" fill="none" stroke="white" stroke-width="0.9" '
            'stroke-dasharray="0.1 1.8" stroke-linecap="round"/>'
            f'<path :d="{name}.felt" fill="none" stroke="#ff6fd0" stroke-width="0.7"/>'
            '<path :d="path" fill="none" stroke="#56B4E9" stroke-width="0.9"/>'
            '<circle v-for="(at, k) in foci_at" :key="k" :cx="at[0]" :cy="at[1]" r="1.8" '
            'fill="none" stroke="#56B4E9" stroke-width="1"/>'
            '<path :d="`M${x - 2},${-y - 2}l4,4m0,-4l-4,4`" stroke="white" stroke-width="1.6"/>'
            '<path :d="`M${x - 2},${-y - 2}l4,4m0,-4l-4,4`" stroke="#D55E00" stroke-width="0.9"/>'
            '<rect x="-50" y="-50" width="100" height="100" fill="none" stroke="currentColor" '
            'stroke-width="0.4"/>'
            '<text v-for="t in [-40, -20, 0, 20, 40]" :key="t" :x="t" y="54.2" '
            'text-anchor="middle">{{ t }}</text>'
            '<text v-for="t in [-40, -20, 0, 20, 40]" :key="t" x="-51" :y="1.2 - t" '
            'text-anchor="end">{{ t }}</text><text x="50" y="58" text-anchor="end">mm</text>'
        ],
        raw_attrs=[
            'viewBox="-60 -51 111 110"', 'tabindex="0"', 'role="application"',
            f':aria-label="`Area of the skin, {said}; selected point ${{x}}, ${{y}} mm; '
            'arrow keys move it`"',
            f'@pointerdown="{drag}"', f'@pointermove="$event.buttons && {drag}"', *keys,
        ],
    )  # fmt: skip


def body() -> None:
    """The body in three dimensions through one period, which can be turned, stopped and drawn."""
    with html.Div(v_if="solid", classes="sw-body",
                  raw_attrs=['@vue:mounted="utils.body.begin(trame.state)"']):  # fmt: skip
        html.Canvas(id="body-view", raw_attrs=[
            'tabindex="0"', 'role="application"', 'aria-label="The body, moving; arrow keys turn '
            'it, plus and minus bring it nearer, the space bar plays and pauses"',
        ])  # fmt: skip
        with html.Div(classes="sw-time"):
            html.Button("▶", id="body-play")
            HtmlElement("input", id="body-time", raw_attrs=[
                'type="range"', 'min="0"', 'max="1000"', 'value="0"',
                'aria-label="Where in the period"',
            ])  # fmt: skip
            html.Span(id="body-now")
        html.Div(
            "motion drawn {{ body_motion.times }} times, about its mean; "
            "{{ body_motion.repeats ? 'one period' : 'a period of the slowest tone, "
            "after which it jumps' }}",
            v_if="body_motion.times", classes="sw-caption",
        )  # fmt: skip


def line_table() -> None:
    """The lines at the point."""
    with html.Table(classes="sw-table", id="lines"):
        html.Tr(
            "<th scope='col'>line</th><th scope='col'>Hz</th><th scope='col'>Pa</th>"
            "<th scope='col'>µm</th>"
            "<th scope='col' title='above the threshold of detection'>felt, dB</th>"
        )
        html.Tr(
            '<td v-html="row.name"></td><td>{{ row.frequency }}</td><td>{{ row.pressure }}</td>'
            "<td>{{ row.displacement }}</td><td>{{ row.level }}</td>",
            v_for="row in rows", key="row.name",
        )  # fmt: skip
    html.P("{{ untold }}", v_if="untold", id="untold", style="font-size: 0.86rem")


def notices(session: Session) -> None:
    """What cannot be, and what is being computed."""
    v3.VAlert("{{ problem }}", v_if="problem", type="error", density="compact", id="problem")
    with v3.VAlert(v_if="busy", type="info", density="compact", id="busy"):
        html.Div("{{ body }}: {{ busy }}")
        v3.VProgressLinear(model_value=("done",), indeterminate=("!done",), height=6)
        v3.VBtn("Cancel", click=session.cancel, size="small", variant="text", id="cancel")


def about() -> None:
    """What the models are, and what they leave out."""
    with v3.VNavigationDrawer(
        v_model=("about", False), location="right", temporary=True, width=380,
        raw_attrs=['aria-label="About this model"'],
    ), html.Div(style="padding: 16px"):  # fmt: skip
        v3.VBtn("Close", click="about = false", size="small", id="close-about",
                style="float: right")  # fmt: skip
        html.H2("About this model", style="font-size: 1.1rem")
        for sentence in LEFT_OUT:
            html.P(sentence, style="margin-top: 10px; font-size: 0.86rem")


def _rhythm(session: Session) -> None:
    text(session, "pulses", "Rhythm: on/off in ms, such as 100/50, 40/110; empty is none")
    HtmlElement(
        "svg", v_if="pulses", classes="sw-timeline", children=[
            '<polyline :points="timeline" fill="none" stroke="currentColor" stroke-width="1.5" '
            'vector-effect="non-scaling-stroke"/>'
        ],
        raw_attrs=['viewBox="0 0 100 26"', 'preserveAspectRatio="none"', 'role="img"',
                   'aria-label="Level over the Tacton"'],
    )  # fmt: skip
    with html.Div(v_if="pulses"):
        number(session, "ramp")


def _shapes() -> None:
    with v3.VBtnToggle(v_model=("shape",), mandatory=True, density="compact", classes="sw-shapes",
                       raw_attrs=['aria-label="Shape of the path"'], divided=True,
                       variant="outlined", id="shape"):  # fmt: skip
        for name, path in SHAPES.items():
            v3.VBtn(
                f'<svg viewBox="0 0 24 24" aria-hidden="true"><path d="{path}" '
                'stroke-linecap="round"/></svg>',
                value=name, title=name, id=f"shape-{name}", raw_attrs=[f'aria-label="{name}"'],
            )  # fmt: skip


def _heading(said: str) -> None:
    html.H2(said, classes="sw-heading")


def _error(key: str) -> None:
    html.Div("{{ errors.%s }}" % key, v_if=f"errors.{key}", classes="sw-error",  # noqa: UP031
             id=f"{key}-error", raw_attrs=['role="alert"'])  # fmt: skip
