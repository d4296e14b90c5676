from __future__ import annotations

import numpy as np
import pytest

from clutchest.can.encode import encode
from clutchest.can.frames import Flag, Frames
from clutchest.can.j1939 import pgn
from clutchest.can.j1939_names import group_of
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


def test_times_jitter_and_bytes_that_count_or_stay():
    frames = Frames.empty(60)
    t = np.arange(60) * 10**7
    t[40:] += 10**9
    frames.t_ns[:], frames.id[:], frames.length[:] = t + 3 * 10**9, 0x111, 5
    count = np.arange(60)
    random = np.random.default_rng(3).integers(0, 256, (2, 60))
    frames.data[:, :5] = np.stack(
        [random[0], np.full(60, 7), count % 256, 16 * (count % 16) + (random[1] & 1), random[1]], 1
    )
    other = Frames.empty(1)
    other.id[:] = 0x112
    (row,) = [r for r in survey(Frames.concatenate([other, frames]).sorted()) if r.id == 0x111]
    assert (row.first_s, row.last_s) == (3.0, pytest.approx(4.59))
    assert row.gaps == 1 and row.gap_s == pytest.approx(1.01) and row.jitter_s < 1e-9
    assert row.constant == (1,) and row.counters == (2, 3)


def test_common_parameter_groups_have_names_without_a_database():
    frames = Frames.empty(3)
    frames.id[:], frames.flags[:], frames.length[:] = (
        [0x0CF00400, 0x18FEE300, 0x18FF4831],
        Flag.EXTENDED,
        8,
    )
    eec1, ec1, own = survey(frames)
    assert eec1.group == "EEC1: electronic engine controller 1" and eec1.message is None
    assert "SPN 190 engine speed" in eec1.parameters
    assert "SPN 544 engine reference torque" in ec1.parameters
    assert own.group == "PropB: proprietary B" and own.parameters == ()


def test_the_names_agree_with_the_shipped_database(truck):
    listed = 0
    for message in truck.messages.values():
        group = group_of(pgn(message.id))
        if group is None or message.name == "ClutchActuator":
            continue
        assert group.acronym == message.name
        spns = {s.spn for s in message.signals.values()}
        assert set(group.parameters) & spns
        listed += 1
    assert listed >= 7
