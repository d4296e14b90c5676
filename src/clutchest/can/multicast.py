"""Multicast groups of ``udp_multicast``: on this machine alone, unless an interface is named."""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache

from clutchest.errors import ClutchestError

# level, and options that join, leave, choose where to send and how far
_IPV6 = (
    getattr(socket, "IPPROTO_IPV6", 41),
    getattr(socket, "IPV6_JOIN_GROUP", 20),
    getattr(socket, "IPV6_LEAVE_GROUP", 21),
    getattr(socket, "IPV6_MULTICAST_IF", 17),
    getattr(socket, "IPV6_MULTICAST_HOPS", 18),
)
_IPV4 = (
    socket.IPPROTO_IP,
    socket.IP_ADD_MEMBERSHIP,
    socket.IP_DROP_MEMBERSHIP,
    socket.IP_MULTICAST_IF,
    socket.IP_MULTICAST_TTL,
)
_LOOPBACK = ("lo", "lo0")  # as Linux calls it, and macOS


def listen_on(sockets: Sequence[socket.socket], group: str, network: str) -> None:
    """Join ``group`` on the interface ``network`` alone; with "" on this machine only: what is
    sent does not leave it, and the group is joined on the loopback interface too, where there is
    multicast on it.

    Raises ClutchestError for an interface that is not there.
    """
    for sock in sockets:
        level, join, leave, where, hops = _options(sock)
        if not network:
            sock.setsockopt(level, hops, 0)
            for loopback in _LOOPBACK:
                with suppress(OSError):
                    index = socket.if_nametoindex(loopback)
                    sock.setsockopt(level, join, _request(sock, group, index))
            continue
        try:
            index = socket.if_nametoindex(network)
        except OSError:
            known = ", ".join(name for _, name in socket.if_nameindex())
            raise ClutchestError(f"no network interface '{network}'; there are {known}") from None
        wanted = struct.pack("@i" if sock.family == socket.AF_INET6 else "@8xi", index)
        sock.setsockopt(level, leave, _request(sock, group, 0))
        sock.setsockopt(level, join, _request(sock, group, index))
        sock.setsockopt(level, where, wanted)


def this_machine_only(sock: socket.socket) -> bool:
    """Whether nothing that is sent leaves this machine, so that nothing else is listened to."""
    level, *_, hops = _options(sock)
    return sock.getsockopt(level, hops) == 0


@lru_cache(maxsize=1024)
def is_own(address: str) -> bool:
    """Whether an address is one of this machine."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        place = socket.getaddrinfo(address, 0, family, socket.SOCK_DGRAM)[0][4]
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind(place)
    except OSError:
        return False
    return True


def _options(sock: socket.socket) -> tuple[int, int, int, int, int]:
    return _IPV6 if sock.family == socket.AF_INET6 else _IPV4


def _request(sock: socket.socket, group: str, index: int) -> bytes:
    """A group on an interface, as the system wants it."""
    if sock.family == socket.AF_INET6:
        return socket.inet_pton(socket.AF_INET6, group) + struct.pack("@I", index)
    return socket.inet_aton(group) + struct.pack("@ii", 0, index)
