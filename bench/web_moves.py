"""Random moves on the page: whatever can be turned, clicked, opened or saved."""

import random
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import TimeoutError as NotThere

from skinwave.web.controls import CHOICES, NUMBERS, presets

SAVED = (
    "scene-toml", "waveform-csv", "waveform-wav", "figure-svg", "figure-png", "column-pdf",
    "report-html",
)  # fmt: skip
PULSES = ("", "100/50", "40/20, 10/30", "5/5")
Page = Any


def there(page: Page) -> list[str]:
    """The numbers that can be turned now."""
    return [key for key in NUMBERS if page.locator(f"#{key}-field").count()]


@contextmanager
def unless_gone(control: Any) -> Iterator[None]:
    """A move that nothing comes of if an earlier one, whose effect is late, takes its control away:
    foci with paths of their own have no common speed.
    """
    try:
        yield
    except NotThere:
        if control.count():
            raise


def press(page: Page, rng: random.Random) -> None:
    """Some steps of a slider."""
    key = rng.choice(there(page))
    slider = page.locator(f".sw-row:has(#{key}-field) [role=slider]")
    with unless_gone(slider):
        for _ in range(rng.randint(1, 8)):
            slider.press(rng.choice(["ArrowRight", "ArrowLeft"]))


def fill(page: Page, rng: random.Random) -> None:
    """A number in a field, now and then a wrong one."""
    key = rng.choice(there(page))
    number = NUMBERS[key]
    value = rng.choice([rng.uniform(number.low, number.high)] * 6 + [1e9])
    field = page.locator(f"#{key}-field")
    with unless_gone(field):
        field.fill(f"{round(value) if key == 'foci' else value:.4g}")


def rhythm(page: Page, rng: random.Random) -> None:
    """Pulses as text, by buttons, by keys or drawn with the pointer."""
    handles = page.locator("#timeline .sw-handle")
    way = rng.choice(["text", "add", "remove", "key", "draw"])
    if way == "text" or not (count := handles.count()):
        page.locator("#pulses-field").fill(rng.choice(PULSES))
    elif way in ("add", "remove"):
        page.evaluate("id => document.getElementById(id).click()", f"pulse-{way}")
    elif way == "key":
        handle = handles.nth(rng.randrange(count))
        handle.press(rng.choice(["ArrowLeft", "ArrowRight", "PageUp", "Home", "Delete"]))
    else:
        drawn(page, handles.nth(rng.randrange(count)), rng.uniform(-60, 60))


def drawn(page: Page, handle: Page, far: float) -> None:
    """Draw a handle so many pixels to the right."""
    handle.scroll_into_view_if_needed()
    box = handle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + far, y, steps=5)
    page.mouse.up()


def own(page: Page, rng: random.Random) -> None:
    """One path or paths of their own, or something of one of these, now and then a wrong one."""
    shapes = page.locator("#own select")
    if not (count := shapes.count()) or rng.random() < 0.2:
        page.locator(f"#follow-{rng.choice(['one', 'own', 'own'])}").click()
        return
    which, part = rng.randrange(count), rng.randrange(4)
    if part == 0:
        shapes.nth(which).select_option(rng.choice(CHOICES["shape"][:5]))
        return
    cell = page.locator(f"#own-{part}-{which}")
    if cell.is_enabled():
        cell.fill(rng.choice([f"{rng.uniform(0, 30):.1f}"] * 6 + ["400", "x"]))
        cell.press("Tab")


def shape(page: Page, rng: random.Random) -> None:
    # Not while foci have paths of their own; looked up and clicked at once, as these may come.
    page.evaluate(
        "id => { const it = document.getElementById(id); if (it?.offsetParent) it.click(); }",
        f"shape-{rng.choice(CHOICES['shape'][:5])}",
    )


def choose(page: Page, rng: random.Random) -> None:
    key = rng.choice(["ratio", "drive", "span", "highest", "sharing"])
    page.locator(f".v-field:has(#{key})").click()
    options = page.locator(".v-overlay [role=option]:visible")
    options.first.wait_for()
    options.nth(rng.randrange(options.count())).click()


def body(page: Page, rng: random.Random, bodies: Sequence[str]) -> None:
    name = rng.choice([*bodies, "skin-slab", "skin-slab"])
    page.locator(".v-field:has(#body)").click()
    page.get_by_role("option", name=name, exact=True).click()


def preset(page: Page, rng: random.Random) -> None:
    page.locator("#presets").click()
    page.locator(f"#preset-{rng.choice(list(presets()))}").click()


def select(page: Page, rng: random.Random) -> None:
    page.locator("#kernel-map").click(
        position={"x": rng.uniform(40, 200), "y": rng.uniform(20, 180)}
    )


def button(page: Page, rng: random.Random) -> None:
    page.evaluate(
        "id => document.getElementById(id)?.click()",
        rng.choice(["undo", "redo", "pin", "swap", "solid", "theme", "cancel", "play"]),
    )


def zoom(page: Page, rng: random.Random) -> None:
    plot = page.locator(f"#{rng.choice(['commanded_plot', 'waveform_plot', 'spectrum_plot'])}")
    for key in rng.choices(["+", "-", "ArrowLeft", "ArrowRight", "Home"], k=4):
        plot.press(key)


def save(page: Page, rng: random.Random) -> None:
    page.locator("#save").click()
    with page.expect_download() as saved:
        page.locator(f"#save-{rng.choice(SAVED)}").click()
    saved.value.delete()


def reopen(page: Page, rng: random.Random) -> None:
    """Save the scene, and open it again."""
    page.locator("#save").click()
    with page.expect_download() as saved, tempfile.TemporaryDirectory() as folder:
        page.locator("#save-scene-toml").click()
        path = Path(folder, "scene.toml")
        saved.value.save_as(path)
        page.locator("#open").set_input_files(path)


MOVES: dict[Callable[[Page, random.Random], None], int] = {
    press: 30, fill: 12, select: 12, button: 12, shape: 6, choose: 6, zoom: 5, preset: 4,
    rhythm: 8, own: 8, save: 2, reopen: 1,
}  # fmt: skip
