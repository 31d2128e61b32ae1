"""The rhythm: a timeline whose pulses are drawn longer and shorter, and the same as text."""

from trame.widgets import html
from trame.widgets import vuetify3 as v3
from trame_client.widgets.core import HtmlElement

from skinwave.web.fields import number, text
from skinwave.web.session import Session

HANDLE = (
    '<g v-for="end in v.ends" :key="`${end.pulse}-${end.kind}`" class="sw-handle" tabindex="0" '
    ":class=\"{ 'sw-gap': end.kind === 'gap' }\" :id=\"`rhythm-${end.kind}-${end.pulse}`\" "
    'role="slider" :aria-label="end.name" :aria-valuenow="end.value" :aria-valuetext="end.said" '
    ':aria-valuemin="end.kind === \'on\' ? 1 : 0" :aria-valuemax="v.longest" '
    ":transform=\"`translate(${end.x}, ${end.kind === 'on' ? 6 : 26})`\" "
    '@focus="pulse = end.pulse" '
    '@keydown="utils.rhythm.key($event, end.pulse, end.kind)" '
    '@pointerdown="utils.rhythm.press($event, end.pulse, end.kind, v.span)" '
    '@pointermove="utils.rhythm.move($event)" @pointerup="utils.rhythm.release()" '
    '@pointercancel="utils.rhythm.release()">'
    "<title>{{ end.name }}: {{ end.said }}</title>"
    '<rect x="-8" y="0" width="16" height="20" fill="transparent"/>'
    '<rect class="sw-grip" x="-3" y="1" width="6" height="17" rx="2"/></g>'
)
DRAWN = (
    '<g v-for="v in [utils.rhythm.view(pulses, ramp, rhythm_span)]" :key="0">'
    '<polygon v-for="(b, k) in v.blocks" :key="k" :points="b.points" '
    ":class=\"['sw-block', { 'sw-again': !b.own, 'sw-chosen': b.own && b.pulse === pulse }]\" "
    '@pointerdown="b.own && (pulse = b.pulse)"/>'
    '<rect v-if="!v.period" x="8" y="10" width="280" height="34" class="sw-block sw-again"/>'
    '<text v-if="!v.period" x="148" y="31" text-anchor="middle">no pulses: always on</text>'
    '<path d="M8,44H288" class="sw-axis"/>'
    '<path v-if="v.period" :d="`M${v.end},4V50`" class="sw-axis" stroke-dasharray="2 3"/>'
    '<g v-for="t in v.ticks" :key="t.said"><path :d="`M${t.x},44v4`" class="sw-axis"/>'
    '<text :x="t.x" y="58" text-anchor="middle">{{ t.said }}</text></g>'
    f'<text x="296" y="68" text-anchor="end">time, ms</text>{HANDLE}</g>'
)


def rhythm(session: Session) -> None:
    """Timeline, buttons and text of the pulses, and their ramp."""
    html.Div("Rhythm", classes="sw-note", style="margin-top: 4px")
    HtmlElement("svg", classes="sw-timeline", id="timeline", children=[DRAWN], raw_attrs=[
        'viewBox="0 0 296 70"', 'role="group"',
        'aria-label="Rhythm: pulses and gaps, repeated to the end of the Tacton; arrow keys move '
        'an end by 1 ms, with the shift key by 10, Delete removes its pulse"',
    ])  # fmt: skip
    with html.Div(classes="sw-buttons"):
        _button("Add a pulse", "utils.rhythm.add()", "pulse-add", "pulses.split(',').length < 64")
        _button("Remove pulse {{ pulses ? Math.min(pulse, pulses.split(',').length - 1) + 1 : '' "
                "}}", "utils.rhythm.remove(pulse)", "pulse-remove", "pulses")  # fmt: skip
    text(session, "pulses", "On/off in ms, such as 100/50, 40/110; empty is none")
    with html.Div(v_if="pulses"):
        number(session, "ramp")


def _button(said: str, click: str, name: str, possible: str) -> None:
    v3.VBtn(said, click=click, id=name, size="small", variant="outlined",
            disabled=(f"!({possible})",))  # fmt: skip
