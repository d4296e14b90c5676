"""[ID08] redone: every row passes, and fails without its mechanism; A9 explains what it admits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from clutchest.reproduce import PAPERS
from clutchest.reproduce.claim import Claim, judged
from clutchest.reproduce.id08 import CLAIMS
from clutchest.reproduce.id08.deviations import DEVIATIONS, explain
from clutchest.reproduce.id08.rig import Rig
from clutchest.vehicle import load_vehicle


def rig() -> Rig:
    return Rig(load_vehicle("alsd_rig"))


def test_every_row_of_the_paper_is_there_with_a_mechanism_to_lack() -> None:
    assert [claim.name for claim in CLAIMS] == [f"A{k}" for k in range(1, 10)]
    assert all(claim.without for claim in CLAIMS)


@pytest.mark.parametrize("claim", CLAIMS[:4], ids=lambda claim: claim.name)
def test_a_row_passes_and_fails_without_its_mechanism(claim: Claim[Rig]) -> None:
    row = judged(claim, rig(), {})
    assert row.verdict.passed, row.verdict.obtained
    for name, verdict in row.without.items():
        assert not verdict.passed, (name, verdict.obtained)


@pytest.mark.statistics
@pytest.mark.parametrize("deviation", DEVIATIONS, ids=lambda deviation: deviation.words)
def test_an_extension_explains_a_deviation(deviation: object) -> None:
    found = explain(rig(), deviation)  # type: ignore[arg-type]
    assert found.seen and found.removed >= 0.8
    assert not explain(rig().undeviating(), deviation).seen  # type: ignore[arg-type]


@pytest.mark.statistics
def test_the_wrong_extension_explains_less() -> None:
    """Another extension of the same size of freedom does not remove what one was built for."""
    onset, friction = DEVIATIONS[0], DEVIATIONS[3].extension
    assert explain(rig(), replace(onset, extension=friction)).removed < 0.8


@pytest.mark.slow
def test_the_whole_paper_is_drawn(tmp_path: Path) -> None:
    found = PAPERS["id08"](lambda text, share: None)
    assert found.passed  # every row, and none without its mechanisms
    found.draw(tmp_path)
    drawn = {path.stem for path in tmp_path.iterdir()}
    assert drawn == {"fig5", "fig9", "fig10", "fig11", "fig12", "fig13", "deviations"}
