"""Live buses: any interface of python-can, frames as columns with the best stamps there are."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.can import transport
from clutchest.can.database import Message
from clutchest.can.frames import Flag, Frames
from clutchest.can.multicast import listen_on
from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    import can

BUFFER = 8 << 20  # bytes a socket may hold: seconds of a full bus, where the default holds bursts
MOST = 2000  # frames in one go
SO_RXQ_OVFL, _SO_RCVBUFFORCE, SO_TIMESTAMPNS, _SO_MEMINFO = 40, 33, 35, 55
_DROPS = 8  # the place of a socket's drops in what SO_MEMINFO gives
_CLASSIC, _FD = 16, 72  # bytes of the kernel's struct can_frame and canfd_frame
_TRANSPORT = ((0xEC0000, 0xFF0000), (0xEB0000, 0xFF0000))  # TP.CM and TP.DT of any sender


def open_bus(interface: str, channel: str | None, messages: Iterable[Message] = ()) -> can.BusABC:
    """A bus that lets the frames of ``messages`` in, all if there are none.

    Raises ClutchestError naming what is missing.
    """
    import can

    options: dict[str, Any] = {"can_filters": filters(messages) or None}
    network = ""  # of a multicast group
    if interface == "udp_multicast" and channel is not None:
        channel, _, network = channel.partition("%")
    if channel:
        options["channel"] = channel
    try:
        bus = can.Bus(interface=interface, **options)
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as problem:
        known = "; interfaces that python-can knows: " + ", ".join(sorted(can.VALID_INTERFACES))
        known = "" if interface in can.VALID_INTERFACES else known
        where = f"{interface}{f' {channel}' if channel else ''}"
        reason = " ".join(str(problem).split()) or type(problem).__name__
        cause = problem.__cause__
        if cause is not None and str(cause) not in reason:
            reason += f" ({cause})"
        raise ClutchestError(f"bus {where}: cannot be opened: {reason}{known}") from None
    if type(bus).__name__ == "UdpMulticastBus":
        inner = bus._multicast  # type: ignore[attr-defined]
        listen_on(sockets_of(bus), inner.group, network)
    _widen(bus)
    return bus


def filters(messages: Iterable[Message]) -> list[dict[str, Any]]:
    """What python-can needs to let these messages in, and the packets of those in packets."""
    wanted = list(messages)
    accepted = [
        {"can_id": m.id & m.id_mask, "can_mask": m.id_mask, "extended": m.extended} for m in wanted
    ]
    if any(transport.may_carry(message) for message in wanted):
        accepted += [{"can_id": i, "can_mask": mask, "extended": True} for i, mask in _TRANSPORT]
    return accepted


def sockets_of(bus: can.BusABC) -> list[socket.socket]:
    """The sockets of a bus that has any: python-can gives them no common name."""
    inner = getattr(bus, "_multicast", None)
    candidates = (getattr(bus, "socket", None), getattr(inner, "_socket", None))
    return [s for s in candidates if isinstance(s, socket.socket)]


def _widen(bus: can.BusABC) -> None:
    """Room for bursts: what does not fit into a socket's buffer is lost without an error."""
    for sock in sockets_of(bus):
        for option in (_SO_RCVBUFFORCE, socket.SO_RCVBUF):  # the first one needs the right to
            try:
                sock.setsockopt(socket.SOL_SOCKET, option, BUFFER)
                break
            except OSError:
                continue


def drops_of(sock: socket.socket) -> int:
    """Frames that the kernel has dropped because this socket's buffer was full, as of now; 0 where
    it tells only with the next frame."""
    try:
        return struct.unpack("=9I", sock.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 36))[_DROPS]
    except (OSError, struct.error):
        return 0


@dataclass(frozen=True, slots=True)
class Received:
    """Frames with the stamps of the interface; when they were handed over, ns on the monotonic
    clock; how many the kernel has ``dropped`` so far, None where that is not known; what was
    ``malformed`` so far, by kind; whether ``more`` may have been waiting already."""

    frames: Frames
    at_ns: int
    dropped: int | None = 0
    malformed: Mapping[str, int] = field(default_factory=dict)
    more: bool = False


class BusReader:
    """Reads a python-can bus, of whatever interface; ``dropped`` as :class:`Received` has it."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.dropped: int | None = None

    def read(self, timeout: float) -> Received | None:
        """The frames received so far, waiting up to ``timeout`` s for the first one; None without
        any.  Raises can.CanError or OSError where the interface fails."""
        message = self.bus.recv(timeout)
        if message is None:
            return None
        messages = [message]
        while len(messages) < MOST and (message := self.bus.recv(0)) is not None:
            messages.append(message)
        return _received(frames_of(messages), None)

    def count(self) -> None:
        """Bring ``dropped`` up to date, where no frame says it."""


class SocketReader(BusReader):
    """Reads SocketCAN's own socket: kernel stamps to the nanosecond, and the drops counted."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self.socket = sockets_of(bus)[0]
        self.socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        self.dropped = 0
        self._room = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(4)

    def read(self, timeout: float) -> Received | None:
        """As :meth:`BusReader.read`."""
        import select

        if not select.select([self.socket], [], [], timeout)[0]:
            return None
        payloads: list[bytes] = []
        stamps, sent = [], []
        while len(payloads) < MOST:
            try:
                raw, extra, flags, _ = self.socket.recvmsg(_FD, self._room, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            stamp = 0
            for _, kind, content in extra:
                if kind == SO_TIMESTAMPNS:
                    seconds, ns = struct.unpack("=qq", content[:16])
                    stamp = seconds * 10**9 + ns
                elif kind == SO_RXQ_OVFL:
                    self.dropped = struct.unpack("=I", content[:4])[0]
            payloads.append(raw)
            stamps.append(stamp)
            sent.append(bool(flags & socket.MSG_DONTROUTE))
        if not payloads:
            return None
        return _received(_kernel_frames(payloads, stamps, sent), self.dropped)

    def count(self) -> None:
        """As :meth:`BusReader.count`."""
        self.dropped = max(self.dropped or 0, drops_of(self.socket))


def _received(frames: Frames, dropped: int | None) -> Received:
    """Frames that have been taken just now; there may be more of them."""
    return Received(frames, time.monotonic_ns(), dropped, more=len(frames) >= MOST)


def _kernel_frames(payloads: Sequence[bytes], stamps: list[int], sent: list[bool]) -> Frames:
    """Frames from the kernel's structures: id with flag bits, length, flags, two bytes, data."""
    wide = any(len(raw) == _FD for raw in payloads)
    size = _FD if wide else _CLASSIC
    table = np.frombuffer(b"".join(raw.ljust(size, b"\0") for raw in payloads), np.uint8)
    table = table.reshape(-1, size)
    word = table[:, :4].copy().view(np.uint32)[:, 0]
    fd = np.array([len(raw) == _FD for raw in payloads])
    flags = np.where(word & 0x80000000, Flag.EXTENDED, 0) | np.where(
        word & 0x40000000, Flag.REMOTE, 0
    )
    flags |= np.where(word & 0x20000000, Flag.ERROR, 0) | np.where(fd, Flag.FD, 0)
    flags |= np.where(fd & (table[:, 5] & 1 > 0), Flag.BITRATE_SWITCH, 0)
    flags |= np.where(fd & (table[:, 5] & 2 > 0), Flag.ERROR_STATE, 0)
    flags |= np.where(sent, Flag.SENT, 0)
    data = table[:, 8:].copy()
    length = table[:, 4].copy()
    data[np.arange(data.shape[1]) >= length[:, None]] = 0
    mask = np.where(word & 0xA0000000, 0x1FFFFFFF, 0x7FF).astype(np.uint32)
    return Frames(
        np.array(stamps, np.int64),
        np.zeros(len(payloads), np.uint8),
        word & mask,
        flags.astype(np.uint8),
        length,
        data,
    )


def frames_of(messages: Sequence[can.Message]) -> Frames:
    """Columns of python-can's messages; stamps to 1 µs, which is what its numbers can hold."""
    wide = any(len(m.data) > 8 for m in messages)
    frames = Frames.empty(len(messages), 64 if wide else 8)
    for k, m in enumerate(messages):
        frames.t_ns[k] = round(m.timestamp * 1e6) * 1000
        frames.id[k] = m.arbitration_id
        frames.flags[k] = (
            (Flag.EXTENDED if m.is_extended_id else 0)
            | (Flag.REMOTE if m.is_remote_frame else 0)
            | (Flag.ERROR if m.is_error_frame else 0)
            | (Flag.FD if m.is_fd else 0)
            | (Flag.BITRATE_SWITCH if m.bitrate_switch else 0)
            | (Flag.ERROR_STATE if m.error_state_indicator else 0)
            | (0 if m.is_rx else Flag.SENT)
        )
        if m.is_remote_frame:
            frames.length[k] = m.dlc
        else:
            frames.length[k] = len(m.data)
            frames.data[k, : len(m.data)] = np.frombuffer(m.data, np.uint8)
    return frames


def message_of(frames: Frames, row: int) -> can.Message:
    """One frame as python-can sends it."""
    import can

    flags, length = int(frames.flags[row]), int(frames.length[row])
    remote = bool(flags & Flag.REMOTE)
    return can.Message(
        arbitration_id=int(frames.id[row]),
        is_extended_id=bool(flags & Flag.EXTENDED),
        is_remote_frame=remote,
        is_fd=bool(flags & Flag.FD),
        bitrate_switch=bool(flags & Flag.BITRATE_SWITCH),
        error_state_indicator=bool(flags & Flag.ERROR_STATE),
        dlc=length if remote else None,
        data=None if remote else frames.data[row, :length].tobytes(),
        check=True,
    )
