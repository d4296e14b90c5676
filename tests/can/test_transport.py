"""J1939 transport protocol: packets to messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.can import transport
from clutchest.can.database import Message, SignalLayout
from clutchest.can.frames import Flag, Frames

LONG = Message(
    "Long", 0x18FEE3FE, True, 39, True, None, {"Speed": SignalLayout("Speed", 8 * 25, 16)}
)
ADDRESSED = Message("Addressed", 0x18EF00FE, True, 20, True, None, {})


def packets(
    payload: bytes,
    pgn: int,
    source: int,
    to: int = 0xFF,
    start_ms: int = 0,
    step_ms: int = 50,
    channel: int = 0,
) -> Frames:
    """The announcement and the packets of one transfer."""
    count = -(-len(payload) // 7)
    control = 32 if to == 0xFF else 16
    head = bytes(
        [
            control,
            len(payload) & 255,
            len(payload) >> 8,
            count,
            255,
            pgn & 255,
            pgn >> 8 & 255,
            pgn >> 16,
        ]
    )
    rows = [head] + [
        bytes([i + 1]) + payload[7 * i : 7 * i + 7].ljust(7, b"\xff") for i in range(count)
    ]
    frames = Frames.empty(len(rows))
    frames.t_ns[:] = (start_ms + step_ms * np.arange(len(rows))) * 10**6
    frames.id[:] = 0x1CEB0000 | to << 8 | source
    frames.id[0] = 0x1CEC0000 | to << 8 | source
    frames.flags[:], frames.length[:], frames.channel[:] = Flag.EXTENDED, 8, channel
    frames.data[:] = np.frombuffer(b"".join(rows), np.uint8).reshape(-1, 8)
    return frames


def assembled(frames: Frames, *messages: Message) -> list[tuple[int, int, bytes]]:
    """(ms, id, payload) of what was put together."""
    whole = transport.reassembled(frames.sorted(), messages)
    return [
        (int(t) // 10**6, int(i), d[:n].tobytes())
        for t, i, n, d in zip(whole.t_ns, whole.id, whole.length, whole.data, strict=True)
        if n > 8
    ]


PAYLOAD = bytes(range(100, 139))


def test_a_broadcast_is_put_together():
    frames = packets(PAYLOAD, 0xFEE3, source=0x21)
    assert assembled(frames, LONG) == [(300, 0x18FEE321, PAYLOAD)]
    assert assembled(frames, ADDRESSED) == []
    assert len(transport.reassembled(frames, [LONG])) == len(frames)  # the last packet became it


def test_transfers_of_several_senders_run_side_by_side():
    other = bytes(reversed(PAYLOAD))
    parts = [
        packets(PAYLOAD, 0xFEE3, 0x21),
        packets(other, 0xFEE3, 0x22, start_ms=3),
        packets(other, 0xFEE3, 0x21, start_ms=4, channel=1),
        packets(bytes(20), 0xFECA, 0x23, start_ms=5),
        packets(PAYLOAD[:20], 0xEF00, 0x21, to=0x31, start_ms=6),
    ]
    assert assembled(Frames.concatenate(parts), LONG, ADDRESSED) == [
        (156, 0x18EF0021, PAYLOAD[:20]),
        (300, 0x18FEE321, PAYLOAD),
        (303, 0x18FEE322, other),
        (304, 0x18FEE321, other),
    ]


def test_a_packet_asked_for_again_comes_again():
    frames = packets(PAYLOAD[:20], 0xEF00, 0x21, to=0x31)
    lost = replace(frames.take(np.array([0, 1, 3])), t_ns=np.array([0, 50, 100]) * 10**6)
    again = replace(frames.take(np.array([2])), t_ns=np.array([180]) * 10**6)
    assert assembled(Frames.concatenate([lost, again]), ADDRESSED) == [
        (180, 0x18EF0021, PAYLOAD[:20])
    ]


@pytest.mark.parametrize("what", ["packet lost", "too slow", "aborted", "replaced"])
def test_what_is_not_complete_is_counted(what):
    frames = packets(PAYLOAD, 0xFEE3, 0x21, step_ms=1300 if what == "too slow" else 50)
    if what == "packet lost":
        frames = frames.take(np.array([0, 1, 2, 4, 5, 6]))
    if what in ("aborted", "replaced"):
        frames.data[3] = packets(PAYLOAD, 0xFECA, 0x21).data[0]
        frames.data[3, 0] = 255 if what == "aborted" else 32
        frames.id[3] = frames.id[0]
    whole = transport.reassembled(frames, [LONG])
    assert whole.rejected == (("transport protocol message is not complete", 1),)
    assert len(whole) == len(frames) and whole.data.shape == frames.data.shape


def test_the_longest_there_is():
    payload = np.random.default_rng(1).bytes(1785)
    longest = replace(LONG, length=1785)
    assert assembled(packets(payload, 0xFEE3, 1), longest) == [(12750, 0x18FEE301, payload)]


def test_a_mapped_signal_may_come_by_transport(tmp_path):
    from clutchest.can.decode import decode, rows_of

    frames = transport.reassembled(packets(PAYLOAD, 0xFEE3, source=0x21), [LONG])
    column = decode(frames, rows_of(frames, LONG), LONG, ["Speed"])["Speed"]
    assert column.value.tolist() == [PAYLOAD[25] + 256 * PAYLOAD[26]]
    assert frames.t_ns[column.rows].tolist() == [300_000_000]
