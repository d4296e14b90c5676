"""Every effect of the user's own gets its line: value, z, nearest rival, why it was not named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import clutchest
import discoveries
from clutchest.discovery.discover import discover
from clutchest.discovery.result import Hypothesis, Size
from clutchest.record.discovery_report import hypotheses_rows, report

COLD = """
import casadi as ca
from clutchest.machine import Effect, Number

class ColdLining(Effect):
    name, model, equation = "cold_lining", "dry_clutch", "torque"
    parameters = (Number("loss", "1/(100 K)", 0.0, 0.5),)

    def terms(self, g):
        return {"sliding_torque": lambda torque, q:
                torque * (1 - g.loss * ca.fmax(80 - q.temp_body, 0) / 100)}
"""
LINE = Hypothesis("own", {"loss": Size(0.12, 0.034)}, 1.234, "wear", 2.71, "not significant")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.py"
    path.write_text(COLD, encoding="utf-8")
    return path


@pytest.mark.parametrize("verdict", discoveries.VERDICTS)
def test_its_line_stands_in_every_report(verdict):
    answer = replace(discoveries.discovery(verdict), hypotheses=(LINE,))
    row = ("own", "loss 0.120 ± 0.034", "1.2", "wear, d′ 2.7", "not significant")
    assert hypotheses_rows(answer) == [row]
    assert "| " + " | ".join(row) + " |" in report(answer)
    (told,) = json.loads(json.dumps(answer.summary()))["hypotheses"]
    assert told["parameters"]["loss"] == {"value": 0.12, "std": 0.034}
    assert told["why_not"] == "not significant"


def test_without_one_the_report_has_no_such_part():
    assert "Your own hypotheses" not in report(discoveries.discovery("named"))


@pytest.mark.slow
def test_what_was_rehearsed_is_named(own):
    hidden = {"cold_lining": {"loss": 0.3}}
    drive = clutchest.simulate(
        "truck", "launches", 21, hidden, duration=600.0, effects_files=(own,)
    )
    answer = discover(drive, "truck", effects_files=(own,))
    (line,) = answer.hypotheses
    assert (answer.verdict, line.why_not) == ("named", "")
    loss = line.parameters["loss"]
    assert abs(loss.value - 0.3) < 3.0 * loss.std < 0.3
    assert line.z > 4.0 and line.d_prime_nearest > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [{}, {"friction_level": {"change": 0.2}}])
def test_what_does_not_act_is_told_why(own, hidden):
    drive = clutchest.simulate("truck", "launches", 22, hidden, duration=600.0)
    answer = discover(drive, "truck", effects_files=(own,))
    (line,) = answer.hypotheses
    assert line.why_not
    assert {"cold_lining"}.isdisjoint(c.effect for c in answer.causes)
    loss = line.parameters["loss"]
    assert 0.0 <= loss.value < 0.5 and loss.std > 0.0
