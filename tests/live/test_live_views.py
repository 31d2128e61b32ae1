"""Maps and views in three dimensions of the live page, and the view of a report."""

import json
from io import BytesIO

import matplotlib as mpl
import numpy as np
import pytest
from in_browser import needs_browser, settled
from PIL import Image

from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.load.spectrum import synthesise
from skinwave.report.turntable import focus_places, motion_lines, turntable
from skinwave.results.playback import played_part
from skinwave.results.views import kernel_view
from skinwave.scene.scene import BODIES, Scene

N, REACH = 45, 0.044  # places of a map either way, and how far they reach, m
BODY = """() => {
  const points = [], re = [], triangles = [];
  for (let j = 0, a = 0; j < 21; j++) for (let i = 0; i < 21; i++, a++) {
    points.push(4 * i - 40, 4 * j - 40, 0);
    re.push(1e-6 * Math.exp(-((i - 10) ** 2 + (j - 10) ** 2) / 9));
    if (i < 20 && j < 20) triangles.push(a, a + 1, a + 22, a, a + 22, a + 21);
  }
  window.view = openView(document.getElementById("view"));
  view.show({
    shape: { points: Float32Array.from(points), triangles: Uint32Array.from(triangles) },
    motion: { f: [100], re, im: re.map(() => 0) }, path: [[[-0.01, 0], [0.01, 0]]],
    foci: () => [[0, 0]],
  });
}"""
CHANGES = ("view.seek(0.005)", "view.above.click()", "view.home.click()")
LOAD = MovingPressure(
    tacton=Tacton(trajectory=Trajectory(shape="circle", size=0.02, speed=12.0), am_frequency=140.0)
)


def grid(of):
    x, y = np.meshgrid(*2 * [np.linspace(-REACH, REACH, N)])
    return f"Float32Array.from({json.dumps(of(x, y).ravel().tolist())})"


def picture(page, selector):
    return np.asarray(Image.open(BytesIO(page.locator(selector).screenshot())).convert("RGB"))


def draw(page, rms, **options):
    given = f"{{unit: 'm', ...{json.dumps(options)}, rms: {rms}}}"
    page.evaluate(f"drawMap(document.getElementById('map'), {given})")
    return picture(page, "#map")


@needs_browser
@pytest.mark.parametrize("kind", ["decibel", "signed"])
def test_colours_of_a_map(page, kind):
    scale, options = {
        "decibel": (lambda v: 1 + 20 * np.log10(v / 0.1) / 40, {"decibel": 40}),
        "signed": (lambda v: 0.5 + v / 0.2, {"signed": True}),
    }[kind]
    rms = grid(lambda x, y: np.where(y > 0, x + REACH, np.nan))
    drawn = draw(page, rms, largest=0.1, **options)
    table = mpl.colormaps["RdBu_r" if kind == "signed" else "cividis"]
    left, top, side = 32, 20, 400 - 42  # of the map in the canvas
    for x in (-0.02, 0.0, 0.03):
        at = left + round(side * (x + REACH) / (2 * REACH))
        expected = 255 * np.array(table(scale(x + REACH))[:3])
        np.testing.assert_allclose(drawn[top + side // 3, at], expected, atol=8)
        assert tuple(drawn[top + 2 * side // 3, at]) == (255, 255, 255)


@needs_browser
def test_contours(page):
    ends = page.evaluate(f"contours({grid(lambda x, y: np.hypot(x, y) - 0.015)}, {N})")
    places = REACH * (2 * np.reshape(ends, (-1, 2)) / (N - 1) - 1)
    np.testing.assert_allclose(np.hypot(*places.T), 0.015, atol=1e-4)
    along = np.linalg.norm(np.diff(ends, axis=1), axis=2).sum() * 2 * REACH / (N - 1)
    assert along == pytest.approx(2 * np.pi * 0.015, rel=0.01)


@needs_browser
def test_keys_and_pointer_select_points_of_a_map(page):
    draw(page, grid(lambda x, y: x), point=[0.01, 0.0], title="A < B", unit="Pa", largest=0.1)
    assert {"A < B", "0.100 Pa", "0 mm"} <= {*page.locator("#map text").all_text_contents()}
    page.evaluate("mapControls(document.getElementById('map'), (...at) => { window.at = at; })")
    page.focus("#map")
    for key, expected in (("ArrowRight", [0.011, 0.0]), ("Shift+ArrowDown", [0.011, -0.005])):
        page.keyboard.press(key)
        np.testing.assert_allclose(page.evaluate("at"), expected, atol=1e-9)
    assert "10, 0 mm: 0.0100 Pa" in page.get_attribute("#map", "aria-label")
    page.mouse.click(32 + 358 / 2, 20 + 358 / 4)
    np.testing.assert_allclose(page.evaluate("at"), [0.0, REACH / 2], atol=1e-3)


@needs_browser
def test_a_moving_body(page):
    page.evaluate(BODY)
    settled(page)
    assert "Exaggerated 3,000 times" in page.inner_text("#view")
    assert page.evaluate("view.loop") == pytest.approx(0.1)
    pictures = [picture(page, "#view canvas")]
    assert pictures[0].std() > 10  # not blank
    for change in CHANGES:
        page.evaluate(change)
        pictures.append(picture(page, "#view canvas"))
        assert np.abs(pictures[-1].astype(int) - pictures[-2]).max() > 30
    page.focus("#view canvas")
    page.keyboard.press("Space")
    page.wait_for_function("view.time > 0.006")


def test_lines_of_periodic_motion():
    t, k = np.arange(40) / 40 * 0.02, np.arange(7)
    frames = np.cos(2 * np.pi * 150 * t[:, None] + k) + 0.2 * np.sin(2 * np.pi * 400 * t)[:, None]
    f, lines = motion_lines(frames, 0.02)
    assert f.tolist() == pytest.approx([150, 400])
    np.testing.assert_allclose(synthesise(f, lines, t), frames, atol=1e-9)


def test_foci_on_the_path():
    times = np.linspace(0, 0.05, 5)
    paths, foci = focus_places(LOAD, times)
    np.testing.assert_allclose(np.hypot(*paths[0].T), 0.01)
    np.testing.assert_allclose(foci[:, 0], LOAD.tacton.trajectory.position(times), atol=1e-12)


@needs_browser
def test_the_view_of_a_report(browser, tmp_path):
    scene = Scene(name="s", pressure=LOAD, body=BODIES["skin-slab"], probes=((0.0, 0.0),))
    view = kernel_view(scene, np.array([0.03, 0.03]), played_part(LOAD, 420.0))
    (tmp_path / "view.html").write_text(turntable(view, 1), encoding="utf-8")
    page, requests, errors = browser.new_page(), [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "view.html").as_uri())
    page.wait_for_selector("canvas[data-time]")
    time = page.evaluate("Number(document.querySelector('canvas').dataset.time)")
    assert time >= view.times[1] - 1e-9
    assert picture(page, "canvas").std() > 3
    page.close()
    assert len(requests) == 1
    assert errors == []
