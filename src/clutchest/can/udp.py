"""Frames in UDP datagrams, as python-can's ``udp_multicast`` sends them.

Anybody in reach can send a datagram.  One that is no frame is dropped and counted by kind; it stops
nothing.
"""

from __future__ import annotations

import socket
import struct
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from math import isfinite
from typing import TYPE_CHECKING, Any

from clutchest.can.bus import (
    MOST,
    SO_RXQ_OVFL,
    SO_TIMESTAMPNS,
    BusReader,
    Received,
    drops_of,
    frames_of,
    sockets_of,
)
from clutchest.can.multicast import is_own, this_machine_only

if TYPE_CHECKING:
    import can

LARGEST = 4096  # bytes of a datagram; that of a CAN FD frame has some 300


class UdpReader(BusReader):
    """Reads the socket of a ``udp_multicast`` bus: kernel stamps, and the drops counted."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self.socket = sockets_of(bus)[0]
        self.local = this_machine_only(self.socket)
        self.malformed: Counter[str] = Counter()
        with suppress(OSError):  # where this system counts them
            self.socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            self.dropped = 0
        self._room = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(4)

    def read(self, timeout: float) -> Received | None:
        """As :meth:`BusReader.read`; also where nothing but malformed datagrams came, or so many of
        others that more may be waiting: what comes then is not later than now."""
        import select

        if not select.select([self.socket], [], [], timeout)[0]:
            return None
        messages: list[can.Message] = []
        before, more = self.malformed.total(), False
        for _ in range(MOST):
            try:
                given = self.socket.recvmsg(LARGEST, self._room, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            raw, extra, flags, sender = given
            if self.local and not is_own(_address(sender)):
                self.malformed["from another machine, whose network interface is not named"] += 1
                continue
            stamp = time.time()
            for _, kind, content in extra:
                if kind == SO_TIMESTAMPNS and len(content) >= 16:
                    seconds, ns = struct.unpack("=qq", content[:16])
                    stamp = seconds + ns * 1e-9
                elif kind == SO_RXQ_OVFL and self.dropped is not None:
                    self.dropped = struct.unpack("=I", content[:4])[0]
            if flags & socket.MSG_TRUNC:
                self.malformed["datagram longer than a frame"] += 1
                continue
            message, defect = message_in(raw, stamp)
            if message is None:
                self.malformed[defect] += 1
            elif self.bus._matches_filters(message):
                messages.append(message)
        else:
            more = True
        if not messages and not more and self.malformed.total() == before:
            return None
        malformed = dict(self.malformed)
        return Received(
            frames_of(messages), time.monotonic_ns(), self.dropped, malformed, more=more
        )

    def count(self) -> None:
        """As :meth:`BusReader.count`."""
        if self.dropped is not None:
            self.dropped = max(self.dropped, drops_of(self.socket))


def message_in(raw: bytes, stamp: float) -> tuple[can.Message | None, str]:
    """The frame in a datagram, received at ``stamp`` s; None where there is none, and why."""
    try:
        import msgpack

        given = msgpack.unpackb(raw)
    except Exception:  # the bytes of a stranger
        return None, "not a message of python-can"
    if not isinstance(given, dict):
        return None, "no fields of a frame"
    if wrong := _defect(given):
        return None, wrong
    try:
        return _frame(given, stamp), ""
    except Exception:  # python-can's own check of a frame
        return None, "not a valid CAN frame"


def _address(sender: Any) -> str:
    """The sender's address, with the interface that a link-local one needs."""
    host, scope = str(sender[0]), sender[3] if len(sender) > 3 else 0
    return f"{host}%{scope}" if scope and "%" not in host else host


_FIELDS: Mapping[str, type | tuple[type, ...]] = {
    "arbitration_id": int,
    "is_extended_id": bool,
    "is_remote_frame": bool,
    "is_error_frame": bool,
    "dlc": int,
    "is_fd": bool,
    "bitrate_switch": bool,
    "error_state_indicator": bool,
    "data": (bytes, bytearray),
}


def _defect(given: Mapping[Any, Any]) -> str:
    """Which field of a datagram is not that of a frame, in words; empty if all are."""
    for name, kind in _FIELDS.items():
        value = given.get(name)
        if name == "data" and value is None:
            continue
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            return f"{name} is not that of a frame"
    time_of = given.get("timestamp", 0.0)
    if not isinstance(time_of, int | float) or not isfinite(time_of):
        return "timestamp is not that of a frame"
    return ""


def _frame(given: Mapping[Any, Any], stamp: float) -> can.Message:
    import can

    return can.Message(
        timestamp=stamp,
        **{name: given[name] for name in _FIELDS if name != "data"},
        data=given.get("data"),
        check=True,
    )
