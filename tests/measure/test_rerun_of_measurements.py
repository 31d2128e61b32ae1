"""Folders of validate and measured, had again from their record.json."""

import json
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from skinwave.commands.cli import main
from skinwave.measure import Measurement
from skinwave.measure.writing import write


def command_of(folder):
    return json.loads((Path(folder) / "record.json").read_text())["command"]


@pytest.fixture
def record(tmp_path, monkeypatch):
    """A file without unit and direction, in an empty working directory."""
    monkeypatch.chdir(tmp_path)
    times = np.arange(2000) / 2000
    wave = 1e-3 * np.sin(2 * np.pi * 140 * times)
    noise = 1e-5 * np.random.default_rng(0).normal(size=(2, 2000, 1))
    measured = Measurement(quantity="velocity", times=times, values=wave[:, None] + noise,
                           places=np.array([[0.004, 0.001]]))  # fmt: skip
    write(measured, tmp_path / "record.npz")
    return tmp_path / "record.npz"


def test_an_inspection_is_had_again_from_anywhere(record, tmp_path, monkeypatch):
    asked = ["measured", "record.npz", "--places", "4,1", "--false-alarm", "0.02", "--quiet"]
    assert main([*asked, "--out", "inspected"]) == 0
    away = tmp_path / "away"
    away.mkdir()
    monkeypatch.chdir(away)
    assert main(["rerun", "../inspected", "--quiet"]) == 0
    again = tmp_path / "inspected-rerun"
    for file in ("found-lines.csv", "measurement.csv", "index.html"):
        assert (again / file).read_bytes() == (tmp_path / "inspected" / file).read_bytes()
    assert command_of(again)["options"] == command_of(tmp_path / "inspected")["options"]


def test_a_validation_is_had_again_with_all_its_files(record, tmp_path, monkeypatch):
    taken = []

    def validate(progress, **options):
        taken.append(options)
        return SimpleNamespace(rows=[])

    monkeypatch.setattr("skinwave.verify.validation.validate", validate)
    monkeypatch.setattr("skinwave.verify.validation.sentences", lambda found: ["agree"])
    monkeypatch.setattr("skinwave.verify.validation_page.write", lambda folder, found: None)
    (tmp_path / "impulses").mkdir()
    asked = ["validate", "--zigzag", "record.npz", "4", "--zigzag", "record.npz", "11", "--hand",
             "--skinsource", "impulses", "-o", "validated"]  # fmt: skip
    assert main([*asked, "--quiet"]) == 0
    monkeypatch.chdir(tmp_path / "impulses")
    assert main(["rerun", "../validated", "--quiet"]) == 0
    first, again = taken
    assert [(Path(f).resolve(), v) for f, v in again["zigzags"]] == [(record, 4.0), (record, 11.0)]
    assert again["skinsource"] == tmp_path / "impulses"
    assert os.path.samefile(again["hand"], first["hand"])


def test_an_option_of_several_words_is_no_other_option(record, tmp_path, capsys):
    assert main(["measured", "record.npz", "--out", "inspected", "--quiet"]) == 0
    path = tmp_path / "inspected" / "record.json"
    kept = json.loads(path.read_text())
    kept["command"]["options"]["zigzag"] = [["--hand", "x"]]
    path.write_text(json.dumps(kept))
    assert main(["rerun", "inspected"]) == 2
    assert "the record's option 'zigzag' is none" in capsys.readouterr().err
