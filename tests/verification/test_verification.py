"""Verification cases, their page and the command; the hosted workflow runs the slow cases."""

import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

import fem
from skinwave.commands.cli import main
from skinwave.system.effort import silent
from skinwave.verify import suite
from skinwave.verify.case import Check, below, case, order, relative
from skinwave.verify.stepping import oscillator

# A case of each topic and of each kind of reference, about ten seconds of CPU time. The hosted
# workflow runs `skinwave verify`, with every case.
GATE = (
    "patch", "patch-quadratic", "slivers", "manufactured",
    "stiffness-contrast", "fingertip-with-bone", "thin-sheets", "in-plane-shear", "moving-force",
    "air-operator", "sheet-sound", "rayleigh", "oblique-p-sv", "exact-half-space", "exact-slab",
    "exact-sheet", "order-in-time", "columns", "narrow-focus", "degenerate-paths", "durations",
    "elastica", "tangent",
)  # fmt: skip


@pytest.mark.parametrize("name", GATE)
def test_case_passes(name):
    result = suite.CASES[name].run(debug=True)
    assert result.passed, [check for check in result.checks if not check.passed]
    assert result.case.source


@case("nobody")
def good():
    """Made up."""
    yield relative("length", 1.01, 1.0, 0.02, "m")


@case("nobody")
def bad():
    """Too <long>."""
    yield relative("length", 1.03, 1.0, 0.02, "m")


@case("nobody")
def breaks():
    """Ends early."""
    yield relative("length", 1.01, 1.0, 0.02, "m")
    raise ValueError("no such mesh")


@case("nobody")
def empty():
    """Has no number."""
    yield Check(what="x", value=float("nan"), reference=1.0, error=float("inf"), bar=1.0)


def test_check_fails_beyond_its_tolerance_and_for_nan():
    assert relative("x", 1.0199, 1.0, 0.02).passed
    assert not relative("x", 1.0201, 1.0, 0.02).passed
    assert not below("x", float("nan"), 1.0).passed
    assert not replace(good, checks=lambda: []).run().passed
    assert order("order", [1, 0.5, 0.25], [1, 0.13, 0.016], 3, 0.1).passed
    assert not order("order", [1, 0.5, 0.25], [1, 0.2, 0.04], 3, 0.1).passed


def test_page_and_record_list_failures_and_errors(tmp_path, monkeypatch):
    monkeypatch.setattr(suite, "TOPICS", {"Made up": (good, bad, breaks, empty)})
    results = suite.run_suite([good, bad, breaks, empty], tmp_path, silent)
    assert suite.summary(results).endswith("1 passed, 3 failed")
    written = (tmp_path / "index.html").read_text()
    assert "Too &lt;long&gt;" in written
    assert "no such mesh" in written
    record = json.loads((tmp_path / "verify.json").read_text())
    assert [found["passed"] for found in record["cases"]] == [True, False, False, False]
    assert record["cases"][0]["checks"][0]["reference"] == 1.0
    assert record["cases"][3]["checks"][0]["value"] is None
    with pytest.raises(ValueError, match="no such mesh"):
        suite.run_suite([breaks], tmp_path, silent, debug=True)


def test_interrupt_keeps_finished_cases(tmp_path):
    def interrupted():
        raise KeyboardInterrupt

    stopped = replace(good, checks=interrupted)
    assert len(suite.run_suite([good, stopped], tmp_path, silent)) == 1
    with pytest.raises(KeyboardInterrupt):
        suite.run_suite([stopped], tmp_path, silent)


def test_command_fails_if_a_case_fails(tmp_path, capsys, monkeypatch):
    out = str(tmp_path / "out")
    for given, code in ((good, 0), (bad, 1)):
        monkeypatch.setattr(suite, "CASES", {given.name: given})
        assert main(["verify", "--quick", "--json", "--out", out, "--overwrite"]) == code
        assert json.loads(capsys.readouterr().out)["failed"] == code


def test_time_stepping_refuses_zero_steps_and_infinite_loads():
    with pytest.raises(ValueError, match="dt"):
        next(fem.transient(oscillator(), lambda t: np.zeros(1), 0.0))
    states = fem.transient(oscillator(), lambda t: np.array([np.nan if t else 0.0]), 0.1)
    with pytest.raises(fem.Diverged, match="step 1"):
        list(islice(states, 3))
