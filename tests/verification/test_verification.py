"""Every case of the verification suite, the same as `skinwave verify` shows."""

import json
from itertools import islice

import numpy as np
import pytest

import fem
from skinwave.commands.cli import main
from skinwave.verify import page, suite
from skinwave.verify.case import Case, Check, Entry, below, order, relative
from skinwave.verify.stepping import oscillator

CASES = [
    pytest.param(entry, id=entry.name, marks=[pytest.mark.slow] if entry.slow else [])
    for entry in suite.suite()
]


@pytest.mark.parametrize("entry", CASES)
def test_verification(entry):
    case = entry.run()
    missed = [check for check in case.checks if not check.passed]
    assert case.passed, missed
    assert case.source
    assert case.mesh


def test_names_are_unique_so_that_the_page_can_link_to_them():
    names = [entry.name for entry in suite.suite()]
    assert len(set(names)) == len(names)


def made(*checks, **fields):
    """A case that nothing was computed for."""
    return Case(**{"title": "made up", "source": "nobody", "mesh": "none"} | fields, checks=checks)


def entry(name, run):
    return Entry(name=name, topic="Made up", run=run)


def good():
    return made(relative("length", 1.01, 1.0, 0.02, "m"))


def bad():
    return made(relative("length", 1.03, 1.0, 0.02, "m"), title="too <long>")


def test_a_check_fails_beyond_its_bar_and_on_what_is_no_number():
    assert relative("x", 1.0199, 1.0, 0.02).passed
    assert not relative("x", 1.0201, 1.0, 0.02).passed
    assert not below("x", float("nan"), 1.0).passed
    assert not made().passed
    assert order("order", [1, 0.5, 0.25], [1, 0.13, 0.016], 3, 0.1).passed
    assert not order("order", [1, 0.5, 0.25], [1, 0.2, 0.04], 3, 0.1).passed


def test_the_page_and_the_record_tell_what_failed_and_what_broke_off(tmp_path):
    def breaks():
        raise ValueError("no such mesh")

    entries = [entry("good", good), entry("bad", bad), entry("breaks", breaks)]
    results = suite.run_suite(entries, tmp_path, lambda phase, fraction: None, left_out=4)
    assert page.summary_table(results).endswith("1 passed, 2 failed")
    written = (tmp_path / "index.html").read_text()
    assert "1 passed, 2 failed; 4 slower cases" in written
    assert "too &lt;long&gt;" in written
    assert "no such mesh" in written
    record = json.loads((tmp_path / "verify.json").read_text())
    assert [case["passed"] for case in record["cases"]] == [True, False, False]
    assert record["cases"][0]["checks"][0]["reference"] == 1.0
    with pytest.raises(ValueError, match="no such mesh"):
        suite.run_suite(entries, tmp_path, lambda phase, fraction: None, debug=True)


def test_an_interrupt_keeps_the_finished_cases(tmp_path):
    def interrupted():
        raise KeyboardInterrupt

    entries = [entry("good", good), entry("stopped", interrupted)]
    assert len(suite.run_suite(entries, tmp_path, lambda phase, fraction: None)) == 1
    assert "Interrupted: 1 of 2 cases" in (tmp_path / "index.html").read_text()
    with pytest.raises(KeyboardInterrupt):
        suite.run_suite(entries[1:], tmp_path, lambda phase, fraction: None)


def test_numbers_that_are_none_are_null_in_the_record(tmp_path):
    empty = made(Check(what="x", value=float("nan"), reference=1.0, error=float("inf"), bar=1.0))
    suite.run_suite([entry("empty", lambda: empty)], tmp_path, lambda phase, fraction: None)
    check = json.loads((tmp_path / "verify.json").read_text())["cases"][0]["checks"][0]
    assert check["value"] is None
    assert check["passed"] is False


@pytest.mark.parametrize(("run", "code"), [(good, 0), (bad, 1)])
def test_the_command_ends_with_a_count_and_says_by_its_code_whether_any_failed(
    run, code, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(suite, "suite", lambda: (entry("only", run),))
    out = str(tmp_path / "out")
    assert main(["verify", "--out", out]) == code
    assert capsys.readouterr().out.endswith(f"{1 - code} passed, {code} failed\n")
    assert main(["verify", "--quick", "--json", "--out", out, "--overwrite"]) == code
    assert json.loads(capsys.readouterr().out)["failed"] == code


def test_time_stepping_refuses_nonsense():
    with pytest.raises(ValueError, match="dt = 0"):
        next(fem.transient(oscillator(), lambda t: np.zeros(1), 0.0))
    with pytest.raises(ValueError, match="outside 0..1"):
        next(fem.transient(oscillator(), lambda t: np.zeros(1), 0.1, spectral_radius=1.2))
    with pytest.raises(fem.Diverged, match="not finite at t = 0.1 s, step 1"):
        list(
            islice(fem.transient(oscillator(), lambda t: np.array([np.nan if t else 0.0]), 0.1), 3)
        )
