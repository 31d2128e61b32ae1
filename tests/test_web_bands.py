"""Bands on a page: samples of what is uncertain, aside, and what is then to be seen."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from simple_model import sensation_level
from skinwave.cli import main
from skinwave.scene import BODIES
from skinwave.scene_file import dumps
from skinwave.simulation import compute
from skinwave.spreads import OF_PRESETS, PRESSURE, known_to, spreads_of, with_values
from skinwave.uncertainty.propagate import propagate
from skinwave.uncertainty.sampling import samples
from skinwave.web import band_worker, bands, controls, moves, plots, scenes, waves
from skinwave.web.bands import Bands, Sampler
from skinwave.web.controls import STARTS
from skinwave.web.session import told


def scene_of(**values):
    return scenes.scene_of(STARTS | {"duration": 0.2, "body": "skin-slab"} | values)


def answer(scene):
    return waves.BodyResponses()(scene, lambda *_: None)


def all_of(scene, central, count=6):
    return [found for found in Sampler(count)(scene, central) if found is not None]


def test_samples_are_those_of_the_command_line(monkeypatch):
    """Waveforms by tables, from rest, have the lines of steady wavenumber integrals."""
    scene, seen = scene_of(duration=0.4), []
    kept = bands._seen
    monkeypatch.setattr(bands, "FIRST", 3)
    monkeypatch.setattr(bands, "_seen", lambda *given: seen.append(kept(*given)) or seen[-1])
    first, second, last = all_of(scene, compute(scene, "flat-body"))
    ensemble = propagate(scene, 6)
    levels = np.array([each.levels for each in seen[1:]])  # the first is of the central values
    names = ensemble.method.lines
    strong = [k for k, name in enumerate(names) if name in ("f_AM", "f_d", "2f_d-f_AM", "2f_d")]
    hertz = np.array([140.0, scene.tacton.drawing_frequency])
    exact = sensation_level(ensemble.lines[:, [names.index("f_AM"), names.index("f_d")], 0], hertz)
    found = levels[:, [names.index("f_AM"), names.index("f_d")]]
    assert found == pytest.approx(exact, abs=0.1)
    assert len(strong) == 4
    low, high = np.percentile(levels[:, strong[0]], (5, 95))
    assert last.levels[names[strong[0]]] == pytest.approx((low, high))
    assert (first.done, second.done, last.done) == (3, 6, 6)
    assert "numerical below 0.50 %; one standard deviation of the material" in last.sentences[0]
    assert "loss_scale" in last.sentences[1]
    assert "in nine of ten samples" in last.sentences[2]
    assert (last.waveform[0] <= last.waveform[1]).all()
    assert last.spectrum.shape == (2, len(last.frequencies))


@pytest.mark.parametrize("body", ["none", "palm"])
def test_motion_is_in_proportion_to_the_pressure(body):
    """Known to a factor of 2: 5 and 95 % are half and twice as much."""
    scene = scene_of(body=body)
    central = compute(scene, "point-kernel")
    central = replace(central, effort=replace(central.effort, seconds={"reduce": 30.0}))
    last = all_of(scene, central, 64)[-1]
    for k, factor in enumerate((0.5, 2.0)):
        middle = np.abs(central.values[:, 0])
        assert np.abs(last.waveform[k if body else 0]) == pytest.approx(
            factor * middle, rel=0.1, abs=1e-6 * middle.max()
        )
    costly = [said for said in last.sentences if "would be computed" in said]
    assert len(costly) == (body == "palm")
    assert all("about 32 min; skinwave run --samples 64" in said for said in costly)


def test_sheets_are_sampled_by_their_modes():
    scene = scene_of(body="paper-sheet-loose")
    last = all_of(scene, compute(scene, "plate-modes-transient"))[-1]
    spreads = spreads_of(scene)
    assert {s.part for s in spreads} == {"material", "device"}
    rows = samples(spreads, 6).tolist()
    each = [
        compute(with_values(scene, {s.key: x for s, x in zip(spreads, row, strict=True)}),
                "plate-modes-transient").values[:, 0] for row in rows
    ]  # fmt: skip
    np.testing.assert_allclose(last.waveform, np.percentile(each, (5, 95), axis=0), atol=1e-12)
    assert np.abs(last.waveform[:, 0]).max() < 0.01 * np.abs(last.waveform).max()
    assert last.levels == {}  # paper is no skin
    assert "material not computed" not in last.sentences[0]


def test_nothing_uncertain_has_no_bands():
    exact = scenes.FileSpreads(given=((PRESSURE, known_to(1.0)),), body="none")
    scene = scenes.scene_of(STARTS | {"body": "none"}, None, exact)
    assert spreads_of(scene) == ()
    (found,) = all_of(scene, compute(scene, "point-kernel"))
    assert not found.times.size
    assert found.sentences[0].startswith("Uncertainty: no bands")


class Pipe:
    """What a page says, by the times that are left for it while samples are computed."""

    def __init__(self, *said):
        self.said, self.sent = list(said), []

    def recv(self):
        if not self.said:
            raise EOFError
        return self.said.pop(0)

    def poll(self, wait=0.0):
        if self.said and self.said[0] == "later":
            self.said.pop(0)
            return False
        return bool(self.said)

    def send(self, content):
        self.sent.append(content)


@pytest.fixture
def at_once(monkeypatch):
    monkeypatch.setattr(band_worker, "end_with_parent", lambda: None)
    monkeypatch.setattr(band_worker.os, "nice", lambda _: None)


def test_only_the_newest_request_is_sampled_and_a_change_ends_it(monkeypatch, at_once):
    begun = []

    def sampler(self, scene, response):
        begun.append(scene)
        if scene == "wrong":
            raise ValueError("no\nscene")
        yield from (f"{scene} some", None, f"{scene} all")

    monkeypatch.setattr(Sampler, "__call__", sampler)
    pipe = Pipe((1, "old", None), (2, "a", None), "later", "later", (3, "b", None), None, "later",
                (4, "wrong", None), "later", (5, "c", None))  # fmt: skip
    band_worker.sample_forever(pipe, 6)
    assert begun == ["a", "wrong", "c"], "the old one, and that which was cancelled, are not begun"
    assert pipe.sent == [
        ("bands", 2, "a some"), ("no bands", 4, "no bands: no scene"),
        ("bands", 5, "c some"), ("bands", 5, "c all"),
    ]  # fmt: skip


@pytest.fixture
def session(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    made = session_of(get_server(request.node.name, client_type="vue3"), samples=6)
    made.state.ready()
    made.worker, made.sampler = Mock(), Mock()
    return made


def planted(response):
    """Bands half and twice as large as a response."""
    u = response.values[:, 0]
    f = np.linspace(0, 1000, 200)
    ends = np.sort([0.5 * u, 2 * u], axis=0)
    return Bands(times=response.times, waveform=ends, frequencies=f,
                 spectrum=np.array([[1e-7], [3e-7]]) * np.ones(200), levels={"f_d": (-3.2, 11.8)},
                 done=64, sentences=("first", "second"))  # fmt: skip


def test_bands_are_asked_for_after_the_waves_and_go_with_the_next_change(session):
    session._loop = Mock(call_later=lambda _, call: call() or Mock())
    found = answer(session.scene)
    assert not session.sampler.ask.called
    with session.state:
        told(session, "answer", session.number, found)
    (number, scene, response), _ = session.sampler.ask.call_args
    assert (number, scene, response) == (session.number, session.scene, found.response)
    with session.state:
        told(session, "bands", session.number - 1, planted(response))
    assert session.state.uncertainty == []
    with session.state:
        told(session, "bands", session.number, planted(response))
    assert session.state.uncertainty == ["first", "second"]
    band, *_ = session.state.waveform_plot["data"]
    wave = session.state.waveform_plot["data"][-1]
    assert band["name"] == "5 to 95 %"
    assert (band["role"], band["axis"]) == ("waves", "y2")
    assert max(band["y"]) == pytest.approx(2 * max(wave["y"]), rel=1e-3)
    assert max(band["y"]) < session.state.waveform_plot["y2"]["range"][1]
    assert session.state.spectrum_plot["data"][0]["low"][:2] == pytest.approx([0.1, 0.1])
    row = next(row for row in session.state.rows if row["name"] == "f<sub>d</sub>")
    assert row["band"] == "-3 to +12"
    session.sampler.reset_mock()
    with session.state:
        told(session, "answer", session.number, found)  # once more, with the motion of the body
    assert not session.sampler.ask.called
    with session.state:
        session.state.am = 150
    assert session.sampler.cancel.called
    assert session.bands is None
    assert "low" not in session.state.waveform_plot["data"][0]


def test_a_page_of_no_samples_asks_for_no_bands(session):
    session._loop, session.samples = Mock(), 0
    with session.state:
        told(session, "answer", session.number, answer(session.scene))
    assert not session.sampler.ask.called


@pytest.mark.parametrize("count", ["-1", "1", "1001"])
def test_a_number_of_samples_without_bands_is_refused(capsys, count):
    assert main(["web", "--port", "0", "--samples", count]) == 2
    assert f"--samples = {count} is outside 2..1000; give 0 for" in capsys.readouterr().err


def test_a_band_beyond_all_others_does_not_hide_the_curve(session):
    response = answer(session.scene).response
    wide = planted(response)
    wide = replace(wide, waveform=50 * wide.waveform)
    curves = plots.Curves(kernel=session.kernel, waves=answer(session.scene), bands=wide)
    plot = plots.waveform_plot(curves, (0.0, 0.06))
    largest = max(map(abs, plot["data"][-1]["y"]))
    assert plot["y2"]["range"][1] < 3 * largest


def test_spreads_of_a_scene_file_hold_while_its_body_is_chosen(session):
    given = scene_of()
    spread = (("body.thickness_mm", known_to(1.5)), ("focus.height_mm", known_to(1.1)))
    body = replace(given.body, depth=0.012)
    text = dumps(replace(given, body=body, spreads=spread))
    with session.state:
        moves.open_scene(session, text)
    assert session.state.problem == ""
    assert session.good["body"] == controls.OWN_BODY
    assert dict(session.scene.spreads) == dict(spread)
    assert {"body.thickness_mm", "focus.height_mm"} < {s.key for s in spreads_of(session.scene)}
    with session.state:
        session.state.am = 150
    assert dict(session.scene.spreads) == dict(spread)
    with session.state:
        session.state.body = "palm"
    assert [key for key, _ in session.scene.spreads] == ["focus.height_mm"]
    assert BODIES["palm"].material in OF_PRESETS
