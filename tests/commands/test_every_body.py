"""Every kind of body at every door: a result with all its parts, or a sentence on what it lacks."""

import corpus
import pytest

from skinwave.bodies import KINDS
from skinwave.commands.cli import main
from skinwave.report.renderer import renderer
from skinwave.results import playback
from skinwave.studies import assumptions

SCENE = """
[tacton]
am_frequency_hz = 150
duration_s = 0.05
shape = "circle"
size_mm = 4
speed_m_per_s = 2
[probes]
points_mm = [[0, 0], [4, 0]]
[body]
"""
SMALL = "size_x_mm = 24\nsize_y_mm = 24\nthickness_mm = {}\n"
LAYER = '[[body.layers]]\nthickness_mm = 2\nmaterial = "dermis"\n'
BODY = {
    "sheet": 'kind = "sheet"\nmaterial = "paper"\n' + SMALL.format(0.2),
    "slab": SMALL.format(6) + 'sides = "clamped"\n',
    "layers": SMALL.format(8) + 'sides = "clamped"\n' + LAYER,
    "half-space": "thickness_mm = inf\n",
    "disc": 'kind = "disc"\nmaterial = "ecoflex"\nsides = "free"\n' + SMALL.format(6),
    "palm": 'kind = "palm"\n' + SMALL.format(8),
    "layered palm": 'kind = "palm"\n' + SMALL.format(10) + LAYER.replace("= 2", "= 4"),
    "finger": 'preset = "fingertip"\n',
    "mesh": 'kind = "mesh"\nfile = "plain.vtu"\n',
    "regions": 'kind = "mesh"\nfile = "block.vtu"\nregions = { deep = "fat" }\n',
}
SIZES = {"finger": "4", "layers": "4"}  # mm; 6 for others
# Doors that take long. `test_examples` reports a palm and a half-space, `test_relax_bodies` relaxes
# the other kinds.
RELAXED = ("slab", "palm", "regions")
REPORTED = ("finger", "regions")
LIVE = ("half-space", "finger", "regions")
QUIET = ("--quiet", "--out")


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """A folder with a block of 24 x 24 x 8 mm, whose lower half is another region."""
    folder = tmp_path_factory.mktemp("blocks")
    corpus.write_block(folder / "block.vtu")
    corpus.write_block(folder / "plain.vtu", regions=False)
    return folder


@pytest.fixture
def scene(blocks, monkeypatch, in_one_process, read_here):
    """The name of a scene's file with a body, in a folder with the meshes; few frames of films."""
    monkeypatch.chdir(blocks)
    monkeypatch.setattr(assumptions, "can_be_alone", lambda *step: False)
    monkeypatch.setattr(playback, "FRAMES", playback.Frames(fewest=4, most=4))

    def named(body):
        (blocks / f"{body}.toml").write_text(SCENE + BODY[body])
        return f"{body}.toml"

    return named


def sizes(body):
    has_mesh = body not in ("sheet", "half-space")
    return ("--element-size", SIZES.get(body, "6")) if has_mesh else ()


@pytest.mark.parametrize("body", BODY)
def test_a_body_is_planned_run_compared_and_fitted(body, scene, blocks, capsys):
    file, size = scene(body), sizes(body)
    assert main(["plan", file, *size]) == 0
    assert main(["run", file, *size, *QUIET, f"{body} run"]) == 0
    page = (blocks / f"{body} run/index.html").read_text()
    assert "failed" not in page
    assert f"<h1>{body}" in page
    assert main(["compare", file, *size, *QUIET, f"{body} compared"]) == 0
    page = (blocks / f"{body} compared/index.html").read_text()
    assert "failed" not in page
    assert "dB region" in page
    assert (blocks / f"{body} compared/pictures/propagation.png").exists()
    measured = ["--measured", f"{body} run/responses.npz", "--vary", "gain=0.1:10"]
    assert main(["fit", file, *measured, *QUIET, f"{body} fit"]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("body", RELAXED)
def test_the_assumptions_of_a_body_are_relaxed(body, scene, blocks):
    assert main(["relax", scene(body), *sizes(body), *QUIET, f"{body} relaxed"]) == 0
    assert "no propagation" in (blocks / f"{body} relaxed/effects.csv").read_text()


@pytest.mark.parametrize("body", REPORTED)
def test_a_body_is_reported_with_its_map_and_film(body, scene, blocks, monkeypatch):
    file, size = scene(body), sizes(body)
    monkeypatch.setattr("skinwave.studies.album.REDUCTION_TOLERANCE", 0.05)
    assert main(["report", file, *size, *QUIET, f"{body} report"]) == 0
    page = (blocks / f"{body} report/index.html").read_text()
    assert "failed" not in page
    assert ("film" in page) == renderer().is_available
    reach = ("--reach", "8", "--step", "2")
    assert main(["report", file, "--map", *reach, *size, *QUIET, f"{body} map"]) == 0


@pytest.mark.parametrize("body", BODY)
def test_a_body_is_swept(body, scene):
    vary = ("--vary", "tacton.am_frequency_hz=120,150", "--workers", "1")
    assert main(["sweep", scene(body), *vary, *sizes(body), *QUIET, f"{body} sweep"]) == 0


@pytest.mark.parametrize("body", LIVE)
def test_a_body_moves_on_the_live_page(body, scene, blocks):
    assert main(["live", scene(body), *QUIET, f"{body}.html"]) == 0
    assert (blocks / f"{body}.html").stat().st_size > 100_000


@pytest.mark.parametrize("body", BODY)
def test_dispersion_is_that_of_flat_layers_or_refused(body, scene, capsys):
    file = scene(body)
    kind = {"finger": "finger", "mesh": "mesh", "regions": "mesh", "disc": "disc"}.get(body, "slab")
    code = main(["dispersion", file, *QUIET, f"{body} waves"])
    assert code == (0 if KINDS[kind].dispersion else 2)
    assert ("dispersion curves support" in capsys.readouterr().err) == bool(code)
