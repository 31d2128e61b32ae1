"""Parts of the page: controls, an area with its map, notices, what the model leaves out."""

from functools import partial

from trame.widgets import html
from trame.widgets import vuetify3 as v3
from trame_client.widgets.core import HtmlElement

from simple_model.drive import DRIVES
from skinwave.web import drawings
from skinwave.web.controls import CHOICES, NUMBERS
from skinwave.web.fields import choice, heading, number
from skinwave.web.moves import cancel
from skinwave.web.session import Session
from skinwave.web.space import in_space
from skinwave.web.timeline import rhythm

PROFILES = {
    "gaussian": "Gaussian, of the half width and force of the array's",
    "main_lobe": "main lobe (sinc²), as published",
}
REACH_MM = NUMBERS["x"].high
LEFT_OUT = (
    "<b>Point kernel</b> (Lim, Seifi, Park, CHI EA '24): the stimulus at a point of the skin is "
    "the pressure of the focus, weighted by distance. Nothing propagates, no body deflects. "
    "<i>Kernel, same load</i> has the drive law and focus profile that are chosen, as every body; "
    "<i>kernel, as published</i> the linear drive and the main lobe, whatever is chosen. These two "
    "differ by drive law and profile; waves and the kernel under the same load differ by "
    "propagation.",
    "<b>Skin slab</b>: wavenumber integral of an infinite flat layer of soft tissue of 15 mm on "
    "bone; no sides. <b>Paper sheet, palm</b>: finite elements, coarser than those of <i>skinwave "
    "compare</i>: some per cent of the motion. Another shape, size or height of the focus reduces "
    "the body anew, which takes up to half a minute; other controls do not.",
    "<b>3-D</b>: the steady state about its mean, exaggerated as is said below it. A slab is shown "
    "as far as the area goes; its sides are drawn straight down to the bone.",
    "Motion is linear and begins from rest; a real sheet of paper stiffens as it sags. The "
    "pressure, 50 Pa at full drive, is uncertain by a factor of 2. Air is left out.",
    "Side lobes of the focus, and what several simultaneous foci do to each other, are left out: "
    "simultaneous and time-multiplexed foci are the same load here, devices differ.",
    "Foci on paths of their own have equal pressure and are drawn equally often; a circle is then "
    "a polygon, nowhere further from it than 0.01 mm.",
    "Detection thresholds differ by 5 dB between people. The contour in a map is where the line "
    "with the highest sensation level is at threshold: of waves, the displacement threshold for a "
    "focal spot; of the kernel, 2.2 Pa at 200 Hz (a peak of 4.4 Pa with AM), at other frequencies "
    "in proportion to the displacement threshold. "
    "Maps of a rhythm are those of its pulses while they are on.",
    "Weights of the superposition multiply the two "
    "AM sinusoids; a frequency of 0 is a factor of 1.",
)


def control_panel(session: Session) -> None:
    """All controls."""
    with html.Div(classes="sw-controls", id="controls"):
        v3.VSelect(v_model=("body",), items=("bodies",), label="Body", density="compact",
                   hide_details=True, id="body", style="margin-top: 8px")  # fmt: skip
        heading("In time")
        for key in ("amplitude", "am"):
            number(session, key)
        choice("ratio", "Superposition ratio, first to second AM")
        for key in ("am2", "envelope", "duration"):
            number(session, key)
        rhythm(session)
        heading("In space")
        in_space(session)
        heading("On the skin")
        number(session, "height")
        choice("drive", "Drive law",
               [{"title": f"{name.replace('_', ' ')}: {law.words}", "value": name}
                for name, law in DRIVES.items()])  # fmt: skip
        choice("profile", "Focus profile",
               [{"title": PROFILES[p], "value": p} for p in CHOICES["profile"]])  # fmt: skip
        v3.VCheckbox(v_model=("published", False), density="compact", hide_details=True,
                     id="published", label="show the kernel as published, too")  # fmt: skip
        html.Div("that is, under its own load: linear drive, main lobe", classes="sw-note")
        for key in ("x", "y"):
            number(session, key)
        heading("Scene file")
        v3.VFileInput(v_model=("opened", None), label="Open a scene (TOML)", accept=".toml",
                      density="compact", hide_details=True, id="open")  # fmt: skip


def area(name: str, marked: str, said: str, shown: str = "true") -> None:
    """A map of the area with path, foci, borderlines and the selected point, which it selects."""
    steps = {"left": "-1, 0", "right": "1, 0", "up": "0, 1", "down": "0, -1"}
    keys = [
        f'@keydown.{key}.prevent="utils.skinwave.step({by}, {REACH_MM:g})"'
        for key, by in steps.items()
    ]
    drag = "trigger('select', utils.skinwave.place($event))"
    HtmlElement(
        "svg", v_if=shown, classes="sw-map", id=marked, children=[
            f'<image v-if="{name}.picture" :href="{name}.picture" x="-51.25" y="-51.25" '
            'width="102.5" height="102.5" preserveAspectRatio="none"/>'
            '<path :d="influenced" fill="none" stroke="black" stroke-width="1.1"/>'
            '<path :d="influenced" fill="none" stroke="white" stroke-width="0.9" '
            'stroke-dasharray="0.1 1.8" stroke-linecap="round"/>'
            f'<path :d="{name}.threshold" fill="none" stroke="#ff6fd0" stroke-width="0.7"/>'
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
            "{{ body_motion.repeats ? 'the period of the whole pattern' : 'a part of the pattern, "
            "which may jump where it begins again' }}",
            v_if="body_motion.times", classes="sw-caption",
        )  # fmt: skip
        colour_bar("body_motion.ends || []", drawings.SIGNED)


def differences() -> None:
    """Differences between the values that are pinned and those that are shown."""
    columns = "<td v-for='row in differs' :key='row.name'>{{ row.%s }}</td>"
    HtmlElement("table", v_if="pinned", classes="sw-differs", id="differs", children=[
        "<tr><th scope='col'>{{ differs.length ? '' : 'A and B are the same' }}</th>"
        "<th v-for='row in differs' :key='row.name' scope='col'>{{ row.name }}</th></tr>"
        "<tr v-if='differs.length'><th scope='row' class='sw-a'>A, pinned</th>"
        + columns % "a" + "</tr><tr v-if='differs.length'><th scope='row'>B, shown</th>"
        + columns % "b" + "</tr>"
    ])  # fmt: skip


def summary() -> None:
    """Effects of propagation and of the drive law, in a sentence each."""
    with html.Div(v_if="summary.length", classes="sw-summary", id="summary",
                  raw_attrs=['aria-label="What propagation changes"']):  # fmt: skip
        html.Span("{{ said + ' ' }}", v_for="said in summary", key="said")


def warnings() -> None:
    """Warnings and the expected error of the response: as text, for sentences may quote what came
    from a file.
    """
    with html.Div(v_if="warnings.length || expected", classes="sw-warnings", id="warnings",
                  raw_attrs=['role="status"', 'aria-label="Warnings and errors"']):  # fmt: skip
        html.P("Warning: {{ said }}", v_for="said in warnings", key="said")
        html.P("{{ expected }}", v_if="expected", id="expected")


def colour_bar(ends: str, shades: str) -> None:
    """The colours of a map and what they stand for; `ends` is an expression of texts, evenly
    spaced.
    """
    html.Div(classes="sw-colours", style=f"background: {shades}", raw_attrs=['aria-hidden="true"'])
    with html.Div(classes="sw-ends"):
        html.Span("{{ end }}", v_for=f"(end, k) in {ends}", key="k")


def line_table() -> None:
    """The lines at the point."""
    with html.Table(classes="sw-table", id="lines"):
        html.Tr(
            "<th scope='col'>line</th><th scope='col'>Hz</th><th scope='col'>Pa</th>"
            "<th scope='col'>µm</th>"
            "<th scope='col' title='sensation level: dB above the detection threshold'>dB SL</th>"
        )
        html.Tr(
            "<td><template v-for='(part, k) in row.name.split(/<.?sub>/)' :key='k'>"
            "<sub v-if='k % 2'>{{ part }}</sub><template v-else>{{ part }}</template>"
            "</template></td>"
            "<td>{{ row.frequency }}</td><td>{{ row.pressure }}</td>"
            "<td>{{ row.displacement }}</td><td>{{ row.level }}</td>",
            v_for="row in rows", key="row.name",
        )  # fmt: skip
    html.P("{{ unresolved }}", v_if="unresolved", id="unresolved", style="font-size: 0.86rem")


def notices() -> None:
    """Error messages of the controls' values."""
    v3.VAlert("{{ problem }}", v_if="problem", type="error", density="compact", id="problem")


def computing(session: Session) -> None:
    """Progress of a computation, over the place of its result."""
    with html.Div(v_if="busy", id="busy", classes="sw-busy"):
        html.Div("{{ body }}: {{ busy }}{{ left ? ', ' + left : '' }}", id="busy-said")
        v3.VProgressLinear(model_value=("done",), indeterminate=("!done",), height=6)
        v3.VBtn("Cancel", click=partial(cancel, session), size="small", variant="text", id="cancel")


def about() -> None:
    """Assumptions of the models, and what they leave out."""
    with v3.VNavigationDrawer(
        v_model=("about", False), location="right", temporary=True, width=380,
        raw_attrs=['aria-label="About this model"'],
    ), html.Div(style="padding: 16px"):  # fmt: skip
        v3.VBtn("Close", click="about = false", size="small", id="close-about",
                style="float: right")  # fmt: skip
        html.H2("About this model", style="font-size: 1.1rem")
        for sentence in LEFT_OUT:
            html.P(sentence, style="margin-top: 10px; font-size: 0.86rem")
