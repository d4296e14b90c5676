from __future__ import annotations

import numpy as np
import pytest

from clutchest.can.encode import encode
from clutchest.can.frames import Flag, Frames
from clutchest.can.survey import survey


def test_rates_gaps_names_and_lengths(truck):
    t = np.arange(100) * 10**7
    t[60:] += 5 * 10**8
    known = encode(truck.message("EEC1"), {"EngineSpeed": np.full(100, 700.0)}, t, 0x21, channel=1)
    plain = Frames.empty(3)
    plain.id[:], plain.length[:], plain.t_ns[:] = 0x123, [8, 2, 8], [0, 10**9, 2 * 10**9]
    single = Frames.empty(2)
    single.id[:], single.flags[:] = 0x124, [0, Flag.REMOTE]
    first, second, third = survey(Frames.concatenate([known, plain, single]).sorted(), [truck])
    assert (first.id, first.extended, first.pgn, first.message) == (0x123, False, None, None)
    assert (first.count, first.rate_hz, first.period_s, first.lengths) == (3, 1.0, 1.0, (2, 8))
    assert (second.id, second.count, second.rate_hz, second.gap_s) == (0x124, 1, None, None)
    assert (third.channel, third.id, third.pgn) == (1, 0x0CF00421, 61444)
    assert third.message == "EEC1"
    assert third.period_s == pytest.approx(0.01) and third.gap_s == pytest.approx(0.51)
    assert third.rate_hz == pytest.approx(99 / 1.49)


def test_an_empty_bus():
    assert survey(Frames.empty()) == []
