"""[ME12] redone: every row holds with the shipped truck, and fails without its mechanism."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from click.testing import CliRunner
from matplotlib.image import imread

from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.reproduce import PAPERS, me12, paper
from clutchest.reproduce.claim import Claim, Margin, Verdict, judged, margin
from clutchest.reproduce.me12.data import NONE, SENSE, WHAT, Imperfections

CLAIMS = {claim.name: claim for claim in me12.CLAIMS}
QUICK = ("D1", "D2", "D3", "D5", "D6")
FIGURES = ("fig2", "fig3", "fig4", "fig5", "fig7", "fig8", "fig9", "fig10", "fig11")


@pytest.fixture(scope="module")
def setup():
    return me12.setup()


def test_every_row_of_the_paper_is_there():
    assert list(CLAIMS) == [*(f"D{k}" for k in range(1, 11)), "k_P"]


@pytest.mark.parametrize("name", QUICK)
def test_row_holds(name, setup):
    verdict = CLAIMS[name].judge(setup)
    assert verdict.passed, verdict.obtained


@pytest.mark.parametrize(
    ("name", "mechanism"), [(name, lacking) for name in QUICK for lacking in CLAIMS[name].without]
)
def test_row_fails_without_its_mechanism(name, mechanism, setup):
    claim = CLAIMS[name]
    verdict = claim.judge(claim.without[mechanism](setup))
    assert not verdict.passed, verdict.obtained


def test_data_are_as_imperfect_as_stated():
    """D7 to D10: late by 50 ms or more, coloured noise, parameters off by per cents."""
    sizes = Imperfections()
    assert sizes.torque_delay >= 0.05
    assert sizes.torque_error >= 20.0 and 0.9 < sizes.torque_error_ar < 1.0
    assert 0.02 <= sizes.parameter_error <= 0.05
    assert sizes.hot_gain > 0 and sizes.cold_loss > 0
    assert set(WHAT) == set(sizes.sizes())
    for name in ("D7", "D8", "D9", "D10"):
        assert {"torque_delay", "torque_error", "parameter_error"} <= set(CLAIMS[name].strained_by)


def test_imperfections_reach_the_data(setup):
    """Each makes another drive of the same truck; the reported torque is late and off."""
    plain = replace(setup, imperfections=NONE)

    def torque(of: me12.Setup):
        return of.drive("cold-start", 1, 30.0)["engine_torque"].value

    assert set(SENSE) < set(setup.vehicle.parameters)
    for name, (size, _, _) in Imperfections().sizes().items():
        if name == "hot_gain":  # nothing is hot within half a minute
            continue
        more = {"torque_error": 20.0} if name == "torque_error_ar" else {}
        one = plain.wrong(**{name: size, **more})
        assert (torque(one) != torque(plain)).any(), name


def test_a_row_whose_mechanism_does_nothing_fails():
    idle = Claim("X1", "", "", "", lambda setup: Verdict("", True), {"nothing": lambda s: s})
    assert not judged(idle, None, {}).passed


def test_margin_ends_where_the_row_fails():
    found = margin(lambda size: Verdict("", size < 5.3), 1.0)
    assert found == Margin(1.0, 5.0, 6.0)
    assert margin(lambda size: Verdict("", True), 1.0) == Margin(1.0, 16.0, None)


def test_stored_margins_are_those_of_the_shipped_numbers(setup):
    known = me12.margins(setup)
    assert set(known) == {claim.name for claim in me12.CLAIMS if claim.strained_by}
    for name, of_row in known.items():
        assert set(of_row) == set(CLAIMS[name].strained_by)
        for imperfection, found in of_row.items():
            assert found.size == getattr(setup.imperfections, imperfection)
            assert found.fails_at is None or found.size <= found.holds_at < found.fails_at
    assert me12.margins(setup.wrong(torque_delay=0.06)) == {}


@pytest.mark.slow
def test_a_stored_margin_is_where_the_row_fails(setup):
    found = me12.margins(setup)["D8"]["torque_delay"]
    judge = CLAIMS["D8"].judge
    assert judge(setup.wrong(torque_delay=found.holds_at)).passed
    assert found.fails_at is not None
    assert not judge(setup.wrong(torque_delay=found.fails_at)).passed


@pytest.mark.slow
def test_command_reproduces_all(tmp_path, monkeypatch):
    """Every row, with and without its mechanisms, one drive each; table, figures, exit code."""
    for module in (me12.pulses, me12.launch, me12.limits):
        monkeypatch.setattr(module, "SEEDS", (1,))
    result = CliRunner().invoke(app, ["reproduce", "me12", "--out", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    table = json.loads(result.stdout)
    assert table == json.loads((tmp_path / "table.json").read_text(encoding="utf-8"))
    assert table["pass"] and [row["row"] for row in table["rows"]] == list(CLAIMS)
    for row in table["rows"]:
        assert row["without"], "a row that cannot fail is no row"
        assert not any(without["pass"] for without in row["without"].values()), row
    assert {path.stem for path in tmp_path.glob("*.png")} == set(FIGURES)
    for name in FIGURES:
        picture = imread(tmp_path / f"{name}.png")
        assert picture[..., :3].std() > 0.05, f"{name} is blank"


def test_exit_code_tells_of_a_row_that_fails(tmp_path, monkeypatch):
    claim = CLAIMS["D5"]
    broken = replace(claim, judge=lambda s: claim.judge(s.modelled(heat_capacity_body=30e3)))
    monkeypatch.setattr(me12, "CLAIMS", (broken,))
    monkeypatch.setattr("clutchest.reproduce.me12.figures.draw", lambda data, folder: None)
    result = CliRunner().invoke(app, ["reproduce", "me12", "--out", str(tmp_path)])
    assert result.exit_code == 1
    assert "FAIL" in result.stdout
    assert not json.loads((tmp_path / "table.json").read_text(encoding="utf-8"))["pass"]


def test_unknown_paper_is_named():
    with pytest.raises(ClutchestError, match=r"unknown paper 'me21'.*me12"):
        paper("me21")
    assert set(PAPERS) >= {"me12"}
