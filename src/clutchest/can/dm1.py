"""SAE J1939-73, DM1: the active trouble codes, broadcast.

Lamps (2 bytes), then per code its suspect parameter number, failure mode and how often it occurred
(4 bytes).  Up to one code fits into a frame; more go out in packets, announced by a BAM (J1939-21).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError

PGN = 65226
EVERY_S = 1.0  # s between two broadcasts while a code is active; a change is sent at once
_PRIORITY, _TRANSFER_PRIORITY = 6, 7
_CM, _DT, _EVERYONE, _BAM = 0xEC, 0xEB, 0xFF, 32
_APART_NS = 50_000_000  # between packets of a broadcast
_MOST = (1785 - 2) // 4  # codes in one message
_AMBER, _NO_FLASH, _NONE = 0x04, 0xFF, 0x00
_UNKNOWN_COUNT = 127


@dataclass(frozen=True, slots=True)
class Code:
    """One active code; ``count`` how often it occurred, 127: not known."""

    spn: int
    fmi: int
    count: int = _UNKNOWN_COUNT

    def __post_init__(self) -> None:
        for name, most in (("spn", 0x7FFFF), ("fmi", 0x1F), ("count", 0x7F)):
            if not 0 <= getattr(self, name) <= most:
                raise ClutchestError(
                    f"trouble code: {name} {getattr(self, name)}, expected 0 … {most}"
                )

    def bytes(self) -> bytes:
        """Four bytes: SPN low, middle, its upper three bits with the FMI, conversion and count."""
        return bytes(
            (self.spn & 0xFF, self.spn >> 8 & 0xFF, self.spn >> 16 << 5 | self.fmi, self.count)
        )


def payload(codes: Sequence[Code]) -> bytes:
    """The message's bytes: with codes the amber lamp is on; without, all bytes mean "none".

    Raises ClutchestError for more codes than a message may carry.
    """
    if len(codes) > _MOST:
        raise ClutchestError(f"{len(codes)} trouble codes, expected at most {_MOST}")
    lamps = bytes((_AMBER if codes else _NONE, _NO_FLASH))
    body = b"".join(code.bytes() for code in codes) or bytes(4)
    return lamps + body


def read_payload(data: bytes) -> list[Code]:
    """The codes in a message's bytes, filling left out."""
    codes = []
    for k in range(2, len(data) - 3, 4):
        low, middle, high, count = data[k : k + 4]
        spn, fmi = low | middle << 8 | (high >> 5) << 16, high & 0x1F
        if (spn, fmi) not in ((0, 0), (0x7FFFF, 0x1F)):
            codes.append(Code(spn, fmi, count & 0x7F))
    return codes


def frames_of(codes: Sequence[Code], source_address: int, t_ns: int = 0) -> Frames:
    """The frames of one broadcast by ``source_address``, the first at ``t_ns``, packets 50 ms
    apart."""
    data = payload(codes)
    if len(data) <= 8:
        can_id = _PRIORITY << 26 | PGN << 8 | source_address
        return _frames([(can_id, data.ljust(8, b"\xff"))], t_ns)
    packets = -(-len(data) // 7)
    announced = bytes(
        (
            _BAM,
            len(data) & 0xFF,
            len(data) >> 8,
            packets,
            0xFF,
            PGN & 0xFF,
            PGN >> 8 & 0xFF,
            PGN >> 16,
        )
    )
    cm, dt = (
        _TRANSFER_PRIORITY << 26 | form << 16 | _EVERYONE << 8 | source_address
        for form in (_CM, _DT)
    )
    rows = [(cm, announced)]
    for k in range(packets):
        rows.append((dt, bytes([k + 1]) + data[7 * k : 7 * k + 7].ljust(7, b"\xff")))
    return _frames(rows, t_ns)


def _frames(rows: Sequence[tuple[int, bytes]], t_ns: int) -> Frames:
    frames = Frames.empty(len(rows))
    for k, (can_id, data) in enumerate(rows):
        frames.t_ns[k] = t_ns + k * _APART_NS
        frames.id[k], frames.flags[k], frames.length[k] = can_id, Flag.EXTENDED, 8
        frames.data[k] = np.frombuffer(data, np.uint8)
    return frames
