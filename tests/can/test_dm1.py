"""DM1: bytes as SAE J1939-73 lays them out, in one frame or in packets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchest.can import j1939
from clutchest.can.database import Message
from clutchest.can.dm1 import PGN, Code, frames_of, payload, read_payload
from clutchest.can.transport import reassembled
from clutchest.errors import ClutchestError

CODES = st.builds(Code, st.integers(1, 0x7FFFE), st.integers(0, 30), st.integers(0, 127))
DM1 = Message("DM1", 0x18FECA00, True, 255, True, 1.0, {})


def test_a_code_worked_out_by_hand():
    # SPN 1208 = 0x04B8, FMI 3, 10 times
    assert Code(1208, 3, 10).bytes() == bytes((0xB8, 0x04, 0x03, 0x0A))
    # SPN 520192 = 0x7F000, FMI 11
    assert Code(520192, 11, 1).bytes() == bytes((0x00, 0xF0, 0xEB, 0x01))


def test_one_code_is_one_frame():
    frames = frames_of([Code(190, 2, 1)], 0x80)
    assert len(frames) == 1
    assert j1939.pgn(int(frames.id[0])) == PGN and frames.id[0] & 0xFF == 0x80
    assert bytes(frames.data[0]) == bytes((0x04, 0xFF, 190, 0, 2, 1, 0xFF, 0xFF))


def test_no_code_says_so():
    frames = frames_of([], 0x80)
    assert bytes(frames.data[0]) == bytes((0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF))
    assert read_payload(bytes(frames.data[0])) == []


@settings(deadline=None)
@given(st.lists(CODES, min_size=2, max_size=60))
def test_several_codes_arrive_in_packets(codes):
    frames = frames_of(codes, 0x80, 1_000)
    assert np.all(np.diff(frames.t_ns) == 50_000_000)
    whole = reassembled(frames, [DM1])
    rows = np.flatnonzero(whole.length > 8)
    assert len(rows) == 1
    data = bytes(whole.data[rows[0], : int(whole.length[rows[0]])])
    assert data == payload(codes)
    assert read_payload(data) == codes


def test_what_does_not_fit_is_refused():
    with pytest.raises(ClutchestError, match="spn 524288"):
        Code(524_288, 1)
    with pytest.raises(ClutchestError, match="446 trouble codes"):
        payload([Code(190, 2)] * 446)
