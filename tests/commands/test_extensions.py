"""Formats and columns from outside: the examples of the documentation, and a package with one."""

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from skinwave.commands.cli import main
from skinwave.live.html_file import page
from skinwave.measure.reading import read
from skinwave.scene import file as scene_file
from skinwave.sweeps import dataset, measures
from skinwave.system import extensions, formats

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples/extensions"
NAMES = ("logger_format", "stroke_format", "crest_column")
REGISTRIES = (
    formats.MEASUREMENTS, formats.PATTERN_READERS, formats.PATTERN_WRITERS, measures.COLUMNS,
)  # fmt: skip
STROKE = {"corners_mm": [[-10.0, 0.0], [0.0, 5.0], [10.0, 0.0]], "speed_mm_per_s": 4000.0}
RATE, PLACES_MM = 2000.0, [[0.0, 0.0], [5.0, -2.5]]
UM_S = np.arange(1.0, 9.0).reshape(2, 4)  # of two places at four times
SCENE = """
[tacton]
am_frequency_hz = 100
duration_s = 0.1
[focus]
drive = "force_corrected"
[body]
kind = "none"
[probes]
points_mm = [[0, 0], [1, 0]]
"""


@pytest.fixture(scope="module", autouse=True)
def examples():
    """The modules of the examples; what they register is gone afterwards, for all other tests."""
    before = [{**registry.records} for registry in REGISTRIES]
    sys.path.insert(0, str(FOLDER))
    yield [import_module(name) for name in NAMES]
    sys.path.remove(str(FOLDER))
    for registry, records in zip(REGISTRIES, before, strict=True):
        for name in {*registry.records} - {*records} - {*registry.built_in}:
            del registry.records[name]
    os.environ.pop(extensions.VARIABLE)
    for name in NAMES:
        del sys.modules[name]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    head = {"rate_hz": RATE, "places_mm": PLACES_MM, "unit": "um/s"}
    Path("palm.log4").write_bytes(json.dumps(head).encode() + b"\n" + UM_S.astype("<f4").tobytes())
    Path("drawing.stroke").write_text(json.dumps(STROKE))
    Path("scene.toml").write_text(SCENE)
    return tmp_path


def test_examples_are_short():
    for name in NAMES:
        assert len((FOLDER / f"{name}.py").read_text("utf-8").splitlines()) <= 33


def test_a_measurement_of_an_own_format_is_read_in_si_and_into_the_body(here):
    measured = read("palm.log4")
    assert measured.values[0] == pytest.approx(-1e-6 * UM_S.T)
    assert measured.places == pytest.approx(1e-3 * np.array(PLACES_MM))
    assert measured.times[1] == pytest.approx(1 / RATE)
    assert read("palm.log4", sign=1).values[0] == pytest.approx(1e-6 * UM_S.T)
    with pytest.raises(ValueError, match="--columns has no effect on logger files"):
        read("palm.log4", columns=("1",))
    Path("bad.log4").write_bytes(b"{}\n")
    with pytest.raises(ValueError, match=r"bad\.log4: the file is no \.log4 file .* export it"):
        read("bad.log4")


def test_a_pattern_of_an_own_format_is_converted_both_ways(here, capsys):
    assert main(["convert", "drawing.stroke", "drawn.toml", "--resize", "2"]) == 0
    tacton = scene_file.read(Path("drawn.toml")).tacton
    assert tacton.trajectory.speed == pytest.approx(8.0)
    corners = np.array(STROKE["corners_mm"])
    assert np.array(tacton.trajectory.points) == pytest.approx(2e-3 * corners)
    assert main(["convert", "drawing.stroke", "again.stroke", "--json"]) == 0
    again = json.loads(Path("again.stroke").read_text())
    assert np.array(again["corners_mm"]) == pytest.approx(corners)
    assert again["speed_mm_per_s"] == pytest.approx(4000.0)
    assert "the load on the path changes by less than 0.01 %" in capsys.readouterr().out
    assert main(["convert", "scene.toml", "am.stroke"]) == 2
    assert not Path("am.stroke").exists()
    assert main(["convert", "drawing.stroke", "drawing.xyz"]) == 2
    said = capsys.readouterr().err
    assert "pattern format to write '.xyz' is unknown, use one of .toml" in said
    assert ".stroke" in said


def test_help_messages_and_the_live_page_have_one_list(here, capsys):
    every = formats.suffixes(formats.MEASUREMENTS)
    assert every.startswith(".csv, .tsv")
    assert every.endswith(".log4")
    for command in ("fit", "convert"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
    said = "".join(capsys.readouterr().out.split())
    assert every.replace(" ", "") in said
    assert said.count(".stroke") == 2
    assert f"{every}. You can also drop" in page({"bodies": []})
    with pytest.raises(ValueError, match=f"'.xyz' is unknown, use one of {every}"):
        read("palm.xyz")


@pytest.mark.parametrize("registry", REGISTRIES[:3], ids=lambda registry: registry.what)
def test_each_listed_suffix_is_registered_by_its_own_module(registry):
    """As what is listed without importing the modules must be what they register."""
    for suffix, module in registry.built_in.items():
        if suffix != ".toml":
            assert extensions.find(registry, suffix).function.__module__ == module
    assert {*registry.records} - {".log4", ".stroke"} == {*registry.built_in} - {".toml"}


def test_the_documentation_names_each_suffix_of_a_measurement():
    page = (ROOT / "docs/measurements.md").read_text("utf-8")
    assert [suffix for suffix in formats.MEASUREMENTS.built_in if f"`{suffix}`" not in page] == []


def test_names_that_are_taken_or_never_found_are_refused(examples):
    logger, stroke, crest = examples
    with pytest.raises(ValueError, match=r"'\.csv' is registered already"):
        formats.register(formats.MEASUREMENTS, ".csv", function=logger.read)
    with pytest.raises(ValueError, match=r"'\.wav' is registered already"):
        formats.register(formats.PATTERN_READERS, ".wav", function=stroke.read)
    with pytest.raises(ValueError, match=r"suffix '\.LOG' is not like '\.csv'"):
        formats.register(formats.MEASUREMENTS, ".LOG", function=logger.read)
    with pytest.raises(ValueError, match="'mean_part' is registered already"):
        measures.register(measures.Column(name="mean_part", value=crest.mean_part))
    with pytest.raises(ValueError, match=r"'a\.b' needs a name of small letters"):
        measures.register(measures.Column(name="a.b", value=crest.mean_part))


def test_a_sweep_in_other_processes_has_own_columns(here):
    """The pressure (1 + sin)/2 has the crest factor √2 and the mean part 1/2."""
    words = ["--vary", "tacton.am_frequency_hz=80,120", "--model", "point-kernel", "--out", "swept"]
    assert main(["sweep", "scene.toml", *words, "--workers", "1", "--quiet"]) == 0
    rows = dataset.read(Path("swept"))
    assert len(rows) == 2
    for row in rows:
        assert row["own_crest_factor"] == pytest.approx([2**0.5] * 2, rel=2e-3)
        assert row["own_mean_part"] == pytest.approx(0.5, rel=2e-3)
        assert "own_" not in row["warnings"]


def test_a_column_that_fails_loses_nothing_else(here, monkeypatch):
    def fails(run):
        raise KeyError("f_d")

    columns = {
        "broken": measures.Column(name="broken", value=fails),
        "wide": measures.Column(name="wide", value=lambda run: [1.0, 2.0, 3.0], per_probe=True),
    }
    for name, column in columns.items():
        monkeypatch.setitem(measures.COLUMNS.records, name, column)
    words = ["--vary", "tacton.am_frequency_hz=80,120", "--model", "point-kernel", "--out", "swept"]
    assert main(["sweep", "scene.toml", *words, "--scheduler", "threads", "--quiet"]) == 0
    row = dataset.read(Path("swept"))[0]
    assert (row["status"], row["own_broken"], row["own_wide"]) == ("done", None, None)
    assert "column own_broken is missing: KeyError: 'f_d'" in row["warnings"]
    assert "own_wide is missing: its function returns the shape (3,)" in row["warnings"]
    assert row["own_mean_part"] == pytest.approx(0.5, rel=2e-3)


def test_an_entry_point_of_a_package_is_loaded_and_a_broken_one_named(here):
    about = here / "site/logger-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: logger\nVersion: 1.0\n")
    point = about / "entry_points.txt"
    point.write_text("[skinwave]\nlogger = logger_format\n")
    env = {k: x for k, x in os.environ.items() if k != extensions.VARIABLE}
    env["PYTHONPATH"] = os.pathsep.join(map(str, (ROOT, FOLDER, here / "site")))
    how = {"env": env, "check": False, "capture_output": True, "text": True}
    code = "from skinwave.measure.reading import read; print(read('palm.log4').values.min())"
    found = subprocess.run([sys.executable, "-c", code], **how)
    assert float(found.stdout) == pytest.approx(-8e-6), found.stderr
    command = [sys.executable, "-m", "skinwave", "fit", "--help"]
    assert ".log4" in subprocess.run(command, **how).stdout
    point.write_text("[skinwave]\nlogger = no_such_module\n")
    done = subprocess.run(command, **how)
    assert done.returncode == 2
    assert "the module 'no_such_module' of the package logger cannot be imported" in done.stderr
    assert "update or uninstall logger" in done.stderr
