"""Fields of the control panel: a number with a slider, several numbers as text, a choice."""

from collections.abc import Sequence
from typing import Any

from trame.widgets import html
from trame.widgets import vuetify3 as v3

from skinwave.web.controls import CHOICES, NUMBERS
from skinwave.web.moves import setter
from skinwave.web.session import Session


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
        error(key)


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
        error(key)


def choice(key: str, said: str, items: Sequence[Any] = ()) -> None:
    """A dropdown."""
    v3.VSelect(
        v_model=(key,), items=(f"{key}_items", list(items or CHOICES[key])), label=said,
        density="compact", hide_details=True, id=key, style="margin-top: 8px",
        raw_attrs=[f'v-memo="[{key}]"'],
    )  # fmt: skip


def heading(said: str) -> None:
    """A heading over what belongs together."""
    html.H2(said, classes="sw-heading")


def error(key: str) -> None:
    """Message about an invalid entry, if there is one."""
    html.Div("{{ errors.%s }}" % key, v_if=f"errors.{key}", classes="sw-error",  # noqa: UP031
             id=f"{key}-error", raw_attrs=['role="alert"'])  # fmt: skip
