"""PCAP and pcapng with SocketCAN frames, as Wireshark and tcpdump record them from a CAN interface
or from all interfaces of a Linux machine.

Sources: IETF drafts "PCAP Capture File Format" and "PCAP Next Generation (pcapng) Capture File
Format"; tcpdump.org, LINKTYPE_CAN_SOCKETCAN, LINKTYPE_LINUX_SLL and LINKTYPE_LINUX_SLL2.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.log_format import LogFormat, begins_with
from clutchest.can.log_source import BLOCK, LogSource
from clutchest.can.text_scan import Table
from clutchest.can.time_stamps import EPOCH_NS
from clutchest.native import compiled

SOCKETCAN, SLL, SLL2 = 227, 113, 276  # link types
_MAGICS = {  # first bytes → (byte order, ns of a unit of time)
    b"\xd4\xc3\xb2\xa1": ("<", 1_000),
    b"\xa1\xb2\xc3\xd4": (">", 1_000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
_SECTION = b"\x0a\x0d\x0d\x0a"
_INTERFACE, _SIMPLE, _ENHANCED = 1, 3, 6  # kinds of blocks
_HEADER = 16  # bytes before each packet
_FD_SIZE = 72  # bytes of a CAN FD frame as Linux has it
_LARGEST = 1 << 18  # bytes of a packet or block
_NO_FRAME, _CUT, _TOO_LARGE = "no CAN frame in this packet", "packet is cut off", "file is damaged"
_EFF, _RTR, _ERR = 0x80000000, 0x40000000, 0x20000000
_EXTENDED, _REMOTE, _ERROR, _FD = (
    int(Flag.EXTENDED),
    int(Flag.REMOTE),
    int(Flag.ERROR),
    int(Flag.FD),
)
_BRS, _ESI = int(Flag.BITRATE_SWITCH), int(Flag.ERROR_STATE)


@dataclass(frozen=True, slots=True)
class _Link:
    """An interface: its link type, and the ns of a unit of its times."""

    kind: int
    unit_ns: float
    big_endian: bool


@dataclass
class _Packets:
    """Packets gathered until there are enough for a block of frames."""

    data: list[bytes] = field(default_factory=list)
    t_ns: list[int] = field(default_factory=list)
    channel: list[int] = field(default_factory=list)
    link: list[_Link] = field(default_factory=list)
    size: int = 0

    def add(self, data: bytes, t_ns: int, channel: int, link: _Link) -> None:
        """One more packet."""
        self.data.append(data)
        self.t_ns.append(t_ns)
        self.channel.append(channel & 0xFF)
        self.link.append(link)
        self.size += _HEADER + len(data)

    def frames(self, rejected: Counter[str]) -> Frames:
        """The frames in them, with what was ``rejected``, which is emptied."""
        out = Table.of(max(len(self.data), 1), 64)
        ends = np.cumsum([0, *map(len, self.data)])
        kinds = np.array([link.kind for link in self.link], np.int64)
        big = np.array([link.big_endian for link in self.link], bool)
        whole = np.frombuffer(b"".join(self.data), np.uint8)
        times, channels = np.array(self.t_ns, np.int64), np.array(self.channel, np.uint8)
        n = _frames(whole, ends, times, channels, kinds, big, out)
        rejected[_NO_FRAME] += len(self.data) - n
        frames = out.frames(n, tuple((reason, k) for reason, k in rejected.items() if k))
        rejected.clear()
        if not len(frames) or int(frames.length.max()) <= 8:
            frames = replace(frames, data=frames.data[:, :8].copy())
        return frames


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of a capture; packets without any are counted in ``rejected``."""
    packets, rejected = _Packets(), Counter[str]()
    absolute = True
    of = _of_pcapng if source.head.startswith(_SECTION) else _of_pcap
    for packet in of(source, rejected):
        packets.add(*packet)
        if len(packets.data) == 1:
            absolute = packet[1] >= EPOCH_NS
        if packets.size >= BLOCK:
            yield replace(packets.frames(rejected), absolute=absolute)
            packets = _Packets()
    yield replace(packets.frames(rejected), absolute=absolute)


Packet = tuple[bytes, int, int, _Link]


def _of_pcap(source: LogSource, rejected: Counter[str]) -> Iterator[Packet]:
    order, unit_ns = _MAGICS[source.head[:4]]
    header = source.read(24)
    if len(header) < 24:
        return
    link = _Link(struct.unpack(order + "I", header[20:24])[0] & 0xFFFF, unit_ns, order == ">")
    while len(head := source.read(_HEADER)) == _HEADER:
        seconds, fraction, length, _ = struct.unpack(order + "IIII", head)
        if length > _LARGEST:
            rejected[_TOO_LARGE] += 1
            return
        data = source.read(length)
        if len(data) < length:
            rejected[_CUT] += 1
            return
        yield data, seconds * 10**9 + fraction * unit_ns, 0, link
    rejected[_CUT] += bool(head)


def _of_pcapng(source: LogSource, rejected: Counter[str]) -> Iterator[Packet]:
    order, links = "<", list[_Link]()
    while len(head := source.read(8)) == 8:
        body = b""
        if head[:4] == _SECTION:
            body = source.read(4)
            order, links = (">" if body == b"\x1a\x2b\x3c\x4d" else "<"), []
        kind, size = struct.unpack(order + "II", head)
        if size < 12 + len(body) or size > _LARGEST or size % 4:
            rejected[_TOO_LARGE] += 1
            return
        body += source.read(size - 8 - len(body))
        if len(body) < size - 8:
            rejected[_CUT] += 1
            return
        body = body[:-4]
        if kind == _INTERFACE and len(body) >= 8:
            links.append(_interface(body, order))
        elif kind == _ENHANCED and len(body) >= 20:
            which, high, low, length, _ = struct.unpack(order + "IIIII", body[:20])
            if which < len(links):
                t_ns = round((high << 32 | low) * links[which].unit_ns)
                yield body[20 : 20 + length], min(t_ns, 2**62), which, links[which]
        elif kind == _SIMPLE and links:
            rejected["packet without a time"] += 1
    rejected[_CUT] += bool(head)


def _interface(body: bytes, order: str) -> _Link:
    """The interface that a block describes; times are in µs unless an option says otherwise."""
    kind, unit_ns, at = struct.unpack(order + "H", body[:2])[0], 1e3, 8
    while at + 4 <= len(body):
        code, length = struct.unpack(order + "HH", body[at : at + 4])
        if code == 9 and length == 1 and at + 4 < len(body):
            exponent = body[at + 4]
            unit_ns = 1e9 * (2.0 ** -(exponent & 127) if exponent & 128 else 10.0**-exponent)
        at += 4 + -(-length // 4) * 4
    return _Link(kind, int(unit_ns) if unit_ns >= 1 else unit_ns, order == ">")


@compiled
def _frames(data, ends, t_ns, channel, kinds, big, out):  # type: ignore[no-untyped-def]
    """Fills the table with the frames of packets; how many there are."""
    n = 0
    for k in range(len(kinds)):
        i, end = ends[k], ends[k + 1]
        fd = False
        big_endian = True
        if kinds[k] == SLL or kinds[k] == SLL2:
            at, header = (14, 16) if kinds[k] == SLL else (0, 20)
            if end - i < header:
                continue
            protocol = data[i + at] * 256 + data[i + at + 1]
            if protocol != 0x000C and protocol != 0x000D:
                continue
            fd, i, big_endian = protocol == 0x000D, i + header, big[k]
        elif kinds[k] != SOCKETCAN:
            continue
        else:
            fd = end - i == _FD_SIZE
        if end - i < 8:
            continue
        if big_endian:
            can_id = (
                data[i] * 16777216 + data[i + 1] * 65536 + data[i + 2] * 256 + np.int64(data[i + 3])
            )
        else:
            can_id = (
                data[i + 3] * 16777216 + data[i + 2] * 65536 + data[i + 1] * 256 + np.int64(data[i])
            )
        length, more = np.int64(data[i + 4]), data[i + 5]
        fd = fd or length > 8 or (more & 4) != 0
        flags = 0
        if can_id & _EFF:
            flags |= _EXTENDED
        if can_id & _RTR and not fd:
            flags |= _REMOTE
        if can_id & _ERR:
            flags = _ERROR
        if fd and not can_id & _ERR:
            flags |= _FD | (_BRS if more & 1 else 0) | (_ESI if more & 2 else 0)
        carried = flags & (_REMOTE | _ERROR) == 0
        if length > 64 or (carried and i + 8 + length > end):
            continue
        out.t_ns[n], out.channel[n], out.flags[n] = t_ns[k], channel[k], flags
        out.id[n] = 0 if flags & _ERROR else can_id & (0x1FFFFFFF if can_id & _EFF else 0x7FF)
        out.length[n] = length if not flags & _ERROR else 0
        for byte in range(length if carried else 0):
            out.data[n, byte] = data[i + 8 + byte]
        n += 1
    return n


FORMAT = LogFormat(
    title=".pcap",
    about="PCAP and pcapng with SocketCAN frames",
    suffix=".pcap",
    sniff=begins_with(*_MAGICS, _SECTION),
    read=read,
)
