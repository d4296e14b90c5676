"""The best way to read a bus."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from clutchest.can.bus import BusReader, SocketReader, sockets_of
from clutchest.can.udp import UdpReader

if TYPE_CHECKING:
    import can


def reader_of(bus: can.BusABC) -> BusReader:
    """The reader of this bus that knows most: kernel stamps and drops, where there are any."""
    if os.name == "posix" and sockets_of(bus):
        if type(bus).__name__ == "SocketcanBus":
            return SocketReader(bus)
        if type(bus).__name__ == "UdpMulticastBus":
            return UdpReader(bus)
    return BusReader(bus)
