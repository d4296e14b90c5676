"""Frames of live buses: python-can's messages, and what the kernel hands over, byte by byte."""

from __future__ import annotations

import socket
import struct
from types import SimpleNamespace

import numpy as np
import pytest

import can
from clutchest.can.bus import SocketReader, frames_of, message_of
from clutchest.can.frames import Flag

SO_RXQ_OVFL, SO_TIMESTAMPNS, MSG_DONTROUTE = 40, 35, 4


def test_every_kind_of_message():
    messages = [
        can.Message(1_700_000_000.123456, 0x18FEF100, data=[1, 2, 3]),
        can.Message(0.000001, 0x123, is_extended_id=False, is_remote_frame=True, dlc=5),
        can.Message(1.0, 0x7FF, is_extended_id=False, is_error_frame=True),
        can.Message(2.5, 0x1, is_fd=True, bitrate_switch=True, data=range(12)),
        can.Message(3.0, 0x2, is_fd=True, error_state_indicator=True, is_rx=False, data=[9]),
    ]
    frames = frames_of(messages)
    assert frames.t_ns.tolist() == [
        1_700_000_000_123_456_000,
        1000,
        10**9,
        2_500_000_000,
        3 * 10**9,
    ]
    assert frames.id.tolist() == [0x18FEF100, 0x123, 0x7FF, 1, 2]
    extended = Flag.EXTENDED
    assert frames.flags.tolist() == [
        extended,
        Flag.REMOTE,
        Flag.ERROR,
        extended | Flag.FD | Flag.BITRATE_SWITCH,
        extended | Flag.FD | Flag.ERROR_STATE | Flag.SENT,
    ]
    assert frames.length.tolist() == [3, 5, 0, 12, 1]
    assert frames.data.shape == (5, 64)
    assert frames.data[0, :4].tolist() == [1, 2, 3, 0]
    assert frames.data[3, :13].tolist() == [*range(12), 0]
    for k in (0, 1, 3):
        sent = message_of(frames, k)
        assert sent.equals(messages[k], timestamp_delta=None, check_direction=False)


class Kernel(socket.socket):
    """A socket that hands over what was put in ``waiting``."""

    waiting: list[tuple]

    def recvmsg(self, *sizes):
        if not self.waiting:
            raise BlockingIOError
        return self.waiting.pop(0)


def given(frame: bytes, seconds: int, ns: int, dropped: int = 0, flags: int = 0) -> tuple:
    stamp = (socket.SOL_SOCKET, SO_TIMESTAMPNS, struct.pack("=qq", seconds, ns))
    lost = (socket.SOL_SOCKET, SO_RXQ_OVFL, struct.pack("=I", dropped))
    return frame, [stamp, lost], flags, None


@pytest.mark.skipif(not hasattr(socket, "AF_CAN"), reason="SocketCAN is Linux's")
def test_what_the_kernel_hands_over():
    def classic(word: int, data: bytes, length: int | None = None) -> bytes:
        return struct.pack("=IB3x8s", word, len(data) if length is None else length, data)

    def fd(word: int, flags: int, data: bytes) -> bytes:
        return struct.pack("=IBB2x64s", word, len(data), flags, data)

    here, there = socket.socketpair()
    with here, there, Kernel(fileno=here.detach()) as kernel:
        there.send(b"x")  # there is something to read
        kernel.waiting = [
            given(classic(0x98FEF100, b"\x01\x02\xff\xff", 2), 1_700_000_000, 123_456_789),
            given(classic(0x40000123, b"", 4), 1_700_000_001, 5, flags=MSG_DONTROUTE),
            given(classic(0x20000004, bytes(8)), 0, 999_999_999),
            given(fd(0x80000001, 1, bytes(range(12))), 2, 0),
            given(fd(0x7FF, 2, b"\x07"), 3, 0, dropped=70_000),
        ]
        received = SocketReader(SimpleNamespace(socket=kernel)).read(1.0)
    assert received is not None and received.dropped == 70_000
    frames = received.frames
    s = 10**9
    assert frames.t_ns.tolist() == [
        1_700_000_000 * s + 123_456_789,
        1_700_000_001 * s + 5,
        999_999_999,
        2 * s,
        3 * s,
    ]
    assert frames.id.tolist() == [0x18FEF100, 0x123, 4, 1, 0x7FF]
    assert frames.flags.tolist() == [
        Flag.EXTENDED,
        Flag.REMOTE | Flag.SENT,
        Flag.ERROR,
        Flag.EXTENDED | Flag.FD | Flag.BITRATE_SWITCH,
        Flag.FD | Flag.ERROR_STATE,
    ]
    assert frames.length.tolist() == [2, 4, 8, 12, 1]
    assert frames.data[0, :4].tolist() == [1, 2, 0, 0]  # nothing behind the length
    np.testing.assert_array_equal(frames.data[3, :13], [*range(12), 0])
    assert frames.data[4, :2].tolist() == [7, 0]
