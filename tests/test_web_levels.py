"""What the interactive tool tells beside its curves: thresholds, levels over a control, dB,
differences, measurements, examples, help.
"""

import base64
import re
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from markupsafe import escape
from PIL import Image

from simple_model import sensation_level
from skinwave.effort import silent
from skinwave.patterns import Options
from skinwave.patterns.conversion import write_pattern
from skinwave.web import (
    controls,
    downloads,
    drawings,
    layer_values,
    level_view,
    levels,
    measured,
    model,
    plots,
    scenes,
    waves,
)  # fmt: skip
from skinwave.web.controls import STARTS
from skinwave.web.examples import EXAMPLES
from skinwave.web.help import BAR, HELP
from skinwave.web.plots import Curves

AT_20 = STARTS | {"x": 20.0, "duration": 0.5}


@pytest.fixture(scope="module")
def responses():
    return waves.BodyResponses()


@pytest.fixture(scope="module")
def shown(responses):
    """A scene on the skin slab with the kernel's response and the waves."""
    scene = scenes.scene_of(AT_20)
    return scene, model.kernel(scene), responses(scene, silent)


def test_levels_of_steady_lines_are_those_of_the_lines_in_the_response(responses, shown):
    scene, kernel, found = shown
    highest = max(line.sensation for line in found.lines)
    assert responses.level(scene) == pytest.approx(highest, abs=0.1)
    in_pressure = [
        sensation_level(line.amplitude, line.frequency, unit="Pa")
        for line in kernel.lines if line.frequency > 0
    ]  # fmt: skip
    assert levels.kernel_level(scene) == pytest.approx(max(in_pressure), abs=0.1)


def test_levels_of_waves_are_known_at_all_heights_whose_tables_are_made_where_they_lack(shown):
    """The present height is of one range of tables, most that are shown of another."""
    own = waves.BodyResponses()
    own(shown[0], silent)
    _, scene_of_each = level_view.variants("level by height", AT_20)
    some = slice(None, None, 6)
    known = np.array([own.level(scene) for scene in scene_of_each[some]])
    assert np.isfinite(known).all()
    for scene, level in list(zip(scene_of_each[some], known, strict=True))[:2]:
        lines = own(scene, silent).lines
        assert level == pytest.approx(max(line.sensation for line in lines), abs=0.1)
    assert scene_of_each[0].pressure.height < 0.16 < scene_of_each[-1].pressure.height
    at_depth = scenes.scene_of(AT_20 | {"depth": 2.0})
    assert np.isnan(own.level(at_depth)), "a threshold is that of the surface"


def test_the_highest_level_is_of_waves_only_where_all_of_theirs_are_known(shown):
    found, _ = level_view.variants("level by size", AT_20)
    waves_of = found.kernel[::-1].copy()
    whole = replace(found, waves=waves_of)
    assert (whole.of, whole.best) == ("waves", found.at[waves_of.argmax()])
    assert "(highest: waves)" in level_view.level_plot(whole, shown[2])["title"]
    partly = waves_of.copy()
    partly[:-1] = np.nan
    part = replace(found, waves=partly)
    assert (part.of, part.best) == ("kernel", found.best)
    plot = level_view.level_plot(part, shown[2])
    assert "(highest: kernel)" in plot["title"]
    assert any(f"(at 1 of {len(found.at)})" in curve["name"] for curve in plot["data"])
    assert plot["names"][0]["y"] == pytest.approx(max(found.kernel), abs=1e-3)


def test_the_sentence_on_what_is_above_threshold_says_what_line_and_map_say(shown):
    scene, kernel, found = shown
    line = max(found.lines, key=lambda each: each.sensation)
    away, beyond = levels.reach(scene, found.map)
    said = levels.above_threshold(scene, (kernel, found))
    assert f"{line.sensation:+.0f} dB SL at {line.frequency:.0f} Hz" in said
    assert f"from the path {'beyond' if beyond else 'out to'} {1e3 * away:.0f} mm" in said
    assert ("yes" in said) == (line.sensation >= 0)
    # The contour of threshold lies as far from the circle, on its own axis.
    outermost = max(np.hypot(*contour.T).max() for contour in found.map.threshold)
    assert away == pytest.approx(outermost - 0.01, abs=1e-4)


def test_nothing_is_above_threshold_of_silence_and_nothing_is_said_of_paper(responses):
    silence = scenes.scene_of(AT_20 | {"amplitude": 0.0})
    kernel = model.kernel(silence)
    found = responses(silence, silent)
    assert levels.reach(silence, found.map) is None
    assert "no, next to nothing moves" in levels.above_threshold(silence, (kernel, found))
    paper = scenes.scene_of(AT_20 | {"body": "paper-sheet-loose"})
    assert levels.above_threshold(paper, (kernel, found)) == ""
    assert levels.above_threshold(paper, (kernel,)) == "", "nor while its waves are computed"


@pytest.mark.parametrize("view", level_view.LEVELS)
def test_a_curve_of_levels_goes_through_the_present_value(responses, shown, view):
    found, own = level_view.variants(view, AT_20)
    at = int(np.flatnonzero(found.at == found.current)[0])
    assert found.kernel[at] == pytest.approx(levels.kernel_level(shown[0]))
    assert responses.level(own[at]) == pytest.approx(responses.level(shown[0]))
    assert found.best == found.at[found.kernel.argmax()]
    plot = level_view.level_plot(found, None)
    key, low, high = level_view.LEVELS[view]
    assert controls.NUMBERS[key].unit in plot["x"]["said"]
    assert plot["x"]["range"] == [low, high]
    assert plot["names"][0]["x"] == found.best


def test_a_spectrum_in_decibel_has_the_same_lines(shown):
    _, kernel, found = shown
    linear = plots.spectrum_plot(Curves(kernel=kernel, waves=found), 600.0)
    decibel = plots.in_decibel(linear)
    for before, after in zip(linear["data"], decibel["data"], strict=True):
        low = decibel[after["axis"]]["range"][0]
        seen = np.array(after["y"]) > low + 0.1
        amplitude = 10 ** (np.array(after["y"])[seen] / 20)
        assert amplitude == pytest.approx(np.array(before["y"])[seen], rel=2e-3)
    assert decibel["y"]["said"] == "pressure, dB re 1 Pa"
    assert decibel["y2"]["said"].endswith("dB re 1 µm")


def test_a_difference_of_maps_has_the_sign_of_what_moves_more(shown):
    _, kernel, found = shown

    def colours(url):
        return np.asarray(Image.open(BytesIO(base64.b64decode(url.partition(",")[2]))), float)

    same = colours(drawings.difference(found.map, found.map))[..., :3]
    assert np.ptp(same) < 1
    image = colours(drawings.difference(found.map, kernel.map))[::-1, :, :3]
    relative = [each.map.rms / each.map.rms.max() for each in (found, kernel)]
    more = 20 * np.log10(
        np.maximum(relative[0], drawings.LEAST) / np.maximum(relative[1], drawings.LEAST)
    )
    reddish = image[..., 0] - image[..., 2]
    assert (reddish[more > 3] > 0).all()
    assert (reddish[more < -3] < 0).all()
    assert (more > 3).any()


def test_a_measurement_is_drawn_at_the_place_nearest_the_point(shown):
    _, kernel, found = shown
    t = np.arange(0, 0.5, 2.5e-4)
    text = "t [s],u(10,0) [um],u(19,1) [um]\n" + "".join(
        f"{x:.6f},{np.sin(2 * np.pi * 140 * x):.6f},{0.5 * np.sin(2 * np.pi * 100 * x):.6f}\n"
        for x in t
    )
    known = measured.read("mine.csv", text.encode())
    curves = Curves(kernel=kernel, waves=found, measured=known)
    own = [c for c in plots.spectrum_plot(curves)["data"] if c["role"] == "measured"]
    assert len(own) == 1
    strongest = int(np.argmax(own[0]["y"]))
    assert own[0]["x"][strongest] == pytest.approx(100.0, abs=2)
    assert own[0]["y"][strongest] == pytest.approx(0.5, rel=0.01)
    waveform = [
        c for c in plots.waveform_plot(curves, (0.0, 0.06))["data"] if c["role"] == "measured"
    ]
    assert max(waveform[0]["y"]) == pytest.approx(0.5, rel=0.01)
    with pytest.raises(ValueError, match="mine.xyz"):
        measured.read("mine.xyz", b"1, 2")


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_set_what_the_controls_take(name):
    values, refused = controls.from_query(EXAMPLES[name].query)
    assert not refused
    scenes.scene_of(values)


def test_there_is_help_at_each_control():
    """On the page itself, at each that can be turned, chosen or opened."""
    pytest.importorskip("trame_vuetify")
    from skinwave.web import layout

    beside = {"hold", "published", "opened", "measured_file"}
    assert set(HELP) == set(controls.KEYS) | set(layer_values.PARTS) | beside
    page = layout.rendered()
    for key, said in HELP.items():
        assert str(escape(said)) in page, key
    for key in (set(HELP) - {"layers"}) - set(layer_values.PARTS):
        assert f'id="help-{key}"' in page, key
    for part in layer_values.PARTS:
        assert f':id="`help-{part}-${{k}}`"' in page, part
    bar = page[page.index("<VAppBar ") : page.index("</VAppBar>")]
    named = set(re.findall(r'(?<![:\w])id="([\w-]+)"', bar))
    aside = {"help-bar", "highest-level", "redo", "swap", "theme", "about"}  # what others say, too
    inside = {name for name in named if name.startswith(("preset-", "save-")) or name in HEARD}
    assert named - aside - inside == set(BAR)
    for key, (_, said) in BAR.items():
        assert str(escape(said)) in page, key


HEARD = {"hear"}  # in the menu of what is saved


@pytest.mark.parametrize("suffix", downloads.PATTERNS)
def test_patterns_are_saved_as_they_are_converted(suffix):
    scene = scenes.scene_of(STARTS | {"am": 0.0})
    assert downloads.pattern_of(scene, suffix) == write_pattern(scene, suffix, Options())[0]
