"""The interactive tool in a browser: what a user does, and what is then to be seen."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from in_browser import ended, frames, needs_browser, served, settled

from simple_model import spectrum
from skinwave.scene_file import loads
from skinwave.simulation import compute
from skinwave.web import controls, model, scenes
from skinwave.web.controls import NUMBERS, STARTS

ARTEFACTS = Path(__file__).parent.parent / ".ci" / "artefacts"
READY = "() => window.trame?.utils?.plots?.shown?.spectrum_plot?.figure"
PATIENCE = 600_000  # ms, after which a test that hangs is ended
pytestmark = [pytest.mark.slow, needs_browser]
for name in ("playwright", "trame", "trame_vuetify"):
    pytest.importorskip(name)


class Logs:
    def __init__(self):
        self.asked, self.errors = [], []


def opened(browser, address, query="", motion="reduce"):
    """A page at rest, unless a reader's system asks for no less "motion"."""
    size = {"width": 1280, "height": 720}
    page, logs = browser.new_page(viewport=size, reduced_motion=motion), Logs()
    page.set_default_timeout(PATIENCE)
    page.on("request", lambda request: logs.asked.append(request.url))
    page.on("pageerror", lambda error: logs.errors.append(str(error)))
    page.on("console", lambda m: logs.errors.append(m.text) if m.type == "error" else None)
    page.goto(address + query.replace("?", "&"))
    page.wait_for_function(READY)
    return page, logs


@pytest.fixture(scope="module")
def visit(browser, address):
    return opened(browser, address)


def begun(page, query):
    page.evaluate("() => window.trame.state.set('solid', false)")
    page.evaluate("q => window.trame.trigger('restart', [q])", query)
    state_becomes(page, "query", query)
    return page


@pytest.fixture
def page(visit):
    """The page as it is at the beginning."""
    return begun(visit[0], "")


@pytest.fixture
def bare(visit):
    """The page without a body, whose waves are computed with every move."""
    return begun(visit[0], "body=none")


def state(page, key):
    return page.evaluate("key => window.trame.state.get(key)", key)


def state_becomes(page, key, value):
    page.wait_for_function(
        "([key, value]) => JSON.stringify(window.trame.state.get(key)) === value",
        arg=[key, json.dumps(value, separators=(",", ":"))],
    )


def query_has(page, part):
    """Wait until the session has set this part of the page's address."""
    page.wait_for_function("part => decodeURIComponent(location.search).includes(part)", arg=part)


def drawn(page, plot):
    """The curves that a canvas shows."""
    return page.evaluate("plot => window.trame.utils.plots.shown[plot].figure.data", plot)


def ink(page, canvas):
    """How many pixels of a canvas are of each colour."""
    return page.evaluate(
        """id => { const from = document.getElementById(id);
        const copy = document.createElement('canvas');
        [copy.width, copy.height] = [from.width, from.height];
        const g = copy.getContext('2d');
        g.drawImage(from, 0, 0);
        const bytes = g.getImageData(0, 0, copy.width, copy.height).data, found = {};
        for (let k = 0; k < bytes.length; k += 4) {
          const colour = bytes.slice(k, k + 4).join();
          found[colour] = (found[colour] || 0) + 1;
        }
        return found }""",
        canvas,
    )


def choose(page, key, title):
    page.locator(f".v-field:has(#{key})").click()
    page.get_by_role("option", name=title).click()


def photographed(page, name):
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=ARTEFACTS / f"web-{name}.png")


def test_the_spectrum_on_the_page_is_what_simulate_answers(page):
    page.locator(".sw-row:has(#am-field) [role=slider]").press("ArrowRight")
    query_has(page, "am=141")
    values = controls.from_query(page.evaluate("location.search.slice(1)"))[0]
    f, amplitude = spectrum(compute(scenes.scene_of(values), "point-kernel"))
    page.wait_for_function("() => true")
    shown = drawn(page, "spectrum_plot")[0]
    assert np.allclose(shown["x"], f[f <= 600], atol=1e-2)
    assert np.allclose(shown["y"], amplitude[f <= 600, 0], atol=1e-4 * amplitude.max())
    named = model.kernel(scenes.scene_of(values)).lines[0]
    row = page.locator("#lines tr").nth(1).locator("td")
    assert row.nth(1).inner_text() == f"{named.frequency:.1f}"
    assert row.nth(2).inner_text() == f"{named.amplitude:.3g}"
    photographed(page, "kernel")


def test_it_opens_with_the_skin_slab_and_its_body_first(page):
    assert page.locator(".v-field:has(#body)").inner_text().strip().endswith("skin-slab")
    first = page.locator("#controls input, #controls [role=slider]").first
    assert first.get_attribute("id") == "body"
    page.wait_for_function("() => window.trame.state.get('wave_map').picture")
    page.locator("#published").click()
    page.wait_for_function(
        "() => window.trame.utils.plots.shown.waveform_plot.figure.data.length === 3"
    )
    assert drawn(page, "waveform_plot")[0]["name"] == "kernel, as published, Pa"
    photographed(page, "published")
    page.locator("#published").click()


@pytest.mark.parametrize("key", [key for key in NUMBERS if key not in ("ramp", "drawn")])
def test_a_slider_and_a_field_turn_each_number(bare, key):
    page = bare
    number, row = NUMBERS[key], page.locator(f".sw-row:has(#{key}-field)")
    way = -1 if number.start == number.high else 1
    row.locator("[role=slider]").press("ArrowRight" if way > 0 else "ArrowLeft")
    expected = number.start + way * number.step
    state_becomes(
        page, "query", controls.to_query(STARTS | {"body": "none", key: round(expected, 6)})
    )
    assert float(page.locator(f"#{key}-field").input_value()) == pytest.approx(expected)
    page.locator(f"#{key}-field").fill(f"{number.low + 3 * number.step:g}")
    query_has(page, f"{key}={number.low + 3 * number.step:g}")
    page.locator(f"#{key}-field").fill("1e9")
    page.wait_for_selector(f"#{key}-error")
    assert "is outside" in page.locator(f"#{key}-error").inner_text()
    assert page.locator(f"#{key}-field").get_attribute("aria-invalid") == "true"


def test_a_number_can_be_typed_digit_by_digit(bare):
    """Though its beginning, 1 mm, is refused."""
    page = bare
    field = page.locator("#height-field")
    field.fill("")
    field.press_sequentially("1")
    page.wait_for_selector("#height-error")
    assert field.input_value() == "1"
    field.press_sequentially("50")
    query_has(page, "height=150")
    assert field.input_value() == "150"
    page.wait_for_selector("#height-error", state="detached")


def test_dropdowns_shapes_rhythm_and_hold_do_what_they_say(bare):
    page = bare
    choose(page, "ratio", "0.25:0.75")
    query_has(page, "ratio=0.25:0.75")
    choose(page, "drive", "linear")
    query_has(page, "drive=linear")
    page.locator("#foci-field").fill("3")
    choose(page, "sharing", "in turn")
    query_has(page, "sharing=time_multiplexed")
    page.wait_for_function("() => window.trame.state.get('foci_track')[0].length === 3")
    page.locator("#phases-field").fill("0, 25, 50")
    query_has(page, "phases=0")
    page.wait_for_function(
        "() => Math.abs(window.trame.state.get('foci_track')[0][1][1] + 10) < 0.01"
    )
    assert page.locator("#kernel-map circle").count() == 3
    for shape in ("point", "line", "triangle", "square"):
        page.locator(f"#shape-{shape}").click()
        query_has(page, f"shape={shape}")
    page.locator("#pulses-field").fill("100/50, 40/110")
    query_has(page, "pulses=100/50")
    page.wait_for_selector("#rhythm-gap-1")
    page.locator("#ramp-field").fill("10")
    query_has(page, "ramp=10")
    photographed(page, "rhythm")
    page.locator("#pulses-field").fill("")
    page.locator("#hold").click()
    page.wait_for_function("() => window.trame.state.get('held_frequency') > 0")
    held = page.locator("#drawing").inner_text()
    page.locator("#size-field").fill("14")
    query_has(page, "speed=8.4")
    assert page.locator("#drawing").inner_text() == held
    page.locator("#hold").click()


def drawn_by(page, selector, dx):
    """Draw what a selector finds by some pixels to the right."""
    box = page.locator(selector).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for part in (0.3, 0.7, 1):
        page.mouse.move(x + part * dx, y)
        frames(page, 2)
    page.mouse.up()


def test_the_rhythm_is_edited_on_its_timeline(bare):
    page = bare
    assert page.locator("#timeline .sw-handle").count() == 0
    page.locator("#pulse-add").click()
    query_has(page, "pulses=100/100")
    page.locator("#pulse-add").click()
    query_has(page, "pulses=100/100,+100/100")
    # The axis reaches to 500 ms, so that 56 of 280 pixels are 100 ms.
    wide = page.locator("#timeline").bounding_box()["width"] / 296
    drawn_by(page, "#rhythm-on-0", -28 * wide)
    page.wait_for_function("() => /^(49|50|51).100, 100/.test(window.trame.state.get('pulses'))")
    drawn_by(page, "#rhythm-gap-1", 28 * wide)
    page.wait_for_function("() => / 100.(149|150|151)$/.test(window.trame.state.get('pulses'))")
    assert state(page, "rhythm_span") == 0
    page.locator("#pulses-field").fill("50/100, 100/150")
    handle = page.locator("#rhythm-on-1")
    before = handle.bounding_box()["x"]
    for key in ("ArrowRight", "Shift+ArrowRight", "ArrowLeft"):
        handle.press(key)
    query_has(page, "pulses=50/100,+110/150")
    assert page.locator("#pulses-field").input_value() == "50/100, 110/150"
    assert handle.bounding_box()["x"] > before
    assert handle.get_attribute("role") == "slider"
    assert handle.get_attribute("aria-label") == "Length of pulse 2, ms"
    assert handle.get_attribute("aria-valuenow") == "110"
    assert handle.get_attribute("aria-valuetext") == "110 ms"
    page.locator("#rhythm-gap-0").press("Home")
    query_has(page, "pulses=50/0,+110/150")
    page.locator("#rhythm-on-0").press("PageDown")
    query_has(page, "pulses=40/0,+110/150")
    assert page.locator("#timeline text", has_text="time, ms").count() == 1
    photographed(page, "timeline")
    page.locator("#ramp-field").fill("20")
    query_has(page, "ramp=20")
    corners = page.locator(".sw-block").first.get_attribute("points").split()
    assert corners[1].split(",")[0] == corners[2].split(",")[0], "ramps meet in the middle"
    page.locator("#rhythm-on-0").press("ArrowLeft")
    page.wait_for_selector("#problem")
    assert "half the shortest pulse" in page.locator("#problem").inner_text()
    assert state(page, "stale")
    page.locator("#undo").click()
    state_becomes(page, "stale", False)
    page.locator("#rhythm-on-0").press("Delete")
    query_has(page, "pulses=110/150")
    page.locator("#ramp-field").fill("10")  # or the next is one move with the last
    query_has(page, "ramp=10")
    page.locator("#pulse-remove").click()
    state_becomes(page, "pulses", "")
    assert page.locator("#pulse-remove").is_disabled()
    page.locator("#undo").click()
    state_becomes(page, "pulses", "110/150")


def test_foci_follow_paths_of_their_own(bare, tmp_path):
    page = bare
    page.locator("#foci-field").fill("2")
    query_has(page, "foci=2")
    page.locator("#follow-own").click()
    query_has(page, "paths=circle/20/-20/0,+circle/20/20/0")
    assert page.locator("#size-field").count() == 0
    page.locator(".sw-row:has(#drawn-field) [role=slider]").press("ArrowRight")
    query_has(page, "drawn=101")
    page.locator("#drawn-field").fill("90")
    query_has(page, "drawn=90")
    page.locator("#own-0-1").select_option("square")
    for column, value in ((1, "15"), (2, "22.5"), (3, "-10")):
        page.locator(f"#own-{column}-1").fill(value)
        page.locator(f"#own-{column}-1").press("Tab")
    query_has(page, "square/15/22.5/-10")
    page.locator("#own-2-1").fill("21")  # an update of something else meanwhile
    for drawn in (80, 90):
        page.evaluate("drawn => window.trame.state.set('drawn', drawn)", drawn)
        query_has(page, f"drawn={drawn}")
    assert page.locator("#own-2-1").input_value() == "21"
    page.locator("#own-2-1").fill("22.5")
    page.locator("#own-2-1").press("Tab")
    page.wait_for_function("() => window.trame.state.get('own_speeds') === '5.65, 5.4 m/s'")
    assert "90.00 times a second" in page.locator("#own-speeds").inner_text()
    assert page.locator("#kernel-map path[stroke='#56B4E9']").get_attribute("d").count("M") == 2
    row = page.locator("#lines tr", has_text="fd+fAM").first.locator("td")
    assert row.nth(1).inner_text() == "230.0"
    page.locator("#own-1-0").fill("70")
    page.locator("#own-1-0").press("Tab")
    page.wait_for_selector("#paths-error")
    assert "path 1: 70 mm is outside" in page.locator("#paths-error").inner_text()
    page.locator("#own-1-0").fill("12")
    page.locator("#own-1-0").press("Tab")
    page.wait_for_selector("#paths-error", state="detached")
    page.locator("#pulses-field").fill("100/50")
    query_has(page, "pulses=100/50")
    choose(page, "body", "skin-slab")
    page.wait_for_function("() => window.trame.state.get('wave_map').picture")
    photographed(page, "own-paths")
    kept = state(page, "query")
    page.locator("#save").click()
    with page.expect_download() as saved:
        page.locator("#save-scene-toml").click()
    saved.value.save_as(tmp_path / "own.toml")
    page.locator("#follow-one").click()
    page.wait_for_function("() => !window.trame.state.get('paths')")
    page.locator("#undo").click()
    state_becomes(page, "query", kept)
    page.locator("#redo").click()
    page.wait_for_function("() => !window.trame.state.get('paths')")
    page.locator("#open").set_input_files(tmp_path / "own.toml")
    state_becomes(page, "query", kept)
    page.locator("#foci-field").fill("3")
    page.wait_for_selector("#own-0-2")


def test_presets_undo_redo_pin_and_looks(page):
    page.locator("#presets").click()
    page.locator("#preset-am80-stm30").click()
    query_has(page, "am=80")
    page.locator("#undo").click()
    state_becomes(page, "query", "")
    page.locator("#redo").click()
    query_has(page, "size=30")
    page.locator("#pin").click()
    page.locator("#undo").click()
    state_becomes(page, "query", "")
    names = [curve["name"] for curve in drawn(page, "spectrum_plot")]
    assert "A: kernel, same load, Pa" in names
    assert "B: kernel, same load, Pa" in names
    names, a, b = (row.split("\t") for row in page.locator("#differs tr").all_inner_texts())
    assert names[1:] == ["AM frequency", "Size", "Drawing speed"]
    assert a == ["A, pinned", "80 Hz", "30 mm", "18 m/s"]
    assert b == ["B, shown", "140 Hz", "20 mm", "12 m/s"]
    page.locator("#swap").click()
    query_has(page, "size=30")
    photographed(page, "pinned")
    page.locator("#pin").click()
    choose(page, "span", "all")
    page.wait_for_function("() => window.trame.state.get('waveform_plot').data[0].x.at(-1) > 900")
    choose(page, "span", "first 60 ms")
    choose(page, "highest", "300")
    page.wait_for_function("() => window.trame.state.get('spectrum_plot').x.range[1] === 300")
    choose(page, "highest", "600")


def at_rest(element):
    """Where an element is once it stays there: lines above it come and go."""
    before, now = None, element.bounding_box()
    while now != before:
        settled(element.page)
        before, now = now, element.bounding_box()
    return now


def test_a_click_or_a_key_on_the_map_selects(bare):
    page = bare
    area = page.locator("#kernel-map")
    for x, y in ((12.3, -7.8), (-31.4, 22.2)):
        frame = at_rest(area.locator("rect"))
        at = ((x + 50) / 100 * frame["width"], (50 - y) / 100 * frame["height"])
        page.mouse.click(frame["x"] + at[0], frame["y"] + at[1])
        page.wait_for_function("x => Math.abs(window.trame.state.get('x') - x) < 0.5", arg=x)
        assert abs(state(page, "y") - y) < 0.5
    before = state(page, "x")
    area.press("ArrowRight")
    page.wait_for_function("x => window.trame.state.get('x') > x + 0.9", arg=before)


def test_every_press_on_the_map_counts_however_fast(bare):
    page = bare
    page.locator("#kernel-map").evaluate(
        """map => {
          for (const [key, count] of [['Right', 9], ['Up', 7], ['Left', 2]])
          for (let k = 0; k < count; k++)
            map.dispatchEvent(
              new KeyboardEvent('keydown', {key: 'Arrow' + key, bubbles: true})) }"""
    )
    state_becomes(page, "x", STARTS["x"] + 7)
    query_has(page, "x=17&y=7")


NAMED = """() => {
  const plot = window.trame.utils.plots.shown.spectrum_plot, { box, figure } = plot, crossed = [];
  const of = (axis) => figure[axis].range, [from, to] = plot.zoom || figure.x.range;
  const over = (a, b) =>
    a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
  for (const [k, one] of plot.named.entries()) {
    const out = one.y < box.y || one.x < box.x || one.x + one.w > box.x + box.w;
    if (out || plot.named.some((other, n) => n !== k && over(one, other)))
      crossed.push(['a name or the edge', one.said]);
    for (const curve of figure.data) for (let n = 0; n < curve.y.length; n++) {
      const [low, high] = of(curve.axis), x = box.x + box.w * (curve.x[n] - from) / (to - from);
      const y = box.y + box.h * (1 - (curve.y[n] - low) / (high - low));
      if (over(one, { x, y, w: 0, h: 0 })) crossed.push([curve.name, one.said]);
    }
  }
  return [plot.named.length, crossed] }"""


@pytest.mark.parametrize(
    "query", ["", "body=none", "am=80&size=30", "am=37&am2=55&ratio=0.5:0.5", "drive=linear"]
)
def test_names_of_lines_are_on_no_peak_and_on_no_other_name(page, query):
    page.evaluate("q => window.trame.trigger('restart', [q])", query)
    state_becomes(page, "query", query)
    state_becomes(page, "waves_stale", False)
    for step in ("pinned", "published"):
        count, crossed = page.evaluate(NAMED)
        assert count >= 3
        assert crossed == []
        if step == "pinned":
            page.locator("#pin").click()
            page.locator("#published").click()
            page.wait_for_function(
                "() => window.trame.utils.plots.shown.spectrum_plot.figure.data[0].role"
                " === 'published'"
            )
    photographed(page, "names")
    page.locator("#published").click()


def test_no_name_of_a_curve_is_on_a_curve(page):
    state_becomes(page, "waves_stale", False)
    page.locator("#pin").click()
    page.locator("#am-field").fill("99")
    query_has(page, "am=99")
    state_becomes(page, "waves_stale", False)
    for plot in ("waveform_plot", "spectrum_plot"):
        shown = f"window.trame.utils.plots.shown.{plot}"
        lowest = page.evaluate(f"() => Math.max(...{shown}.entries.map(({{ y }}) => y + 6))")
        assert lowest > 28, "there are too many for one row"
        assert lowest <= page.evaluate(f"() => {shown}.box.y")


def test_colours_have_a_bar_with_unit_and_sign(page):
    state_becomes(page, "waves_stale", False)
    bars = page.locator(".sw-ends")
    assert re.fullmatch(r"0\s+[\d.]+\s+[\d.]+ Pa", bars.nth(0).inner_text())
    assert re.fullmatch(r"0\s+[\d.]+\s+[\d.]+ µm", bars.nth(1).inner_text())
    assert "linear-gradient" in page.locator(".sw-colours").nth(0).evaluate(
        "bar => getComputedStyle(bar).backgroundImage"
    )
    page.locator("#solid").click()
    page.wait_for_function("() => window.trame.state.get('body_motion').frames")
    low, _, high = page.locator(".sw-ends").nth(1).inner_text().splitlines()
    assert re.fullmatch(r"[\d.]+ µm out of the body", low)
    assert re.fullmatch(r"[\d.]+ µm into the body", high)
    page.locator("#solid").click()


def test_warnings_stand_at_the_top_as_text(page):
    said = "a <b>linear</b> sheet <img src=x onerror='window.hurt = 1'>"
    page.evaluate("said => window.trame.state.set('warnings', [said])", said)
    page.wait_for_selector("#warnings")
    assert page.locator("#warnings").inner_text() == f"Warning: {said}"
    assert page.evaluate("window.hurt") is None
    top = page.locator("#warnings").bounding_box()
    assert top["y"] + top["height"] <= page.locator("#kernel-map").bounding_box()["y"]
    page.evaluate("() => window.trame.state.set('warnings', [])")


TOLD = """() => {
  const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
    .map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const canvas = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  const rgba = (said) => { canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = said;
    canvas.fillRect(0, 0, 1, 1); const c = canvas.getImageData(0, 0, 1, 1).data;
    return [c[0], c[1], c[2], c[3] / 255]; };
  const mixed = (over, under) => [0, 1, 2].map((k) => over[3] * over[k] + (1 - over[3]) * under[k]);
  const found = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const at = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !at?.checkVisibility({ opacityProperty: true })
        || at.closest('[aria-hidden=true], :disabled, .v-btn--disabled, script, style, title, svg'))
      continue;
    const chain = [];
    for (let e = at; e; e = e.parentElement) chain.unshift(e);
    let under = [255, 255, 255], text = null;
    for (const e of chain) {
      const style = getComputedStyle(e), faded = Number(style.opacity);
      const back = rgba(style.backgroundColor);
      back[3] *= faded;
      under = mixed(back, under);
      text = [...rgba(style.color)];
    }
    text[3] *= chain.reduce((all, e) => all * Number(getComputedStyle(e).opacity), 1);
    const [a, b] = [light(mixed(text, under)), light(under)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) found.push([walk.currentNode.data.trim().slice(0, 40), ratio.toFixed(2)]);
  }
  return found }"""


@pytest.mark.parametrize("theme", ["as it opens", "the other"])
def test_text_stands_out_from_what_is_behind_it(page, theme):
    if theme == "the other":
        page.locator("#theme").click()
    page.locator("#pin").click()
    page.locator("#size-field").fill("900")
    page.wait_for_selector("#size-error")
    settled(page)
    faint = page.evaluate(TOLD)
    if theme == "the other":
        photographed(page, "dark")
        page.locator("#theme").click()
    assert faint == []


def test_toggles_say_whether_they_are_pressed(page):
    state_becomes(page, "waves_stale", False)
    for name in ("pin", "solid", "theme"):
        button = page.locator(f"#{name}")
        before, said = button.get_attribute("aria-pressed"), button.inner_text()
        assert before in ("true", "false")
        button.click()
        page.wait_for_function(
            "([id, before]) => document.getElementById(id).ariaPressed !== before",
            arg=[name, before],
        )
        assert button.inner_text() == said, "what is pressed keeps its name"
        button.click()
    for one, other in (("follow-one", "follow-own"), ("shape-circle", "shape-square")):
        assert page.locator(f"#{one}").get_attribute("aria-pressed") == "true"
        assert page.locator(f"#{other}").get_attribute("aria-pressed") == "false"


def test_a_page_has_one_heading_of_the_first_level_and_can_be_zoomed(page):
    assert page.locator("h1").count() == 1
    assert page.locator("h1").inner_text() == "skinwave"
    viewport = page.locator("meta[name=viewport]").get_attribute("content")
    assert viewport.startswith("width=device-width")
    assert not re.search("maximum-scale|minimum-scale|user-scalable", viewport)


def test_zooming_into_the_commanded_tacton_shows_its_carrier(bare):
    page = bare
    frame = page.locator("#commanded_plot").bounding_box()
    middle = frame["y"] + frame["height"] / 2
    page.mouse.move(frame["x"] + 200, middle)
    page.mouse.down()
    page.mouse.move(frame["x"] + 206, middle + 1)
    page.mouse.move(frame["x"] + 214, middle + 2)
    page.mouse.up()
    page.wait_for_function(
        "() => window.trame.state.get('commanded_plot').title.includes('with its')"
    )
    photographed(page, "carrier")
    page.mouse.dblclick(frame["x"] + 200, middle)
    page.wait_for_function(
        "() => window.trame.state.get('commanded_plot').title.includes('envelope')"
    )


def test_curves_are_drawn_read_and_zoomed_by_keys(page):
    curve = "0,0,0,255" if not state(page, "dark") else "255,255,255,255"
    assert ink(page, "waveform_plot").get(curve, 0) > 200
    plot = page.locator("#waveform_plot")
    before = ink(page, "waveform_plot")
    plot.hover()
    assert ink(page, "waveform_plot") != before, "nothing is read out"
    plot.press("+")
    zoom = "() => window.trame.utils.plots.shown.waveform_plot.zoom"
    low, high = page.evaluate(zoom)
    assert (low, high) == pytest.approx((15, 45))
    plot.press("Home")
    assert page.evaluate(zoom) is None


def test_the_body_moves_in_three_dimensions(page):
    page.locator("#solid").click()
    page.wait_for_function("() => window.trame.state.get('body_motion').frames")
    play, now = page.locator("#play"), page.locator("#body-now")
    assert play.inner_text() == "▶ Play", "less motion is asked for"
    assert page.locator(".sw-play:visible").count() == 1
    assert re.fullmatch(r"\d+\.\d\d of \d+\.\d\d ms", now.inner_text())
    stopped = ink(page, "body-view")
    assert len(stopped) > 50, "next to nothing is drawn"
    frames(page, 12)
    assert ink(page, "body-view") == stopped
    page.locator("#body-time").fill("500")
    half = float(now.inner_text().split()[0])
    assert half == pytest.approx(state(page, "body_motion")["period"] / 2, abs=0.01)
    assert ink(page, "body-view") != stopped
    page.locator("#body-view").press("ArrowLeft")
    turned = ink(page, "body-view")
    page.locator("#body-view").press("+")
    assert ink(page, "body-view") != turned
    play.click()
    page.wait_for_function("t => !document.getElementById('body-now').textContent.startsWith(t)",
                           arg=f"{half:.2f}")  # fmt: skip
    photographed(page, "body")
    page.locator("#body-view").press(" ")
    assert play.inner_text() == "▶ Play"
    page.locator("#solid").click()
    page.wait_for_selector("#wave-map")


def test_a_page_opens_with_moving_waves_and_one_button_that_stops_them(browser, address):
    page, logs = opened(browser, address, motion="no-preference")
    now = page.locator("#body-now")
    page.wait_for_function("() => document.getElementById('body-now')?.textContent.length > 3")
    first, before = now.inner_text(), ink(page, "body-view")
    page.wait_for_function("said => document.getElementById('body-now').textContent !== said",
                           arg=first)  # fmt: skip
    assert ink(page, "body-view") != before
    play = page.locator(".sw-play:visible")
    assert play.count() == 1
    assert play.inner_text() == "❚❚ Pause"
    for shown, above in ((play, 0), (page.locator("#body-view"), play.bounding_box()["y"])):
        frame = shown.bounding_box()
        assert above <= frame["y"]
        assert frame["y"] + frame["height"] <= 720, "it is seen without scrolling"
    photographed(page, "opening")
    play.click()
    assert play.inner_text() == "▶ Play"
    rest = now.inner_text()
    frames(page, 12)
    assert now.inner_text() == rest
    assert logs.errors == []
    page.close()


def test_nothing_moves_by_itself_where_less_motion_is_asked_for(browser, address):
    page, _ = opened(browser, address)
    page.wait_for_function("() => document.getElementById('body-now')?.textContent.length > 3")
    rest = page.locator("#body-now").inner_text()
    frames(page, 12)
    assert page.locator("#body-now").inner_text() == rest
    assert page.locator("#play").inner_text() == "▶ Play"
    page.close()


def test_peaks_are_read_by_keys_and_what_is_zoomed_to_stays_in_the_data(page):
    state_becomes(page, "waves_stale", False)
    plot, said = page.locator("#spectrum_plot"), page.locator("#plot-said")
    shown = "window.trame.utils.plots.shown.spectrum_plot"
    found = []
    plot.focus()
    for _ in range(4):
        plot.press("Shift+ArrowRight")
        found.append(page.evaluate(f"{shown}.value"))
        assert said.inner_text().startswith(f"frequency, Hz {found[-1]:.5g}")
        assert "kernel, same load, Pa" in said.inner_text()
    assert found == sorted(set(found))
    named = [name["x"] for name in state(page, "spectrum_plot")["names"]]
    assert min(abs(140 - value) for value in found) < 1.5 or max(found) < 140
    assert any(abs(value - name) < 1.5 for value in found for name in named)
    plot.press("Shift+ArrowLeft")
    assert page.evaluate(f"{shown}.value") == pytest.approx(found[-2])
    assert page.locator("#plot-said").get_attribute("aria-live") == "polite"
    plot.press("+")
    for _ in range(6):
        plot.press("ArrowLeft")
    assert page.evaluate(f"{shown}.zoom") == pytest.approx([0, 300])
    for _ in range(6):
        plot.press("ArrowRight")
    assert page.evaluate(f"{shown}.zoom") == pytest.approx([300, 600])
    plot.press("-")
    assert page.evaluate(f"{shown}.zoom") == pytest.approx([0, 600])
    plot.press("Home")


def test_small_curves_stand_beside_height_and_profile(page):
    inset = page.locator("#inset-height")
    assert "height of the focus, mm; 200 mm: 1.00" in inset.get_attribute("aria-label")
    at = inset.locator("circle").get_attribute("cx")
    profile = page.locator("#inset-profile .sw-curve").get_attribute("d")
    page.locator("#height-field").fill("300")
    query_has(page, "height=300")
    page.wait_for_function(
        "at => document.querySelector('#inset-height circle').getAttribute('cx') !== at", arg=at
    )
    assert page.locator("#inset-profile .sw-curve").get_attribute("d") != profile
    assert "relative force" in inset.text_content()
    assert "distance D from the focus, mm" in page.locator("#inset-profile").text_content()


def test_examples_show_what_they_speak_of_and_can_be_undone(page):
    page.locator("#pin").click()
    page.locator("#example-wake").click()
    page.locator("#body-view").wait_for()
    page.locator("#undo").click()
    state_becomes(page, "query", "")
    page.locator("#example-layers").click()
    page.wait_for_function("() => document.getElementById('layers').open")
    page.locator("#modulus-0-field").wait_for()
    assert page.locator("label[for=loss-0-field]").inner_text().startswith("epidermis")
    page.locator("#help-modulus-0").click()
    assert "Shear modulus" in page.locator("#modulus-0-help").inner_text()
    assert state(page, "pinned")
    page.locator("#undo").click()
    state_becomes(page, "query", "")
    page.locator("#help-bar").click()
    assert page.locator("#bar-help").is_visible()
    assert "8 points" in page.locator("#save-help").inner_text()
    page.locator("#help-bar").click()
    assert not page.locator("#bar-help").is_visible()


def test_maps_of_both_bodies_are_seen_at_once(page):
    state_becomes(page, "waves_stale", False)
    page.locator("#pin").click()
    page.locator("#pinned-map").wait_for()
    settled(page)
    a, b = (page.locator(f"#{name}-map").bounding_box() for name in ("pinned", "wave"))
    assert abs(a["y"] - b["y"]) < 2
    assert a["x"] >= b["x"] + b["width"] - 1
    assert a["y"] + a["height"] <= 720
    beyond = page.evaluate("""() => { const at = document.querySelector('.sw-lines');
        return at.scrollWidth - at.clientWidth }""")
    assert beyond <= 1
    photographed(page, "two-bodies")


def test_a_figure_is_that_of_the_part_that_is_zoomed_to(page, tmp_path):
    state_becomes(page, "waves_stale", False)
    page.locator("#spectrum_plot").press("+")
    low, high = page.evaluate("window.trame.utils.plots.shown.spectrum_plot.zoom")
    view = page.evaluate("window.trame.utils.skinwave.view()")
    assert f"spectrum_plot:{low:g}:{high:g}" in view
    page.locator("#save").click()
    with page.expect_download() as saved:
        page.locator("#save-column-svg").click()
    saved.value.save_as(tmp_path / "figure.svg")
    said = (tmp_path / "figure.svg").read_text()
    assert ">600<" not in said
    assert re.search(r'width="252(\.0*)?pt"', said)
    page.locator("#spectrum_plot").press("Home")


def test_what_is_saved_opens_again(bare, tmp_path):
    page = bare
    page.locator("#am-field").fill("95")
    query_has(page, "am=95")
    for item, start in (("scene-toml", b"name ="), ("waveform-csv", b'"time'),
                        ("waveform-wav", b"RIFF"), ("figure-svg", b"<?xml"),
                        ("figure-png", b"\x89PNG"),
                        ("report-html", b"<!doctype html>")):  # fmt: skip
        page.locator("#save").click()
        with page.expect_download() as saved:
            page.locator(f"#save-{item}").click()
        saved.value.save_as(tmp_path / item)
        assert (tmp_path / item).read_bytes().startswith(start), item
    assert loads((tmp_path / "scene-toml").read_text()).tacton.am_frequency == 95
    page.locator("#am-field").fill("96")
    query_has(page, "am=96")
    (tmp_path / "again.toml").write_bytes((tmp_path / "scene-toml").read_bytes())
    page.locator("#open").set_input_files(tmp_path / "again.toml")
    query_has(page, "am=95")


def test_plots_follow_a_slider_and_waves_come_with_a_body(page):
    choose(page, "body", "none")
    query_has(page, "body=none")
    choose(page, "body", "skin-slab")
    state_becomes(page, "waves_stale", False)
    page.wait_for_function("() => window.trame.state.get('wave_map').picture")
    shown = drawn(page, "waveform_plot")
    assert [curve["name"] for curve in shown] == ["kernel, same load, Pa", "waves (flat-body), µm"]
    page.locator(".sw-row:has(#am-field) [role=slider]").press("ArrowRight")
    query_has(page, "am=141")
    state_becomes(page, "waves_stale", False)
    assert len(drawn(page, "waveform_plot")) == 2
    photographed(page, "waves")


def test_themes_about_and_a_tablet(page):
    before = state(page, "dark")
    page.locator("#theme").click()
    page.wait_for_function("d => window.trame.state.get('dark') !== d", arg=before)
    page.locator("#about").click()
    page.get_by_text("Detection thresholds differ", exact=False).first.wait_for(state="attached")
    settled(page)
    photographed(page, "about")
    page.locator("#close-about").click()
    page.locator("#theme").click()
    page.set_viewport_size({"width": 820, "height": 1180})
    settled(page)
    wide = page.evaluate("document.documentElement.scrollWidth")
    photographed(page, "tablet")
    page.set_viewport_size({"width": 1280, "height": 720})
    assert wide <= 820


def test_a_spectrum_in_decibel_help_and_the_level_over_a_control(bare):
    bare.locator("#decibel").click()
    bare.wait_for_function(
        "() => window.trame.utils.plots.shown.spectrum_plot.figure.y.said.includes('dB re 1 Pa')"
    )
    bare.locator("#decibel").click()
    bare.locator("#help-speed").click()
    assert "surface waves" in bare.locator("#speed-help").inner_text()
    bare.locator("#help-speed").press("Enter")
    assert bare.locator("#speed-help").count() == 0
    bare.evaluate("() => window.trame.state.set('third', 'level by height')")
    bare.locator("#highest-level").wait_for()
    bare.locator("#highest-level").click()
    bare.wait_for_function("() => window.trame.state.get('height') !== 200")
    curve = drawn(bare, "spectrum_plot")[0]
    best = curve["x"][int(np.argmax(curve["y"]))]
    assert state(bare, "height") == pytest.approx(best, abs=0.01)
    photographed(bare, "level")
    bare.evaluate("() => window.trame.state.set('third', 'spectrum')")
    bare.wait_for_function(READY)


def test_one_button_plays_foci_and_cursors_and_cursors_are_shared(bare):
    value = "plot => window.trame.utils.plots.shown[plot].value"
    focus = "Number(document.querySelector('#kernel-map .sw-focus').getAttribute('cx'))"
    before = bare.evaluate(focus)
    bare.locator("#play").click()
    bare.wait_for_function("() => window.trame.utils.plots.shown.waveform_plot.value > 1")
    bare.wait_for_function(f"before => Math.abs({focus} - before) > 1", arg=before)
    bare.locator("#play").click()
    bare.wait_for_function("() => window.trame.state.get('phase') > 0")
    bare.wait_for_function(f"() => ({value})('waveform_plot') === null")
    bare.locator("#commanded_plot").hover(position={"x": 200, "y": 60})
    assert bare.evaluate(value, "waveform_plot") == bare.evaluate(value, "commanded_plot") > 0
    line = next(row for row in state(bare, "spectrum_plot")["names"])
    place = """x => { const plot = window.trame.utils.plots.shown.spectrum_plot, box = plot.box;
        const [low, high] = plot.zoom || plot.figure.x.range;
        return box.x + (x - low) / (high - low) * box.w }"""
    near = bare.evaluate(place, line["x"]) + 4  # pixels beside the peak
    bare.locator("#spectrum_plot").hover(position={"x": near, "y": 60})
    assert bare.evaluate(value, "spectrum_plot") == pytest.approx(line["x"], abs=1)


def test_a_measurement_is_shown_beside_the_models(bare, tmp_path):
    t = np.arange(0, 0.2, 5e-4)
    rows = "".join(f"{x:.4f},{np.sin(600 * x):.5f}\n" for x in t)
    (tmp_path / "mine.csv").write_text("t [s],u(10,0) [um]\n" + rows)
    bare.locator("#measurement").set_input_files(tmp_path / "mine.csv")
    bare.locator("#measured-said").wait_for()
    assert "measured at (10, 0) mm" in bare.locator("#measured-said").inner_text()
    assert [c["name"] for c in drawn(bare, "waveform_plot") if c["role"] == "measured"]
    (tmp_path / "bad.csv").write_text("a,b\n1,2\n")
    bare.locator("#measurement").set_input_files(tmp_path / "bad.csv")
    bare.locator("#problem").wait_for()
    assert "bad.csv" in bare.locator("#problem").inner_text()
    bare.evaluate("() => window.trame.state.set('measured_file', [])")
    bare.locator("#measured-said").wait_for(state="detached")


def test_bands_come_when_nothing_is_changed_and_go_with_the_next_change(browser):
    process, address = served("--port", "0")
    page, _ = opened(browser, address, "?body=none")
    done = "() => window.trame.state.get('uncertainty').some(said => said.includes('numerical'))"
    page.wait_for_function(done)
    band, kernel = drawn(page, "waveform_plot")
    assert band["name"] == "5 to 95 %"
    assert max(band["y"]) == pytest.approx(
        2 * max(kernel["y"]), rel=0.1
    )  # the pressure is known to 2
    assert max(band["low"]) == pytest.approx(0.5 * max(kernel["y"]), rel=0.1)
    assert "device 43 %" in page.locator("#uncertainty summary").inner_text()
    page.locator("#uncertainty summary").click()
    assert "focus.peak_pressure_pa" in page.locator("#uncertainty").inner_text()
    photographed(page, "bands")
    shade = "0,0,0,71" if not state(page, "dark") else "255,255,255,71"
    assert ink(page, "waveform_plot").get(shade, 0) > 500
    page.locator(".sw-row:has(#am-field) [role=slider]").press("ArrowRight")
    query_has(page, "am=141")
    page.wait_for_function("() => !window.trame.utils.plots.shown.waveform_plot.figure.data[0].low")
    assert ink(page, "waveform_plot").get(shade, 0) < 50
    page.close()
    ended(process)


def test_on_a_narrow_screen_all_of_the_bar_is_there_and_the_panel_is_not(page):
    right = "() => document.getElementById('controls').getBoundingClientRect().right"
    page.set_viewport_size({"width": 700, "height": 900})
    page.wait_for_function(f"{right} <= 0")
    beyond, wide = page.evaluate(
        """() => { const bar = document.querySelector('.v-toolbar__content');
        return [bar.scrollWidth - bar.clientWidth, document.documentElement.scrollWidth] }"""
    )
    photographed(page, "narrow")
    page.set_viewport_size({"width": 1280, "height": 720})
    page.wait_for_function(f"{right} > 300")
    assert beyond <= 0
    assert wide <= 700


@pytest.mark.parametrize("query", ["", "pulses=10/20&foci=2&paths=point/0/9/9,+line/9/0/0"])
def test_what_can_be_turned_has_a_name_for_a_screen_reader(page, query):
    page.evaluate("q => window.trame.trigger('restart', [q])", query)
    query_has(page, query.partition("&")[0])
    settled(page)
    nameless = page.evaluate(
        """() => [...document.querySelectorAll(
          'button, select, [role=slider], input:not([type=hidden])')]
        .filter(e => e.offsetParent && !(e.getAttribute('aria-label') || e.title || e.innerText
          || (e.labels && e.labels.length) || e.getAttribute('aria-labelledby')))
        .map(e => e.outerHTML.slice(0, 200))"""
    )
    assert nameless == []


def test_axe_finds_no_serious_violation(page):
    """In the panel with what opens in it, in a list that is open, and in the dark."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()

    def violations():
        settled(page)
        found = axe.run(page, options={"resultTypes": ["violations"], "preload": False})
        return [
            (each["id"], each["nodes"][0]["target"])
            for each in found.response["violations"]
            if each["impact"] in ("serious", "critical")
        ]

    query = "body=none&pulses=10/20&foci=2&paths=point/0/9/9,+line/9/0/0"
    page.evaluate("q => window.trame.trigger('restart', [q])", query)
    page.locator("#own").wait_for()
    page.locator("#help-am").click()
    page.locator("#pin").click()
    page.locator("#highest").press("ArrowDown")
    page.locator(".v-overlay [role=option]:visible").first.wait_for()
    assert violations() == []
    page.keyboard.press("Escape")
    page.locator("#help-am").click()
    page.locator("#pin").click()
    page.locator("#theme").click()
    assert violations() == []
    page.locator("#theme").click()


def test_two_pages_do_not_disturb_each_other_and_ask_nothing_of_the_network(
    browser, address, page, visit
):
    other, logs = opened(browser, address, "?am=60&shape=square&body=none")
    assert (state(other, "am"), state(other, "shape")) == (60, "square")
    other.locator("#size-field").fill("33")
    query_has(other, "size=33")
    assert state(page, "query") == ""
    page.locator("#am-field").fill("222")
    query_has(page, "am=222")
    assert state(other, "am") == 60
    other.close()
    own = address.partition("?")[0]
    for log in (visit[1], logs):
        assert log.errors == []
        elsewhere = [url for url in log.asked if not url.startswith((own, "data:", "blob:"))]
        assert elsewhere == []
