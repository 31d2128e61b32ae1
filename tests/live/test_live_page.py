"""The live page: its assembly, its records, and its behaviour in a browser."""

import json
import re

import numpy as np
import pytest
from in_browser import frames, needs_browser

from skinwave.commands.cli import main
from skinwave.live.html_file import json_for_script, page, policy
from skinwave.live.records import body_of, editables, record_of, toml_of, with_changes
from skinwave.live.values import control_values, presets
from skinwave.scene.file import loads
from skinwave.scene.scene import BODIES

SCENE = """
name = "circle on skin"
[tacton]
am_frequency_hz = 140
shape = "circle"
size_mm = 20
speed_m_per_s = 12
duration_s = 0.5
[body]
preset = "skin-slab"
[probes]
points_mm = [[10, 0]]
"""
SET = {
    "": {"shape": "circle", "size": 20.0, "speed": 12.0, "am": 140.0, "x": 10.0},
    "centre_mm = [5, 0]": {"paths": "circle/20/5/0", "foci": 1, "drawn": 190.985932},
    "foci = [0, 0.25]": {"foci": 2, "phases": "0, 25"},
    "rhythm.pulses_ms = [[100, 50]]\nrhythm.ramp_ms = 5": {"pulses": "100/50", "ramp": 5.0},
}


def test_data_cannot_end_its_script():
    text = json_for_script({"name": "</script><!--é"})
    assert "<" not in text
    assert json.loads(text) == {"name": "</script><!--é"}
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_for_script({"x": np.nan})


def test_only_a_served_page_may_send_requests():
    assert "connect-src 'none'" in policy("")
    assert "connect-src 'self'" in policy("", served=True)
    data = {"bodies": [], "start": {}, "presets": [], "selftest": [], "api": None}
    text = page(data)
    assert not re.search(r'(src|href)="(?!data:)[^"#]', text.partition("<script")[0])


def test_values_of_scenes():
    titles = [each["title"] for each in presets()]
    assert len(titles) == 15 + 4
    assert {"AM 140 Hz", "Circle 10 mm at 6 m/s", "AM 140 Hz + circle 20 mm at 12 m/s"} <= {*titles}
    for tacton, expected in SET.items():
        found = control_values(loads(SCENE.replace("[body]", f"{tacton}\n[body]")), "skin-slab")
        assert expected.items() <= found.items()
    for more in ("depth_mm = 1", 'quantity = "strain_zz"', '[load]\nkind = "shear"'):
        with pytest.raises(ValueError, match="no control|pressure"):
            control_values(loads(SCENE + more), "skin-slab")


@pytest.mark.parametrize("name", ["palm-layers", "paper-sheet"])
def test_each_value_of_a_body_can_be_changed(name):
    body = BODIES[name]
    assert body_of(toml_of(body)) == body
    for each in editables(body):
        if each.choices:
            continue
        other = each.value * 1.2 + 0.01
        found = {new.key: new.value for new in editables(with_changes(body, {each.key: other}))}
        assert found[each.key] == pytest.approx(other, rel=1e-3)
        assert with_changes(body, {each.key: each.value}) == body
    both = {"layers.1.modulus": 140.0, "layers.1.thickness": 2.0}
    if name == "palm-layers":
        before, after = (
            {each.key: each.value for each in editables(each)}
            for each in (body, with_changes(body, both))
        )
        assert {key for key in before if after[key] != pytest.approx(before[key])} == both.keys()


def test_invalid_changes_are_refused():
    for changes in ({"width": 3}, {"modulus": "3"}, {"modulus": float("nan")}, {"modulus": -3},
                    {"base": "glued"}, {"base": "free", "sides": "free"}):  # fmt: skip
        with pytest.raises(ValueError, match=r"width|modulus|base|free|unconst"):
            with_changes(BODIES["skin-slab"], changes)


def test_the_record_of_a_body():
    slab, sheet = (record_of(BODIES[name], {}) for name in ("skin-slab", "paper-sheet"))
    assert (slab["extent_mm"], slab["thickness_mm"]) == (None, None)
    assert sheet["extent_mm"] == [74.0, 52.5]
    assert sheet["thickness_mm"] == pytest.approx(0.13375)
    branches = slab["dispersion"]["branches"]
    assert {len(branch["c"]) for branch in branches} == {len(slab["dispersion"]["f"])}
    assert any(3 < (branch["c"][-1] or 0) < 8 for branch in branches)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    (folder / "circle.toml").write_text(SCENE)
    command = ["live", str(folder / "circle.toml"), "-o", str(folder / "live.html"), "--quiet"]
    assert main(command) == 0
    return folder / "live.html"


def test_the_command_writes_one_file(file, capsys, tmp_path):
    data = json.loads(re.search(r'id="data">(.*?)</script>', file.read_text(), re.DOTALL)[1])
    assert [body["name"] for body in data["bodies"]] == ["skin-slab"]
    assert data["start"]["am"] == 140
    assert data["presets"][0]["title"] == "circle on skin"
    assert len(data["selftest"]) == 60
    assert file.stat().st_size < 1.5e6
    (tmp_path / "bad.toml").write_text("[tacton]\nshape = 3\n")
    for words, out in (([], file), ([str(tmp_path / "bad.toml")], tmp_path / "a.html")):
        assert main(["live", *words, "-o", str(out)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "a.html").exists()
    assert sorted(path.name for path in file.parent.iterdir()) == ["circle.toml", "live.html"]


@pytest.fixture
def opened(browser, file):
    made = []

    def opening(width=1280, height=800, part=""):
        tab = browser.new_page(viewport={"width": width, "height": height}, reduced_motion="reduce")
        made.append(tab)
        tab.messages = []
        tab.on("console", lambda message: tab.messages.append(message.text))
        tab.on("pageerror", lambda error: tab.messages.append(str(error)))
        # The program of the worker is a part of the page, not of the network.
        tab.on("request", lambda request: request.url.startswith("blob:")
               or tab.messages.append(request.url))  # fmt: skip
        tab.goto(f"{file.as_uri()}{part}")
        tab.locator("#wave-map image, #problem:not(:empty)").first.wait_for(state="attached")
        return tab

    yield opening
    for tab in made:
        tab.close()


def tiles(tab):
    tab.locator("#tiles[aria-busy=false]").wait_for(state="attached")
    return tab.inner_text("#tiles")


@needs_browser
def test_it_works_from_a_file_and_passes_its_self_test(opened, file):
    tab = opened(part="#selftest")
    tab.locator("#selftest-title", has_text="largest error").wait_for(timeout=60_000)
    assert float(tab.get_attribute("#selftest-title", "data-error")) < 0.01
    assert "191 Hz" in tiles(tab)
    assert tab.messages == [file.as_uri()]


@needs_browser
@pytest.mark.parametrize("width", [1280, 390])
def test_accessibility_and_size(opened, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    tab = opened(width=width)
    found = axe.run(tab, options={"resultTypes": ["violations"], "preload": False}).response
    serious = [each for each in found["violations"] if each["impact"] in ("serious", "critical")]
    assert [(each["id"], each["nodes"][0]["target"]) for each in serious] == []
    root = tab.evaluate("(({ scrollWidth, scrollHeight }) => [scrollWidth, scrollHeight])"
                        "(document.documentElement)")  # fmt: skip
    assert root[0] <= width
    assert width == 390 or root[1] <= 800, "one screen holds all"


@needs_browser
def test_controls_and_undo(opened):
    tab = opened()
    before = tiles(tab)
    tab.get_by_role("slider", name="Drawing speed").first.focus()
    tab.keyboard.press("ArrowRight")
    tab.locator("#tiles", has_text="193 Hz").wait_for()
    assert "speed=12.1" in tab.evaluate("location.href")
    tab.keyboard.press("Control+z")
    assert tiles(tab) == before
    tab.fill("#am-field", "fast")
    assert tab.inner_text("#problem")
    assert tab.get_attribute("#am-field", "aria-invalid") == "true"
    assert tiles(tab) == before
    tab.fill("#am-field", "140")
    assert tiles(tab) == before
    assert tab.inner_text("#problem") == ""
    own = level(tab)
    tab.click("#tab-level")
    tab.click("#best:enabled")
    frames(tab, 2)
    assert "speed=" in tab.evaluate("location.href")
    assert level(tab) >= own


@needs_browser
def test_a_preset_is_compared_with_a_pinned_result(opened):
    tab = opened()
    tab.click("#pin")
    tab.click("[popovertarget=presets]")
    tab.get_by_role("button", name="AM 80 Hz", exact=True).click()
    rows = tab.locator("#ab tr", has_text="AM frequency")
    rows.get_by_text("80 Hz").wait_for()
    tab.click("#swap")
    tab.locator("#tiles", has_text="191 Hz").wait_for()
    assert "80 Hz" in rows.locator("td").first.inner_text()


def level(tab):
    shown = tab.inner_text("#tiles .value >> nth=2").removesuffix(" dB")
    return int(shown.replace("\N{MINUS SIGN}", "-"))


@needs_browser
def test_saved_files_and_a_measurement(opened, tmp_path):
    tab = opened()
    for title, held in (("Maps and plots, SVG", "<svg"), ("Scene, TOML", "speed_m_per_s = 12")):
        tab.click("[popovertarget=save]")
        with tab.expect_download() as saved:
            tab.get_by_role("button", name=title).click()
        assert held in saved.value.path().read_text(encoding="utf-8")
    file = tmp_path / "measured.csv"
    rows = "".join(f"{1e-4 * k:.4f},{np.sin(0.1 * k):.4f}\n" for k in range(600))
    file.write_text("time [s],displacement [µm]\n" + rows, encoding="utf-8")
    tab.set_input_files("#measurement", file)
    tab.locator("#waveform .is-measured").first.wait_for(state="attached")
    tab.evaluate("document.querySelector('#files').open = true")
    tab.click("#measured-clear")
    tab.locator("#waveform .is-measured").first.wait_for(state="detached")


@needs_browser
def test_waves_move_beside_a_kernel_that_is_silent_outside(opened):
    tab = opened()
    tab.click("#play")
    pixels = """() => ["kernel-map", "wave-map"].map((id) => {
      const canvas = document.getElementById(id).previousElementSibling, n = canvas.width;
      const { data } = canvas.getContext("2d").getImageData(0, Math.floor(n / 10), n, 1);
      return [...data].join();
    })"""
    before = tab.evaluate(pixels)
    tab.wait_for_function(f"(before) => ({pixels})()[1] !== before[1]", arg=before)
    assert tab.evaluate(pixels)[0] == before[0]
    tab.click("[popovertarget=save]")
    with tab.expect_download() as saved:
        tab.get_by_role("button", name="Maps and plots, SVG").click()
    assert saved.value.path().read_text(encoding="utf-8").count("<image") == 4  # maps and bars
    assert tab.locator("#wave-map image").count() == 2  # the map, in the picture that is saved
    assert "1 s shows 12 ms" in tab.inner_text("#phase-text")
    assert [said for said in tab.messages[1:] if "readback" not in said] == []


@needs_browser
def test_a_session_keeps_both_results(opened, tmp_path):
    tab = opened()
    tab.click("#pin")
    tab.fill("#am-field", "80")
    tab.keyboard.press("Tab")
    tab.click("[popovertarget=save]")
    with tab.expect_download() as saved:
        tab.get_by_role("button", name="Session").click()
    file = tmp_path / "session.json"
    saved.value.save_as(file)
    other = opened()
    other.set_input_files("#session", file)
    other.locator("#notice", has_text="is open").wait_for()
    other.click("#tab-ab")
    tab.click("#tab-ab")
    assert tiles(other) == tiles(tab)
    assert other.inner_text("#ab") == tab.inner_text("#ab")
    wrong = tmp_path / "wrong.json"
    wrong.write_text('{"format": "skinwave live session", "b": {"am": "fast"}}')
    other.set_input_files("#session", wrong)
    other.locator("#problem", has_text="is not a number").wait_for()


@needs_browser
def test_a_saved_scene_opens_again(opened, tmp_path):
    part = (
        "#am=93&shape=polyline&polyline=0/0, 10/5, 12/-3&foci=2&phases=0, 30&pulses=100/50&x=4&y=-2"
    )
    tab = opened(part=part)
    tab.click("[popovertarget=save]")
    with tab.expect_download() as saved:
        tab.get_by_role("button", name="Scene, TOML").click()
    saved.value.save_as(tmp_path / "scene.toml")
    other = opened()
    other.set_input_files("#session", tmp_path / "scene.toml")
    other.locator("#notice", has_text="is open").wait_for()
    assert other.evaluate("location.hash") == tab.evaluate("location.hash")
    (tmp_path / "other.toml").write_text('name = "other"\n')
    other.set_input_files("#session", tmp_path / "other.toml")
    other.locator("#problem", has_text="skinwave web").wait_for()
