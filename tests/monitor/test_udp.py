"""Datagrams of strangers: dropped and counted, and nothing else."""

from __future__ import annotations

import socket
import struct
import sys
import time

import msgpack
import pytest

import can
from clutchest.can.bus import BusReader, open_bus
from clutchest.can.readers import reader_of
from clutchest.can.udp import UdpReader
from clutchest.errors import ClutchestError
from clutchest.monitor.reception import Reception
from fuzz.kinds import FRAME

GROUP = "239.74.163.77"


@pytest.fixture
def buses():
    opened = [open_bus("udp_multicast", GROUP) for _ in range(2)]
    yield opened
    for bus in opened:
        bus.shutdown()


MALFORMED = {
    "not msgpack": b"\xc1garbage",
    "empty": b"",
    "a number": msgpack.packb(5),
    "a list": msgpack.packb([FRAME]),
    "no fields": msgpack.packb({}),
    "id of 1.5": msgpack.packb({**FRAME, "arbitration_id": 1.5}),
    "id beyond": msgpack.packb({**FRAME, "arbitration_id": 1 << 40}),
    "id below": msgpack.packb({**FRAME, "arbitration_id": -1}),
    "nan": msgpack.packb({**FRAME, "arbitration_id": float("nan")}),
    "time": msgpack.packb({**FRAME, "timestamp": float("inf")}),
    "text as data": msgpack.packb({**FRAME, "data": "12345678"}),
    "long data": msgpack.packb({**FRAME, "data": b"1" * 300}),
    "dlc": msgpack.packb({**FRAME, "dlc": 3}),
    "huge": b"\0" * 6000,
}


@pytest.mark.skipif(sys.platform != "linux", reason="Linux counts what a socket drops")
@pytest.mark.parametrize("what", MALFORMED)
def test_a_malformed_datagram_costs_no_frame(buses, what):
    sender, listening = buses
    reader = reader_of(listening)
    assert isinstance(reader, UdpReader) and reader.dropped == 0
    sound = can.Message(arbitration_id=0xCF00400, data=b"12345678")
    sender.send(sound)
    sender._multicast.send(MALFORMED[what])
    sender.send(sound)
    frames = malformed = 0
    until = time.monotonic() + 5.0
    while (frames, malformed) != (2, 1) and time.monotonic() < until:
        if (got := reader.read(0.2)) is not None:
            frames += len(got.frames)
            malformed = sum(got.malformed.values())
    assert (frames, malformed) == (2, 1)


def test_frames_that_others_keep_waiting_are_said_to_come(buses, monkeypatch):
    monkeypatch.setattr("clutchest.can.udp.MOST", 5)
    sender, listening = buses
    listening.set_filters([{"can_id": 0x7, "can_mask": 0x7FF, "extended": False}])
    reader = reader_of(listening)
    for number in [*[0x8] * 5, 0x7]:
        sender.send(can.Message(arbitration_id=number, data=b"1", is_extended_id=False))
    first, second = reader.read(5.0), reader.read(5.0)
    assert first.more and not len(first.frames)
    assert not second.more and second.frames.id.tolist() == [0x7]


def test_nothing_leaves_this_machine_unless_an_interface_is_named(buses):
    from clutchest.can.bus import sockets_of
    from clutchest.can.multicast import is_own, this_machine_only

    (sock,) = sockets_of(buses[0])
    assert (
        this_machine_only(sock) and sock.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    )
    assert is_own("127.0.0.1") and not is_own("192.0.2.1")
    with pytest.raises(ClutchestError, match="no network interface 'nowhere0'"):
        open_bus("udp_multicast", f"{GROUP}%nowhere0")


def test_a_thread_that_dies_ends_the_reception(buses):
    reports = []
    reception = Reception(buses[1], (), None, lambda *what: reports.append(what))

    class Broken(BusReader):
        def read(self, timeout):
            raise struct.error("out of the blue")

    reception._listener._reader = Broken(buses[1])
    with pytest.raises(ClutchestError, match=r"thread that receives frames has ended .*out of the"):
        for _ in range(100):
            reception.take(0.1, None)
    assert reports == []
